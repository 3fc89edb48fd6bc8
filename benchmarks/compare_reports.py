"""Compares what two checkouts say of the same stages, in JSON, and prints every difference.

The stages: all checkpoints as this checkout builds them, every single fault of one checkpoint, and
the stages of other people in `../shared/corpus` where they are there. Each is checked, checked
beside the starter, linted, and its repairs are compared.

Usage: python benchmarks/compare_reports.py OTHER_CHECKOUT [--faults 05] [--every N] [--most N]
       [--leave-out KEY ...]
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

REPOSITORY = Path(__file__).resolve().parents[1]
CORPUS = REPOSITORY.parent / "shared" / "corpus"
sys.path.insert(0, str(REPOSITORY / "tests/support"))
sys.path.insert(0, str(REPOSITORY / "benchmarks"))


def write_stages(folder: Path, checkpoint: str, every: int) -> dict[str, list[Path]]:
    """Write built stages and faulty ones; return the files of each group."""
    from pxr import Sdf, Usd
    from sabotage import graph_faults
    from sweep import scene_faults

    from lab3_usd.spec.load.loader import load_lab
    from lab3_usd.stage.write.builder import build_checkpoint

    lab = load_lab()
    built = [
        build_checkpoint(None, name, folder / f"{asked.file}.usda")
        for name, asked in lab.checkpoints.items()
    ]
    asked = lab.checkpoints[checkpoint]
    layer = Sdf.Layer.FindOrOpen(str(folder / f"{asked.file}.usda"))
    faulty = []
    for number, fault in enumerate([*graph_faults(lab, asked), *scene_faults(asked)][::every]):
        copy = Sdf.Layer.CreateAnonymous(".usda")
        copy.TransferContent(layer)
        fault.break_it(Usd.Stage.Open(copy))
        path = folder / f"{asked.file}_fault{number:04}.usda"
        copy.Export(str(path))
        faulty.append(path)
    corpus = [path for path in sorted(CORPUS.rglob("*.usd*")) if path.is_file()]
    return {"built": built, "faults": faulty, "corpus": corpus}


def answers(checkout: Path, arguments: list[str], files: list[Path]) -> tuple[int, Any]:
    """Return exit code and JSON of a command, run with the source of a checkout."""
    run = subprocess.run(
        [sys.executable, "-m", "lab3_usd", *arguments, "--format", "json", *map(str, files)],
        env={**os.environ, "PYTHONPATH": str(checkout / "src"), "PYTHONHASHSEED": "0"},
        cwd=checkout,
        capture_output=True,
        check=False,
    )
    if run.returncode not in {0, 1}:
        raise SystemExit(f"{checkout}: {arguments}: {run.stderr.decode()[-2000:]}")
    return run.returncode, json.loads(run.stdout)


def differences(old: Any, new: Any, left_out: frozenset[str], where: str = "") -> Iterator[str]:
    """Yield every place in which two JSON documents differ; `left_out` are keys that may."""
    if isinstance(old, dict) and isinstance(new, dict):
        for key in sorted((old.keys() | new.keys()) - left_out):
            yield from differences(old.get(key), new.get(key), left_out, f"{where}/{key}")
    elif isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
        for number, (before, after) in enumerate(zip(old, new, strict=True)):
            name = after.get("path", number) if isinstance(after, dict) else number
            yield from differences(before, after, left_out, f"{where}[{name}]")
    elif old != new:
        yield f"{where}:\n    old {json.dumps(old)[:1500]}\n    new {json.dumps(new)[:1500]}"


def main() -> None:
    """Compare, and exit with 1 where anything differs."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("other", type=Path, help="the other checkout")
    parser.add_argument("--faults", default="05", help="the checkpoint whose faults are made")
    parser.add_argument("--every", type=int, default=1, help="make each N-th fault only")
    parser.add_argument("--most", type=int, default=40, help="print so many differences")
    parser.add_argument("--leave-out", nargs="*", default=[], help="keys that may differ: name")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        groups = write_stages(Path(name), options.faults, options.every)
        starter = groups["built"][0]
        at = ["--checkpoint", options.faults]
        runs = [
            ("built, checked", ["check", "--isolated"], groups["built"]),
            ("built, beside the starter", ["check", "--isolated", "--starter", str(starter)],
             groups["built"]),
            ("faults, checked", ["check", "--isolated", *at], groups["faults"]),
            ("faults, beside the starter", ["check", "--isolated", "--starter", str(starter), *at],
             groups["faults"]),
            ("faults, linted", ["lint", "--isolated"], groups["faults"]),
            ("corpus, checked", ["check", "--isolated", *at], groups["corpus"]),
            ("corpus, linted", ["lint", "--isolated"], groups["corpus"]),
        ]  # fmt: skip
        count = 0
        for title, arguments, files in runs if groups["corpus"] else runs[:5]:
            old, new = (answers(place, arguments, files) for place in (options.other, REPOSITORY))
            found = [*differences(old[1], new[1], frozenset(options.leave_out))]
            found += [f"exit code {old[0]}, now {new[0]}"] if old[0] != new[0] else []
            print(f"{title}: {len(files)} stages, {len(found)} differences", flush=True)
            for line in found[: max(0, options.most - count)]:
                print("   ", line)
            count += len(found)
    raise SystemExit(1 if count else 0)


if __name__ == "__main__":
    main()
