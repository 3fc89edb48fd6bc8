"""Writes the table of who sees what into `lint-corpus.md`: the seeded faults past each validator.

Run `python docs/make_validators.py` after faults, rules or validators have changed. Python 3.12 has
them all: `pip install -e .[nvidia] ros-openusd-compliance-checker simready-foundation-tier-core`.
"""

from __future__ import annotations

import logging
import sys
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests/support"))

import yaml
from foreign_robots import ROBOTS
from linting import broken_robot
from pxr import Usd

from lab3_usd.judge.lint import lint_stage
from lab3_usd.stage.read.native import native_errors

TESTS = Path(__file__).resolve().parents[1] / "tests"
PAGE = Path(__file__).with_name("lint-corpus.md")
FAULTS: Mapping[str, Mapping[str, Mapping[str, Any]]] = yaml.safe_load(
    (TESTS / "lint_faults.yaml").read_text(encoding="utf-8")
)
ISSUES: Mapping[str, str] = yaml.safe_load(
    (TESTS / "lint_fault_issues.yaml").read_text(encoding="utf-8")
)
# What the others do judge: without it nobody would know whether they were running.
CONTROL = "*control: a joint joins a prim that is not there*"
JOINTS = {
    "rover": "/World/Rover/left_wheel_joint",
    "truck": "/Fleet/Truck/joints/rear",
    "arm": "/arm/shoulder_joint",
}
MARK = "<!-- Below: written by docs/make_validators.py. -->\n"
NVIDIA = "usd_validation_nvidia"
Said = Counter[tuple[str, str]]  # the rules that speak, and the prims that they speak of


class Validator(NamedTuple):
    """A column: its title, the package that it is measured with, and what it says of a file."""

    title: str
    package: str
    said: Callable[[Path], Said]


def by_lint(path: Path) -> Said:
    """Return the errors and warnings of the linter; its notes do not count."""
    findings = lint_stage(path).findings
    return Counter(
        (finding.rule, finding.prim) for finding in findings if finding.severity != "note"
    )


def by_openusd(path: Path) -> Said:
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


def by_nvidia(path: Path) -> Said:
    """Return what NVIDIA's own rules say, of any severity."""
    return _by_engine(NVIDIA, path)


def by_simready(path: Path) -> Said:
    """Return what the rules of SimReady say, of any severity."""
    return _by_engine("simready", path)


def _by_engine(package: str, path: Path) -> Said:
    issues = _engine(package).validate(str(path)).issues()
    return Counter((issue.rule.__name__, str(getattr(issue.at, "path", "/"))) for issue in issues)


def by_rep(path: Path) -> Said:
    """Return what the checker of REP-0158 says, of any severity."""
    from compliance_checker import ComplianceChecker

    checker = ComplianceChecker.from_path(str(path), include_export=True, include_extended=True)
    return Counter(
        (violation.check_id, violation.prim_path) for violation in checker.run().violations
    )


VALIDATORS = (
    Validator("`lab3 lint`", "lab3-usd", by_lint),
    Validator("OpenUSD", "usd-core", by_openusd),
    Validator("NVIDIA", "usd-validation-nvidia", by_nvidia),
    Validator("REP-0158", "ros-openusd-compliance-checker", by_rep),
    Validator("SimReady", "simready-foundation-tier-core", by_simready),
)


def column(validator: Validator, faults: Iterable[str] = FAULTS) -> dict[str, str]:
    """Return for each fault in how many robots the validator sees it, as `2 of 3`.

    A fault is seen where anything is said that is not said of the sound robot; by the linter, where
    it is said at the place of the fault.
    """
    sound = {each: said_of(validator, each, []) for each in ROBOTS}
    cells = {}
    for name in faults:
        seen = 0
        for robot, seed in FAULTS[name].items():
            new = said_of(validator, robot, seed["break"]) - sound[robot]
            at = [seed["at"]] if isinstance(seed["at"], str) else seed["at"]
            seen += any(validator.said is not by_lint or prim in at for _, prim in new)
        cells[name] = f"{seen} of {len(FAULTS[name])}" if seen else "-"
    return cells


def said_of(validator: Validator, robot: str, steps: list[dict[str, Any]]) -> Said:
    """Return what a validator says of a robot after these steps, saved as a file of its own."""
    stage = broken_robot(robot, steps)
    stage.SetDefaultPrim(next(iter(stage.GetPseudoRoot().GetChildren())))
    with TemporaryDirectory() as folder:
        path = Path(folder) / f"{robot}.usda"
        stage.GetRootLayer().Export(str(path))
        return validator.said(path)


def control(validator: Validator) -> str:
    """Return in how many robots a validator sees what is not about ROS."""
    seen = [
        said_of(validator, robot, [{"targets": [f"{joint}.physics:body1", "/gone"]}])
        - said_of(validator, robot, [])
        for robot, joint in JOINTS.items()
    ]
    return f"{sum(map(bool, seen))} of {len(seen)}" if any(seen) else "-"


def table() -> Iterator[str]:
    """Yield the lines of the table."""
    columns = [column(validator) for validator in VALIDATORS]
    yield _row("fault", [*(validator.title for validator in VALIDATORS), "users"])
    yield _row("---", ["---"] * (len(columns) + 1))
    for name in FAULTS:
        yield _row(name, [*(cells[name] for cells in columns), issue_link(name)])
    seen = [sum(cell != "-" for cell in cells.values()) for cells in columns]
    had = f"{sum(name in ISSUES for name in FAULTS)} issues"
    yield _row(f"**faults seen, of {len(FAULTS)}**", [*(f"**{each}**" for each in seen), had])
    yield _row(CONTROL, [*(control(validator) for validator in VALIDATORS), ""])
    yield _row("version", [*(version(validator.package) for validator in VALIDATORS), ""])


def issue_link(fault: str) -> str:
    """Return a link to the issue that tells of a fault, '' for none."""
    repository, _, number = ISSUES.get(fault, "").partition("#")
    name = repository.rpartition("/")[2]
    return f"[{name} #{number}](https://github.com/{repository}/issues/{number})" if number else ""


def _row(first: str, cells: Iterable[str]) -> str:
    return f"| {' | '.join((first, *cells))} |"


def page() -> str:
    """Return the whole page: what is written by hand, and the table."""
    by_hand = PAGE.read_text(encoding="utf-8").partition(MARK)[0]
    return by_hand + MARK + "\n" + "\n".join(table()) + "\n"


def missing() -> Iterator[str]:
    """Yield the packages that are not installed."""
    for validator in VALIDATORS:
        if installed(validator.package) is None:
            yield validator.package


def installed(package: str) -> str | None:
    """Return the version of a package; None where it is not installed."""
    try:
        return version(package)
    except PackageNotFoundError:
        return None


if __name__ == "__main__":
    logging.disable(logging.CRITICAL)  # some validators log each file that lacks something
    if names := ", ".join(missing()):
        sys.exit(f"not installed: {names}")
    PAGE.write_text(page(), encoding="utf-8", newline="\n")
