"""Domain, namespace, topic and time of a request, by what a stage has already."""

from __future__ import annotations

from collections.abc import Iterator

from lab3_usd.author.task import Hole, Task
from lab3_usd.errors import AmbiguousError, UsageError
from lab3_usd.facts.clocks import topic_clocks
from lab3_usd.facts.domains import LAST_DOMAIN, domains
from lab3_usd.facts.endpoints import namespaces_above, ros_name


def ros(task: Task) -> Iterator[Hole]:
    """Yield the domain, the namespace and the topic of a request."""
    yield from domain_holes(task)
    yield from namespace_holes(task)
    yield from _topic(task)


def _topic(task: Task) -> Iterator[Hole]:
    usual, topic = task.recipe.usual.get("topic"), task.options.topic
    if usual is None:
        return
    if isinstance(topic, dict):
        raise UsageError(f"--topic: {task.recipe.kind} has one topic; write --topic NAME")
    name = usual if topic is None else checked_topic(topic, "--topic")
    if "joint_topics" in task.recipe.needs and task.options.states is False:
        yield Hole("topic", name)
        return
    yield Hole("topic", name, "topic", name, "usual name" if topic is None else "given", "--topic")


def checked_topic(name: str, option: str) -> str:
    """Return the name of a topic.

    Raises:
        UsageError: ROS 2 has no such topic.
    """
    if ros_name("", name) is None:
        raise UsageError(f"{option} {name!r}: is not a topic; letters, digits, _ and / make one")
    return name


def domain_holes(task: Task) -> Iterator[Hole]:
    """Yield the domain: the one that is given, that of the stage, or the default."""
    number = task.options.domain
    if number is not None:
        if not 0 <= number <= LAST_DOMAIN:
            raise UsageError(f"--domain {number}: ROS 2 has the domains 0 to {LAST_DOMAIN}")
        yield Hole("domain", number, "domain", str(number), "given", "--domain")
        yield Hole("domain_by_environment", value=False)
        return
    by_domain = domains(task.stage)
    if not by_domain:
        source = "as Isaac Sim's default"
        yield Hole("domain", None, "domain", "ROS_DOMAIN_ID, else 0", source, "--domain")
        yield Hole("domain_by_environment", None)
        return
    clocks = {stamp.domain for stamp in topic_clocks(task.stage) if stamp.is_clock}
    choices = [*clocks] if len(clocks) == 1 else [*by_domain]
    if len(choices) > 1:
        names = [f"{domain} ({nodes[0].path})" for domain, nodes in by_domain.items()]
        raise AmbiguousError("ROS domain", names, "--domain")
    domain = choices[0]
    source = by_domain[domain][0].path if domain in by_domain else "the clock's"
    shown = f"ROS_DOMAIN_ID, else {domain.name}" if domain.from_environment else domain.name
    yield Hole("domain", domain.number or None, "domain", shown, f"as {source}", "--domain")
    yield Hole("domain_by_environment", None if domain.from_environment else False)


def namespace_holes(task: Task) -> Iterator[Hole]:
    """Yield the namespace that the nodes need so that their topics are those of the subject."""
    given = task.options.namespace
    if given is not None:
        if given and ros_name(given, "a") is None:
            raise UsageError(f"--namespace {given!r}: is not a namespace of ROS 2")
        yield Hole("namespace", given, "namespace", given, "given", "--namespace")
        yield Hole("tf_namespace", given)
        return
    subject = task.subject
    spaces = [value for _, value in namespaces_above(subject, task.stage)] if subject else []
    own = [value for _, value in namespaces_above(task.path, task.stage)]
    wanted, natural = "/".join(spaces), "/".join(own)
    # Nodes that read a render product look above the sensor by themselves.
    is_found = task.sensor is not None and "outputs" in task.recipe.needs
    if wanted and wanted != natural and not is_found:
        shown = f"isaac:namespace above {subject}, written into the nodes"
        yield Hole("namespace", wanted, "namespace", wanted, shown, "--namespace")
    elif wanted:
        yield Hole("namespace", None, "namespace", wanted, "isaac:namespace above", "--namespace")
    else:
        yield Hole("namespace", None)
    is_other = bool(wanted) and wanted != next(iter(own), "")
    yield Hole("tf_namespace", wanted if is_other else None)


def time(task: Task) -> Iterator[Hole]:
    """Yield whether simulation time begins anew after Stop, as elsewhere in the stage."""
    restarting = {
        stamp.restarts for stamp in topic_clocks(task.stage) if stamp.restarts is not None
    }
    if restarting == {False}:
        source = "as the stage's other stamps"
        yield Hole("restart", value=False, label="time", shown="goes on after Stop", source=source)
    else:
        yield Hole("restart", value=True)
