"""What a worker does, done in this process: judging, serving, giving up what it does not need."""

from __future__ import annotations

import ctypes
import gc
import io
import json
import os
import pickle
import re
import resource
import shutil
import struct
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from linting import add_counting_rule, add_failing_rule
from msgspec.structs import replace
from other_labs import cut_wire, stage, starter, submission
from pxr import Sdf, Usd

from lab3_usd.data import data_folder
from lab3_usd.errors import StageError, UsageError
from lab3_usd.grade.intake.scratch import make_scratch
from lab3_usd.grade.intake.staging import Source
from lab3_usd.grade.intake.submission_copy import Limits
from lab3_usd.grade.workers import machine, sandbox, worker_main, worker_process
from lab3_usd.grade.workers.shipment import packed, unpacked
from lab3_usd.grade.workers.submission_grading import GradingSetup, grade_submission
from lab3_usd.grade.workers.worker_messages import (
    FAULT,
    Assignment,
    PoolSettings,
    Start,
    Task,
    encode,
    status_of,
)
from lab3_usd.grade.workers.worker_process import Worker
from lab3_usd.model.stage import StageModel
from lab3_usd.report.options import tool_version
from lab3_usd.stage.sandboxed_open import files_of

SETTINGS = PoolSettings(None, None, Limits())


@pytest.fixture(scope="module")
def course() -> GradingSetup:
    return worker_main.load_setup(replace(SETTINGS, starter=starter()))


def judged(course: GradingSetup, folder: Path, scratch: Path, **changes: Any) -> dict[str, Any]:
    (scratch / "copy").mkdir(parents=True)
    task = Task("jane", "jane", (Source(folder),), **changes)
    return grade_submission(course, task, scratch / "copy", lambda _name: None)


def test_a_submission_is_judged_and_the_working_directory_left_as_it_was(
    course: GradingSetup, tmp_path: Path
) -> None:
    before = Path.cwd()
    found = judged(course, submission(tmp_path / "jane", "00", "01"), tmp_path)
    assert (found["status"], found["verdicts"]) == ("graded", {"00": "pass", "01": "pass"})
    assert sorted(found["reports"]) == ["report.html", "report.json", "results.json"]
    assert Path.cwd() == before


def test_the_starter_stands_in_for_a_sublayer_that_was_not_handed_in(
    course: GradingSetup, tmp_path: Path
) -> None:
    given = starter().name
    found = {}
    for name in (given, "other.usda"):
        folder = submission(tmp_path / name / "jane", "01")
        (work,) = folder.rglob("*01*.usda")
        layer = Sdf.Layer.FindOrOpen(str(work))
        layer.subLayerPaths.append(f"./supplied/{name}")
        layer.Save()
        found[name] = judged(course, folder, tmp_path / name)
    assert found[given]["verdicts"] == {"01": "pass"}
    (remark,) = (text for text in found[given]["remarks"] if given in text)
    assert remark.endswith(f"./supplied/{given} was not submitted; the grader's file replaces it")
    assert found["other.usda"]["verdicts"] == {"01": "fail"}


def test_what_is_known_is_not_judged_again(course: GradingSetup, tmp_path: Path) -> None:
    jane = submission(tmp_path / "jane", "00")
    first = judged(course, jane, tmp_path / "one")
    again = judged(course, jane, tmp_path / "two", known=first["digest"])
    assert again == {"status": "known", "digest": first["digest"]}


def test_a_file_that_ended_a_worker_is_unreadable_and_the_others_are_judged(
    course: GradingSetup, tmp_path: Path
) -> None:
    name = f"work/{stage('01').name}"
    found = judged(
        course,
        submission(tmp_path / "jane", "00", "01"),
        tmp_path,
        broken={name: "ran out of time (20 s)"},
    )
    assert (found["status"], found["reason"]) == ("timeout", f"{name}: ran out of time (20 s)")
    assert found["verdicts"] == {"00": "pass", "01": "unreadable"}


