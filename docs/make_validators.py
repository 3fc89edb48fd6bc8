"""Measures which validator finds which seeded fault, and writes the result into `lint-corpus.md`.

Run `python docs/make_validators.py [EXTENSION]` after faults, rules or validators have changed.
Python 3.12 has them all: `pip install -e .[nvidia] ros-openusd-compliance-checker
simready-foundation-tier-core simready-foundation-tier-sensors`. EXTENSION is the folder
`isaacsim/exts/isaacsim.asset.validation` of the unpacked wheel isaacsim-asset 6.2.0.0: Isaac Sim's
own rules. What is not there keeps what was measured before. The measurement is kept in
`tests/lint_validators.json`.
"""

from __future__ import annotations

import json
import logging
import sys
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import cache
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory
from types import ModuleType
from typing import Any, NamedTuple

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests/support"))
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "benchmarks"))

import corpus
import quick_yaml
from pxr import Plug, Sdf, Usd
from scene_stages import CASES, ROBOT, with_values

from lab3_usd.isaac.sensor_models import LongList
from lab3_usd.pipeline.stage import lint_stage
from lab3_usd.sim.dry_run import dry_run
from lab3_usd.spec.load.loader import load_lab, load_platform
from lab3_usd.stage.read.native_validators import native_errors

TESTS = Path(__file__).resolve().parents[1] / "tests"
PAGE = Path(__file__).with_name("lint-corpus.md")
MEASURED = TESTS / "lint_validators.json"
FAULTS: Mapping[str, Mapping[str, Mapping[str, Any]]] = quick_yaml.load(
    (TESTS / "lint_faults.yaml").read_text(encoding="utf-8")
)
ISSUES: Mapping[str, str] = quick_yaml.load(
    (TESTS / "lint_fault_issues.yaml").read_text(encoding="utf-8")
)
# The control, a fault that the others do judge, shows that they were running: a joint without body.
JOINTS = {
    "rover": "/World/Rover/left_wheel_joint",
    "truck": "/Fleet/Truck/joints/rear",
    "arm": "/arm/shoulder_joint",
}
MARK = "<!-- Below: written by docs/make_validators.py. -->\n"
NVIDIA = "usd_validation_nvidia"
ISAAC = "isaacsim"
LINT, SIM = "lab3 lint", "lab3 sim"
DRIVE = "0.15,0,1 0,0.8,0.5"  # of the dry runs, which are short
Reports = Counter[tuple[str, str]]  # rule and prim of each report


class Validator(NamedTuple):
    """A column: its title, the package that it is measured with, and its reports about a file."""

    title: str
    package: str
    reports: Callable[[Path], Reports]


def by_lint(path: Path) -> Reports:
    """Return the errors and warnings of the linter; its notes do not count."""
    findings = lint_stage(path).findings
    return Counter(
        (finding.rule, finding.prim) for finding in findings if finding.severity != "note"
    )


def by_sim(path: Path) -> Reports:
    """Return the checks of a dry run that fail."""
    checks = dry_run(path, load_lab(), "", DRIVE).behaviour.checks
    return Counter((check.name, check.prim) for check in checks if check.verdict == "bad")


def by_openusd(path: Path) -> Reports:
    """Return what the validators of usd-core say, of any severity."""
    errors = native_errors(Usd.Stage.Open(str(path)), path.name)
    return Counter((error.validator, error.prim) for error in errors)


@cache
def _engine(package: str) -> Any:
    """Return NVIDIA's engine with every rule that a package brings."""
    import usd_validation_nvidia as module

    registry = module.CategoryRuleRegistry()
    engine = module.ValidationEngine(init_rules=False, variants=False)
    for category in registry.categories:
        for rule in registry.get_rules(category):
            if rule.__module__.split(".")[0] == package:
                engine.enable_rule(rule)
    return engine


def by_nvidia(path: Path) -> Reports:
    """Return what NVIDIA's own rules say, of any severity."""
    return _by_engine(NVIDIA, path)


def by_isaac(path: Path) -> Reports:
    """Return what the rules of Isaac Sim's own extension say, of any severity."""
    return _by_engine(ISAAC, path)


