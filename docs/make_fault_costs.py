"""Measures what ten faults of the robot cost, and writes the table into `graders.md`.

Run `python docs/make_fault_costs.py` after rules, the rubric or the counting have changed.
"""

from __future__ import annotations

import sys
from collections import defaultdict
from collections.abc import Iterator, Mapping
from pathlib import Path
from tempfile import TemporaryDirectory

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests/support"))

from failing_students import Mistake, hand_in, opened_starter, rubric
from grade_files import LAB, built
from pxr import Gf
from scene_stages import ROBOT, Change, put, remove, turn
from submissions import checked

from lab3_usd.grade.dry_runs import with_dry_runs
from lab3_usd.grade.scoring import Grade, facts_of, grade_facts

PAGE = Path(__file__).with_name("graders.md")
BEGIN, END = "<!-- Below: written by docs/make_fault_costs.py. -->\n", "<!-- Above. -->\n"
WHEEL, SCAN = f"{ROBOT}/joints/wheel_left_joint", f"{ROBOT}/base_scan"
HOLDS = f"{ROBOT}/joints/scan_joint"
FAULTS: Mapping[str, tuple[Change, str]] = {
    "the lidar's link held 20 degrees tilted": (
        put(HOLDS, "physics:localRot0", Gf.Quatf(turn(20, (0, 1, 0)))),
        "scan and TF rest on the link",
    ),
    "the lidar's link 0.1 m higher": (
        put(SCAN, "xformOp:translate", Gf.Vec3d(-0.032, 0, 0.282)),
        "its joint puts it back at Play",
    ),
    "the lidar's link not fixed": (remove(HOLDS), "scan and TF rest on the link"),
    "no lidar's link": (
        remove(SCAN),
        "its joint now connects the robot to the world; lidar and frame are gone",
    ),
    "another mass of base_link": (
        put(f"{ROBOT}/base_link", "physics:mass", 2.0),
        "the drive rests on the mass",
    ),
    "another mass of the caster": (
        put(f"{ROBOT}/caster_back_link", "physics:mass", 1.0),
        "no graph rests on it",
    ),
    "no damping of a wheel": (
        put(WHEEL, "drive:angular:physics:damping", 0.0),
        "the robot does not follow /cmd_vel",
    ),
    "a wheel joint about X": (
        put(WHEEL, "physics:axis", "X"),
        "the robot does not follow /cmd_vel",
    ),
    "no caster": (
        remove(f"{ROBOT}/caster_back_link"),
        "its joint now connects the robot to the world; its frame is gone",
    ),
    "the robot 1 m aside": (
        put(ROBOT, "xformOp:translate", Gf.Vec3d(1.8, 1, 0)),
        "all graphs work there",
    ),
}


def graded(change: Change) -> Grade:
    """Grade a submission whose stages all have a fault, beside the right starter."""
    with TemporaryDirectory() as folder:
        hand_in(Mistake("fault", (change,)), built(), Path(folder) / "fault")
        result = checked(Path(folder) / "fault", starter=opened_starter())
        found = [each for each in result.submission.findings if each.rule[0] != "M"]
        facts = facts_of(result.results, rubric().required, found)
        return grade_facts(rubric(), with_dry_runs(facts, LAB, {}))


def rows() -> Iterator[str]:
    """Yield the table: each fault, its cost, and where it is paid."""
    yield "| fault of the robot, in every stage | costs | by item | why |"
    yield "|---|---|---|---|"
    for name, (change, why) in FAULTS.items():
        grade = graded(change)
        by_item: dict[str, float] = defaultdict(float)
        for line in grade.lost:
            by_item[line.item] += line.points
        parts = [f"{item} {points:.2f}" for item, points in by_item.items() if points]
        yield f"| {name} | {100 - grade.earned:.2f} | {', '.join(parts)} | {why} |"


def main() -> None:
    """Write the table."""
    text = PAGE.read_text(encoding="utf-8")
    start, end = text.index(BEGIN) + len(BEGIN), text.index(END)
    table = "\n".join(rows())
    PAGE.write_text(f"{text[:start]}\n{table}\n\n{text[end:]}", encoding="utf-8")


if __name__ == "__main__":
    main()
