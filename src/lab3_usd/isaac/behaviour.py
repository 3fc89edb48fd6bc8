"""What node types do that their ports do not say: what they need, follow, read and change."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from fnmatch import fnmatchcase
from typing import Literal

from msgspec import Struct

from lab3_usd.isaac.releases import is_release_within


class Need(Struct, frozen=True, forbid_unknown_fields=True):
    """Inputs of which at least one must be connected or set; else the node computes from zeros.

    This applies only if the input `when` is connected, set or true, `when_wired` is connected, and
    `unless` is not true. An authored zero suffices with `zero_counts`. A constant value does not
    suffice with `changing`, nor a number of 0 or below with `positive`. `effect` describes what
    happens otherwise, `source` is the file of Isaac Sim that shows it. `until` is the last release
    in which this is so, '' for all.
    """

    inputs: tuple[str, ...]
    effect: str
    source: str
    when: str = ""
    when_wired: str = ""
    unless: str = ""
    zero_counts: bool = False
    changing: bool = False
    positive: bool = False
    severity: Literal["error", "warning"] = "error"
    until: str = ""


class SensorOf(Struct, frozen=True, forbid_unknown_fields=True):
    """The sensors whose render product a node reads: prims of these types.

    `schemas_until` are schemas that also made a prim such a sensor, each with the last release in
    which it did, and `instead` says what to do since. `needs` is a schema that a prim of the types
    must carry, '' where it needs none. `turned` tells whether messages and frames have the axes of
    REP 103 for cameras: the prim's own, turned half around X. `in_frame` are attributes of the
    sensor, each with the value with which points are in its own frame. Where two are read together
    whose values of one of the attributes `equal` differ, Isaac Sim crashes in the releases
    `equal_in`, the first and the last.
    """

    types: tuple[str, ...]
    source: str
    schemas_until: Mapping[str, str] = {}
    instead: str = ""
    needs: str = ""
    turned: bool = False
    in_frame: Mapping[str, str] = {}
    equal: tuple[str, ...] = ()
    equal_in: tuple[str, str] = ("", "")

    def schemas_in(self, release: str) -> set[str]:
        """Return the schemas that make a prim such a sensor in a release."""
        return {
            name
            for name, last in self.schemas_until.items()
            if is_release_within(release, "", last)
        }


class BodyOf(Struct, frozen=True, forbid_unknown_fields=True):
    """The body that a node follows: the prim of the input `prim`, with one of these schemas.

    From the release `robot_since` on, a prim with the schema `robot` and none of these represents
    the first link in its relationship `links`: a prim with the schema `link`, or the first link of
    a robot that is listed. `gives` are the outputs that change when the body moves.
    """

    prim: str
    schemas: tuple[str, ...]
    robot: str
    links: str
    link: str
    gives: tuple[str, ...]
    source: str
    robot_since: str = ""


class JointsOf(Struct, frozen=True, forbid_unknown_fields=True):
    """How a node picks the joints that it moves, each with the last release in which it does so.

    Until `zeros_until` numbers of joints that are all 0 are ignored, so that all joints move. Until
    `spreads_until` one command counts for all joints named.
    """

    zeros_until: str
    spreads_until: str
    source: str


class UnitOf(Struct, frozen=True, forbid_unknown_fields=True):
    """The unit of length of what a node gives.

    `metres` are outputs in metres. Others keep the unit of the input `passes`; where the input `by`
    says so, metres become units of the stage (`to_stage`) or the other way (`to_metres`).
    """

    source: str
    metres: tuple[str, ...] = ()
    passes: str = ""
    by: str = ""
    to_stage: str = ""
    to_metres: str = ""


class TargetOf(Struct, frozen=True, forbid_unknown_fields=True):
    """The prims that a node can read by its input `input`.

    Such a prim has one of these types and one of these schemas, where any are listed. A prim above
    it carries the schema `inside`; it or a prim below it carries `holds`; it carries `part_of`, or
    is a link or joint of what does. While its attribute `switch` is False, nothing is read. `since`
    is the first release in which that holds.
    """

    input: str
    what: str
    effect: str
    source: str
    types: tuple[str, ...] = ()
    schemas: tuple[str, ...] = ()
    inside: str = ""
    holds: str = ""
    part_of: str = ""
    switch: str = ""
    since: str = ""


class QuantityOf(Struct, frozen=True, forbid_unknown_fields=True):
    """The quantities that outputs give, and those that inputs are meant for.

    `sizes` are the inputs that state a size of the driven robot, each with which one that is.
    """

    source: str
    gives: Mapping[str, str] = {}
    takes: Mapping[str, tuple[str, ...]] = {}
    sizes: Mapping[str, str] = {}


class Scripts(Struct, frozen=True, forbid_unknown_fields=True):
    """Node types (patterns) and schemas that run code from the file."""

    types: tuple[str, ...]
    apis: tuple[str, ...]

    def runs(self, node_type: str) -> bool:
        """Whether a node of this type runs code that the file holds."""
        return any(fnmatchcase(node_type, pattern) for pattern in self.types)

    def among(self, apis: Iterable[str]) -> str | None:
        """Return the first of these schemas by which a prim runs code, None where there is none."""
        return next((api for api in apis if api in self.apis), None)


class Building(Struct, frozen=True, forbid_unknown_fields=True):
    """What scripts that build graphs rely on.

    `module` contains the controller. Defaults are `evaluator` for a graph, `target` for the
    relationship of targets, and `compound` for the type of a node that is given as a dictionary.
    `stages` and `modes` map names in scripts to values in files. After the release
    `old_names_until`, old type names are unknown to scripts.
    """

    module: str
    evaluator: str
    compound: str
    target: str
    old_names_until: str
    stages: Mapping[str, str]
    modes: Mapping[str, str]


class Door(Struct, frozen=True, forbid_unknown_fields=True):
    """The inputs of a gate that opens and closes: signals that may pass, and that change it.

    It begins shut while the input `closed` is True.
    """

    enter: str
    toggle: str
    closed: str


class SingleSignal(Struct, frozen=True, forbid_unknown_fields=True):
    """Outputs that signal once, unless a wire reaches `again`.

    With `when` they do so where that input has one of the `values`, and an event surely fires then.
    """

    outputs: tuple[str, ...]
    again: str = ""
    when: str = ""
    values: tuple[str, ...] = ()


class WriterPorts(Struct, frozen=True, forbid_unknown_fields=True):
    """What a type changes while it runs, and the inputs that say so.

    `prims` are relationships, `paths` texts; `wires` lead to the node whose work is changed.
    `property` is what is written, '' for the prims themselves. A prim without one of the `schemas`
    does not change. One that `is_view` changes cameras, which matter to their viewer alone unless a
    render product has them. `what` is changed where no prim is named. `run` says what becomes of
    the run, '' for types that change prims: where the input `by` is one of `only`, and the input
    `value` is not the `usual` one.
    """

    prims: tuple[str, ...] = ()
    paths: tuple[str, ...] = ()
    wires: tuple[str, ...] = ()
    property: str = ""
    schemas: tuple[str, ...] = ()
    is_view: bool = False
    what: str = "the scene"
    run: str = ""
    by: str = ""
    only: tuple[str, ...] = ()
    value: str = ""
    usual: bool | None = None
