"""Writes every robot and every seeded fault of the tests as stages, with one file of labels.

Usage: python benchmarks/corpus.py -o DIR

`DIR/labels.json` lists the stages: what is wrong in each, at which prims, since which release, and
who says so. The same checkout writes the same bytes. docs/lint-corpus.md says how to score a
validator on them.
"""

from __future__ import annotations

import argparse
import json
import re
import sys
from collections.abc import Iterator, Sequence
from functools import cache, partial
from pathlib import Path
from typing import Any, NamedTuple

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests/support"))

import quick_yaml
from linting import broken_robot
from pxr import Sdf, Usd
from robot_kinds import KINDS

from lab3_usd.check.registry import all_rules
from lab3_usd.files import write_whole
from lab3_usd.spec.load.loader import load_platform

TESTS = Path(__file__).resolve().parents[1] / "tests"
LABELS = "labels.json"
SEEDS = (
    "seeded by the authors of lab3, who also wrote its linter: mistakes that nobody thought of are "
    "missing"
)
PUBLISHED = "published source of Isaac Sim 6.0.1"
RIGHT, UNUSUAL, FAULTY = "right", "unusual", "faulty"


class Entry(NamedTuple):
    """A stage: a robot and the steps that change it; with a fault the prims, one of which has it.

    `group` is the folder; `rule` is that of the linter whose case it is, '' for none.
    """

    group: str
    name: str
    robot: str
    steps: list[dict[str, Any]]
    prims: tuple[str, ...] = ()
    source: str = ""
    since: str = ""
    rule: str = ""

    @property
    def is_of_users(self) -> bool:
        """Whether it has a fault that users make, and is no case of a rule."""
        return self.group == FAULTY and not self.rule

    @property
    def file(self) -> str:
        """The file of the stage below the folder of the corpus."""
        name = self.name if self.group == RIGHT else f"{self.name} ({self.robot})"
        return f"{self.group}/{_slug(' '.join(filter(None, (self.rule, name))))}.usda"


def _slug(text: str) -> str:
    return re.sub(r"[^a-z0-9]+", "-", text.lower()).strip("-")


def _table(path: str) -> dict[str, Any]:
    read: dict[str, Any] = quick_yaml.load((TESTS / path).read_text(encoding="utf-8"))
    return read


def _places(at: str | list[str]) -> tuple[str, ...]:
    return (at,) if isinstance(at, str) else tuple(at)


@cache
def entries() -> tuple[Entry, ...]:
    """Return all stages: robots, unusual ones that work, faults of users, cases of rules."""
    return (*_right(), *_of_users(), *_of_rules())


def _right() -> Iterator[Entry]:
    for name in KINDS:
        yield Entry(RIGHT, name, name, [])
    for name, case in _table("lint_legal.yaml").items():
        known = case if isinstance(case, dict) else {"steps": case}
        yield Entry(UNUSUAL, name, known.get("robot", "rover"), known["steps"])


def _of_users() -> Iterator[Entry]:
    issues = _table("lint_fault_issues.yaml")
    for name, robots in _table("lint_faults.yaml").items():
        issue = issues.get(name, "").replace("#", "/issues/")
        source = f"https://github.com/{issue}" if issue else PUBLISHED
        for robot, seed in robots.items():
            places = _places(seed["at"])
            yield Entry(FAULTY, name, robot, seed["break"], places, source)
    for name, seed in _table("robot_faults.yaml").items():
        places, since = _places(seed["at"]), seed.get("since", "")
        yield Entry(FAULTY, name, seed["robot"], seed["break"], places, seed["source"], since)


def _of_rules() -> Iterator[Entry]:
    rules = all_rules()
    for path in sorted((TESTS / "lint_cases").glob("*.yaml")):
        case, rule = _table(f"lint_cases/{path.name}"), rules[path.stem]
        for name, seed in {"": case, **case.get("more", {})}.items():
            prims = tuple(dict.fromkeys(site.split()[1] for site in seed["expect"]))
            robot = seed.get("robot", case.get("robot", "rover"))
            what = name or rule.manual.partition("\n")[0].rstrip(".")
            if prims:  # of a note alone nobody says that it is a fault
                source = rule.section("Basis") or PUBLISHED
                yield Entry(FAULTY, what, robot, seed["break"], prims, source, rule=path.stem)


def made(entry: Entry) -> Usd.Stage:
    """Return a stage, with a default prim, which some validators ask for."""
    stage = broken_robot(entry.robot, entry.steps)
    if not stage.HasDefaultPrim():
        stage.SetDefaultPrim(next(iter(stage.GetPseudoRoot().GetChildren())))
    return stage


def first_release(stage: Usd.Stage) -> str:
    """Return the first known release that has all node types of a stage which 6.0 has."""
    platform = load_platform()
    used = {str(prim.GetAttribute("node:type").Get() or "") for prim in stage.TraverseAll()}
    known = [platform.releases_of(name) for name in used if name in platform.types]
    releases = platform.known_releases
    return next(
        (each for each in releases if all(each in several for several in known if several)),
        platform.release,
    )


def write(entry: Entry, folder: Path) -> dict[str, Any]:
    """Write a stage, and the layers that it refers to beside it; return its label."""
    stage = made(entry)
    path = folder / entry.file
    path.parent.mkdir(parents=True, exist_ok=True)
    layer = Sdf.Layer.CreateAnonymous(".usda")
    layer.TransferContent(stage.GetRootLayer())
    own = {stage.GetRootLayer().identifier, stage.GetSessionLayer().identifier}
    assets = [used for used in stage.GetUsedLayers() if used.identifier not in own]
    for number, asset in enumerate(assets):
        name = f"{path.stem}.asset{number or ''}.usda"
        _write(path.with_name(name), asset.ExportToString())
        layer.UpdateCompositionAssetDependency(asset.identifier, f"./{name}")
    _write(path, layer.ExportToString())
    label: dict[str, Any] = {"file": entry.file, "right": entry.group != FAULTY, "what": entry.name}
    if entry.group != RIGHT:
        label["of"] = Entry(RIGHT, entry.robot, entry.robot, []).file
    since = max(entry.since, first_release(stage))
    if entry.group == FAULTY:
        label |= {"prims": list(entry.prims), "since": since, "source": entry.source}
        label |= {"rule": entry.rule} if entry.rule else {}
    else:
        label["since"] = since
    return label


def _write(path: Path, text: str) -> None:
    write_whole(path, text.encode(), force=True)


def write_corpus(folder: Path, stages: Sequence[Entry]) -> list[dict[str, Any]]:
    """Write stages and their labels; return the labels."""
    labels = list(map(partial(write, folder=folder), stages))
    document = {"release": load_platform().release, "seeds": SEEDS, "stages": labels}
    _write(folder / LABELS, json.dumps(document, indent=1) + "\n")
    return labels


def main() -> None:
    """Write the corpus into a folder."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("-o", "--out", type=Path, required=True, help="the folder of the corpus")
    folder = parser.parse_args().out
    labels = write_corpus(folder, entries())
    right = sum(label["right"] for label in labels)
    print(f"{folder / LABELS}: {right} right stages, {len(labels) - right} with a fault")


if __name__ == "__main__":
    main()
