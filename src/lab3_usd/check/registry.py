"""The table of rules: what a rule is, and how a function becomes one."""

from __future__ import annotations

import importlib
import inspect
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import cache
from itertools import chain
from os.path import realpath
from pathlib import Path
from typing import TYPE_CHECKING, Literal, TypeVar, get_args

from msgspec import Struct

from lab3_usd.data import program
from lab3_usd.errors import RuleError, UsageError, guess
from lab3_usd.model.finding import SEVERITIES, Place, Problem, Severity, family_of, id_order

if TYPE_CHECKING:
    from lab3_usd.spec.lab import Checkpoint, Lab

# What a rule looks at: one graph of a spec beside its graph in the stage, the whole stage, the same
# for each robot of the lab, the world around each or around none, its transforms (from the
# checkpoint on that asks for them), the requirements beside the findings that stay, the stage
# beside its starter, the map files, the saved output of the running system, the folder. Rules of
# the scope `model` look at a stage with or without a spec, as those of one's `own` do, those of
# `lint` at one without, those of `native` at what OpenUSD's validators say of it.
Scope = Literal[
    "graph",
    "stage",
    "robot",
    "world",
    "model",
    "lint",
    "native",
    "frames",
    "requirements",
    "starter",
    "maps",
    "navigation",
    "evidence",
    "submission",
    "file",
    "own",
    "script",
]
Check = TypeVar("Check", bound=Callable[..., Iterator[Problem]])

FAMILIES = {
    "F": "files",
    "G": "graphs",
    "N": "nodes",
    "P": "settings",
    "R": "targets",
    "W": "wires",
    "S": "scene",
    "L": "lidar",
    "C": "camera",
    "D": "sensors",
    "T": "frames",
    "Q": "topics",
    "U": "starter",
    "M": "maps",
    "V": "navigation",
    "E": "evidence",
    "X": "submission",
    "Z": "unopened",
    "K": "lint",
    "Y": "physics",
    "B": "scripts",
    "UV": "native",
}
# The families that judge what the starter brings: it excuses the faults that it has itself.
SUPPLIED = ("S",)
# The modules below check/rules whose rules are about other things than stages, by family. Of the
# others, those that begin with `lint_` are lint's alone, and those with `any_` lint's as well.
APART = {
    "F": ("files",),
    "U": ("starter",),
    "M": ("maps",),
    "V": ("nav2",),
    "E": ("evidence", "evidence_topics"),
    "X": ("submission",),
    "Z": ("files",),
    "B": ("scripts",),
    "UV": ("native",),
}
OF_LINT = ("K", "Y")  # the families that judge a stage without a lab


TF = "TF"  # a part of a stage that is no graph and no sensor, as the scene is


_FRAME = f"{TF}/frame/"


def frame_places(*frames: str) -> tuple[Place, ...]:
    """Return the places at which a finding stands that is about frames: their requirements."""
    return tuple((f"{_FRAME}{frame}", None) for frame in frames)


def in_tree(place: str, topic: str) -> str:
    """Return the place of a frame in the tree on a topic, any other place as it is."""
    frame = place.removeprefix(_FRAME)
    return place if frame == place else f"{_FRAME}{topic} {frame}"


class Parameter(Struct, frozen=True):
    """One number of a rule of lint that a configuration may set: above 0, and what it is."""

    rule: str
    name: str
    default: float
    about: str


Parameters = tuple[tuple[tuple[str, str], float], ...]  # values by rule and name


class Demand(Struct, frozen=True):
    """One requirement of the scene, as the rule that judges it states it.

    A `Problem` fails it by its `id`, or by the absence of its `prim`. It is listed among the other
    demands of that prim, or under `part` where it is about no single prim.
    """

    id: str
    title: str
    prim: str
    handout: str
    part: Literal["", "assembly", "world", "starter"] = ""

    @property
    def group(self) -> str:
        """The group that its id begins with: the scene, a robot or a sensor."""
        return self.id.partition("/")[0]


Demands = Callable[["Lab", "Checkpoint"], Iterable[Demand]]


