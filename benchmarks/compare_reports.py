"""Compares what two checkouts say of the same stages, in JSON, and counts the differences by kind.

The stages: those of tests/support/agreement.py (built, each single fault, cases of rules,
other people's robots, `../shared/corpus` where it is). Each of the lab is checked, those of one
checkpoint beside the starter as well, and all are linted. A difference is of a finding that is new,
gone or changed (with the keys that are), or of another key of a report; each kind has an example.

Usage: python benchmarks/compare_reports.py OTHER_CHECKOUT [--every N] [--verbose]
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections import defaultdict
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests/support"))

from agreement import CHECKPOINT, Subject, all_subjects
from places import REPOSITORY

from lab3_usd.spec.load.loader import load_lab
from lab3_usd.stage.write.builder import build_checkpoint

AT_ONCE = 150  # stages of one command
Report = Mapping[str, Any]


def written(subject: Subject, number: int, folder: Path) -> Path:
    """Return the file of a stage."""
    if isinstance(subject.make, Path):
        return subject.make
    path = folder / f"stage{number:04}.usda"
    subject.make().GetRootLayer().Export(str(path))
    return path


def reports(checkout: Path, arguments: list[str], files: list[str]) -> dict[str, Report]:
    """Return what a command says of each file, run with the source of a checkout."""
    said: dict[str, Report] = {}
    for start in range(0, len(files), AT_ONCE):
        run = subprocess.run(
            [sys.executable, "-m", "lab3_usd", *arguments, "--isolated", "--format", "json",
             *files[start : start + AT_ONCE]],
            env={**os.environ, "PYTHONPATH": str(checkout / "src"), "PYTHONHASHSEED": "0"},
            cwd=checkout,
            capture_output=True,
            check=False,
        )  # fmt: skip
        if run.returncode not in {0, 1}:
            raise SystemExit(f"{checkout}: {arguments}: {run.stderr.decode()[-2000:]}")
        said |= {report["path"]: report for report in json.loads(run.stdout)["results"]}
    return said


def differences(old: Report, new: Report) -> Iterator[tuple[str, str]]:
    """Yield the differences of two reports of a stage: the kind of each, and what it is."""
    for key in sorted((old.keys() | new.keys()) - {"findings"}):
        if old.get(key) != new.get(key):
            yield key, f"{old.get(key)}, now {new.get(key)}"
    before, after = by_site(old), by_site(new)
    for site in sorted(before.keys() | after.keys()):
        was, now = before[site], after[site]
        for one, other in zip(was, now, strict=False):
            keys = [key for key in sorted(other) if one.get(key) != other[key]]
            if keys:
                changes = "; ".join(f"{key} {one.get(key)!r}, now {other[key]!r}" for key in keys)
                yield f"changed {other['rule']}: {', '.join(keys)}", f"{other['prim']}: {changes}"
        for name, left in (("gone", was[len(now) :]), ("new", now[len(was) :])):
            for one in left:
                yield f"{name} {one['rule']} {one['severity']}", f"{one['prim']}: {one['message']}"


def by_site(report: Report) -> defaultdict[str, list[dict[str, Any]]]:
    """Return the findings of a report by rule, prim and property."""
    sites: defaultdict[str, list[dict[str, Any]]] = defaultdict(list)
    for finding in report["findings"]:
        sites[f"{finding['rule']} {finding['prim']} {finding['property']}"].append(finding)
    return sites


def main() -> None:
    """Compare, and exit with 1 where anything differs."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("other", type=Path, help="the other checkout")
    parser.add_argument("--every", type=int, default=1, help="take each N-th stage only")
    parser.add_argument("--verbose", action="store_true", help="print every difference")
    options = parser.parse_args()
    found: defaultdict[str, list[str]] = defaultdict(list)
    count = 0
    with tempfile.TemporaryDirectory() as name:
        subjects = all_subjects()[:: options.every]
        files = {str(written(each, n, Path(name))): each for n, each in enumerate(subjects)}
        starter = build_checkpoint(None, load_lab().first, Path(name) / "starter.usda")
        runs = [(["lint"], list(files))]
        for point in load_lab().checkpoints:
            at = [path for path, subject in files.items() if subject.checkpoint == point]
            runs.append((["check", "--checkpoint", point], at))
            if point == CHECKPOINT:
                runs.append((["check", "--checkpoint", point, "--starter", str(starter)], at))
        for arguments, paths in runs:
            old, new = (reports(place, arguments, paths) for place in (options.other, REPOSITORY))
            count += len(new)
            for path, report in new.items():
                for kind, text in differences(old[path], report):
                    found[kind].append(f"{arguments[0]} of {files[path].name}: {text}")
    for kind, texts in sorted(found.items(), key=lambda entry: (-len(entry[1]), entry[0])):
        for text in texts if options.verbose else texts[:1]:
            print(f"{len(texts):>6} {kind} [{text[:300]}]")
    print(f"{len(subjects)} stages, {count} reports, {sum(map(len, found.values()))} differences")
    raise SystemExit(1 if found else 0)


if __name__ == "__main__":
    main()