def register_schemas(folder: Path) -> None:
    """Make usd-core know the schemas of sensors by name, type and default, as Isaac Sim does.

    Of a long default the length is right, and each entry is the lowest. Nothing may have asked
    usd-core for its schemas before.
    """
    layer, types = Sdf.Layer.CreateNew(str(folder / "generatedSchema.usda")), {}
    for name, schema in load_platform().sensor_models.schemas.items():
        kind = "multipleApply" if any("*" in each for each in schema.attributes) else "singleApply"
        types[f"Sensor{name}"] = {
            "alias": {"UsdSchemaBase": name},
            "bases": ["UsdAPISchemaBase"],
            "schemaKind": f"{kind}API",
        }
        spec = Sdf.CreatePrimInLayer(layer, f"/{name}")
        spec.specifier = Sdf.SpecifierClass
        spec.SetInfo("apiSchemas", Sdf.TokenListOp.Create(prependedItems=[*schema.brings]))
        for attribute, said in schema.attributes.items():
            value = said.default
            if isinstance(value, LongList):
                value = (value.low,) * value.length
            usd_type = Sdf.ValueTypeNames.Find(said.type)
            made = Sdf.AttributeSpec(spec, attribute.replace("*", "__INSTANCE_NAME__"), usd_type)
            if value is not None:
                made.default = (
                    usd_type.type.pythonClass(value) if value.__class__ is tuple else value
                )
    layer.Save()
    plugin = {"Name": "sensors", "Type": "resource", "Root": ".", "ResourcePath": "."}
    plugin = {**plugin, "Info": {"Types": types}}
    (folder / "plugInfo.json").write_text(json.dumps({"Plugins": [plugin]}), encoding="utf-8")
    Plug.Registry().RegisterPlugins(str(folder))


def load_isaac(extension: Path) -> None:
    """Import the rules of Isaac Sim's extension from its folder, unchanged.

    Its package also has the class that Kit starts, which needs two of Kit's modules by name. The
    rules use neither; that of contacts between colliders needs PhysX, and is left out.
    """
    kit = {name: ModuleType(name) for name in ("carb", "omni", "omni.ext")}
    kit["omni.ext"].IExt = object  # type: ignore[attr-defined] - a base class
    kit["omni"].ext = kit["omni.ext"]  # type: ignore[attr-defined] - as an import has it
    sys.modules.update(kit)
    sys.path.insert(0, str(extension))
    import_module("isaacsim.asset.validation")


def by_simready(path: Path) -> Reports:
    """Return what the rules of SimReady say, of any severity."""
    return _by_engine("simready", path)


def _by_engine(package: str, path: Path) -> Reports:
    if __name__ != "__main__":  # as the tests ask, of a few stages
        return _issues(package, path)
    return _with_schemas().apply(_issues, (package, path))


@cache
def _with_schemas() -> Any:
    """Return a process in which usd-core knows the schemas of sensors, and all rules are there."""
    return get_context("spawn").Pool(1, _prepare, [sys.argv[1:2]])


def _prepare(extension: list[str]) -> None:
    logging.disable(logging.CRITICAL)
    with TemporaryDirectory() as folder:
        register_schemas(Path(folder))
        Usd.SchemaRegistry()  # reads them
    for each in extension:
        load_isaac(Path(each))


def _issues(package: str, path: Path) -> Reports:
    issues = _engine(package).validate(str(path)).issues()
    return Counter((issue.rule.__name__, str(getattr(issue.at, "path", "/"))) for issue in issues)


def by_rep(path: Path) -> Reports:
    """Return what the checker of REP-0158 says, of any severity."""
    from compliance_checker import ComplianceChecker

    checker = ComplianceChecker.from_path(str(path), include_export=True, include_extended=True)
    return Counter(
        (violation.check_id, violation.prim_path) for violation in checker.run().violations
    )


VALIDATORS = (
    Validator(LINT, "lab3-usd", by_lint),
    Validator("OpenUSD", "usd-core", by_openusd),
    Validator("NVIDIA", "usd-validation-nvidia", by_nvidia),
    Validator("REP-0158", "ros-openusd-compliance-checker", by_rep),
    Validator("SimReady", "simready-foundation-tier-sensors", by_simready),
    Validator("Isaac Sim", ISAAC, by_isaac),
)
# Changes of the lab's lidar: those that NVIDIA's checker or public rules refuse, and right ones.
LIDARS = {
    "refused": [*CASES["refused"].values()],
    "told": [case["change"] for case in CASES["told"].values()],
    "taken": [*CASES["taken"].values()],
}


