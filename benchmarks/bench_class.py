"""Measures what a student of a class costs, right or with faults, and a class of a thousand.

Usage: python benchmarks/bench_class.py [OTHER_CHECKOUT] [--right N] [--faulty N] [--runs N]
       python benchmarks/bench_class.py --mixed 1000 [--jobs N]

Two classes are graded: the right students of `bench_grade.py`, and such with one mistake each, as
in `failing_class.py`. No two of them have arranged their nodes alike. Checkouts take turns on the
same files; what counts is the processor time of all processes, in the median, without what the
start of a run takes. The gradebooks of two checkouts are compared to the byte.

A mixed class has 40 right students of 100, 50 with a mistake, 6 copies of others, two without a
stage and two damaged archives. Its page is opened, sorted and searched in a browser.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from statistics import median

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests/support"))

from bench_grade import (
    LAB,
    MEGABYTE,
    SMALL,
    children,
    make_class,
    of_student,
    resident,
    watched,
)
from browser import DESKTOP, PHONE, Browser, started
from failing_students import failing_at, hand_in
from grade_files import stage, starter

from lab3_usd.grade.class_run import ClassSettings, grade_class

REPOSITORY = Path(__file__).resolve().parents[1]
MOST_NAMED = 10  # files that differ
WHOLE = tuple(LAB.checkpoints)
# What somebody does on the page, as scripts; each is timed until the page is laid out again.
SEARCH = """
const field = document.forms[0].elements.text;
field.value = "wheel";
field.dispatchEvent(new Event("input", { bubbles: true }));
"""
ACTIONS = {
    "sort by points": "document.querySelectorAll('thead button')[3].click();",
    "search": SEARCH,
    "end the search": SEARCH.replace('"wheel"', '""'),
    "show all": "document.querySelector('.filter button').click();",
    "sort all": "document.querySelectorAll('thead button')[0].click();",
}
LOADED = "return performance.getEntriesByType('navigation')[0].duration"
TIMED = "const start = performance.now(); {} document.body.offsetHeight; "
TIMED += "return performance.now() - start;"


def main() -> int:
    """Grade the classes, and print what they cost."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("other", type=Path, nargs="?", help="the other checkout")
    parser.add_argument("--right", type=int, default=40, help="right students")
    parser.add_argument("--faulty", type=int, default=40, help="students with faults")
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--mixed", type=int, default=0, help="grade a mixed class instead")
    parser.add_argument("--jobs", type=int, default=2, help="processes for the mixed class")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        if options.mixed:
            make_mixed_class(Path(name, "class"), options.mixed)
            print_mixed(Path(name), options.jobs)
            return 0
        return compare(Path(name), options)


def compare(folder: Path, options: argparse.Namespace) -> int:
    """Grade both classes with both checkouts in turn; 1 where their gradebooks differ."""
    checkouts = [REPOSITORY, *([options.other.resolve()] if options.other else [])]
    make_class(folder / "few", SMALL, WHOLE)
    make_class(folder / "right", SMALL + options.right, WHOLE)
    make_faulty_class(folder / "faulty", options.faulty)
    took: dict[tuple[Path, str], list[float]] = {}
    for _ in range(options.runs):
        for kind in ("few", "right", "faulty"):
            for checkout in checkouts:
                took.setdefault((checkout, kind), []).append(graded(checkout, folder, kind))
    for checkout in checkouts:
        few, right, faulty = (median(took[checkout, kind]) for kind in ("few", "right", "faulty"))
        each = (right - few) / options.right
        failing = (faulty - few + each * SMALL) / options.faulty
        print(
            f"{checkout}: {1000 * each:.0f} ms a right student, {1000 * failing:.0f} ms one with"
            " faults"
        )
    if options.other is None:
        return 0
    different = [
        f"{kind}/{line}"
        for kind in ("right", "faulty")
        for line in differing(*(folder / f"{kind}-{c.name}" for c in checkouts))
    ]
    print(f"{len(different)} files differ", *different[:MOST_NAMED], sep="\n  ")
    return 1 if different else 0