class Rule(Struct, frozen=True):
    """One rule: a stable id, a name, a usual severity, and the generator that finds problems.

    Its `manual` is its docstring: what is wrong; `Why:`; `Fix:`; `Example:`, or the same in the
    `words` of a lab (`check.manual`). `formerly` is the name of an earlier release, which is still
    understood. `demands` yields what a checkpoint requires of the scene and the rule judges;
    several rules may judge the same demands. `counted` is what a report calls one of its notes and
    several, where it only counts them. `needs` is the part of a lab (`check.manual.PARTS`) without
    which there is nothing to judge. `parameters` are the numbers that a configuration may set.
    """

    id: str
    name: str
    severity: Severity
    scope: Scope
    check: Callable[..., Iterator[Problem]]
    words: str = ""
    formerly: str = ""
    demands: Demands | None = None
    counted: tuple[str, str] = ("", "")
    needs: str = ""
    parameters: tuple[Parameter, ...] = ()

    @property
    def manual(self) -> str:
        """What its docstring says, or the words of a lab for it."""
        return self.words or _docstring(self.check) or ""

    @property
    def family(self) -> str:
        """The letters that the id begins with."""
        return family_of(self.id)

    def section(self, title: str) -> str:
        """Return the paragraph of the manual that opens with `title:`, as one line."""
        for paragraph in self.manual.split("\n\n"):
            if paragraph.startswith(f"{title}:"):
                return " ".join(paragraph[len(title) + 1 :].split())
        return ""

    @property
    def hint(self) -> str:
        """The repair, as messages end: a single sentence has no full stop."""
        text = self.section("Fix")
        return text if ". " in text else text.removesuffix(".")


_docstring = cache(inspect.getdoc)
_RULES: dict[str, Rule] = {}
_IDS: dict[str, str] = {}  # by the name of a rule
_OF_LINT: set[Callable[..., Iterator[Problem]]] = set()


def _are_one(
    check: Callable[..., Iterator[Problem]], other: Callable[..., Iterator[Problem]]
) -> bool:
    """Whether a module that is imported again, maybe under another name, brings the same rule."""
    return check.__qualname__ == other.__qualname__ and (
        check.__module__ == other.__module__
        or realpath(check.__code__.co_filename) == realpath(other.__code__.co_filename)
    )


def rule(  # noqa: PLR0913 - decorators name them
    rule_id: str,
    name: str,
    scope: Scope = "lint",
    severity: Severity = "error",
    formerly: str = "",
    demands: Demands | None = None,
    counted: tuple[str, str] = ("", ""),
    needs: str = "",
    parameters: tuple[Parameter, ...] = (),
) -> Callable[[Check], Check]:
    """Register a generator of `Problem`s as the rule `rule_id`, which is never used again.

    What is true of any stage is written once and registered twice, for `lint` and for a scope of
    labs: each keeps its id, its name and its severity, and the manual is that of both. Where a lab
    asks for something at the site of a problem, `check.demands` adds it.

    Raises:
        RuleError: the id or the name is taken, or there is no such severity or scope.
    """
    for value, choices in ((severity, SEVERITIES), (scope, get_args(Scope))):
        if value not in choices:
            raise RuleError(f"rule {rule_id}: '{value}' is none of {', '.join(choices)}")

    def register(check: Check) -> Check:
        other = _RULES.get(rule_id)
        namesake = _IDS.setdefault(name, rule_id)
        if namesake != rule_id and namesake in _RULES:
            raise RuleError(f"rule {rule_id}: its name {name} is that of {namesake}")
        if other is not None and not _are_one(check, other.check):
            code = other.check.__code__
            raise RuleError(
                f"rule {rule_id} is taken by {other.name} at "
                f"{code.co_filename}:{code.co_firstlineno}; {_free_id(rule_id)} is free"
            )
        _RULES[rule_id] = Rule(
            rule_id, name, severity, scope, check, "", formerly, demands, counted, needs, parameters
        )
        if scope == "lint":
            _OF_LINT.add(check)
        _in_order.cache_clear()
        scene_demands.cache_clear()
        return check

    return register


def _free_id(rule_id: str) -> str:
    """Return the id after the last one of the same letters."""
    letters = family_of(rule_id)
    numbers = [int(name.removeprefix(letters)) for name in _RULES if family_of(name) == letters]
    return f"{letters}{max(numbers) + 1:0{len(rule_id) - len(letters)}}"


def own_rules() -> dict[str, Rule]:
    """Return the rules of one's own, in order of id."""
    names = [name for name, registered in _RULES.items() if registered.scope == "own"]
    return {name: _RULES[name] for name in sorted(names, key=id_order)}


def _sorted_by_id() -> dict[str, Rule]:
    return {name: _RULES[name] for name in sorted(_RULES, key=id_order)}


