"""`lab3 check --watch`: what is judged again, how saves are understood, how it ends."""

from __future__ import annotations

import json
import os
import queue
import re
import shutil
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import forking
import pytest
from breaking import Step, broken, place
from browser import Browser
from click.testing import Result
from in_process import invoke
from machine import eventually
from msgspec.structs import replace
from pxr import Sdf

from lab3_usd.commands.shared import watching
from lab3_usd.commands.shared.watching import changes_between
from lab3_usd.errors import StageError, UsageError
from lab3_usd.model.finding import Finding, Report, StageResult
from lab3_usd.report.html.live_page import live_page, version_file, version_script
from lab3_usd.stage.read.opening import open_stage
from lab3_usd.stage.read.watched_files import may_be_whole, text_in_memory
from lab3_usd.stage.write.starter import build_starter

NAME = "Lab3_02_ros_drive.usda"
DRIVE, CLOCK = "ROS_Drive/differential_controller", "ROS_Clock/ros2_publish_clock"
RADIUS: Step = {"set": [f"{DRIVE}.inputs:wheelRadius", 0.033]}
WIRE: Step = {"disconnect": f"{CLOCK}.inputs:execIn"}

READ_OFTEN = """
import sys
from pathlib import Path
from lab3_usd.errors import StageError
from lab3_usd.stage.read.opening import open_stage
from lab3_usd.stage.read.watched_files import text_in_memory
with text_in_memory():
    for _ in range(40):
        try:
            open_stage(Path(sys.argv[1]))
        except StageError:
            pass
"""

Saves = list[Callable[[], Any]]


def content(*steps: Step) -> bytes:
    """The stage after these steps, as it is saved."""
    text: str = broken("02", list(steps)).GetRootLayer().ExportToString()
    return text.encode()


RIGHT, WRONG, WORSE = content(), content(RADIUS), content(RADIUS, WIRE)


@pytest.fixture
def stage(tmp_path: Path) -> Path:
    path = tmp_path / "work" / NAME
    path.parent.mkdir()
    path.write_bytes(RIGHT)
    return path


@pytest.fixture
def watch(monkeypatch: pytest.MonkeyPatch) -> Callable[..., Result]:
    """Run the command with these saves instead of the events of the system."""

    def run(saves: Saves, *arguments: Path | str, command: str = "check") -> Result:
        coming = iter(saves)

        def events(folders: set[str]) -> Iterator[frozenset[str]]:
            for save in coming:
                saved = frozenset(os.path.realpath(path) for path in save())
                yield frozenset(each for each in saved if str(Path(each).parent) in folders)
            raise KeyboardInterrupt

        monkeypatch.setattr(watching, "saves", events)
        return invoke(command, "--watch", "--quiet", *arguments)

    return run


def write(path: Path, data: bytes) -> Callable[[], list[Path]]:
    def save() -> list[Path]:
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(data)
        return [path]

    return save


def remove(path: Path) -> Callable[[], list[Path]]:
    def save() -> list[Path]:
        path.unlink()
        return [path]

    return save


def over(text: bytes, layer: str) -> str:
    """A stage that says nothing by itself above a layer, with the metadata of another stage."""
    head = text.decode().partition("\ndef ")[0]
    return re.sub(r"\(\n", f"(\n    subLayers = [@{layer}@]\n", head, count=1) + "\n"


def news(result: Result) -> list[str]:
    """What each save changed, in figures."""
    return re.findall(r": (\d+ repaired, \d+ new.*?) left$", result.stdout, re.MULTILINE)


@pytest.fixture
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    """Wait for no other half of a save."""
    monkeypatch.setattr(watching, "PATIENCE", 0.0)


# ---- what is judged again


def test_each_save_is_told_by_what_it_changed(watch: Callable[..., Result], stage: Path) -> None:
    saves = [write(stage, each) for each in (WRONG, WORSE, RIGHT)]
    result = watch(saves, stage)
    assert news(result) == [
        "0 repaired, 1 new; 1 error",
        "0 repaired, 1 new; 2 errors",
        "2 repaired, 0 new; nothing",
    ]
    assert result.exit_code == 0
    assert [line.split()[:3] for line in result.stdout.splitlines() if line.startswith("  ")] == [
        ["new", "error", "P01"],
        ["new", "error", "W01"],
        ["repaired", "error", "W01"],
        ["repaired", "error", "P01"],
    ]


