"""The topics of a stage that are judged: with a lab beside what it asks for, and without one."""

from __future__ import annotations

from typing import TYPE_CHECKING

from msgspec import Struct

from lab3_usd.check.match.rule_inputs import ModelSubject, StageSubject
from lab3_usd.facts.domains import Domain
from lab3_usd.facts.endpoints import Endpoint, endpoints, namespaces_above, ros_name
from lab3_usd.isaac.node_types import INPUT
from lab3_usd.isaac.topics import TRANSFORMS
from lab3_usd.model.finding import Place
from lab3_usd.model.stage import once_per_stage

if TYPE_CHECKING:
    from lab3_usd.spec.graph import NodeSpec
    from lab3_usd.spec.ros import TopicSpec

Heard = tuple[str, str]  # a topic, and the name of a domain


@once_per_stage
def role_specs(subject: StageSubject) -> dict[str, NodeSpec]:
    """Map the path of each node that plays a role to the spec of the role."""
    return {
        path: subject.lab.graphs[name].nodes[role]
        for name, roles in subject.roles.items()
        for path, role in roles.role_of.items()
        if role in subject.lab.graphs[name].nodes
    }


class Publishers(Struct, frozen=True, eq=False):
    """Who publishes one topic in one domain: the one that stays, and the others.

    `blamed` are those of the others that play no role.
    """

    right: Endpoint
    others: tuple[Endpoint, ...]
    blamed: tuple[Endpoint, ...]

    def rivals(self, endpoint: Endpoint) -> tuple[Endpoint, ...]:
        """Return who publishes the topic beside one of them."""
        return tuple(e for e in (self.right, *self.others) if e is not endpoint)


def domain_name(domain: Domain, subject: ModelSubject) -> str:
    """Return the domain of a node; what the environment names is the domain of the lab."""
    if isinstance(subject, StageSubject) and domain.from_environment:
        return str(subject.lab.ros.system.domain)
    return domain.name


def wanted_topic(endpoint: Endpoint, subject: ModelSubject) -> TopicSpec | None:
    """Return what a lab asks of a topic that its listeners hear, None where nothing is asked."""
    if not isinstance(subject, StageSubject):
        return None
    if domain_name(endpoint.domain, subject) != str(subject.lab.ros.system.domain):
        return None
    return subject.lab.topics_until(subject.checkpoint.id).get(endpoint.topic or "")


@once_per_stage
def publishers_by_topic(subject: ModelSubject) -> tuple[Publishers, ...]:
    """Return who publishes each topic, where several do; transforms have many publishers.

    Nobody hears publishers of different domains together. With a lab a role comes first; one whose
    topic is not that of its role does not count.
    """
    tree, together = subject.platform.ros.tree_topics, dict[Heard, list[Endpoint]]()
    for endpoint in endpoints(subject.stage):
        is_sent = endpoint.topic and endpoint.runs and endpoint.direction == "publishes"
        is_tree = endpoint.topic in tree or endpoint.type == TRANSFORMS
        if is_sent and not is_tree and _is_meant(endpoint, subject):
            key = (str(endpoint.topic), domain_name(endpoint.domain, subject))
            together.setdefault(key, []).append(endpoint)
    played = role_specs(subject) if isinstance(subject, StageSubject) else {}
    topics = []
    for group in together.values():
        right = next((endpoint for endpoint in group if endpoint.node.path in played), group[0])
        surplus = tuple(endpoint for endpoint in group if endpoint is not right)
        blamed = tuple(endpoint for endpoint in surplus if endpoint.node.path not in played)
        topics.append(Publishers(right, surplus, blamed))
    return tuple(topic for topic in topics if topic.others)


def _is_meant(endpoint: Endpoint, subject: ModelSubject) -> bool:
    """Whether a publisher is to publish this topic, as far as its role tells."""
    if not isinstance(subject, StageSubject):
        return True
    path = endpoint.node.path
    spec = role_specs(subject).get(path)
    wanted = {} if spec is None else {value.port: str(value.value) for value in spec.settings}
    if endpoint.port not in wanted:
        return True
    above = "/".join(name for _, name in namespaces_above(path, subject.stage))
    space = wanted.get(INPUT + subject.platform.ros.namespace, above)
    return ros_name(space, wanted[endpoint.port]) == endpoint.topic


def graph_of(endpoint: Endpoint) -> str:
    """Return the path of the graph of an endpoint."""
    return endpoint.node.path.rpartition("/")[0]


def plays_role(endpoint: Endpoint, subject: ModelSubject) -> bool:
    """Whether a node plays a role in a lab."""
    return isinstance(subject, StageSubject) and endpoint.node.path in role_specs(subject)


def assumed(endpoint: Endpoint, subject: ModelSubject) -> tuple[Place, ...]:
    """Return what a problem of an endpoint rests on: with a lab, the node's type and its topic."""
    if not isinstance(subject, StageSubject):
        return ()
    path = endpoint.node.path
    return ((path, "node:type"), (path, endpoint.port), once_there(path))


def once_there(node: str) -> Place:
    """Return the place that stands for the graph of a node: it repeats none of the lab's."""
    return node.rpartition("/")[0], "(repeated)"
