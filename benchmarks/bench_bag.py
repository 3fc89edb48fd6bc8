"""Measures what `lab3 bag` takes for a large recording: processor, clock and memory.

Usage: python benchmarks/bench_bag.py [--megabytes N] [--folder DIR]

A dry run of checkpoint 05 is recorded with an image beside each camera info, until the recording
is as large as asked. It lies in a temporary folder (below DIR), which is deleted.
"""

from __future__ import annotations

import argparse
import math
import multiprocessing
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from recordings import Sent

REPOSITORY = Path(__file__).resolve().parents[1]
DRIVE = "0.2,0,1.4 0,0,0.3 -0.2,0,1.4 0,0,0.3"  # 3.4 seconds, after which it is where it was
SECONDS, HERTZ, MEGABYTES_EACH = 3.4, 10.0, 640 * 480 * 3 / 1e6
KILOBYTES = 1024
KIND, TOPIC = "sensor_msgs/msg/Image", "/camera/image_raw"


def write(folder: Path, megabytes: float) -> None:
    """Write a recording of that size, in a process of its own: it takes memory."""
    sys.path.insert(0, str(REPOSITORY / "tests/support"))
    import numpy as np
    from breaking import correct_stage
    from recordings import Sent, rewritten

    from lab3_usd.sim.ros_messages import STORE

    stage = folder / "Lab3_05.usda"
    correct_stage("05").GetRootLayer().Export(str(stage))
    times = math.ceil(megabytes / MEGABYTES_EACH / HERTZ / SECONDS)
    drive = folder / "drive.txt"
    drive.write_text("\n".join(DRIVE.split() * times))
    command = [sys.executable, "-m", "lab3_usd", "sim", str(stage), "--drive", str(drive)]
    subprocess.run([*command, "--bag", str(folder / "dry")], check=True, capture_output=True)
    pixels: dict[int, np.ndarray] = {}

    def with_image(sent: Sent) -> Iterator[Sent]:
        yield sent
        if sent.topic == "/camera/camera_info":
            info = sent.said
            size = 3 * info.width * info.height
            data = pixels.setdefault(size, np.zeros(size, dtype=np.uint8))
            sizes = (info.height, info.width, "rgb8", 0, 3 * info.width)
            said = STORE.types[KIND](info.header, *sizes, data)
            yield Sent(sent.time, TOPIC, KIND, said, sent.qos)

    rewritten(folder / "dry", folder / "run", with_image)


def main() -> int:
    """Write the recording, judge it, and print what that took."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--megabytes", type=float, default=1000.0)
    parser.add_argument("--folder", type=Path)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(dir=options.folder) as name:
        writing = multiprocessing.get_context("spawn").Process(
            target=write, args=(Path(name), options.megabytes)
        )
        writing.start()
        writing.join()
        bag = Path(name, "run")
        size = sum(path.stat().st_size for path in bag.rglob("*")) / 1e6
        command = [sys.executable, "-m", "lab3_usd", "bag", str(bag)]
        begun = time.perf_counter()
        with subprocess.Popen(command, stdout=subprocess.DEVNULL) as judging:
            _, status, took = os.wait4(judging.pid, 0)
            judging.returncode = os.waitstatus_to_exitcode(status)
        seconds = time.perf_counter() - begun
    print(
        f"{size:.0f} MB: {took.ru_utime + took.ru_stime:.1f} s of the processor, {seconds:.1f} s by"
        f" the clock, {took.ru_maxrss / KILOBYTES:.0f} MB of memory"
    )
    return 1 if judging.returncode > 1 or writing.exitcode else 0


if __name__ == "__main__":
    sys.exit(main())