def test_a_map_is_announced_and_left_out_where_it_ended_a_worker(
    course: GradingSetup, tmp_path: Path
) -> None:
    facts = course.lab.scene.map
    assert facts is not None
    jane, announced = submission(tmp_path / "jane"), list[str]()
    shutil.copytree(data_folder("maps"), jane / "maps")
    (yaml,) = (jane / "maps").glob("*.yaml")
    yaml.rename(jane / "maps" / facts.yaml)
    (image,) = (f"maps/{path.name}" for path in (jane / "maps").glob("*.pgm"))

    def report(name: str, broken: dict[str, str]) -> tuple[list[dict[str, Any]], dict[str, Any]]:
        (tmp_path / name).mkdir()
        task = Task("jane", "jane", (Source(jane),), broken=broken)
        found = grade_submission(course, task, tmp_path / name, announced.append)
        (about,) = json.loads(found["reports"]["report.json"])["submissions"]
        return [each for each in about["findings"] if each["rule"] == "M05"], found

    fine, _ = report("one", {})
    assert fine == []
    assert image in announced
    (left_out,), found = report("two", {image: "ran out of time (20 s)"})
    assert (left_out["prim"], "ran out of time" in left_out["message"]) == (image, True)
    assert set(found["verdicts"].values()) == {"pass"}


@pytest.mark.parametrize(
    ("limits", "status"), [(Limits(files=1), "too large"), (Limits(total_size=10), "too large")]
)
def test_too_much_is_not_judged(tmp_path: Path, limits: Limits, status: str) -> None:
    course = worker_main.load_setup(replace(SETTINGS, limits=limits))
    found = judged(course, submission(tmp_path / "jane", "00", "01"), tmp_path)
    assert (found["status"], found["earned"]) == (status, 0.0)
    assert "holds more than" in found["reason"]


def test_a_damaged_archive_is_unreadable(course: GradingSetup, tmp_path: Path) -> None:
    (tmp_path / "jane.zip").write_bytes(b"no zip")
    assert judged(course, tmp_path / "jane.zip", tmp_path)["status"] == "unreadable"


def test_a_folder_with_nothing_but_a_damaged_archive_is_unreadable(
    course: GradingSetup, tmp_path: Path
) -> None:
    (tmp_path / "jane").mkdir()
    (tmp_path / "jane" / "work.zip").write_bytes(b"no zip")
    found = judged(course, tmp_path / "jane", tmp_path)
    assert found["status"] == "unreadable"
    assert found["reason"].startswith("work.zip: is damaged")


def test_a_submission_without_stages_is_empty_and_says_why(
    course: GradingSetup, tmp_path: Path
) -> None:
    (tmp_path / "jane").mkdir()
    (tmp_path / "jane" / "Lab3_01_ros_clock.usda").symlink_to(stage("01"))
    found = judged(course, tmp_path / "jane", tmp_path)
    assert found["status"] == "empty"
    assert "link that leads out" in found["reason"]


@pytest.mark.usefixtures("own_rules")
def test_a_rule_that_fails_is_a_crash_over_its_file(course: GradingSetup, tmp_path: Path) -> None:
    add_failing_rule("S99", "stage", KeyError, "x")
    found = judged(course, submission(tmp_path / "jane", "00"), tmp_path)
    assert found["status"] == "crashed"
    assert found["crashes"]
    assert re.match(
        rf"work/{stage('00').name}: rule S99 failed \(KeyError: 'x', at linting.py:",
        found["reason"],
    )


@pytest.mark.usefixtures("own_rules")
def test_a_rule_that_lacks_memory_is_not_the_tools_fault(
    course: GradingSetup, tmp_path: Path
) -> None:
    add_failing_rule("S99", "stage", MemoryError)
    with pytest.raises(MemoryError):
        judged(course, submission(tmp_path / "jane", "00"), tmp_path)


def test_what_leads_out_is_an_error_of_the_stage_and_what_was_refused_of_the_submission(
    course: GradingSetup, tmp_path: Path
) -> None:
    jane = submission(tmp_path / "jane", "01")
    (jane / "work" / "more.usda").symlink_to(stage("04"))
    path = jane / "work" / stage("01").name
    layer = cut_wire(path).read_text()
    path.write_text(layer.replace("(\n", "(\n    subLayers = [@../../../solution.usda@]\n", 1))
    report = json.loads(judged(course, jane, tmp_path)["reports"]["report.json"])
    (result,) = report["results"]
    assert [each["actual"] for each in result["findings"] if each["rule"] == "Z02"] == [
        "../../../solution.usda"
    ]
    assert [
        each["prim"] for each in report["submissions"][0]["findings"] if each["rule"] == "Z01"
    ] == ["work/more.usda"]


