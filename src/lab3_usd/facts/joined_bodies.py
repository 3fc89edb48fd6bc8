"""Which bodies joints tie together, and which robot a prim belongs to."""

from __future__ import annotations

from collections import Counter

from msgspec import Struct

from lab3_usd.facts.tree import first_connected
from lab3_usd.model.physics import FIXED, bodies, bodies_below, is_joint_type
from lab3_usd.model.prims import upwards
from lab3_usd.model.stage import StageModel, once_per_stage

_WORLD = ""  # what stands still, which ends of joints name by ''


class JoinedBodies(Struct, frozen=True, eq=False):
    """The bodies of a stage, grouped by their joints.

    `robots` maps each body to the first body of its robot (all that joints connect), `rigid` to the
    first one of those that move rigidly with it: '' for the world. `sizes` are the numbers of
    bodies of the robots, `holds` the robot of the bodies below each prim, '' for several.
    """

    robots: dict[str, str]
    rigid: dict[str, str]
    sizes: dict[str, int]
    holds: dict[str, str]

    def carrier(self, path: str) -> str:
        """Return the body that a prim moves with, '' where it stands still."""
        while path and path not in self.robots:
            path = path.rpartition("/")[0]
        return path

    def move_together(self, one: str, other: str) -> bool:
        """Whether two prims never move against each other, as far as joints tell."""
        return self.rigid_of(one) == self.rigid_of(other)

    def rigid_of(self, path: str) -> str:
        """Return the first body of those that a prim moves with, '' where it stands still."""
        return self.rigid.get(self.carrier(path), _WORLD)

    def owner(self, path: str) -> str:
        """Return the robot that a prim is part of or holds; '' for none, or one of several."""
        body = self.carrier(path)
        if body:
            return self.robots[body]
        return self.holds.get(path, "")


@once_per_stage
def joined_bodies(stage: StageModel) -> JoinedBodies:
    """Return what the joints of a stage tie together, those that are switched off included."""
    paths = bodies_below(stage, "/")
    ungrouped = JoinedBodies(dict.fromkeys(paths, ""), {}, {}, {})
    tied = [
        (tuple(ungrouped.carrier(end) for end in bodies(joint)), joint.type == FIXED)
        for joint in stage.of_type(is_joint_type)
        if joint.present
    ]
    robots = first_connected(paths, (pair for pair, _ in tied if all(pair)))
    rigid = first_connected([_WORLD, *paths], (pair for pair, is_fixed in tied if is_fixed))
    holds: dict[str, str] = {}
    for path, robot in robots.items():
        for top in ("", *upwards(path.rpartition("/")[0])):
            holds[top] = robot if holds.get(top, robot) == robot else ""
    return JoinedBodies(robots, rigid, Counter(robots.values()), holds)