def test_another_wrong_value_is_a_change(watch: Callable[..., Result], stage: Path) -> None:
    other = content({"set": [f"{DRIVE}.inputs:wheelRadius", 0.04]})
    result = watch([write(stage, WRONG), write(stage, other)], stage)
    assert news(result)[1] == "0 repaired, 0 new, 1 changed; 1 error"


@pytest.mark.usefixtures("impatient")
def test_what_a_damaged_save_may_still_have_is_not_repaired(
    watch: Callable[..., Result], stage: Path
) -> None:
    damaged = WORSE.replace(b"def ", b"fed ", 1)
    saves = [write(stage, each) for each in (WORSE, damaged, damaged, WRONG)]
    assert news(watch(saves, stage)) == [
        "0 repaired, 2 new; 2 errors",
        "0 repaired, 1 new, 2 unknown until it can be read; 1 error",
        "0 repaired, 0 new, 2 unknown until it can be read; 1 error",
        "2 repaired, 0 new; 1 error",
    ]


def test_a_line_that_moved_is_no_news(watch: Callable[..., Result], stage: Path) -> None:
    moved = WRONG.replace(b"\n", b"\n# one\n# two\n", 1)
    result = watch([write(stage, WRONG), write(stage, moved)], stage)
    assert news(result)[1] == "0 repaired, 0 new; 1 error"


def test_another_file_beside_it_is_not_judged(watch: Callable[..., Result], stage: Path) -> None:
    result = watch([write(stage.with_name("notes.txt"), b"")], stage)
    assert news(result) == []


def test_a_layer_that_the_stage_uses_counts(watch: Callable[..., Result], stage: Path) -> None:
    part = stage.parents[1] / "parts" / "part.usda"
    part.parent.mkdir()
    part.write_bytes(RIGHT)
    stage.write_text(over(RIGHT, "../parts/part.usda"))
    result = watch([write(part, WRONG)], stage)
    assert news(result) == ["0 repaired, 1 new; 1 error"]


def test_a_layer_counts_from_when_the_stage_begins_to_use_it(
    watch: Callable[..., Result], stage: Path
) -> None:
    part = stage.parents[1] / "parts" / "part.usda"
    begins = write(stage, over(RIGHT, "../parts/part.usda").encode())
    saves = [write(part, RIGHT), begins, write(part, WRONG), write(part, RIGHT)]
    told = [
        "0 repaired, 0 new; nothing",
        "0 repaired, 1 new; 1 error",
        "1 repaired, 0 new; nothing",
    ]
    assert news(watch(saves, stage)) == told


def test_a_layer_that_something_still_holds_is_read_anew(
    watch: Callable[..., Result], stage: Path
) -> None:
    held = Sdf.Layer.FindOrOpen(str(stage))
    assert news(watch([write(stage, WRONG)], stage)) == ["0 repaired, 1 new; 1 error"]
    del held


def test_folders_that_are_new_in_a_submission_are_watched(
    watch: Callable[..., Result], stage: Path
) -> None:
    maps = stage.parents[1] / "maps"

    def make() -> list[Path]:
        maps.mkdir()
        return [maps]

    told = news(watch([make, write(maps / "turtlebot3_map.yaml", b"")], stage.parents[1]))
    assert len(told) == 2
    assert told[0] != told[1]


def test_a_save_that_was_judged_already_is_told_once(
    watch: Callable[..., Result], stage: Path
) -> None:
    result = watch([write(stage, WRONG), lambda: [stage]], stage)
    assert news(result) == ["0 repaired, 1 new; 1 error"]


def test_in_a_folder_stages_come_and_go(watch: Callable[..., Result], stage: Path) -> None:
    other = stage.with_name("second.usda")
    result = watch([write(other, WRONG), remove(other)], "--checkpoint", "02", stage.parent)
    assert news(result) == ["0 repaired, 1 new; 1 error", "1 repaired, 0 new; nothing"]