@pytest.mark.usefixtures("own_rules")
def test_a_stage_that_is_saved_again_is_read_once(course: GradingSetup, tmp_path: Path) -> None:
    asked: list[StageModel] = []
    add_counting_rule("S99", asked)
    folder = submission(tmp_path / "jane", "03", "04")
    shutil.copy(folder / "work" / stage("04").name, folder / "work" / stage("05").name)
    found = judged(course, folder, tmp_path)
    assert found["verdicts"] == dict.fromkeys(("03", "04", "05"), "pass")
    assert len({id(stage) for stage in asked}) == 2


def test_hardly_anything_of_a_submission_is_left_for_the_garbage_collector(
    course: GradingSetup, tmp_path: Path
) -> None:
    folder = submission(tmp_path / "jane", "00", "04")
    cut_wire(folder / "work" / stage("04").name)
    judged(course, folder, tmp_path / "first")  # which imports what judging needs
    gc.collect()
    gc.disable()
    judged(course, folder, tmp_path / "second")
    gc.set_debug(gc.DEBUG_SAVEALL)
    gc.collect()
    gc.set_debug(0)
    gc.enable()
    left = [type(each) for each in gc.garbage]
    gc.garbage.clear()
    assert {StageModel, Usd.Stage}.isdisjoint(left)
    assert len(left) < worker_main._UNTIL_COLLECTED / 20


# -- serving


def prepared() -> worker_main.Prepared:
    """What a worker judges with that gave up nothing: this process goes on."""
    return worker_main.Prepared(worker_main.load_setup(SETTINGS), [], [], {"files": False})


def test_a_worker_serves_tasks_until_there_are_no_more(tmp_path: Path) -> None:
    (tmp_path / "scratch").mkdir()
    jane = Task("jane", "jane", (Source(submission(tmp_path / "jane", "00")),))
    answers = io.BytesIO()
    line = encode(Assignment(7, jane, 200.0))
    start = Start(tmp_path / "scratch", SETTINGS)
    worker_main._serve(start, prepared(), io.BytesIO(line), answers)
    said = [json.loads(line) for line in answers.getvalue().splitlines()]
    assert [list(line)[1] for line in said] == ["peak", "open", "open", "done"]
    assert [line.get("turn") for line in said] == [None, 7, 7, 7]
    assert [line["open"] for line in said[1:3]] == ["", f"work/{stage('00').name}"]
    assert said[3]["done"]["verdicts"] == {"00": "pass"}
    assert list((tmp_path / "scratch").iterdir()) == []


def test_an_answer_that_would_be_too_long_is_a_status(tmp_path: Path) -> None:
    (tmp_path / "scratch").mkdir()
    jane = Task("jane", "jane", (Source(submission(tmp_path / "jane", "00")),))
    settings = replace(SETTINGS, limits=Limits(answer_size=10_000))
    answers = io.BytesIO()
    line = encode(Assignment(7, jane, 200.0))
    start = Start(tmp_path / "scratch", settings)
    worker_main._serve(start, prepared(), io.BytesIO(line), answers)
    done = json.loads(answers.getvalue().splitlines()[-1])["done"]
    assert status_of(done["failed"]) == "too large"


@pytest.mark.parametrize(
    ("error", "died"),
    [
        (MemoryError(), "ran out of memory"),
        (KeyError("x"), "this program failed: KeyError: 'x' at test_grade_inside.py"),
    ],
)
def test_what_goes_wrong_while_judging_is_answered(
    course: GradingSetup,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    error: Exception,
    died: str,
) -> None:
    def fail(*arguments: Any) -> None:
        del arguments
        raise error

    monkeypatch.setattr(worker_main, "grade_submission", fail)
    found = worker_main.answer(course, Task("jane", "jane", ()), tmp_path, lambda _: None)
    assert found["died"].startswith(died)
    assert list(tmp_path.iterdir()) == []


