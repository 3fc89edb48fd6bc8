"""Prints how many lines the package finds where OpenUSD wrote them, and how fast.

Usage: python benchmarks/bench_lines.py [FOLDER...]
"""

from __future__ import annotations

import statistics
import sys
import tempfile
import time
from collections.abc import Iterable
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests/support"))

from usda_measure import build_text_stages, measure, text_files

from lab3_usd.stage.read.opening import quiet
from lab3_usd.stage.statements import scan_text

CORPUS = Path(__file__).resolve().parents[2] / "shared" / "corpus"
LINES = 100_000
ROUNDS = 5
MIN_SHARE = 0.99  # some people indent by hand


def main(folders: Iterable[Path]) -> int:
    """Print the table; return 1 where fewer than 99 % are found."""
    with tempfile.TemporaryDirectory() as folder:
        built = build_text_stages(Path(folder))
        total = _print_share("built stages", built)
        for each in folders:
            total += _print_share(str(each), [*text_files(each)])
        _print_speed(built[-1])
    return int(total > 0)


def _print_share(title: str, files: list[Path]) -> int:
    """Print one row; return 1 where the share is too small."""
    with quiet():
        measures = [measure(file) for file in files]
    paths = sum(each.paths for each in measures)
    wrong = [f"{each.file}: {path}" for each in measures for path in each.wrong]
    share = 1 - len(wrong) / paths if paths else 1.0
    print(f"{title}: {len(files)} layers, {paths} paths, {share:.3%} at the same place")
    for each in wrong:
        print(f"  {each}")
    return int(share < MIN_SHARE)


def _print_speed(file: Path) -> None:
    body = file.read_text(encoding="utf-8")
    text = body * (LINES // body.count("\n") + 1)
    times = []
    for _ in range(ROUNDS):
        start = time.perf_counter()
        scan_text(text)
        times.append(time.perf_counter() - start)
    lines, median = text.count("\n"), statistics.median(times)
    print(f"speed: {lines} lines ({len(text) / 1e6:.1f} MB) in {median:.2f} s")


if __name__ == "__main__":
    given = [Path(argument) for argument in sys.argv[1:]]
    sys.exit(main(given or [CORPUS] * CORPUS.is_dir()))