def make_faulty_class(folder: Path, count: int) -> None:
    """Write students with a mistake each, chosen evenly, who arranged their nodes differently."""
    right = folder.with_name("right-submission")
    make_class(right, 1, WHOLE)
    (own,) = right.iterdir()
    mistakes = list(failing_at("05", stage("05")))
    for number in range(count):
        place = folder / f"faulty{number:04}"
        hand_in(mistakes[number * len(mistakes) // count], own, place)
        for path in place.glob("work/*.usda"):
            path.write_text(of_student(path.read_text(), number))
    shutil.rmtree(right)


def make_mixed_class(folder: Path, count: int) -> None:
    """Write a class as they are: right, wrong, copied, empty and damaged."""
    make_class(folder, 40 * count // 100, WHOLE)
    make_faulty_class(folder.with_name("faulty"), count // 2)
    for path in folder.with_name("faulty").iterdir():
        shutil.move(path, folder / path.name)
    people = sorted(folder.iterdir())
    chosen = people[:: max(1, len(people) * 50 // (3 * count))][: 6 * count // 100]
    for path in chosen:
        shutil.copytree(path, folder / f"copy-{path.name}")
    for number in range(count // 50):
        (folder / f"empty{number:04}").mkdir()
        (folder / f"damaged{number:04}.zip").write_bytes(b"PK\x03\x04" + bytes(200))


def graded(checkout: Path, folder: Path, kind: str) -> float:
    """Grade a class with a checkout, and return the seconds of processors that it took."""
    out = folder / f"{kind}-{checkout.name}"
    shutil.rmtree(out, ignore_errors=True)
    command = [sys.executable, "-m", "lab3_usd", "grade", str(folder / kind)]
    command += ["--starter", str(starter()), "--output", str(out)]
    environment = {**os.environ, "PYTHONPATH": str(checkout / "src"), "PYTHONHASHSEED": "0"}
    before = os.times()
    subprocess.run(command, env=environment, cwd=checkout, check=True, capture_output=True)
    after = os.times()
    return sum(after[2:4]) - sum(before[2:4])


def differing(ours: Path, theirs: Path) -> Iterator[str]:
    """Yield the files of two gradebooks that are not the same."""
    names = {path.relative_to(book) for book in (ours, theirs) for path in book.rglob("*.*")}
    for name in sorted(names):
        both = [book / name for book in (ours, theirs)]
        if not all(path.is_file() for path in both) or len({p.read_bytes() for p in both}) > 1:
            yield name.as_posix()


def print_mixed(folder: Path, jobs: int) -> None:
    """Grade the class in a folder, and print what it took, and what its page does."""
    book = folder / "book"
    with watched() as most:
        begun, before = time.perf_counter(), sum(os.times()[:4])
        rows = grade_class(ClassSettings(folder / "class", starter(), book, jobs=jobs))
        seconds, busy = time.perf_counter() - begun, sum(os.times()[:4]) - before
    sizes = [path.stat().st_size for path in book.rglob("*") if path.is_file()]
    print(f"{len(rows)} students: {seconds:.0f} s by the clock, {busy:.0f} s of processors")
    print(
        f"memory: {most['parent'] / MEGABYTE:.0f} MB, {most['workers'] / MEGABYTE:.0f} MB a worker"
    )
    page = book / "index.html"
    print(
        f"gradebook: {sum(sizes) / MEGABYTE:.0f} MB in {len(sizes)} files, its page"
        f" {page.stat().st_size / MEGABYTE:.1f} MB"
    )
    if shutil.which("chromium") is None:
        print("no browser: chromium is not installed")
        return
    with started() as browser:
        for name, size in (("desktop", DESKTOP), ("phone", PHONE)):
            print(f"{name}: {', '.join(page_figures(browser, page, size))}")


def page_figures(browser: Browser, page: Path, size: tuple[int, int]) -> Iterator[str]:
    """Yield how long the page of a class takes for what, its width, and the browser's memory."""
    browser.open(page, size)
    yield f"load {browser.run(LOADED):.0f} ms"
    for action, script in ACTIONS.items():
        yield f"{action} {browser.run(TIMED.format(script)):.0f} ms"
    width = browser.run("return document.documentElement.scrollWidth")
    yield f"{width} of {size[0]} pixels wide"
    processes = [*below(os.getpid())]
    yield f"{max(map(resident, processes)) / MEGABYTE:.0f} MB"


def below(process: int) -> Iterator[int]:
    """Yield all processes that a process has started, directly or not."""
    for child in children(process):
        yield child
        yield from below(child)


if __name__ == "__main__":
    sys.exit(main())