def test_a_starter_that_cannot_be_opened_ends_the_worker(tmp_path: Path) -> None:
    with pytest.raises(StageError):
        worker_main.load_setup(replace(SETTINGS, starter=tmp_path / "gone.usda"))


# -- giving up


class Kernel:
    """Stands for the C library: notes what is asked of it, and answers as it is told."""

    def __init__(self, **answers: int) -> None:
        self.answers = answers
        self.asked: list[str] = []

    def __getattr__(self, name: str) -> Any:
        def call(*arguments: Any) -> int:
            key = f"{name}_{arguments[0]}" if name in {"syscall", "unshare", "prctl"} else name
            self.asked.append(key)
            return self.answers.get(key, 0)

        return call


def test_network_and_privileges_are_given_up_in_this_order() -> None:
    kernel = Kernel()
    assert sandbox.give_up_privileges(kernel) == {"privileges": True, "network": True}
    assert kernel.asked == [f"unshare_{0x40000000}", "prctl_1", "prctl_38", "capset"]


def test_without_permission_a_namespace_of_users_is_tried() -> None:
    kernel = Kernel(**{f"unshare_{0x40000000}": -1})
    assert sandbox.give_up_privileges(kernel)["network"] is True
    kernel = Kernel(**{f"unshare_{kind}": -1 for kind in (0x40000000, 0x50000000)})
    assert sandbox.give_up_privileges(kernel)["network"] is False


@pytest.mark.parametrize("uid", [0, 1000])
def test_capabilities_are_given_up_but_to_read_where_root_grades(
    monkeypatch: pytest.MonkeyPatch, uid: int
) -> None:
    given: list[bytes] = []

    class Library:
        def capset(self, header: bytes, sets: bytes) -> int:
            del header
            given.append(sets)
            return 0

    monkeypatch.setattr(os, "geteuid", lambda: uid)
    assert sandbox._no_capabilities(Library())
    assert struct.unpack("<6I", given[0])[:2] == ((4, 4) if uid == 0 else (0, 0))


def test_another_platform_gives_up_nothing_and_says_so() -> None:
    assert sandbox.give_up_privileges(None) == {"privileges": False, "network": False}


@pytest.mark.parametrize(("version", "truncates", "network"), [(1, 0, 0), (3, 1, 0), (4, 1, 1)])
def test_the_rules_of_the_kernel_follow_its_version(
    tmp_path: Path, version: int, truncates: int, network: int
) -> None:
    rulesets: list[bytes] = []
    rules: list[int] = []

    class Library:
        def prctl(self, *arguments: int) -> int:
            del arguments
            return 0

        def syscall(self, number: int, *arguments: Any) -> int:
            if number == 444 and arguments[0] is None:
                return version
            if number == 444:
                rulesets.append(arguments[0])
                return os.open(os.devnull, os.O_RDONLY)
            if number == 445:
                rules.append(struct.unpack("<Qi", arguments[2])[0])
            return 0

    (tmp_path / "file").touch()
    readable = [tmp_path, tmp_path / "file", tmp_path / "gone"]
    assert sandbox.fence_files(readable, [tmp_path], Library())
    handled = struct.unpack_from("<Q", rulesets[0])[0]
    assert handled >> 14 == truncates
    assert len(rulesets[0]) == (16 if network else 8)
    read, file, write = rules
    assert (read, file) == (0b1101, 0b101)
    assert write & 0b10
    assert write < 1 << 15


@pytest.mark.parametrize("answers", [{"syscall_444": 0}, {"syscall_444": -1}])
def test_a_kernel_without_landlock_fences_nothing(answers: dict[str, int]) -> None:
    assert not sandbox.fence_files([], [], Kernel(**answers))


def test_a_kernel_that_makes_no_ruleset_fences_nothing() -> None:
    class Library:
        def syscall(self, number: int, attributes: bytes | None, *rest: Any) -> int:
            del number, rest
            return 4 if attributes is None else -1

    assert not sandbox.fence_files([], [], Library())


