"""Rules about frames that messages name, and about transforms whose frames nobody can tell."""

from __future__ import annotations

from collections.abc import Iterator

from lab3_usd.check.match.conformance import setting_matches
from lab3_usd.check.registry import rule
from lab3_usd.check.ros.running import effective_value
from lab3_usd.check.ros.topics import endpoints
from lab3_usd.check.tf.frames import unknown_publishers
from lab3_usd.check.tf.lab_frames import TfView
from lab3_usd.model.finding import Problem
from lab3_usd.model.stage import Node
from lab3_usd.spec.topic_names import frame_ports


@rule("T11", "frame-id-outside-the-tree", scope="frames")
def frame_id_outside_the_tree(view: TfView) -> Iterator[Problem]:
    """A message names a frame that is not in the TF tree of the stage.

    Why: a subscriber asks tf2 for the frame and waits for ever. Isaac Sim reports no error.

    Fix: set the frame id of the publisher to a frame that the stage publishes, or publish that
    frame.

    Example: an IMU publisher keeps its default frame id, and no transform places that frame.
    """
    subject = view.subject
    if view.hidden or unknown_publishers(subject.stage, subject.lab):
        return
    required = {frame for edge in subject.lab.frames.edges for frame in edge}
    frames = {frame for edge in view.edges for frame in (edge.parent, edge.child)} | required
    extra = [node for roles in subject.roles.values() for node in roles.extra]  # told as such
    for endpoint in endpoints(subject.stage, subject.lab):
        if endpoint.runs and endpoint.direction == "publishes" and endpoint.node not in extra:
            found = _foreign_frames(endpoint.node, endpoint.port, view)
            yield from (problem for problem in found if problem.actual not in frames)


def _foreign_frames(node: Node, topic: str, view: TfView) -> Iterator[Problem]:
    """Yield the frame ids of one topic that the rules of settings do not find fault with."""
    kind, spec = node.type, view.role_specs.get(node.path)
    asked = {} if spec is None else {setting.port: setting for setting in spec.settings}
    for port in () if kind is None or kind.tf is not None else frame_ports(kind, topic):
        value = effective_value(node, port, view.running)
        if not isinstance(value, str) or (
            port in asked and not setting_matches(node, asked[port], value)
        ):
            continue
        yield Problem(
            node.path,
            f"{port} is '{value}', a frame that nothing publishes",
            property=port,
            expected="a frame of the TF tree",
            actual=value,
            severity="warning" if spec is None else None,
        )


@rule("T12", "unknown-frames", scope="frames", severity="warning")
def unknown_frames(view: TfView) -> Iterator[Problem]:
    """A node publishes transforms whose frame names are not in the stage.

    Why: the names are computed while the simulation runs. They may include a frame of the lab,
    which then has two publishers and jumps between them.

    Fix: type the frame ids into the node, or delete it if the lab does not need it. Otherwise check
    the tree with view_frames while the simulation runs.

    Example: a Publish Raw Transform Tree whose Child Frame ID is connected to a node that computes
    it.
    """
    subject = view.subject
    for path in unknown_publishers(subject.stage, subject.lab):
        if path not in subject.faulty_prims:
            yield Problem(
                path,
                "publishes transforms between frames that the stage does not tell",
                handout=subject.lab.frames.handout,
            )
