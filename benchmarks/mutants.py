"""Changes one place of the program at a time, and prints which changes the tests notice.

Usage: python benchmarks/mutants.py [--seed N] [--count N] [--only ROOM] [--jobs N] [--map FOLDER]
       python benchmarks/mutants.py --near [--seed N] [--count N] [--only ROOM] [--jobs N]

Places are drawn by the seed, in each room as many as its share of the code. A mutant is killed when
a test fails that passes on the program as it is, or when the tests no longer end. Only test files
that execute the changed statement run, those that name its module and those of its room first;
which they are is measured once (`--map` keeps it) and again for a test file that changes. In a
module that changed since, lines are found again by their text. Not part of the suite: it takes an
hour. With `--near` nothing is measured: the test files that name the module run, then those of its
room; a survivor may be killed by a test of another room.

What no test can see is no mutant: `strict=` of `zip`, which asserts what the code guarantees;
`encoding=` left away, which is the same on this machine; `return False` made None, where True is a
mutant as well. A whole number from eight on is doubled or halved: it is a limit or a size, and one
more means nothing; a smaller one, and every fraction, grows by one.
"""

from __future__ import annotations

import argparse
import ast
import hashlib
import json
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from difflib import SequenceMatcher
from functools import cache
from pathlib import Path
from queue import SimpleQueue

from coverage import CoverageData
from coverage.exceptions import DataError

REPOSITORY = Path(__file__).resolve().parents[1]
PACKAGE = Path("src/lab3_usd")
NOT_COPIED = (".git", ".venv*", "out", "__pycache__", ".*_cache", ".hypothesis", ".import_linter*")
# They hold the texts of the code and the package, not what the program does.
HOUSE = ("action", "house", "installation", "validators_table", "wheel")
NOT_RUN = (
    *(f"tests/house/test_{name}.py" for name in HOUSE),
    "tests/grade/test_grade_bench.py",
    "_browser.py",
)
# Where the tests of a room lie that are not in the folder of its name.
TESTS = {"lint": "check", "diff": "stage", "new_lab": "spec", "judge": "check", "model": "check"}
ROOMS = {
    "check/rules/lint_": "lint",
    "stage/compare/": "diff",
    "diff.py": "diff",
    "model/changes.py": "diff",
    "features/diff/": "diff",
}
MEASURE = """[run]
core = sysmon
parallel = true
patch = subprocess, _exit
sigterm = true
source_pkgs = lab3_usd
data_file = {folder}/data
disable_warnings = no-data-collected,module-not-imported,module-not-measured,no-sysmon
"""
TURNED = {
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.Is: ast.IsNot,
    ast.IsNot: ast.Is,
    ast.In: ast.NotIn,
    ast.NotIn: ast.In,
    ast.Lt: ast.GtE,
    ast.LtE: ast.Gt,
    ast.Gt: ast.LtE,
    ast.GtE: ast.Lt,
}
BOUNDARY = {ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt}
ASSERTED, OF_THE_MACHINE = "strict", "encoding"  # keywords
LEAST_LIMIT = 8
NOTHING = {"None", "False"}  # to whoever asks only whether it is so
DELETED = (ast.Expr, ast.AugAssign, ast.Continue, ast.Break, ast.Raise, ast.Delete)
TYPES_AND_DECORATORS = {
    "annotation",
    "returns",
    "decorator_list",
    "bases",
    "pattern",
    "type_params",
}
SECONDS_NEAR = 10  # that a test file is taken to last which was not measured
MEASURE_LIMIT, SLACK, PER_SECOND = 900, 60, 5
FAILED = re.compile(r"^(?:FAILED|ERROR) (tests/\S+?\.py(?:::.*?)?)(?: - .*)?$", re.MULTILINE)


