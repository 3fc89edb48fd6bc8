"""Rules about what a checkpoint holds before the handout asks for it."""

from __future__ import annotations

from collections.abc import Iterator

from lab3_usd.check.absence import is_at_or_below
from lab3_usd.check.finding import Problem, Severity
from lab3_usd.check.registry import rule
from lab3_usd.check.sensor_place import candidates, is_named, lidars
from lab3_usd.check.subject import StageSubject


@rule("S18", "starter-not-empty", scope="stage")
def starter_not_empty(subject: StageSubject) -> Iterator[Problem]:
    """Checkpoint 00 holds what only later parts of the lab add.

    Why: the first checkpoint shows the supplied scene. Leftovers of a finished lab publish beside
    the student's own graphs: two clocks, two odometries, two parents of one frame.

    Fix: open the supplied file and save it as checkpoint 00 before adding anything; delete what is
    named here.

    Example: `/World/ActionGraph` in `Lab3_00_student_start.usda`.
    """
    if subject.checkpoint.graphs:
        return
    spec = subject.lab.scene["forbidden"]["starter"]
    form = subject.lab.catalog.graph
    told = [graph.path for graph in subject.lab.graphs.values()]
    told = [path for path in told if (prim := subject.stage.prim(path)) and prim.type == form.type]
    for path, kind in sorted(_prims_and_nodes(subject)):
        is_sensor = any(kind == subject.lab.scene[name]["type"] for name in ("lidar", "camera"))
        is_wrong = is_named(path.rpartition("/")[2], spec["names"]) or kind == form.type
        is_wrong = is_wrong or (path in spec["paths"] and not is_sensor)
        if is_wrong and not any(is_at_or_below(path, top) for top in told):
            told.append(path)
            message = f"{path} is not part of the supplied scene; was this saved late?"
            yield Problem(path, message, actual=kind, handout=spec["handout"])


def _prims_and_nodes(subject: StageSubject) -> Iterator[tuple[str, str]]:
    """Yield path and type of everything in the scene, nodes of graphs included."""
    for prim in subject.stage.prims.values():
        if prim.present:
            yield prim.path, prim.type
    for node in subject.stage.nodes():
        yield node.path, ""


@rule("L08", "early-lidar", scope="stage", severity="warning")
def early_lidar(subject: StageSubject) -> Iterator[Problem]:
    """The stage holds a lidar before the handout asks for one.

    Why: the file was perhaps saved late, after work on Part D had begun. In checkpoint 00 no lidar
    may be there at all (A2).

    Fix: save each checkpoint before going on to the next part.

    Example: `/turtlebot3_burger/base_scan/Lidar2D` in checkpoint 02.
    """
    if "lidar" in subject.checkpoint.sensors:
        return
    severity: Severity | None = None if subject.checkpoint.graphs else "error"
    for prim in lidars(subject):
        message = f"{prim.path} belongs to a later checkpoint; was this saved late?"
        yield Problem(prim.path, message, actual=prim.type, handout="A2", severity=severity)


@rule("C09", "early-camera", scope="stage", severity="warning")
def early_camera(subject: StageSubject) -> Iterator[Problem]:
    """The robot carries a camera before the handout asks for one.

    Why: the file was perhaps saved late, after work on Part E had begun. In checkpoint 00 the
    robot may have no camera at all (section 2, A2).

    Fix: save each checkpoint before going on to the next part.

    Example: `/turtlebot3_burger/base_footprint/Camera_1` in checkpoint 03.
    """
    if "camera" in subject.checkpoint.sensors:
        return
    severity: Severity | None = None if subject.checkpoint.graphs else "error"
    # A camera in the place of the lidar is a wrong lidar.
    others = [subject.lab.scene[sensor]["path"] for sensor in subject.checkpoint.sensors]
    robot = subject.lab.scene["robot"]["path"]
    for prim in candidates(subject.lab, subject.stage, "camera"):
        # One of the world may have any name.
        if prim.path in others or not is_at_or_below(prim.path, robot):
            continue
        message = f"{prim.path} belongs to a later checkpoint; was this saved late?"
        yield Problem(prim.path, message, actual=prim.type, handout="A2", severity=severity)
