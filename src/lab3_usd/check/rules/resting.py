"""The rule about the robot at rest: on the ground, nothing of it below, its lidar above."""

from __future__ import annotations

from collections.abc import Iterator

from lab3_usd.check.absence import hides_place, is_at_or_below
from lab3_usd.check.finding import Problem, Severity
from lab3_usd.check.ground import ground_height
from lab3_usd.check.model import Collider, StageModel
from lab3_usd.check.physics import collides
from lab3_usd.check.poses import IDENTITY
from lab3_usd.check.posing import misfits, root_tolerance
from lab3_usd.check.registry import rule
from lab3_usd.check.subject import StageSubject


@rule("S19", "not-at-rest", scope="stage")
def not_at_rest(subject: StageSubject) -> Iterator[Problem]:
    """A wheel hangs in the air, or a part of the robot is below the ground.

    Why: at Play the robot drops, tips, or is thrown up by the overlap (A5); a lidar below the
    ground sees nothing (8.7). Judged from the collision shapes as saved, while the robot root
    stands right; in the later checkpoints, which may be saved after a run, a warning.

    Fix: set the transform of the link or of the ground that is named here as the supplied file has
    it.

    Example: the ground plane moved to Z = -0.1.
    """
    if not _root_stands_right(subject):
        return
    ground = ground_height(subject)
    if ground is None:
        return
    lows = {body: low - ground for body, low in _lows(subject).items()}
    spec = subject.lab.scene["robot"]
    wheels = [f"{spec['path']}/{name}" for name in spec["wheels"]["joints"].values()]
    limit = _limit(subject)
    off = {body: low for body, low in lows.items() if low < -limit}
    off |= {body: lows[body] for body in wheels if body in lows and lows[body] > limit}
    standing = [body for body in wheels if body in lows]
    if standing and all(body in off for body in standing):
        # All wheels at once: it is the robot or the ground that is wrong, and one thing to say.
        off = {spec["path"]: off[standing[0]]}
    later = subject.checkpoint.id > spec["pose_is_error_until"]
    severity: Severity | None = "warning" if later else None
    for body, low in off.items():
        where = "above" if low > 0 else "below"
        part = body.rpartition("/")[2]
        message = f"{part} is {abs(low):.3g} m {where} the ground"
        related = () if body == spec["path"] else (spec["path"],)
        expected, actual = "on the ground", f"{low:.3g} m"
        yield Problem(body, message, None, expected, actual, "A5", related, severity)


def _root_stands_right(subject: StageSubject) -> bool:
    spec = subject.lab.scene["robot"]
    root = subject.stage.prim(spec["path"])
    if root is None or root.local is None:
        return False
    tolerance = root_tolerance(subject.lab.scene, subject.stage)
    return not any(misfits(root, root.local or IDENTITY, spec["pose"], tolerance))


def _limit(subject: StageSubject) -> float:
    """Allow the wheels as much as the robot's own height is allowed."""
    spec = subject.lab.scene["robot"]
    root = subject.stage.prim(spec["path"])
    height = root.world[14] if root is not None and root.world else 0.0
    given = abs(height * subject.stage.meters_per_unit - spec["pose"]["translate"][2])
    allowed: float = min(given, subject.lab.scene["tolerance"]["root_position"])
    return float(subject.lab.scene["tolerance"]["rest"]) + allowed


def _lows(subject: StageSubject) -> dict[str, float]:
    """Return how low each link reaches, in metres: its collision shapes, else its own origin."""
    spec, stage = subject.lab.scene["robot"], subject.stage
    lows: dict[str, float] = {}
    for name, link in spec["links"].items():
        path = f"{spec['path']}/{name}"
        shapes = [box.low[2] for box in stage.colliders if _carries(box, path, stage)]
        prim = stage.prim(path)
        if prim is not None and hides_place(stage, prim):
            continue
        if shapes:
            lows[path] = min(shapes)
        elif "offset" in link and prim is not None and prim.world:
            lows[path] = prim.world[14] * stage.meters_per_unit
    return lows


def _carries(box: Collider, path: str, stage: StageModel) -> bool:
    """Whether the shape belongs to the link and is switched on."""
    prim = stage.prim(box.path)
    return is_at_or_below(box.path, path) and prim is not None and collides(prim)
