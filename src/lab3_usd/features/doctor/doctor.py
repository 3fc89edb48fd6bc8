"""`lab3 doctor`: what works on this computer, and how to get what does not."""

from __future__ import annotations

import platform
import re
import shutil
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping
from importlib import metadata
from pathlib import Path
from typing import Literal

import click
from msgspec import Struct

from lab3_usd.commands.rules import LEAST
from lab3_usd.commands.shared.options import width
from lab3_usd.data import program
from lab3_usd.errors import EXIT_FOUND
from lab3_usd.installation import NAME, install_command
from lab3_usd.report.options import tool_version
from lab3_usd.report.safe_text import folded

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "firefox", "microsoft-edge")
EXTRAS = {
    "png": ("resvg-py", "pictures as PNG"),
    "nvidia": ("usd-validation-nvidia", "the rules in NVIDIA's validator"),
    "sim": ("rosbags", "bags of dry runs and of the running system"),
    "live": ("cyclonedds", "dry runs that other programs of ROS 2 hear and drive"),
    "editor": ("pygls", "findings in an editor, as you type"),
    "watch": ("watchfiles", "checking again whatever is saved"),
    "cluster": ("distributed", "grading on several computers"),
}
State = Literal["ok", "missing", "bad"]


class Diagnosis(Struct, frozen=True):
    """The state of one component: a `missing` one is optional, a `bad` one is required.

    `command` adds what is missing.
    """

    name: str
    state: State
    text: str
    command: str = ""


@click.command("doctor")
def command() -> None:
    """Report what works on this computer: versions, checking, extras, browser, sandbox.

    For a missing extra, the command is printed that adds it to this installation.

    Exit code: 0 all that is needed works (extras may be missing), 1 something does not.
    """
    system = f"Python {platform.python_version()}, {platform.platform()}"
    click.echo(f"{program()} {tool_version()}, {system}")
    states = []
    for check in _checks():
        states.append(check.state)
        click.echo("\n".join(diagnosis_lines(check)))
    if "bad" in states:
        sys.exit(EXIT_FOUND)


def diagnosis_lines(check: Diagnosis) -> Iterator[str]:
    """Yield the lines of a check; a command is one line, however long, so that it can be copied."""
    head = f"{check.state:<8} {check.name:<10} "
    hanging = " " * len(head)
    lines = folded(check.text, max(width(), LEAST), head, hanging)
    yield from lines or [head.rstrip()]
    if check.command:
        yield hanging + check.command


def _checks() -> Iterator[Diagnosis]:
    yield dependencies()
    yield checking()
    for name, (package, purpose) in EXTRAS.items():
        yield extra(name, package, purpose)
    yield browser()
    yield sandbox()


def dependencies() -> Diagnosis:
    """Look for the packages that the installed package asks for."""
    try:
        requirements = metadata.requires(NAME) or []
    except metadata.PackageNotFoundError:
        return Diagnosis("packages", "missing", f"{NAME} runs from its files, and is not installed")
    versions, absent = [], []
    for line in requirements:
        if ";" in line:
            continue  # of an extra
        name = re.split(r"[^\w.-]", line, maxsplit=1)[0]
        try:
            versions.append(f"{name} {metadata.version(name)}")
        except metadata.PackageNotFoundError:
            absent.append(name)
    if absent:
        return Diagnosis("packages", "bad", f"not installed: {', '.join(absent)}")
    return Diagnosis("packages", "ok", ", ".join(versions))


def checking() -> Diagnosis:
    """Build the last stage of the lab, and check it."""
    begun = time.perf_counter()
    try:
        from lab3_usd.pipeline.stage import check_stage
        from lab3_usd.spec.lab import STARTER
        from lab3_usd.spec.load.loader import load_lab
        from lab3_usd.stage.write.builder import build_checkpoint

        lab = load_lab()
        last = lab.last
        if not (lab.folder / STARTER).is_file():
            return Diagnosis("checking", "missing", f"{lab.title} has no {STARTER} to build on")
        with tempfile.TemporaryDirectory() as folder:
            stage = build_checkpoint(None, last, Path(folder) / "stage.usda")
            result = check_stage(stage, last)
    except Exception as error:  # noqa: BLE001 - whatever fails is the answer
        return Diagnosis("checking", "bad", f"{type(error).__name__}: {error}")
    seconds = time.perf_counter() - begun
    text = f"the stage of checkpoint {last} was built and checked in {seconds:.1f} s: "
    return Diagnosis("checking", "ok" if result.verdict == "pass" else "bad", text + result.verdict)


def extra(name: str, package: str, purpose: str) -> Diagnosis:
    """Look for the package that an extra of ours installs."""
    try:
        version = metadata.version(package)
    except metadata.PackageNotFoundError:
        return Diagnosis(name, "missing", purpose, install_command(name))
    return Diagnosis(name, "ok", f"{purpose} ({package} {version})")


def browser() -> Diagnosis:
    """Look for a program that shows HTML reports."""
    if sys.platform in {"darwin", "win32"}:
        return Diagnosis("browser", "ok", "the system brings one, which shows HTML reports")
    program = next(filter(None, map(shutil.which, BROWSERS)), None)
    if program is None:
        text = f"HTML reports can be written, not shown: none of {', '.join(BROWSERS)} is here"
        return Diagnosis("browser", "missing", text)
    return Diagnosis("browser", "ok", f"{program} shows HTML reports")


def sandbox() -> Diagnosis:
    """Start a worker of `lab3 grade`, and say which walls this system puts around it."""
    try:
        from lab3_usd.grade.intake.submission_copy import Limits
        from lab3_usd.grade.workers.worker_messages import PoolSettings
        from lab3_usd.grade.workers.worker_process import end_worker, start_worker

        worker = start_worker(PoolSettings(None, None, Limits()))
    except Exception as error:  # noqa: BLE001 - whatever fails is the answer
        return Diagnosis("sandbox", "bad", f"{type(error).__name__}: {error}")
    end_worker(worker)
    return walls(worker.confined)


def walls(confined: Mapping[str, bool]) -> Diagnosis:
    """Say which walls there are around a worker, by their names."""
    from lab3_usd.grade.workers.sandbox import WALLS

    held = sorted(name for name, is_held in confined.items() if is_held)
    absent = [f"{name} ({WALLS[name]})" for name in sorted({*confined} - {*held})]
    if absent:
        return Diagnosis(
            "sandbox", "missing", f"{program()} grade does without: {', '.join(absent)}"
        )
    return Diagnosis("sandbox", "ok", f"{program()} grade confines {', '.join(held)}")