def test_a_file_without_a_checkpoint_in_its_name_disturbs_nothing(
    watch: Callable[..., Result], stage: Path
) -> None:
    unnamed = stage.with_name("unnamed.usda")
    result = watch([write(unnamed, RIGHT), write(stage, WRONG)], stage.parent)
    assert news(result) == ["0 repaired, 1 new; 1 error"]


def test_a_submission_is_judged_as_a_whole(watch: Callable[..., Result], stage: Path) -> None:
    result = watch([write(stage, WRONG)], stage.parents[1])
    assert news(result)[0].startswith("0 repaired, 1 new; ")


def test_another_starter_counts_for_every_stage(watch: Callable[..., Result], stage: Path) -> None:
    starter = stage.parents[1] / "starter.usda"
    build_starter(starter)
    changed = starter.read_bytes().replace(b"physics:mass = ", b"physics:mass = 9", 1)
    assert changed != starter.read_bytes()
    result = watch([write(starter, changed)], "--starter", starter, stage)
    assert news(result) == ["0 repaired, 1 new; 1 error"]


@pytest.mark.usefixtures("impatient")
def test_a_layer_of_the_starter_counts_for_every_stage(
    watch: Callable[..., Result], stage: Path
) -> None:
    starter, part = stage.parents[1] / "starter.usda", stage.parents[1] / "parts" / "part.usda"
    part.parent.mkdir()
    build_starter(part)
    right = part.read_bytes()
    starter.write_text(over(right, "./parts/part.usda"))
    heavier = right.replace(b"physics:mass = ", b"physics:mass = 9", 1)
    saves = [write(part, heavier), write(part, right[:-9]), write(part, right)]
    result = watch(saves, "--starter", starter, stage)
    assert news(result)[0] == "0 repaired, 1 new; 1 error"
    assert news(result)[-1] == "1 repaired, 0 new; nothing"


@pytest.mark.usefixtures("impatient")
def test_a_starter_that_stays_broken_is_told_and_the_watch_goes_on(
    watch: Callable[..., Result], stage: Path
) -> None:
    starter = stage.parents[1] / "starter.usda"
    build_starter(starter)
    whole = starter.read_bytes()
    saves = [write(starter, b""), write(starter, whole), write(stage, WRONG)]
    result = watch(saves, "--starter", starter, stage)
    assert "starter.usda: is empty" in result.stderr
    assert news(result) == ["0 repaired, 0 new; nothing", "0 repaired, 1 new; 1 error"]


def test_a_layer_that_is_about_to_be_written_is_told(tmp_path: Path) -> None:
    root, part = tmp_path / "root.usda", tmp_path / "part.usda"
    root.write_text("#usda 1.0\n(\n    subLayers = [@./part.usda@]\n)\n")
    part.touch()
    with text_in_memory(), pytest.raises(StageError) as told:
        open_stage(root)
    assert f"{part}: is empty; save it again" in str(told.value)


def test_lint_watches_too(watch: Callable[..., Result], stage: Path) -> None:
    result = watch([write(stage, content(WIRE))], stage, command="lint")
    assert len(news(result)) == 1
    assert "0 repaired, 0 new" not in news(result)[0]


# ---- how saves are understood


@pytest.fixture
def patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """Wait as long as a busy machine takes for the other half of a save."""
    monkeypatch.setattr(watching, "PATIENCE", 60.0)


@pytest.mark.usefixtures("patient")
def test_a_file_that_is_gone_for_a_moment_is_no_fault(
    watch: Callable[..., Result], stage: Path
) -> None:
    def replaced() -> list[Path]:
        stage.unlink()
        threading.Timer(0.1, lambda: stage.write_bytes(WRONG)).start()
        return [stage]

    assert news(watch([replaced], stage)) == ["0 repaired, 1 new; 1 error"]


@pytest.mark.usefixtures("patient")
def test_a_stage_of_a_folder_that_is_moved_away_while_it_is_saved_is_one_change(
    watch: Callable[..., Result], stage: Path
) -> None:
    def saved_with_a_backup() -> list[Path]:
        stage.rename(stage.with_name(f"{NAME}~"))
        threading.Timer(0.1, lambda: stage.write_bytes(WRONG)).start()
        return [stage]

    assert news(watch([saved_with_a_backup], stage.parent)) == ["0 repaired, 1 new; 1 error"]


