"""The visible shapes of a stage, cut by the plane of a beam."""

from __future__ import annotations

from msgspec import Struct, field

from lab3_usd.model.dry_run.affine import Affine
from lab3_usd.model.dry_run.behaviour import Segment
from lab3_usd.model.dry_run.scene import Scene
from lab3_usd.sim.geometry.cuts import cut, joined
from lab3_usd.sim.geometry.shapes import Triangle, placed
from lab3_usd.sim.robot.machines import Machines

LEVEL = 1e-6  # radians by which a beam may lean and its cut still be kept


class Surroundings(Struct):
    """The visible shapes of a stage; what moves with a body is kept apart."""

    still: list[Triangle]
    moving: dict[str, list[Triangle]]  # by body, in its frame
    cuts: dict[float, list[Segment]] = field(default_factory=dict)
    own: dict[str, list[Segment]] = field(default_factory=dict)  # by sensor

    @classmethod
    def of(cls, scene: Scene, machines: Machines) -> Surroundings:
        """Sort the visible shapes of a scene."""
        found = cls([], {})
        for prim in scene.prims.values():
            if prim.seen and prim.type != "Camera":
                body = machines.body_of(prim.path)
                if body:
                    back = machines.bodies[body].world.rigid().inverse()
                    found.moving.setdefault(body, []).extend(placed(prim, back.then(prim.world)))
                else:
                    found.still.extend(placed(prim, prim.world))
        return found

    def around(self, at: Affine) -> list[Segment]:
        """Return what the plane through `at` cuts out of what stands still, in that frame."""
        back = at.inverse()
        (_, _, lean), (_, _, tilt), (_, _, up) = at.rows
        if abs(lean) + abs(tilt) > LEVEL or up < 0:
            inside = [(back.point(a), back.point(b), back.point(c)) for a, b, c in self.still]
            return cut(inside, 0.0)
        level = self.level(at.origin[2])
        (c, s, _), (d, e, _), _ = back.rows
        x, y, _ = back.origin
        return [
            (c * p + s * q + x, d * p + e * q + y, c * u + s * v + x, d * u + e * v + y)
            for p, q, u, v in level
        ]

    def level(self, height: float) -> list[Segment]:
        """Return what a level plane cuts out of what stands still."""
        height = round(height, 6)
        if height not in self.cuts:
            self.cuts[height] = joined(cut(self.still, height))
        return self.cuts[height]

    def beside(self, sensor: str, machines: Machines) -> list[Segment]:
        """Return what the plane of a sensor cuts out of bodies that do not carry it."""
        own = machines.member.get(machines.body_of(sensor))
        back = machines.inverse(sensor)
        found: list[Triangle] = []
        for body, surface in self.moving.items():
            if machines.member[body] is not own:
                place = back.then(machines.place(body))
                found += [(place.point(a), place.point(b), place.point(c)) for a, b, c in surface]
        return joined(cut(found, 0.0)) if found else []

    def carried(self, sensor: str, machines: Machines) -> list[Segment]:
        """Return what the plane of a sensor cuts out of the machine that carries it."""
        if sensor not in self.own:
            machine = machines.member.get(machines.body_of(sensor))
            back = machines.inverse(sensor)
            found: list[Triangle] = []
            for each in machine.rest if machine is not None else ():
                place = back.then(machines.place(each))
                for a, b, c in self.moving.get(each, ()):
                    found.append((place.point(a), place.point(b), place.point(c)))
            self.own[sensor] = joined(cut(found, 0.0))
        return self.own[sensor]