@dataclass(frozen=True, slots=True)
class Mutant:
    """One change: what stands in the text from `start` to `end` becomes `after`.

    `first` to `last` are the lines of the statement; `name` says what kind of change it is.
    """

    path: Path
    start: tuple[int, int]
    end: tuple[int, int]
    first: int
    last: int
    in_function: bool
    name: str
    after: str

    @property
    def room(self) -> str:
        """Which room of the program it changes."""
        inside = self.path.relative_to(PACKAGE).as_posix()
        of_prefix = (room for prefix, room in ROOMS.items() if inside.startswith(prefix))
        folder = inside.split("/")[0] if "/" in inside else "commands"
        return next(of_prefix, folder)

    def text(self, source: bytes) -> bytes:
        """Return a source with the change made."""
        lines = source.splitlines(keepends=True)
        (row, column), (last_row, last_column) = self.start, self.end
        before = b"".join(lines[: row - 1]) + lines[row - 1][:column]
        rest = lines[last_row - 1][last_column:] + b"".join(lines[last_row:])
        return before + self.after.encode() + rest

    def row(self, source: bytes) -> str:
        """Return where it is and what changes."""
        lines = source.splitlines()[self.start[0] - 1 : self.end[0]]
        lines[-1] = lines[-1][: self.end[1]]
        lines[0] = lines[0][self.start[1] :]
        before = " ".join(b" ".join(lines).decode().split())
        after = " ".join(self.after.split())
        place = f"{self.path.relative_to(PACKAGE)}:{self.start[0]}"
        return f"{place}  {self.name}: {before[:90]}  ->  {after[:90]}"


def mutants(path: Path, source: bytes) -> Iterator[Mutant]:
    """Yield every change that can be made in one module."""
    for node, statement, in_function in _nodes(ast.parse(source), None, in_function=False):
        body = getattr(statement, "body", None)
        last = body[0].lineno - 1 if body else statement.end_lineno
        for name, after in _changes(node):
            start, end = (node.lineno, node.col_offset), (node.end_lineno, node.end_col_offset)
            span = (statement.lineno, max(last, statement.lineno))
            yield Mutant(path, start, end, *span, in_function, name, after)


def _nodes(node: ast.AST, statement: ast.stmt | None, *, in_function: bool) -> Iterator[tuple]:
    """Yield the nodes that can be changed, each with its statement."""
    if isinstance(node, ast.Import | ast.ImportFrom | ast.JoinedStr):
        return
    if isinstance(node, ast.If) and ast.unparse(node.test).endswith("TYPE_CHECKING"):
        return
    if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
        return  # a docstring
    if isinstance(node, ast.stmt):
        statement = node
    if statement is not None and hasattr(node, "lineno"):
        yield node, statement, in_function
    is_function = isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda)
    for field, value in ast.iter_fields(node):
        is_frozen = isinstance(node, ast.ClassDef) and field == "keywords"
        is_asserted = isinstance(node, ast.keyword) and node.arg == ASSERTED
        if is_frozen or is_asserted or field in TYPES_AND_DECORATORS:
            continue
        for child in value if isinstance(value, list) else [value]:
            if isinstance(child, ast.AST):
                inside = in_function or (is_function and field == "body")
                yield from _nodes(child, statement, in_function=inside)