def test_a_stage_that_becomes_a_link_is_one_change(
    watch: Callable[..., Result], stage: Path, tmp_path: Path
) -> None:
    def link() -> list[Path]:
        (tmp_path / "elsewhere.usda").write_bytes(WRONG)
        stage.unlink()
        stage.symlink_to(tmp_path / "elsewhere.usda")
        return [stage]

    def nothing() -> list[Path]:
        return []

    assert news(watch([link, nothing, nothing], stage)) == ["0 repaired, 1 new; 1 error"]


@pytest.mark.usefixtures("patient")
def test_a_text_that_is_half_written_is_waited_for(
    watch: Callable[..., Result], stage: Path
) -> None:
    def half() -> list[Path]:
        stage.write_bytes(WRONG[: len(WRONG) // 2])
        threading.Timer(0.1, lambda: stage.write_bytes(WRONG)).start()
        return [stage]

    result = watch([half], stage)
    assert news(result) == ["0 repaired, 1 new; 1 error"]
    assert "P01" in result.stdout


def binary(text: bytes, folder: Path) -> bytes:
    """The same stage as a binary layer."""
    layer = Sdf.Layer.CreateAnonymous(".usda")
    layer.ImportFromString(text.decode())
    path = folder / f"{time.monotonic_ns()}.usdc"
    layer.Export(str(path))
    return path.read_bytes()


def test_a_binary_layer_is_whole_only_with_all_its_sections(tmp_path: Path) -> None:
    data, path = binary(WRONG, tmp_path), tmp_path / "stage.usd"
    steps = [*range(0, len(data), len(data) // 50), len(data) - 1, len(data)]
    whole = []
    for length in steps:
        path.write_bytes(data[:length])
        whole.append(may_be_whole(path))
    assert whole == [False] * (len(steps) - 1) + [True]
    assert not may_be_whole(tmp_path / "nowhere.usd")


@pytest.mark.usefixtures("impatient")
def test_a_file_that_stays_broken_is_told(watch: Callable[..., Result], stage: Path) -> None:
    result = watch([write(stage, b"#usda 1.0\nnonsense"), write(stage, RIGHT)], stage)
    assert news(result) == ["0 repaired, 1 new; 1 error", "1 repaired, 0 new; nothing"]
    assert "F01" in result.stdout


# ---- how it reports


def test_data_comes_alone_on_standard_output(watch: Callable[..., Result], stage: Path) -> None:
    result = watch([write(stage, WRONG)], "--format", "jsonl", stage)
    lines = [json.loads(line) for line in result.stdout.splitlines() if line]
    assert [line["rule"] for line in lines if "rule" in line] == ["P01"]
    assert "1 new" in result.stderr


def test_a_report_in_a_file_is_written_anew(watch: Callable[..., Result], stage: Path) -> None:
    output = stage.parents[1] / "report.json"
    result = watch([write(stage, WRONG)], "--format", "json", "-o", output, stage)
    assert json.loads(output.read_text())["summary"]["errors"] == 1
    assert "1 new" in result.stdout


@pytest.mark.parametrize(("words", "times"), [((), 2), (("-o", "report.txt"), 0)])
def test_a_terminal_is_cleared_before_each_report(
    words: tuple[str, ...],
    times: int,
    watch: Callable[..., Result],
    stage: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    cleared: list[None] = []
    monkeypatch.chdir(stage.parent)
    monkeypatch.setattr(watching, "understands_ansi", lambda _stream: True)
    monkeypatch.setattr(watching.click, "clear", lambda: cleared.append(None))
    watch([write(stage, WRONG)], stage, *words)
    assert len(cleared) == times


def test_a_page_reloads_itself_while_it_is_watched_and_is_plain_afterwards(
    watch: Callable[..., Result], stage: Path
) -> None:
    page = stage.parents[1] / "page.html"
    seen: list[str] = []

    def save() -> list[Path]:
        seen.extend([page.read_text(), version_file(page).read_text()])
        return write(stage, WRONG)()

    watch([save, save], "--format", "html", "-o", page, stage)
    assert [seen[1], seen[3]] == [version_script(1), version_script(2)]
    assert "const version = 1;" in seen[0]
    assert "const version = 2;" in seen[2]
    assert "lab3Version" not in page.read_text()
    assert "P01" in page.read_text()
    assert not version_file(page).exists()


# ---- wrong use


def test_a_file_beside_the_page_that_is_not_its_script_stays(
    watch: Callable[..., Result], stage: Path, tmp_path: Path
) -> None:
    page = tmp_path / "report.html"
    version_file(page).write_text("notes")
    with pytest.raises(UsageError, match="move it away"):
        watch([], "--format", "html", "--output", page, stage)
    assert (version_file(page).read_text(), page.exists()) == ("notes", False)


def test_without_the_library_the_extra_is_named(
    stage: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "watchfiles", None)
    with pytest.raises(UsageError, match=r"the extra watch"):
        invoke("check", "--watch", stage)


def test_a_baseline_is_not_written_again_and_again(stage: Path) -> None:
    with pytest.raises(UsageError):
        invoke("check", "--watch", "--write-baseline", "known.json", stage)


# ---- what is news


def report(*messages: str) -> Report:
    findings = tuple(
        Finding("N01", "missing-node", "error", "/Graph", message) for message in messages
    )
    return Report((StageResult("a.usda", "02", findings),))


@pytest.mark.parametrize(
    ("before", "after", "figures"),
    [
        ([], [], (0, 0, 0)),
        ([], ["a", "a"], (2, 0, 0)),
        (["a", "a"], ["a"], (0, 0, 1)),
        (["a", "b"], ["b", "c"], (0, 1, 0)),
        (["a", "b"], ["b"], (0, 0, 1)),
    ],
)
def test_findings_are_paired(
    before: list[str], after: list[str], figures: tuple[int, int, int]
) -> None:
    found = changes_between(report(*before), report(*after))
    assert (len(found.new), len(found.changed), len(found.repaired)) == figures


def test_a_finding_that_a_baseline_recognises_elsewhere_has_not_changed() -> None:
    first = Finding("K47", "no-clock", "warning", "/A", "no clock", identity="/")
    reports = [
        Report((StageResult("a.usda", None, (replace(first, prim=prim),)),))
        for prim in ("/A", "/B")
    ]
    found = changes_between(*reports)
    assert (found.new, found.changed, found.repaired) == ((), (), ())


def test_a_page_allows_scripts_from_disk_alone() -> None:
    policy = "default-src 'none'; script-src 'sha256-x='"
    page = f'<meta content="{policy}"><body></body>'
    found = live_page(page, Path("a</script>.html"), 3)
    assert re.search(r"script-src file: 'sha256-[^']+' 'sha256-x='", found)
    assert found.count("</script>") == 1


# ---- the real thing


class Watcher:
    """A running `lab3 check --watch`, and the lines that it prints."""

    def __init__(self, *arguments: Path | str) -> None:
        command = [sys.executable, "-m", "lab3_usd", "check", "--watch", "--quiet"]
        self.process = forking.Popen(
            [*command, *map(str, arguments)],
            stdout=forking.PIPE,
            stderr=forking.PIPE,
            text=True,
        )
        self.lines: queue.Queue[str] = queue.Queue()
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self) -> None:
        for line in self.process.stdout or ():
            self.lines.put(line)

    def wait_for(self, text: str) -> str:
        while text not in (line := self.lines.get(timeout=60)):
            pass
        return line

    def end(self) -> tuple[int, str]:
        self.process.send_signal(signal.SIGINT)
        errors = self.process.stderr.read() if self.process.stderr else ""
        return self.process.wait(60), errors


@pytest.fixture
def watcher() -> Iterator[Callable[..., Watcher]]:
    started: list[Watcher] = []

    def start(*arguments: Path | str) -> Watcher:
        started.append(Watcher(*arguments))
        started[-1].wait_for("watching")
        time.sleep(0.1)  # until the system tells of events; what it does not is seen in a second
        return started[-1]

    yield start
    for each in started:
        each.process.kill()
        each.process.wait()
        for stream in (each.process.stdout, each.process.stderr):
            if stream is not None:
                stream.close()


def test_saves_of_every_kind_are_noticed_and_ctrl_c_leaves_cleanly(
    watcher: Callable[..., Watcher], stage: Path
) -> None:
    running = watcher(stage)
    stage.write_bytes(WRONG)
    running.wait_for("1 error left")
    temporary = stage.with_name(f".{NAME}.tmp")
    temporary.write_bytes(WORSE)
    temporary.replace(stage)
    running.wait_for("2 errors left")
    stage.rename(stage.with_name(f"{NAME}.bak"))
    stage.write_bytes(RIGHT)
    running.wait_for("nothing left")
    assert running.end() == (0, "")


def test_a_binary_stage_that_is_written_slowly_in_place_is_judged_when_it_is_whole(
    watcher: Callable[..., Watcher], stage: Path
) -> None:
    path = stage.rename(stage.with_suffix(".usd"))
    versions = [binary(each, stage.parents[1]) for each in (WRONG, RIGHT)]
    path.write_bytes(versions[1])
    running = watcher(path)
    for number in range(3):
        data = versions[number % 2]
        with path.open("wb") as file:
            for start in range(0, len(data), len(data) // 4):
                file.write(data[start : start + len(data) // 4])
                file.flush()
                time.sleep(0.05)
        running.wait_for(("new       error P01", "nothing left")[number % 2])
    assert running.end() == (0, "")


def test_an_open_page_reloads_itself(
    chromium: Browser, watcher: Callable[..., Watcher], stage: Path
) -> None:
    page = stage.parents[1] / "page.html"
    running = watcher("--format", "html", "-o", page, stage)
    chromium.open(page)
    assert place(DRIVE) not in chromium.one("main").text
    assert chromium.logs() == []
    stage.write_bytes(WRONG)
    running.wait_for("1 new")
    # Asked in one step: an element may go between finding it and reading it.
    read = "return document.body ? document.body.innerText : ''"
    assert eventually(lambda: "wheelRadius is 0.033" in chromium.run(read))
    assert running.end() == (0, "")


def keeps_cutting_short(file: int, data: bytes, is_over: threading.Event) -> None:
    """Write a file again and again, as programs do that write in place."""
    while not is_over.is_set():
        os.ftruncate(file, 0)
        os.pwrite(file, data, 0)
        time.sleep(0.001)


@pytest.mark.parametrize("ending", [".usda", ".usd"])
def test_text_may_be_written_while_it_is_read(tmp_path: Path, ending: str) -> None:
    path, is_over = tmp_path / f"part{ending}", threading.Event()
    path.write_bytes(RIGHT)
    (tmp_path / "root.usda").write_text(over(RIGHT, f"./part{ending}"))
    reader = forking.Popen([sys.executable, "-c", READ_OFTEN, tmp_path / "root.usda"])
    with path.open("rb+") as file:
        writer = threading.Thread(
            target=keeps_cutting_short, args=(file.fileno(), RIGHT, is_over), daemon=True
        )
        writer.start()
        exit_code = reader.wait()
        is_over.set()
        writer.join()
    assert exit_code == 0


def test_a_folder_that_goes_and_comes_back_is_heard_again(
    watcher: Callable[..., Watcher], stage: Path
) -> None:
    running = watcher(stage)
    shutil.rmtree(stage.parent)
    running.wait_for("no such file")
    stage.parent.mkdir()
    stage.write_bytes(WRONG)
    running.wait_for("P01")
    stage.write_bytes(RIGHT)
    running.wait_for("nothing left")


def test_a_save_in_place_of_a_link_is_noticed(
    watcher: Callable[..., Watcher], stage: Path, tmp_path: Path
) -> None:
    link = tmp_path / "links" / NAME
    link.parent.mkdir()
    link.symlink_to(stage)
    running = watcher(link)
    temporary = link.with_name("saved")
    temporary.write_bytes(WRONG)
    temporary.replace(link)
    running.wait_for("1 error left")


def test_a_folder_that_is_gone_before_it_is_watched_ends_nothing(tmp_path: Path) -> None:
    assert [*watching.saves([str(tmp_path / "gone")])] == []
