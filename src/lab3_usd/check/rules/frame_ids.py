"""Rules about frames that messages name, and about transforms whose frames nobody can tell."""

from __future__ import annotations

from collections.abc import Iterator

from lab3_usd.check.finding import Problem
from lab3_usd.check.frames import unknown_publishers
from lab3_usd.check.met import setting_met
from lab3_usd.check.model import Node
from lab3_usd.check.registry import rule
from lab3_usd.check.running import effective
from lab3_usd.check.subject import StageSubject
from lab3_usd.check.tf_view import TfView, tf_view
from lab3_usd.check.topics import endpoints, frame_ports


@rule("T11", "frame-id-outside-the-tree", scope="stage")
def frame_id_outside_the_tree(subject: StageSubject) -> Iterator[Problem]:
    """A message names a frame that is not in the TF tree of the stage.

    Why: whoever receives the message asks tf2 for the frame and waits for ever; Isaac Sim gives no
    error.

    Fix: set the frame id of the publisher to a frame that the stage publishes, or publish that
    frame.

    Example: an IMU publisher keeps its default frame id, and no transform places that frame.
    """
    if not subject.checkpoint.frames:
        return
    view = tf_view(subject)
    if view.hidden or unknown_publishers(subject.stage, subject.lab):
        return
    required = {frame for edge in subject.lab.frames.edges for frame in edge}
    frames = {frame for edge in view.edges for frame in (edge.parent, edge.child)} | required
    for endpoint in endpoints(subject.stage, subject.lab):
        if endpoint.runs and endpoint.direction == "publishes":
            found = _foreign_frames(endpoint.node, endpoint.port, view)
            yield from (problem for problem in found if problem.actual not in frames)


def _foreign_frames(node: Node, topic: str, view: TfView) -> Iterator[Problem]:
    """Yield the frame ids of one topic that the rules of settings do not find fault with."""
    kind, spec = node.type, view.played.get(node.path)
    asked = {} if spec is None else {setting.port: setting for setting in spec.settings}
    for port in () if kind is None or kind.tf is not None else frame_ports(kind, topic):
        value = effective(node, port, view.running)
        if not isinstance(value, str) or (
            port in asked and not setting_met(node, asked[port], value)
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


@rule("T12", "unknown-frames", scope="stage", severity="warning")
def unknown_frames(subject: StageSubject) -> Iterator[Problem]:
    """A node publishes transforms between frames that the stage does not tell.

    Why: the names come over a wire when the simulation runs. A frame of the lab may be among them,
    which then has two publishers, and jumps between them.

    Fix: type the frame ids into the node, or delete it where the lab does not need it. Otherwise
    check the tree with view_frames while the simulation runs.

    Example: a Publish Raw Transform Tree whose Child Frame ID is wired to a node that computes it.
    """
    if not subject.checkpoint.frames:
        return
    for path in unknown_publishers(subject.stage, subject.lab):
        if path not in subject.blamed:
            yield Problem(
                path,
                "publishes transforms between frames that the stage does not tell",
                handout=subject.lab.frames.handout,
            )
