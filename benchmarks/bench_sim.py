"""Measures how much faster than real time a dry run is, with and without the scan, and its memory.

Usage: python benchmarks/bench_sim.py [--slow N] [--runs N] [--robots N]

The built stage of checkpoint 05 is driven by the fixed drive, `--slow` times as long as usual, on
one core, with the lidar and without it; then stages of 10 and 100 robots with lidar and camera are
played, each robot by its own commands; `--robots` plays one stage of that many instead. Exits with
1 where less comes out than is asked for.
"""

from __future__ import annotations

import argparse
import resource
import statistics
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

from msgspec import Struct

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests/support"))

from robot_kinds import fleet

from lab3_usd import build_checkpoint
from lab3_usd.model.dry_run import Scene
from lab3_usd.sim.any_stage import play_any
from lab3_usd.sim.execution.drive import Session, fixed_drive
from lab3_usd.sim.judge.checks import asked_checks, judge
from lab3_usd.sim.judge.topics import expected_at
from lab3_usd.sim.lidar import sweep
from lab3_usd.sim.outcome import Judged, behaviour_of
from lab3_usd.sim.plays import Play
from lab3_usd.spec.load.loader import load_lab, load_platform
from lab3_usd.stage.read.opening import open_stage
from lab3_usd.stage.read.scene import read_scene

CHECKPOINT = "05"
LIDAR_GRAPH = "ROS_Lidar2D"
ASKED = {"with scan": 20.0, "without scan": 30.0}  # times real time
FLEETS = (10, 100)  # robots
EACH = 1.0  # seconds of the processor that a robot may take
KILOBYTES = 1024


class Figure(Struct, frozen=True):
    """What playing took: seconds that were played, of the processor, and in judging."""

    played: float
    busy: float
    judging: float

    @property
    def times_real(self) -> float:
        """How much faster than real time it was played and judged."""
        return self.played / (self.busy + self.judging)


def measured(scene: Scene, drive: Sequence[Session]) -> Figure:
    """Play a scene once and judge it."""
    lab = load_lab()
    sweep.cache_clear()  # what the run before has seen
    start = time.process_time()
    wanted = expected_at(lab, lab.checkpoints[CHECKPOINT])
    trial = Play("", wanted, drive).recorded(scene, lab.platform)
    played = time.process_time()
    behaviour_of([Judged("", trial, judge(trial, asked_checks(trial)))])
    done = time.process_time()
    return Figure(trial.recording.seconds, played - start, done - played)


def without_scan(scene: Scene) -> Scene:
    """Return the scene without the graph of the lidar."""
    kept = tuple(graph for graph in scene.graphs if not graph.path.endswith(LIDAR_GRAPH))
    return Scene(scene.meters_per_unit, scene.up, kept, scene.prims, scene.missing)


def main() -> int:
    """Print the medians."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--slow", type=float, default=3.0)
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--robots", type=int, default=0)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        path = build_checkpoint(None, CHECKPOINT, Path(folder) / "Lab3_05.usda")
        scene = read_scene(open_stage(path), load_platform())
    drive = fixed_drive(slow=options.slow)
    short = 0
    for name, each in (("with scan", scene), ("without scan", without_scan(scene))):
        found = [measured(each, drive) for _ in range(options.runs)]
        times = statistics.median(figure.times_real for figure in found)
        share = statistics.median(f.judging / (f.busy + f.judging) for f in found)
        print(
            f"{name}: {found[0].played:.1f} s played, {times:.1f} times real time"
            f" ({ASKED[name]:.0f} asked), {share:.0%} of it judging"
        )
        short += times < ASKED[name]
    for count in (options.robots,) if options.robots else FLEETS:
        asked = count * EACH
        robots = read_scene(fleet(count), load_platform())
        start = time.process_time()
        played = play_any(robots, load_platform(), None)
        busy = time.process_time() - start
        checks = [check for play in played.plays for check in play.checks]
        right = sum(check.name == "follows" and check.verdict == "ok" for check in checks)
        print(f"{count} robots: {busy:.1f} s of the processor ({asked:.0f} asked), {right} follow")
        short += busy > asked or right < count
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / KILOBYTES
    print(f"memory: {memory:.0f} MB at most")
    return 1 if short else 0


if __name__ == "__main__":
    sys.exit(main())