def added_by(registered: Rule) -> None:
    """Add a rule that was registered before, as a source of rules that is used again brings it."""
    _RULES[registered.id] = registered


def without_rules(names: Iterable[str]) -> None:
    """Forget rules."""
    for name in names:
        del _RULES[name]
    _in_order.cache_clear()
    scene_demands.cache_clear()


def holds_without_lab(rule: Rule) -> bool:
    """Whether a rule of labs is one of lint as well, written without a lab in mind."""
    return rule.scope != "lint" and rule.check in _OF_LINT


def twins(rule: Rule) -> list[Rule]:
    """Return the other ids of a rule: those that it has in lint, or in a lab."""
    return [
        other for other in all_rules().values() if other.check is rule.check and other.id != rule.id
    ]


@contextmanager
def own_rules_removed_on_exit() -> Iterator[None]:
    """Forget, after the body, the rules of one's own that it added."""
    before = frozenset(own_rules())
    try:
        yield
    finally:
        without_rules(own_rules().keys() - before)


def families() -> dict[str, str]:
    """Return what the rules of each family are about, by its letters, in the order of lists."""
    own = {own_rule.family: "custom rules" for own_rule in own_rules().values()}
    return {**FAMILIES, **own}


def all_rules() -> dict[str, Rule]:
    """Return every rule by id, in order of id; imports the families on the first call."""
    import_rules(*FAMILIES)
    return _sorted_by_id()


def rule_names() -> dict[str, str]:
    """Return the id of each rule by its name, and by the name that it had earlier."""
    rules = all_rules().values()
    former = {rule.formerly: rule.id for rule in rules if rule.formerly}
    return {**former, **{rule.name: rule.id for rule in rules}}


def padded_id(written: str) -> str:
    """Return an id with two digits where one is written: K01 for K1."""
    return f"{written[:1]}{written[1:].zfill(2)}"


def check_rule_names(names: Iterable[str], where: str = "") -> tuple[str, ...]:
    """Return ids of rules and letters of families; names of rules count as their ids.

    `where` opens the message.

    Raises:
        UsageError: there is no such rule or family; left out, it would hide every fault.
    """
    ids = []
    for name in map(str.strip, names):
        upper = name.upper()
        rule_id = upper if upper in families() else None
        rule_id = rule_id or (upper if upper in all_rules() else rule_names().get(name.lower()))
        if rule_id is None:
            place = f"{where}: " if where else ""
            names = [*all_rules(), *rule_names()]
            written = name.lower() if name.islower() else upper
            hint = guess(written, names, f"{program()} rules lists them")
            if (padded := padded_id(upper)) in all_rules():
                hint = f"did you mean '{padded}'?"
            raise UsageError(f"{place}there is no rule or family '{upper}'; {hint}")
        ids.append(rule_id)
    return tuple(ids)


def rules_of(scope: Scope, *families: str) -> list[Rule]:
    """Return the rules of one scope and of the families named, in order of id.

    Only those families are imported.
    """
    import_rules(*families)
    return list(_in_order(scope, families))


@cache
def scene_demands() -> tuple[Demands, ...]:
    """Return what the rules imported so far demand of the scene, in order of their ids."""
    stated = (registered.demands for registered in _sorted_by_id().values())
    return tuple(dict.fromkeys(demands for demands in stated if demands is not None))


@cache
def import_rules(*families: str) -> None:
    """Import the rules of families, so that asking for them takes no time."""
    modules = (APART.get(family) or _modules_about_stages(family in OF_LINT) for family in families)
    for module in dict.fromkeys(chain.from_iterable(modules)):
        importlib.import_module(f"lab3_usd.check.rules.{module}")


@cache
def _modules_about_stages(is_lint: bool) -> tuple[str, ...]:  # noqa: FBT001 - a key of the cache
    """Return the modules with rules of lint, or else with those of labs."""
    apart = {module for modules in APART.values() for module in modules}
    files = {file.stem for file in Path(__file__).with_name("rules").iterdir()}
    names = sorted(name for name in files - apart if not name.startswith("_"))
    if is_lint:
        return tuple(name for name in names if name.startswith(("lint_", "any_")))
    return tuple(name for name in names if not name.startswith("lint_"))


@cache
def _in_order(scope: Scope, families: tuple[str, ...]) -> tuple[Rule, ...]:
    rules = (rule for rule in _sorted_by_id().values() if rule.scope == scope)
    return tuple(rule for rule in rules if rule.family in families)