def test_limits_are_set_within_those_that_hold_already(monkeypatch: pytest.MonkeyPatch) -> None:
    resource = pytest.importorskip("resource", reason="this platform has no limits")
    given: dict[int, tuple[int, int]] = {}
    hard = {resource.RLIMIT_NOFILE: 100}
    monkeypatch.setattr(
        resource, "getrlimit", lambda name: (0, hard.get(name, resource.RLIM_INFINITY))
    )
    monkeypatch.setattr(resource, "setrlimit", given.__setitem__)
    used = sandbox._address_space()
    assert sandbox.limit_resources(Limits(memory=1 << 40))
    assert given[resource.RLIMIT_AS][0] - used == pytest.approx(1 << 40, rel=0.01)
    assert given[resource.RLIMIT_NOFILE] == (100, 100)
    assert given[resource.RLIMIT_CORE] == (0, 0)


def test_a_system_that_refuses_limits_is_found_out(monkeypatch: pytest.MonkeyPatch) -> None:
    resource = pytest.importorskip("resource", reason="this platform has no limits")

    def refuse(*_arguments: object) -> None:
        raise OSError

    monkeypatch.setattr(resource, "setrlimit", refuse)
    assert not sandbox.limit_resources(Limits())


def test_the_address_space_is_known_where_the_platform_tells_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    if Path("/proc/self/statm").exists():
        assert sandbox._address_space() > 1 << 20

    def missing(*arguments: Any, **named: Any) -> str:
        del arguments, named
        raise OSError

    monkeypatch.setattr(Path, "read_text", missing)
    assert sandbox._address_space() == 0


def test_the_library_of_linux_is_a_library() -> None:
    if sandbox.sys.platform != "linux":
        pytest.skip("not on Linux")
    assert isinstance(sandbox.LIBC, ctypes.CDLL)


# -- a machine of a cluster


@pytest.mark.usefixtures("forked_workers")
def test_a_machine_keeps_a_worker_for_each_of_a_few_shipments(tmp_path: Path) -> None:
    submission(tmp_path / "jane", "00")
    shipment = pickle.dumps(packed(PoolSettings(starter(), None, Limits(), (tmp_path,))))
    task = encode(Task("jane", "jane", (Source(tmp_path / "jane"),)))
    names = [b"first", b"second", b"first", b"third"]
    try:
        slots = []
        for name in names:
            answer = machine.judge_here(tool_version(), name, shipment, task)
            assert answer["verdicts"] == {"00": "pass"}
            slots.append(machine._slot(name, shipment))
        assert slots[0] is slots[2]
        assert len({id(slot) for slot in slots}) == 3
        assert all(slot.worker is not None for slot in slots)
        machine._slot(b"fourth", shipment)  # in place of the one that waited longest
        assert [slot.worker is None for slot in slots] == [False, True, False, False]
    finally:
        for slot, folder in machine._local.slots.values():
            machine._remove(slot, folder)
        machine._local.__dict__.clear()


@pytest.mark.parametrize("rest", [(), (b"one",), (b"one", b"two", b"three", b"four")])
def test_another_release_says_that_it_is_one(rest: tuple[bytes, ...]) -> None:
    (reason,) = machine.judge_here("0.0.0", *rest).values()
    assert reason == f"lab3-usd {tool_version()} is installed there, not 0.0.0"


def test_a_machine_without_the_submission_says_so(tmp_path: Path) -> None:
    shipment = pickle.dumps(packed(PoolSettings(starter(), None, Limits(), (tmp_path,))))
    task = encode(Task("jane", "jane", (Source(tmp_path / "jane"),)))
    try:
        answer = machine.judge_here(tool_version(), b"first", shipment, task)
    finally:
        for slot, folder in machine._local.slots.values():
            machine._remove(slot, folder)
        machine._local.__dict__.clear()
    assert answer == {FAULT: "jane: cannot be read (No such file or directory)"}


