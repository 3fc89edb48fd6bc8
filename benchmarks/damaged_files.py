"""Cuts and flips files of each kind that the program reads, and counts how the commands answer.

Usage: python benchmarks/damaged_files.py [--kind KIND ...] [--flips N] [--seed N]

Of each file every byte of its first and last 200 is changed once, N bytes elsewhere, and it is cut
at 40 places. A command may refuse what is left or judge it: in 10 seconds of a processor, with 2 GB
of memory, and with no error of its own. What fails is printed, and the exit status is 1.
"""

from __future__ import annotations

import argparse
import os
import random
import resource
import shutil
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

os.environ["PXR_WORK_THREAD_LIMIT"] = "1"  # it forks
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests/support"))

from breaking import correct_stage
from in_process import lab3
from pxr import UsdUtils
from recordings import recorded, rewritten
from rosbags.rosbag2 import StoragePlugin

from lab3_usd.errors import EXIT_CRASH

SECONDS, MEMORY = 10, 2 * 10**9
EDGE, CUTS = 200, 40
FLIPS = (0xFF, 0x80, 0x01)


class Kind(NamedTuple):
    """A file of a kind, and the command that reads it."""

    file: Path
    words: tuple[object, ...]


def kinds(folder: Path) -> dict[str, Kind]:
    """Write a right file of each kind."""
    crate = folder / "Lab3_05.usdc"
    correct_stage("05").GetRootLayer().Export(str(crate))
    package = folder / "Lab3_05.usdz"
    UsdUtils.CreateNewUsdzPackage(str(crate), str(package))
    bag = recorded(folder)
    made = {
        "usdc": Kind(crate, ("lint", crate)),
        "usdz": Kind(package, ("lint", package)),
    }
    for plugin in StoragePlugin:
        copy = rewritten(bag, folder / plugin.name.lower(), storage=plugin)
        (file,) = (path for path in copy.iterdir() if path.suffix != ".yaml")
        made[file.suffix[1:]] = Kind(file, ("bag", copy))
    image = folder / "map.pgm"
    image.write_bytes(b"P5\n40 40\n255\n" + bytes([0, 205, 254, 254]) * 400)
    image.with_suffix(".yaml").write_text(
        "image: map.pgm\nresolution: 0.05\norigin: [0, 0, 0]\n"
        "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.25\n"
    )
    made["pgm"] = Kind(image, ("check", crate, "--checkpoint", "07", "--maps", folder))
    return made


def damages(data: bytes, flips: int, dice: random.Random) -> Iterator[tuple[str, bytes]]:
    """Yield what is done to a file, and what is left of it."""
    edges = {*range(min(EDGE, len(data))), *range(max(0, len(data) - EDGE), len(data))}
    for place in sorted(edges | {dice.randrange(len(data)) for _ in range(flips)}):
        flip = dice.choice(FLIPS)
        yield (
            f"byte {place} ^ {flip:#x}",
            data[:place] + bytes([data[place] ^ flip]) + data[place + 1 :],
        )
    for number in range(CUTS):
        place = len(data) * number // CUTS
        yield f"cut at {place}", data[:place]


def answer(words: tuple[object, ...]) -> str:
    """Return how a command ends, run in a process that has little time and memory."""
    child = os.fork()
    if not child:
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS))
        status = 99
        try:
            done = lab3(*words)
            status = done.returncode
            if status == EXIT_CRASH or "Traceback" in done.stderr:
                sys.stderr.write(done.stderr[-1500:])
        finally:
            os._exit(status)
    _, status = os.waitpid(child, 0)
    return f"exit {os.waitstatus_to_exitcode(status)}"


def main() -> int:
    """Damage files of each kind, and print how often each answer came."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--kind", action="append")
    parser.add_argument("--flips", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()
    failed = 0
    with tempfile.TemporaryDirectory() as folder:
        made = kinds(Path(folder))
        for name in args.kind or made:
            file, words = made[name]
            whole = shutil.copy(file, file.with_name("whole"))
            data, answers = Path(whole).read_bytes(), Counter[str]()
            Path(whole).unlink()
            for what, damaged in damages(data, args.flips, random.Random(args.seed)):  # noqa: S311
                file.write_bytes(damaged)
                given = answer(words)
                answers[given] += 1
                if given not in {"exit 0", "exit 1", "exit 2"}:
                    failed += 1
                    print(f"{name}: {what}: {given}", flush=True)
            file.write_bytes(data)
            counts = ", ".join(f"{count} {text}" for text, count in sorted(answers.items()))
            print(f"{name}: {sum(answers.values())} files: {counts}", flush=True)
    return bool(failed)


if __name__ == "__main__":
    sys.exit(main())