def column(validator: Validator, faults: Iterable[str] = FAULTS) -> dict[str, str]:
    """Return for each fault that the validator finds in how many robots, as `2 of 3`.

    The linter finds a fault by an error or warning at its place; any other validator by anything
    that it does not report for the sound robot.
    """
    cells = {}
    for name in faults:
        seen = 0
        for robot, seed in FAULTS[name].items():
            new = new_reports(validator, robot, seed["break"])
            at = [seed["at"]] if isinstance(seed["at"], str) else seed["at"]
            seen += any(validator.reports is not by_lint or prim in at for _, prim in new)
        if seen:
            cells[name] = f"{seen} of {len(FAULTS[name])}"
    return cells


def new_reports(validator: Validator, robot: str, steps: list[dict[str, Any]]) -> Reports:
    """Return what is reported about a robot after these steps, and not about the sound one."""
    return reports_of(validator, robot, steps) - _reports_of_sound(validator, robot)


@cache
def _reports_of_sound(validator: Validator, robot: str) -> Reports:
    return reports_of(validator, robot, [])


def reports_of(validator: Validator, robot: str, steps: list[dict[str, Any]]) -> Reports:
    """Return the reports about a robot after these steps, saved as a file of its own."""
    return _reports_about(validator, corpus.Entry(corpus.FAULTY, "stage", robot, steps))


def _reports_about(validator: Validator, entry: corpus.Entry) -> Reports:
    with TemporaryDirectory() as folder:
        corpus.write(entry, Path(folder))
        return validator.reports(Path(folder) / entry.file)


def score(validator: Validator) -> dict[str, int]:
    """Return how many faults of users a validator finds, and how many right stages it reports.

    It finds a fault by what it does not report of the right robot: at a prim at fault, or anywhere.
    """
    right = [entry for entry in corpus.entries() if entry.group != corpus.FAULTY]
    accused = sum(bool(_reports_about(validator, entry)) for entry in right)
    news = [
        ({prim for _, prim in new_reports(validator, entry.robot, entry.steps)}, entry.prims)
        for entry in corpus.entries()
        if entry.is_of_users
    ]
    at_place = sum(bool(prims & {*at}) for prims, at in news)
    found = sum(bool(prims) for prims, _ in news)
    stages = {"faults": len(news), "stages": len(right)}
    return {"place": at_place, "any": found, "right": accused, **stages}


def lidars(validator: Validator) -> dict[str, str]:
    """Return of how many changes of the lab's lidar a validator says what it says not before."""
    before = _of_lidar(validator, {})
    return {
        group: f"{sum(bool(_of_lidar(validator, each) - before) for each in changes)} of "
        f"{len(changes)}"
        for group, changes in LIDARS.items()
    }


def _of_lidar(validator: Validator, change: Mapping[str, Any]) -> Reports:
    """Return the reports about the lab's last stage after a change of its lidar.

    The robot is the default prim, to which some rules keep.
    """
    stage = with_values(change)
    stage.SetDefaultPrim(stage.GetPrimAtPath(ROBOT))
    with TemporaryDirectory() as folder:
        path = Path(folder) / "stage.usda"
        stage.Export(str(path))
        return validator.reports(path)


def control(validator: Validator) -> str:
    """Return in how many robots a validator finds the control, '' for none."""
    seen = [
        new_reports(validator, robot, [{"targets": [f"{joint}.physics:body1", "/gone"]}])
        for robot, joint in JOINTS.items()
    ]
    return f"{sum(map(bool, seen))} of {len(seen)}" if any(seen) else ""


def measure(known: Mapping[str, Any]) -> dict[str, Any]:
    """Return versions, control and faults by validator: where it found something, and how often.

    What is not installed keeps what is `known` of it.
    """
    versions = {each.title: installed(each.package) for each in VALIDATORS}
    here = [each for each in VALIDATORS if versions[each.title] is not None]
    fresh = {validator.title for validator in here}
    columns = {validator.title: column(validator) for validator in here}
    for title in (each.title for each in VALIDATORS if each.title not in fresh):
        kept = {name: cells[title] for name, cells in known["faults"].items() if title in cells}
        columns[title] = kept
    controls = {validator.title: control(validator) for validator in here}
    controls |= {title: kept for title, kept in known["control"].items() if title not in fresh}
    played = (*here, Validator(SIM, "lab3-usd", by_sim))
    scores = {each.title: score(each) for each in played}
    of_lidars = known.get("lidars", {}) | {each.title: lidars(each) for each in played}
    titles = [validator.title for validator in VALIDATORS]
    return {
        "versions": {title: found or known["versions"][title] for title, found in versions.items()},
        "control": {title: controls[title] for title in titles if controls.get(title)},
        "corpus": {
            title: scores.get(title) or known["corpus"][title] for title in (LINT, SIM, *titles[1:])
        },
        "lidars": {title: of_lidars[title] for title in (LINT, SIM, *titles[1:])},
        "faults": {
            name: {title: columns[title][name] for title in titles if name in columns[title]}
            for name in FAULTS
        },
    }


