"""What each part of the lab is worth: the rubric as plain data, loaded and checked."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Collection, Iterable, Iterator, Mapping
from fnmatch import fnmatchcase
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Annotated, Any, Literal

from msgspec import Meta, Struct, field, to_builtins
from msgspec.structs import replace

from lab3_usd.check.checker import judge
from lab3_usd.check.registry import FAMILIES, all_rules
from lab3_usd.check.rules.props import REMOVED
from lab3_usd.data import program
from lab3_usd.errors import SpecError
from lab3_usd.facts.likely_names import did_you_mean, likely_name
from lab3_usd.model.fault import FAULT_KINDS
from lab3_usd.model.finding import REQUIREMENT_KINDS, Requirement, is_among
from lab3_usd.model.stage import StageModel
from lab3_usd.spec.contradictions.names import LabFault
from lab3_usd.spec.contradictions.references import RULES
from lab3_usd.spec.lab import CHECKPOINTS, RUBRIC, SUBMISSION, Lab
from lab3_usd.spec.positions import located
from lab3_usd.spec.submission import has_teams
from lab3_usd.yaml_file import as_record, read_foreign_yaml, read_yaml, records

# The columns of the table of grades that are no items; the last stands behind the items.
TEAM_COLUMN = "team"  # after the name, where the names of files have a place for it
COLUMNS = ("student", "name", "status", "late", "earned", "possible", "percent", "remarks")
Visibility = Literal["visible", "hidden", "after_due_date", "after_published"]
Points = Annotated[float, Meta(ge=0.001, le=1e6)]  # so that sums and shares stay sane numbers
Share = Annotated[float, Meta(ge=0, le=1)]
BLEMISH, AGAIN = 0.1, 0.2  # where a rubric says nothing
_ERROR = "/error/"  # between a part and a rule


class Item(Struct, frozen=True, forbid_unknown_fields=True):
    """A line of the gradebook; the guide for graders explains its keys."""

    id: str
    points: Points
    title: str = ""
    checkpoint: str = ""
    groups: tuple[str, ...] = ("*",)
    requirements: tuple[str, ...] = ("*",)
    checklist: str = ""
    partial: bool = True
    optional: bool = False
    needs: tuple[str, ...] = ()
    breaks: tuple[str, ...] = ()
    rests: tuple[str, ...] = ()
    dry_run: tuple[str, ...] = ()
    files: tuple[str, ...] = ()
    visibility: Visibility = "visible"

    def asks(self, requirement: Requirement) -> bool:
        """Whether the requirement, of this item's checkpoint, is one of this item's."""
        return fits_name(requirement.group, self.groups) and fits_name(
            requirement.id, self.requirements
        )


def fits_any(pattern: str, names: Iterable[str]) -> bool:
    """Whether one of these names fits a pattern."""
    return any(fnmatchcase(name, pattern) for name in names)


def fits_name(name: str, patterns: Collection[str]) -> bool:
    """Whether a name fits one of these patterns."""
    return any(fnmatchcase(name, pattern) for pattern in patterns)


class Cap(Struct, frozen=True, forbid_unknown_fields=True):
    """An error of `rules` (or families) limits `items`, or all of them, to a share.

    `checkpoints` are patterns of the stages in which it counts; without them, that of the item.
    """

    rules: tuple[str, ...]
    at_most: Share
    because: str
    items: tuple[str, ...] = ()
    checkpoints: tuple[str, ...] = ()

    def looks_at(self, number: str, item: Item) -> bool:
        """Whether an error in the stage of this checkpoint limits the item."""
        if self.checkpoints:
            return fits_name(number, self.checkpoints)
        return item.checkpoint in {"", number}


class Late(Struct, frozen=True, forbid_unknown_fields=True):
    """The share that a late submission may earn, the one that each day costs, and further students.

    The days are those that a grader adds by hand.
    """

    at_most: Share = 1.0
    per_day: Share = 0.0
    students: tuple[str, ...] = ()


class Rubric(Struct, frozen=True, dict=True):
    """Everything that a rubric file says, and what follows from it for one lab.

    `blemish` is the share of an item that each faulty node, prim or error costs, in addition to the
    shares of unmet requirements. `again` is the share that depends on what the item `rests` on,
    judged again in the item's stage. `digest` identifies the rubric.

    Of the lab: `required` holds the requirements of each checkpoint, all unmet; `asked` those of
    each item that no earlier item has; `earlier` the items before each item; `added` the ids of the
    requirements that each checkpoint adds, or, if it adds none, those of the last one that did.
    `files` are the names of its stages.
    """

    title: str
    digest: str
    weights: Mapping[str, float]
    items: tuple[Item, ...]
    caps: tuple[Cap, ...] = ()
    late: Late = field(default_factory=Late)
    blemish: float = BLEMISH
    again: float = AGAIN
    asked: Mapping[str, tuple[Requirement, ...]] = field(default_factory=dict)
    required: Mapping[str, tuple[Requirement, ...]] = field(default_factory=dict)
    earlier: Mapping[str, tuple[Item, ...]] = field(default_factory=dict)
    added: Mapping[str, frozenset[str]] = field(default_factory=dict)
    files: Mapping[str, str] = field(default_factory=dict)

    @property
    def points(self) -> float:
        """The points there are without the optional ones."""
        return sum(item.points for item in self.items if not item.optional)

    @cached_property
    def counted(self) -> frozenset[str]:
        """The ids of all requirements that some item counts."""
        return frozenset(
            requirement.id for requirements in self.asked.values() for requirement in requirements
        )

    @cached_property
    def titles(self) -> Mapping[str, Mapping[str, str]]:
        """The titles of the requirements of each checkpoint, by id."""
        return {
            number: {requirement.id: requirement.title for requirement in requirements}
            for number, requirements in self.required.items()
        }

    def is_priced(self, rule: str) -> bool:
        """Whether a cap says what an error of the rule costs, in whatever stage it is."""
        return any(
            is_among(rule, cap.rules) and "*" in cap.checkpoints and cap.at_most <= 1 - self.blemish
            for cap in self.caps
        )

    def until(self, checkpoint: str) -> Iterator[Item]:
        """Yield the items of a checkpoint and of those before it."""
        reached = [*self.required][: [*self.required].index(checkpoint) + 1]
        return (item for item in self.items if item.checkpoint in reached)


def with_lab(rubric: Rubric, required: Mapping[str, tuple[Requirement, ...]]) -> Rubric:
    """Return a rubric with what follows from it for what the checkpoints of a lab ask for."""
    numbers = [*required]
    asked: dict[str, tuple[Requirement, ...]] = {}
    earlier: dict[str, tuple[Item, ...]] = {}
    paid: set[str] = set()
    for item in rubric.items:
        own = [
            requirement
            for requirement in required.get(item.checkpoint, ())
            if item.asks(requirement) and requirement.id not in paid
        ]
        asked[item.id] = tuple(own)
        reached = numbers[: numbers.index(item.checkpoint)] if item.checkpoint else []
        if own and not item.optional:
            paid.update(requirement.id for requirement in own)
        if not own:
            reached.append(item.checkpoint)
        counting = [
            before
            for before in rubric.items[: rubric.items.index(item)]
            if before.checkpoint in reached and asked[before.id] and not before.optional
        ]
        counting.sort(key=lambda before: numbers.index(before.checkpoint))
        earlier[item.id] = tuple(counting)
    return replace(rubric, required=required, asked=asked, earlier=earlier, added=_added(required))


def _added(required: Mapping[str, tuple[Requirement, ...]]) -> dict[str, frozenset[str]]:
    earlier_ids: set[str] = set()
    added: dict[str, frozenset[str]] = {}
    last: frozenset[str] = frozenset()
    for number, requirements in required.items():
        ids = frozenset(requirement.id for requirement in requirements)
        last = ids - earlier_ids or last
        added[number] = last
        earlier_ids |= ids
    return added


def load_items(
    data: Mapping[str, Mapping[str, Any]],
    required: Mapping[str, tuple[Requirement, ...]],
    lab: Lab,
    file: str,
) -> tuple[Item, ...]:
    """Return the items of a rubric in their order.

    `required` is everything that each checkpoint asks for.

    Raises:
        SpecError: there is none, or one is wrong; the line names it, and opens with `file`.
    """
    if not data:
        raise SpecError(f"{file}: 'items' is empty; a rubric needs at least one")
    lines = [line.text for line in lab.submission.checklist]
    items = {name: _titled(item, lab) for name, item in records(data, Item, file, "id").items()}
    for name, item in items.items():
        # The names head columns of the table of grades.
        if not name or not name.isprintable() or name != name.strip():
            raise SpecError(f"{file}: items: {name!r} cannot be the name of an item")
        if name.casefold() in (*COLUMNS, *([TEAM_COLUMN] if has_teams(lab.files) else [])):
            raise SpecError(
                f"{file}: items: '{name}' is a column of grades.csv; choose another name"
            )
        place = f"{file}: {name}"
        if bool(item.checkpoint) == bool(item.checklist):
            raise SpecError(f"{place}: give either 'checkpoint' or 'checklist'")
        _check_needs(item, tuple(data), place)
        _check_breaks(item, required, place)
        _check_dry_run(item, lab, place)
        if not item.checklist:
            _check_requirements(item, required, place)
        elif item.checklist not in lines:
            raise SpecError(f"{place}: no checklist of the handout has the line '{item.checklist}'")
    return tuple(items.values())


def _titled(item: Item, lab: Lab) -> Item:
    """Return an item with the id of its checkpoint, and a title, by default of what it is for."""
    id_ = lab.ids.get(item.checkpoint, item.checkpoint)
    checkpoint = lab.checkpoints.get(id_)
    title = item.title or (item.checklist if checkpoint is None else checkpoint.title)
    return replace(item, checkpoint=id_, title=title)


def one_of(value: str, allowed: Collection[str], place: str) -> None:
    """Refuse a value that is not one of the `allowed`.

    Raises:
        SpecError: it is not; the message names the one that is likely meant, else all of them.
    """
    if value not in allowed:
        ways = did_you_mean(likely_name(value, allowed)) or f"; known are {', '.join(allowed)}"
        raise SpecError(f"{place}: {value!r} is not known{ways}")


def _check_needs(item: Item, names: tuple[str, ...], place: str) -> None:
    """Refuse what does not stand above: an item is judged after those that it needs."""
    above = names[: names.index(item.id)]
    for name in item.needs:
        if name in above:
            continue
        why = f"there is no such item; the items above are {', '.join(above) or 'none'}"
        if name == item.id:
            why = "which is the item itself"
        elif name in names:
            why = f"which is below it; an item can only need items above it, so move '{name}' up"
        raise SpecError(f"{place}: needs '{name}', {why}")


def _check_breaks(item: Item, required: Mapping[str, tuple[Requirement, ...]], place: str) -> None:
    """Refuse what could contradict nothing: no requirement and no rule."""
    ids = {requirement.id for requirement in required.get(item.checkpoint, ())}
    rules = {*all_rules(), *FAMILIES}
    for name in item.breaks:
        is_rule = name.partition(_ERROR)[2] in rules if _ERROR in name else name in rules
        if not is_rule and not fits_any(name, ids):
            raise SpecError(
                f"{place}: '{name}' in 'breaks' is not a rule, and nothing that "
                f"checkpoint {item.checkpoint} asks for"
            )
    every = [requirement.id for asked in required.values() for requirement in asked]
    for name in item.rests:
        if _ERROR not in name and not fits_any(name, every):
            raise SpecError(f"{place}: '{name}' in 'rests' is nothing that a checkpoint asks for")
    for name in item.files:
        one_of(name, rules, f"{place}: files")


def _check_dry_run(item: Item, lab: Lab, place: str) -> None:
    """Refuse what no dry run shows: no topic, check or kind of fault, of a robot of the lab."""
    if not item.dry_run:
        return
    from lab3_usd.isaac.topics import JOINT_STATES
    from lab3_usd.sim.judge.checks import CHECKS, OF_JOINTS

    has_joints = any(
        topic.subscribed and topic.type == JOINT_STATES for topic in lab.topics.values()
    )
    checks = (*CHECKS, *OF_JOINTS) if has_joints else (*CHECKS,)
    for name in item.dry_run:
        robot, _, of_robot = name.rpartition(": ")
        allowed = lab.topics if name.startswith("/") else (*checks, *FAULT_KINDS)
        one_of(of_robot, allowed, f"{place}: dry_run")
        if robot:
            one_of(robot, [each.name for each in lab.scene.robots], f"{place}: dry_run")


def _check_requirements(
    item: Item, required: Mapping[str, tuple[Requirement, ...]], place: str
) -> None:
    one_of(item.checkpoint, required, place)
    requirements = required[item.checkpoint]
    groups = dict.fromkeys(requirement.group for requirement in requirements)
    ids = [requirement.id for requirement in requirements]
    wrong = [("groups", name) for name in item.groups if not fits_any(name, groups)]
    wrong += [("requirements", name) for name in item.requirements if not fits_any(name, ids)]
    if wrong:
        key, pattern = wrong[0]
        raise SpecError(
            f"{place}: '{pattern}' in '{key}' is nothing that checkpoint {item.checkpoint} "
            f"asks for; its groups are {', '.join(groups)}"
        )
    if not any(item.asks(requirement) for requirement in requirements):
        raise SpecError(f"{place}: its groups and requirements have nothing in common")


class RubricFile(Struct, forbid_unknown_fields=True):
    """The items of the gradebook, in order."""

    title: str
    items: dict[str, dict[str, Any]]
    weights: dict[str, Points] = {}
    blemish: Annotated[float, Meta(ge=0.001, le=1)] = BLEMISH
    again: Share = AGAIN
    caps: tuple[Cap, ...] = ()
    late: Late = Late()


def load_rubric(path: Path | None, lab: Lab) -> Rubric:
    """Load the rubric at `path`, None for that of the lab.

    Raises:
        SpecError: the file is missing or wrong; the line names the item and the key, and ends with
            its place in the file.
    """
    file = path if path is not None else lab.folder / RUBRIC
    try:
        return _rubric_of(file, path, lab)
    except SpecError as error:
        raise located(error, file.parent) from error


def _rubric_of(file: Path, path: Path | None, lab: Lab) -> Rubric:
    if path is None and not file.is_file():
        raise SpecError(f"{lab.title} has no {RUBRIC}; name a rubric with --rubric")
    data = read_yaml(file) if path is None else read_foreign_yaml(file)
    name = file.name
    content = as_record(data, RubricFile, name)
    required = everything_asked(lab)
    for kind in content.weights:
        one_of(kind, REQUIREMENT_KINDS, f"{name}: weights")
    items = load_items(content.items, required, lab, name)
    caps = tuple(replace(cap, checkpoints=_ids(cap.checkpoints, lab)) for cap in content.caps)
    for number, cap in enumerate(caps, start=1):
        _check_cap(cap, content.items, required, f"{name}: cap {number}")
    rubric = Rubric(
        title=content.title,
        digest="",
        weights=dict.fromkeys(REQUIREMENT_KINDS, 1.0) | content.weights,
        items=items,
        caps=caps,
        late=content.late,
        blemish=content.blemish,
        again=content.again,
    )
    # What the checkpoints ask for is no part of it: that is the lab's, not the rubric's.
    content_json = json.dumps(to_builtins(rubric))
    digest = hashlib.sha256(content_json.encode()).hexdigest()
    return with_lab(replace(rubric, digest=digest, files=lab.files), required)


def _ids(patterns: tuple[str, ...], lab: Lab) -> tuple[str, ...]:
    """Return the ids of the checkpoints whose keys fit patterns; one that fits all stays."""
    ids: list[str] = []
    for pattern in patterns:
        named = [id_ for key, id_ in lab.ids.items() if fnmatchcase(key, pattern)]
        ids += [pattern] if pattern == "*" or not named else named
    return tuple(ids)


@lru_cache(maxsize=4)
def everything_asked(lab: Lab) -> Mapping[str, tuple[Requirement, ...]]:
    """Return every requirement of every checkpoint, as an empty stage leaves it: not met."""
    empty = StageModel(lab.platform, "", 1.0, 1.0, (), {})
    return {
        number: tuple(
            replace(requirement, met=False, judged=True, slight=False)
            for requirement in judge(lab, checkpoint, empty).requirements
        )
        for number, checkpoint in lab.checkpoints.items()
    }


def _check_cap(cap: Cap, items: Collection[str], checkpoints: Collection[str], place: str) -> None:
    """Refuse a cap that could limit nothing."""
    if not cap.rules:
        raise SpecError(f"{place}: 'rules' is empty; name the rules whose errors limit the points")
    for rule in cap.rules:
        one_of(rule, (*all_rules(), *FAMILIES), place)
    for name in cap.items:
        one_of(name, items, place)
    for pattern in cap.checkpoints:
        if not fits_any(pattern, checkpoints):
            one_of(pattern, checkpoints, place)


def scoring_faults(lab: Lab) -> Iterator[LabFault]:
    """Yield what is wrong with the points and checklists of a lab, and what they leave out."""
    for rule in lab.handout.rules:
        if rule not in all_rules():
            yield LabFault(
                CHECKPOINTS, f"{RULES}: {rule}", "there is no such rule", f"see {program()} rules"
            )
    required = everything_asked(lab)
    yield from _checklist_faults(lab, required[lab.last])
    if not (lab.folder / RUBRIC).is_file():
        message = f"is missing, so that {program()} grade needs --rubric"
        yield LabFault(RUBRIC, "items", message, severity="warning")
        return
    try:
        rubric = _rubric_of(lab.folder / RUBRIC, None, lab)
    except SpecError as error:
        key, _, message = str(error).removeprefix(f"{RUBRIC}: ").rpartition(": ")
        yield LabFault(RUBRIC, key or "items", message)
        return
    yield from _sections_without_points(lab, rubric, required)
    paid = {each.group for asked in rubric.asked.values() for each in asked}
    for name in () if any(item.checklist for item in rubric.items) else lab.graphs:
        if name not in paid:
            message = f"no item gives points for {name}"
            yield LabFault(RUBRIC, "items", message, f"{name}.yaml", "warning")


def _checklist_faults(lab: Lab, required: tuple[Requirement, ...]) -> Iterator[LabFault]:
    for line in lab.submission.checklist:
        key = f"checklist: {line.section}: '{line.text}'"
        for pattern in line.requirements:
            if not fits_any(pattern, [requirement.id for requirement in required]):
                message = f"'{pattern}' fits no requirement of checkpoint {lab.last}"
                groups = ", ".join(dict.fromkeys(requirement.group for requirement in required))
                yield LabFault(SUBMISSION, f"{key}: requirements", message, f"groups: {groups}")
        for rule in line.rules:
            if rule not in all_rules():
                message = f"there is no rule {rule}"
                yield LabFault(SUBMISSION, f"{key}: rules", message, f"see {program()} rules")


def _sections_without_points(
    lab: Lab, rubric: Rubric, required: Mapping[str, tuple[Requirement, ...]]
) -> Iterator[LabFault]:
    """Yield the sections without a requirement that an item counts, and removals of others."""
    lines = {line.text: line for line in lab.submission.checklist}
    counting = [lines[item.checklist] for item in rubric.items if item.checklist in lines]
    patterns = [pattern for line in counting for pattern in line.requirements]
    counted = rubric.counted.union(
        each.id for each in required[lab.last] if fits_name(each.id, patterns)
    )
    first: dict[str | None, tuple[str, Requirement]] = {}
    removed: dict[str, tuple[str, Requirement]] = {}
    paid: set[str | None] = set()
    for checkpoint, requirements in required.items():
        for requirement in requirements:
            first.setdefault(requirement.handout, (checkpoint, requirement))
            if requirement.id in counted:
                paid.add(requirement.handout)
            elif requirement.id.startswith(REMOVED):
                removed.setdefault(requirement.id, (checkpoint, requirement))
    for section, (checkpoint, requirement) in first.items():
        if section not in paid:
            message = f"no item counts section {section} of the handout"
            hint = f"checkpoint {checkpoint} asks for {requirement.id}"
            yield LabFault(RUBRIC, "items", message, hint, "warning")
    for checkpoint, requirement in removed.values():
        if requirement.handout in paid:
            message = f"no item counts that {requirement.title}"
            hint = f"checkpoint {checkpoint} asks for {requirement.id}"
            yield LabFault(RUBRIC, "items", message, hint, "warning")