def test_a_rubric_and_a_starter_are_shipped_as_bytes(tmp_path: Path) -> None:
    rubric = tmp_path / "mine.yaml"
    rubric.write_text('title: T\nitems:\n  a: {title: A, checkpoint: "00", points: 1}\n')
    shipment = packed(PoolSettings(starter(), rubric, Limits(), (tmp_path,)))
    here = unpacked(shipment, tmp_path / "there")
    assert here.rubric is not None
    assert here.starter is not None
    assert here.rubric.read_bytes() == rubric.read_bytes()
    assert here.starter.read_bytes() == starter().read_bytes()
    assert here.starter != starter()


def starter_with_asset(folder: Path, reference: str) -> Path:
    """A starter in a folder of its own, which refers to an asset beside that folder."""
    (folder / "assets").mkdir()
    (folder / "mine").mkdir()
    (folder / "assets" / "room.usda").write_text(
        '#usda 1.0\n(\n    defaultPrim = "R"\n)\ndef "R" {}\n'
    )
    layer = Sdf.Layer.OpenAsAnonymous(str(starter()))
    layer.GetPrimAtPath("/World").referenceList.Prepend(Sdf.Reference(reference))
    path = folder / "mine" / "starter.usda"
    layer.Export(str(path))
    return path


def test_a_starter_reaches_other_machines_with_assets_outside_its_folder(tmp_path: Path) -> None:
    path = starter_with_asset(tmp_path, "../assets/room.usda")
    shipment = packed(PoolSettings(path, None, Limits()))
    names = [name for name, _ in shipment.files]
    assert names == ["starter/assets/room.usda", "starter/mine/starter.usda"]
    there = unpacked(shipment, tmp_path / "there").starter
    assert there is not None
    assert there.read_bytes() == path.read_bytes()
    assert len(files_of(there)) == 2


def test_a_starter_that_cannot_reach_them_whole_is_refused(tmp_path: Path) -> None:
    path = starter_with_asset(tmp_path, str(tmp_path / "assets" / "room.usda"))
    with pytest.raises(UsageError, match="other machines cannot follow"):
        packed(PoolSettings(path, None, Limits()))


def test_a_cluster_without_a_starter_is_an_error() -> None:
    with pytest.raises(Exception, match="needs a starter"):
        packed(PoolSettings(None, None, Limits()))


def test_a_platform_without_limits_sets_none(monkeypatch: pytest.MonkeyPatch) -> None:
    before = resource.getrlimit(resource.RLIMIT_AS)
    monkeypatch.setitem(sys.modules, "resource", None)
    assert not sandbox.limit_resources(Limits())
    assert resource.getrlimit(resource.RLIMIT_AS) == before


class Ended:
    """Stands for a process that has ended, on a platform that tells no more than its status."""

    pid = 2**22 + 1
    returncode = None
    status = 3

    def wait(self, timeout: float = 0) -> int:
        if self.status is None:
            raise subprocess.TimeoutExpired([], timeout)
        return self.status

    def poll(self) -> int:
        return self.status

    def kill(self) -> None:
        self.killed = True


@pytest.mark.parametrize("lacking", [(), ("wait4", "waitid", "killpg")])
@pytest.mark.parametrize(
    ("status", "how"),
    [
        (3, "ended the worker (exit status 3)"),
        (-15, "ended by SIGTERM"),
        (-6, "crashed usd-core (SIGABRT)"),
        (-999, "crashed usd-core (signal 999)"),
    ],
)
def test_how_it_ended_is_known_where_nothing_more_is(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    lacking: tuple[str, ...],
    status: int,
    how: str,
) -> None:
    for name in lacking:
        monkeypatch.delattr(os, name, raising=False)
    ended: Any = Ended()
    ended.status = status
    there = Worker(ended, tmp_path / "scratch", Limits())
    assert worker_process.how_it_ended(ended, 1, 2.0)[0] == how
    worker_process.end_worker(there)


def test_a_worker_that_cannot_even_be_killed_is_left_behind() -> None:
    hanging: Any = Ended()
    hanging.status = None
    scratch = make_scratch("lab3-grade-")
    worker = Worker(hanging, scratch, Limits())
    worker_process.end_worker(worker)
    assert worker.tasks.get_nowait() is None
    assert not scratch.exists()