def summary(measured: Mapping[str, Any]) -> Iterator[str]:
    """Yield the generated part of the page: totals, reported and missed faults."""
    faults: Mapping[str, Mapping[str, str]] = measured["faults"]
    titles = [validator.title for validator in VALIDATORS]
    yield _row("", titles)
    yield _row("---", ["---"] * len(titles))
    found = {title: sum(title in cells for cells in faults.values()) for title in titles}
    yield _row(f"faults found, of {len(faults)}", [f"**{found[title]}**" for title in titles])
    yield _row("control", [measured["control"].get(title, "-") for title in titles])
    yield _row("version", [measured["versions"][title] for title in titles])
    yield from ("", "On the corpus:", "")
    scores: Mapping[str, Mapping[str, int]] = measured["corpus"]
    yield _row("", scores)
    yield _row("---", ["---"] * len(scores))
    for text, key, total in (
        ("faults of users found at their place", "place", "faults"),
        ("found anywhere", "any", "faults"),
        ("right stages with a report", "right", "stages"),
    ):
        yield _row(text, [f"{score[key]} of {score[total]}" for score in scores.values()])
    for text, group in (
        ("lidars that NVIDIA's checker refuses", "refused"),
        ("lidars that public rules refuse, or whose names are odd", "told"),
        ("right lidars with a report", "taken"),
    ):
        yield _row(text, [measured["lidars"][title][group] for title in scores])
    yield from ("", "Faults that users reported:", "")
    for name in (name for name in faults if name in ISSUES):
        others = ", ".join(title for title in faults[name] if title != LINT)
        yield f"- {_fault(name)}" + (f", also {others}" if others else "") + _missed(faults[name])
    yield from ("", "Others that `lab3 lint` misses in some or all robots:", "")
    for name, cells in faults.items():
        if name not in ISSUES and (missed := _missed(cells)):
            yield f"- {name}{missed}"
    yield from ("", f"[All faults](../tests/{MEASURED.name}), and who finds them.")


def _missed(cells: Mapping[str, str]) -> str:
    """Return in how many robots the linter finds a fault, '' for all."""
    seen, _, robots = cells.get(LINT, "").partition(" of ")
    return "" if seen and seen == robots else f": found in {cells.get(LINT, 'none')}"


def _fault(name: str) -> str:
    link = issue_link(name)
    return f"{name} ({link})" if link else name


def issue_link(fault: str) -> str:
    """Return a link to the issue that reports a fault, '' for none."""
    repository, _, number = ISSUES.get(fault, "").partition("#")
    name = repository.rpartition("/")[2]
    return f"[{name} #{number}](https://github.com/{repository}/issues/{number})" if number else ""


def _row(first: str, cells: Iterable[str]) -> str:
    return f"| {' | '.join((first, *cells))} |"


def page() -> str:
    """Return the whole page: what is written by hand, and the measurement."""
    by_hand = PAGE.read_text(encoding="utf-8").partition(MARK)[0]
    measured = json.loads(MEASURED.read_text(encoding="utf-8"))
    return by_hand + MARK + "\n" + "\n".join(summary(measured)) + "\n"


def installed(package: str) -> str | None:
    """Return the version of a package; None where it is not installed."""
    if package == ISAAC:
        config = Path(*sys.argv[1:2]) / "config" / "extension.toml"
        is_given = __name__ == "__main__" and config.is_file()
        lines = config.read_text(encoding="utf-8").splitlines() if is_given else []
        return next((line.split('"')[1] for line in lines if line.startswith("version")), None)
    try:
        return version(package)
    except PackageNotFoundError:
        return None


if __name__ == "__main__":
    logging.disable(logging.CRITICAL)  # some validators log each file that lacks something
    known = json.loads(MEASURED.read_text(encoding="utf-8"))
    MEASURED.write_text(json.dumps(measure(known), indent=1) + "\n", encoding="utf-8", newline="\n")
    PAGE.write_text(page(), encoding="utf-8", newline="\n")
