"""Rules about files: the stage itself, its sublayers, and the assets it refers to."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import PurePath

from lab3_usd.check.absence import is_at_or_below
from lab3_usd.check.finding import Problem
from lab3_usd.check.registry import rule
from lab3_usd.check.subject import StageSubject


@rule("F01", "unreadable-file", scope="file")
def unreadable_file(reason: str) -> Iterator[Problem]:
    """The file cannot be opened as a USD stage.

    Why: Isaac Sim cannot open it either, and nothing in it can be judged.

    Fix: open the stage in Isaac Sim, save it again as .usda, and hand in that file.

    Example: a file that ends in `.uda`, or an upload that was cut short.
    """
    yield Problem("/", reason)


@rule("F02", "not-verifiable", scope="stage", severity="note")
def not_verifiable(subject: StageSubject) -> Iterator[Problem]:
    """The stage refers to an asset that cannot be found from here, or that lacks a sublayer.

    Why: what the asset holds is neither passed nor failed: it may be there on the computer where
    the stage was made. Graphs, nodes and wires must be in the file itself.

    Fix: hand in the asset beside the stage with a relative path, or choose File > Collect As in
    Isaac Sim. Nothing needs to be done for assets of NVIDIA's own server.

    Example: the lidar refers to `Example_Rotary_2D.usda` on a server.
    """
    users: dict[tuple[str, str], list[str]] = {}
    for missing in subject.stage.unresolved:
        if missing.kind != "sublayer":
            of = PurePath(missing.layer).name if missing.kind == "sublayer of an asset" else ""
            users.setdefault((missing.asset, of), []).append(missing.prim)
    for (asset, of), (first, *others) in users.items():
        what = f"the sublayer {asset} of {of}" if of else asset
        message = (
            f"not verifiable: {what} cannot be found from here, so what it would bring to {first} "
            "is neither passed nor failed"
        )
        yield Problem(first, message, actual=asset, related=tuple(others))


@rule("F03", "missing-sublayer", scope="stage")
def missing_sublayer(subject: StageSubject) -> Iterator[Problem]:
    """A sublayer of the stage itself cannot be found.

    Why: it could hold anything, so that the stage is not the one that was worked on. Prims that it
    may hold are not reported one by one; graphs that are missing are.

    Fix: hand in the sublayer beside the stage with a relative path, or open the stage in Isaac Sim
    and choose File > Save Flattened As.

    Example: `subLayers = [@/home/ana/RAS545/Lab3/work/edits.usda@]`.
    """
    for missing in subject.stage.unresolved:
        if missing.kind == "sublayer":
            message = f"sublayer {missing.asset} cannot be found"
            yield Problem("/", message, actual=missing.asset, handout="6.1")


@rule("F04", "muted-sublayer", scope="stage", severity="warning")
def muted_sublayer(subject: StageSubject) -> Iterator[Problem]:
    """A sublayer that is muted holds parts of the lab.

    Why: Isaac Sim keeps the list of muted layers in the stage, and opens it without them: what they
    hold is not there when somebody else presses Play. It is judged here as if they were not muted.

    Fix: open Window > Layer, click the eye of the layer named here so that it is shown, and save.

    Example: `ROS_Drive` stands in `drive.usda`, which is muted.
    """
    for muted in subject.stage.muted:
        parts = _lab_parts(subject, muted.prims)
        if parts:
            message = f"sublayer {muted.asset} is muted and holds {', '.join(parts)}"
            yield Problem("/", message, actual=muted.asset, handout="6.1", related=parts)


def _lab_parts(subject: StageSubject, prims: Iterable[str]) -> tuple[str, ...]:
    """Return the parts of the lab that these prims belong to: graphs, sensors, the robot."""
    scene, graphs = subject.lab.scene, subject.lab.graphs
    parts = [scene["robot"]["path"], scene["lidar"]["path"], scene["camera"]["path"]]
    parts += [graphs[name].path for name in subject.checkpoint.graphs]
    parts += [roles.graph.path for roles in subject.roles.values() if roles.graph is not None]
    owners = (max((p for p in parts if is_at_or_below(prim, p)), default="") for prim in prims)
    return tuple(sorted({owner for owner in owners if owner}))
