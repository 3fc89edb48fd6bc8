"""Makes the pictures of the documentation with the program itself.

Run `python docs/make_pictures.py` after the drawing has changed; a test compares the SVG files.
The picture of the HTML report is taken with chromium, and stays as it is where there is none.
"""

from __future__ import annotations

import re
import shutil
import struct
import subprocess
import sys
import tempfile
import zlib
from pathlib import Path

DOCS = Path(__file__).resolve().parent
PICTURES = DOCS / "pictures"
DRAWN = {  # what `lab3 draw` names a picture, and its name here
    "ROS_Drive.svg": "drive.svg",
    "TF.svg": "tf.svg",
    "Lab3_02_ros_drive-ROS_Drive.svg": "faults.svg",
    "rover-Drive.svg": "added_drive.svg",
}
ROVER = DOCS / "examples" / "rover.usda"  # a robot without graphs
# The part of the picture of faults that README shows, as it is 830 pixels wide there.
HERO, HERO_VIEW = "hero.svg", (700, 155, 1030, 400)
MAP_ZOOM = 3
WINDOW = "960,860"
BROWSER = (
    "chromium",
    "--headless=new",
    "--no-sandbox",
    "--hide-scrollbars",
    f"--window-size={WINDOW}",
)


def make_pictures(target: Path) -> None:
    """Write every picture into the folder `target`."""
    target.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        wrong = _submission(folder / "ana") / "work" / "Lab3_02_ros_drive.usda"
        _lab3("add", "drive", ROVER, "--output", folder / "rover.usda")
        for drawn in (wrong, "ROS_Drive", "TF", folder / "rover.usda"):
            _lab3("draw", drawn, "--output", folder)
        for drawn, kept in DRAWN.items():
            shutil.copyfile(folder / drawn, target / kept)
        faults = (target / "faults.svg").read_text(encoding="utf-8")
        (target / HERO).write_text(cropped(faults, HERO_VIEW), encoding="utf-8")
        image = (folder / "ana" / "maps" / "turtlebot3_map.pgm").read_bytes()
        (target / "map.png").write_bytes(png_of_pgm(image, MAP_ZOOM))


def make_report_picture(target: Path) -> None:
    """Write the picture of the HTML report into the folder `target`."""
    with tempfile.TemporaryDirectory() as name:
        page = Path(name) / "report.html"
        submission = _submission(Path(name) / "ana")
        _lab3("check", submission, "--format", "html", "--output", page, "--exit-zero")
        picture = target / "report.png"
        subprocess.run([*BROWSER, f"--screenshot={picture}", page.as_uri()], check=True)


def make_drive_picture(target: Path) -> None:
    """Write the picture of a dry run's page into the folder `target`."""
    with tempfile.TemporaryDirectory() as name:
        page = Path(name) / "sim.html"
        _lab3("build", "--output", name, "--only", "05")
        _lab3("sim", Path(name) / "Lab3_05_odometry_tf.usda", "--page", page)
        picture = target / "sim.png"
        # The drive is what there is to see; the checks above it are text.
        whole = page.read_text(encoding="utf-8")
        drive = re.sub(
            r'<section aria-labelledby="checks">.*?</section>', "", whole, flags=re.DOTALL
        )
        page.write_text(drive, encoding="utf-8")
        subprocess.run([*BROWSER, f"--screenshot={picture}", page.as_uri()], check=True)


def _submission(folder: Path) -> Path:
    """Make a submission that has everything of the stages right but the drive graph."""
    starter = folder / "assets" / "student_handout_turtlebot3_ros2_scene.usda"
    starter.parent.mkdir(parents=True)
    _lab3("starter", "--output", starter)
    _lab3("map", starter, "--output", folder / "maps")
    _lab3("build", "--output", folder / "work")
    right = folder / "right"
    _lab3("build", "--output", right, "--only", "02")
    name = "Lab3_02_ros_drive.usda"
    _run(DOCS / "examples" / "mistakes.py", right / name, folder / "work" / name)
    shutil.rmtree(right)
    return folder


def _lab3(*arguments: str | Path) -> None:
    _run("-m", "lab3_usd", *arguments)


def _run(*arguments: str | Path) -> None:
    subprocess.run([sys.executable, *map(str, arguments)], check=True, stdout=subprocess.DEVNULL)


def cropped(picture: str, view: tuple[int, int, int, int]) -> str:
    """Return a picture as SVG that shows only a part of another: left, top, width, height."""
    left, top, width, height = view
    size = f'width="{width}" height="{height}" viewBox="{left} {top} {width} {height}"'
    return re.sub(r'width="\d+" height="\d+" viewBox="[\d. ]+"', size, picture, count=1)


def png_of_pgm(image: bytes, zoom: int) -> bytes:
    """Return a binary PGM image as PNG, each of its pixels `zoom` wide and high."""
    _, size, _, pixels = image.split(b"\n", 3)
    width, height = map(int, size.split())
    rows = [pixels[start : start + width] for start in range(0, width * height, width)]
    wide = (b"".join(bytes([grey]) * zoom for grey in row) for row in rows)
    lines = b"".join((b"\0" + row) * zoom for row in wide)
    header = struct.pack(">IIBBBBB", width * zoom, height * zoom, 8, 0, 0, 0, 0)
    chunks = {b"IHDR": header, b"IDAT": zlib.compress(lines, 9), b"IEND": b""}
    return b"\x89PNG\r\n\x1a\n" + b"".join(_chunk(*chunk) for chunk in chunks.items())


def _chunk(name: bytes, data: bytes) -> bytes:
    check = struct.pack(">I", zlib.crc32(name + data))
    return struct.pack(">I", len(data)) + name + data + check


if __name__ == "__main__":
    make_pictures(PICTURES)
    if shutil.which(BROWSER[0]):
        make_report_picture(PICTURES)
        make_drive_picture(PICTURES)