def _changes(node: ast.AST) -> Iterator[tuple[str, str]]:  # noqa: C901, PLR0912  # a case a kind
    """Yield the name and the new text of each change of one node."""
    match node:
        case ast.Compare(left, [operator], [right]):
            for name, table in (("turned", TURNED), ("boundary", BOUNDARY)):
                if type(operator) in table:
                    after = ast.Compare(left, [table[type(operator)]()], [right])
                    yield name, f"({ast.unparse(after)})"
        case ast.BoolOp(operator, values):
            after = ast.BoolOp(ast.Or() if isinstance(operator, ast.And) else ast.And(), values)
            yield "and/or", f"({ast.unparse(after)})"
        case ast.UnaryOp(ast.Not(), operand):
            yield "not removed", f"({ast.unparse(operand)})"
        case ast.Constant(bool(value)):
            yield "constant", repr(not value)
        case ast.Constant(int(value)) if value >= LEAST_LIMIT:
            yield "doubled", repr(value * 2)
            yield "halved", repr(value // 2)
        case ast.Constant(int(value) | float(value)):
            yield "constant", repr(value + 1)
        case ast.Constant(str(value)) if " " not in value:  # not prose
            yield "constant", repr(f"{value}x" if value else "x")
        case ast.Return(value) if value is not None and ast.unparse(value) not in NOTHING:
            yield "returns None", "return None"
        case ast.Call(function, arguments, keywords):
            for keyword in keywords:
                kept = [kept for kept in keywords if kept is not keyword]
                if keyword.arg and keyword.arg not in {ASSERTED, OF_THE_MACHINE}:
                    after = ast.unparse(ast.Call(function, arguments, kept))
                    yield f"argument {keyword.arg} dropped", after
        case ast.Assign([ast.Attribute() | ast.Subscript()]):
            yield "deleted", "pass"
        case ast.stmt() if isinstance(node, DELETED):
            yield "deleted", "pass"


def drawn(count: int, seed: int) -> list[Mutant]:
    """Draw the mutants: from each room its share of the lines that can be changed."""
    by_room: dict[str, dict[tuple[Path, int], list[Mutant]]] = {}
    for path in sorted((REPOSITORY / PACKAGE).rglob("*.py")):
        inside = path.relative_to(REPOSITORY)
        for mutant in mutants(inside, path.read_bytes()):
            lines = by_room.setdefault(mutant.room, {})
            lines.setdefault((inside, mutant.start[0]), []).append(mutant)
    whole = sum(map(len, by_room.values()))
    shares = {room: count * len(lines) / whole for room, lines in by_room.items()}
    numbers = {room: int(share) for room, share in shares.items()}
    for room in sorted(shares, key=lambda room: numbers[room] - shares[room])[
        : count - sum(numbers.values())
    ]:
        numbers[room] += 1
    chosen = []
    for room, lines in sorted(by_room.items()):
        chance = random.Random(f"{seed} {room}")  # noqa: S311  # not a secret
        places = chance.sample(sorted(lines), numbers[room])
        chosen += [chance.choice(lines[place]) for place in places]
    return chosen


@dataclass(frozen=True, slots=True)
class Measured:
    """One test file on the program as it is: its time, the lines it executes, what fails."""

    path: str
    seconds: float
    lines: Mapping[str, frozenset[int]]
    failing: tuple[str, ...]


def measured(path: str, tree: Path, folder: Path) -> Measured:
    """Return what a test file executes, measured now unless the folder knows it."""
    content = (tree / path).read_bytes()
    name = f"{Path(path).stem}-{hashlib.sha256(content).hexdigest()[:12]}.json"
    if not (folder / name).is_file():
        with tempfile.TemporaryDirectory() as data:
            settings = Path(data, "settings")
            settings.write_text(MEASURE.format(folder=data), encoding="utf-8")
            command = ["-m", "coverage", "run", f"--rcfile={settings}", "-m", "pytest", path]
            started = time.monotonic()
            _, output = _run(tree, [*command, "-q", "-p", "no:cacheprovider"], MEASURE_LIMIT)
            seconds = time.monotonic() - started
            lines = _lines(Path(data))
        sources = {module: _kept_source(tree / PACKAGE / module, folder) for module in lines}
        failing = FAILED.findall(output)
        fields = {"seconds": seconds, "lines": lines, "sources": sources, "failing": failing}
        (folder / name).write_text(json.dumps(fields), encoding="utf-8")
        print(f"measured {path}: {seconds:.0f} s", file=sys.stderr)
    fields = json.loads((folder / name).read_text(encoding="utf-8"))
    lines = {}
    for module, numbers in fields["lines"].items():
        if (tree / PACKAGE / module).is_file():
            moved = _moved_lines(folder / fields["sources"][module], tree / PACKAGE / module)
            lines[module] = frozenset(moved[number] for number in numbers if number in moved)
    return Measured(path, fields["seconds"], lines, tuple(fields["failing"]))


def _kept_source(path: Path, folder: Path) -> str:
    """Keep a module as it was measured, and return the name of the copy."""
    content = path.read_bytes()
    name = f"{path.stem}-{hashlib.sha256(content).hexdigest()[:12]}.py"
    (folder / name).write_bytes(content)
    return name


@cache
def _moved_lines(before: Path, after: Path) -> dict[int, int]:
    """Return where each line of a module now is, by where it was."""
    texts = [path.read_text(encoding="utf-8").splitlines() for path in (before, after)]
    blocks = SequenceMatcher(None, *texts, autojunk=False).get_matching_blocks()
    return {block.a + line: block.b + line for block in blocks for line in range(1, block.size + 1)}


def _lines(folder: Path) -> dict[str, list[int]]:
    """Return the lines of each module that any of the measured processes executed."""
    lines: dict[str, set[int]] = {}
    for path in folder.glob("data*"):
        data = CoverageData(str(path))
        with suppress(DataError):  # of a process that a test has killed
            data.read()
            for module in data.measured_files():
                _, package, inside = module.rpartition("lab3_usd/")
                if package:
                    lines.setdefault(inside, set()).update(data.lines(module) or ())
    return {module: sorted(numbers) for module, numbers in lines.items()}


def _run(tree: Path, command: Sequence[str], limit: float) -> tuple[int | None, str]:
    """Run Python in a copy of the repository; no code where it does not end in time."""
    environment = {**os.environ, "PYTHONPATH": str(tree / "src"), "PYTHONDONTWRITEBYTECODE": "1"}
    with tempfile.TemporaryFile("w+") as output:
        process = subprocess.Popen(
            [sys.executable, *command],
            cwd=tree,
            env=environment,
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )
        try:
            code = process.wait(limit)
        except subprocess.TimeoutExpired:
            code = None
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()
        output.seek(0)
        return code, output.read()


def tests_of(mutant: Mutant, files: Iterable[Measured]) -> list[Measured]:
    """Return the test files that execute the statement.

    Those that name the module come first, then those of its room, the fastest first. What stands
    outside of functions runs wherever the module is imported: there, the test files that name it
    or call one of its functions.
    """
    module = mutant.path.relative_to(PACKAGE).as_posix()
    dotted = f"{PACKAGE.name}.{module.removesuffix('.py').replace('/', '.')}"
    names_it = {
        file.path for file in files if dotted in (REPOSITORY / file.path).read_text("utf-8")
    }
    lines = set(range(mutant.first, mutant.last + 1))
    if not mutant.in_function:
        source = (REPOSITORY / mutant.path).read_bytes()
        lines = {
            statement.lineno
            for node, statement, in_function in _nodes(ast.parse(source), None, in_function=False)
            if in_function and node is statement
        } or lines
    room = f"tests/{TESTS.get(mutant.room, mutant.room)}/"
    return sorted(
        (
            file
            for file in files
            if lines & file.lines.get(module, frozenset())
            or (not mutant.in_function and file.path in names_it)
        ),
        key=lambda file: (
            file.path not in names_it,
            not file.path.startswith(room),
            file.seconds,
            file.path,
        ),
    )


def near_tests(mutant: Mutant, files: Iterable[Measured]) -> list[Measured]:
    """Return the test files that name the module, then those of its room."""
    dotted = ".".join(mutant.path.with_suffix("").parts[1:])
    names_it = {
        file.path for file in files if dotted in (REPOSITORY / file.path).read_text("utf-8")
    }
    room = f"tests/{TESTS.get(mutant.room, mutant.room)}/"
    near = (file for file in files if file.path in names_it or file.path.startswith(room))
    return sorted(near, key=lambda file: (file.path not in names_it, file.path))


def killer(
    mutant: Mutant, chosen: Sequence[Measured], tree: Path, clean: Path, budget: float
) -> tuple[str | None, str]:
    """Return the test that notices a mutant, if any, and how many files ran."""
    path = tree / mutant.path
    source = path.read_bytes()
    path.write_bytes(mutant.text(source))
    spent, done = 0.0, 0
    try:
        for batch in _batches(chosen):
            seconds = sum(file.seconds for file in batch)
            if done and spent + seconds > budget:
                break
            done, spent = done + len(batch), spent + seconds
            paths = [file.path for file in batch]
            known = [f"--deselect={test}" for file in batch for test in file.failing]
            while True:
                command = ["-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", *known, *paths]
                code, output = _run(tree, command, SLACK + PER_SECOND * seconds)
                if code is None:
                    return f"no end: {paths[0]} ...", f"{done} of {len(chosen)}"
                failed = FAILED.search(output)
                if code in {0, 5}:
                    break
                if failed is None:
                    return f"pytest ended with {code}: {output[-80:]!r}", f"{done} of {len(chosen)}"
                again = ["-m", "pytest", "-q", "-p", "no:cacheprovider", failed[1]]
                if _run(clean, again, SLACK + PER_SECOND * seconds)[0] == 0:
                    return failed[1], f"{done} of {len(chosen)}"
                known.append(f"--deselect={failed[1]}")
    finally:
        path.write_bytes(source)
    return None, f"{done} of {len(chosen)}"


def _batches(files: Sequence[Measured], seconds: float = 40) -> Iterator[list[Measured]]:
    """Yield test files that run in one process: starting one takes seconds."""
    batch: list[Measured] = []
    for file in files:
        if batch and sum(before.seconds for before in batch) + file.seconds > seconds:
            yield batch
            batch = []
        batch.append(file)
    if batch:
        yield batch


def _copied(folder: Path, name: str) -> Path:
    """Return a copy of the repository, with the reference material beside it."""
    tree = folder / name / "main"
    shutil.copytree(REPOSITORY, tree, ignore=shutil.ignore_patterns(*NOT_COPIED), symlinks=True)
    shared = REPOSITORY.parent / "shared"
    if shared.is_dir():
        (folder / name / "shared").symlink_to(shared.resolve())
    return tree


def table(rooms: Sequence[str], killed: Counter[str]) -> str:
    """Return how many mutants of each room were killed."""
    lines = [f"{'room':<10}{'mutants':>8}{'killed':>8}{'%':>6}"]
    for room, count in [*sorted(Counter(rooms).items()), ("all", len(rooms))]:
        dead = killed.total() if room == "all" else killed[room]
        lines.append(f"{room:<10}{count:>8}{dead:>8}{100 * dead / max(count, 1):>6.0f}")
    return "\n".join(lines)


def main() -> int:
    """Print a row for each mutant, and the table of rooms."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--count", type=int, default=120)
    parser.add_argument("--only", metavar="ROOM", help="only the mutants of one room")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--near", action="store_true", help="measure nothing, run what is near")
    parser.add_argument("--map", type=Path, help="where it is kept which test executes what")
    parser.add_argument("--budget", type=float, default=400, help="seconds of tests for a mutant")
    parser.add_argument("--list", action="store_true", help="print the mutants and run nothing")
    parser.add_argument("--measure", action="store_true", help="measure the tests, and no more")
    options = parser.parse_args()
    os.nice(10)
    chosen = [
        mutant
        for mutant in drawn(options.count, options.seed)
        if options.only in {None, mutant.room}
    ]
    if options.list:
        for mutant in chosen:
            print(f"{mutant.room:<10}{mutant.row((REPOSITORY / mutant.path).read_bytes())}")
        return 0
    folder = options.map or Path(tempfile.gettempdir(), "lab3-mutants", _state())
    folder.mkdir(parents=True, exist_ok=True)
    names = sorted(
        path.relative_to(REPOSITORY).as_posix()
        for path in (REPOSITORY / "tests").rglob("test_*.py")
        if "support" not in path.parts and "labs" not in path.parts
    )
    names = [name for name in names if not any(skipped in name for skipped in NOT_RUN)]
    with tempfile.TemporaryDirectory() as copies, ThreadPoolExecutor(options.jobs) as pool:
        clean = _copied(Path(copies), "clean")
        trees: SimpleQueue[Path] = SimpleQueue()
        for number in range(options.jobs):
            trees.put(_copied(Path(copies), str(number)))
        if options.near:
            files = [Measured(name, SECONDS_NEAR, {}, ()) for name in names]
        else:
            files = list(pool.map(lambda name: measured(name, clean, folder), names))
        if options.measure:
            return 0

        def outcome(mutant: Mutant) -> bool:
            tree = trees.get()
            try:
                find = near_tests if options.near else tests_of
                test, ran = killer(mutant, find(mutant, files), tree, clean, options.budget)
            finally:
                trees.put(tree)
            source = (REPOSITORY / mutant.path).read_bytes()
            verdict = f"killed by {test}" if test else f"SURVIVED {ran} test files"
            print(f"{mutant.room:<10}{mutant.row(source)}\n{'':<10}{verdict}", flush=True)
            return test is not None

        deaths = list(pool.map(outcome, chosen))
    rooms = [mutant.room for mutant in chosen]
    killed = Counter(room for room, dead in zip(rooms, deaths, strict=True) if dead)
    print(f"\n{table(rooms, killed)}")
    return 0


def _state() -> str:
    """Return a name for the program as it is."""
    digest = hashlib.sha256()
    for path in sorted((REPOSITORY / PACKAGE).rglob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:12]


if __name__ == "__main__":
    sys.exit(main())
