"""What reaches the terminal: nothing of usd-core itself, and no name that a terminal obeys."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from in_process import invoke
from other_labs import stage
from pxr import Usd

from lab3_usd import check_stage, cli
from lab3_usd.errors import Lab3Error
from lab3_usd.stage.write.builder import build_checkpoint
from lab3_usd.stage.write.starter import build_starter

NAME = "Lab3_05_odometry_tf.usda"
# What usd-core begins its own lines with.
RAW = ("Warning: in ", "Error in ", "Coding Error", "Runtime Error", "Status: in ", "/pxr/")
BESIDE = {
    "sub.usda": '#usda 1.0\n(subLayers = [@./gone.usda@])\ndef Xform "A" {}\n',
    "torn.usda": '#usda 1.0\ndef Xform "A" { torn\n',
    "ring.usda": '#usda 1.0\n(defaultPrim = "A")\ndef Xform "A" (references = @./knot.usda@) {}\n',
    "knot.usda": '#usda 1.0\n(defaultPrim = "A")\ndef Xform "A" (references = @./ring.usda@) {}\n',
}
ODD = """
def Xform "Server" (references = @https://assets.example/x.usd@) {}
def Xform "Gone" (payload = @./gone.usd@</No>) {}
def Xform "Sub" (references = @./sub.usda@</Nope>) {}
def Xform "Torn" (references = @./torn.usda@) {}
def Xform "Ring" (references = @./ring.usda@) {}
def Xform "Nowhere" (references = </Nowhere/else>) {}
def Xform "Itself" (
    inherits = </Itself/x>
    specializes = </Itself>
)
{
    def "x" {}
}
def NoSuchType "Unknown" (
    prepend apiSchemas = ["NoSuchAPI", "PhysicsCollisionAPI", "PhysicsDriveAPI:angular"]
)
{
    rel material:binding = </Nowhere>
}
def Mesh "Mesh" (prepend apiSchemas = ["PhysicsCollisionAPI", "MaterialBindingAPI"])
{
    point3f[] points = [(0, 0, 0)]
    int[] faceVertexCounts = [3]
    int[] faceVertexIndices = [0, 1, 2]
    float3[] extent = [(1, 1, 1)]
    float xformOp:translate = 3
    uniform token[] xformOpOrder = [
        "xformOp:translate", "xformOp:translate", "!invert!xformOp:nope", "bogus"
    ]
}
def Cube "Flat" (prepend apiSchemas = ["PhysicsCollisionAPI"])
{
    token size = "big"
    double3 xformOp:scale = (0, 0, 0)
    uniform token[] xformOpOrder = ["xformOp:scale", "xformOp:nope"]
}
def Cube "Copy" (
    instanceable = true
    prepend references = </Flat>
)
{
    int[] xformOpOrder = [1]
}
def Xform "Clips" (
    variants = { string v = "nope" }
    prepend variantSets = "v"
    clips = {
        dictionary default = {
            asset manifestAssetPath = @./no_clip.usda@
            asset[] assetPaths = [@./no_clip.usda@]
            string primPath = "/A"
            double2[] active = [(0, 0)]
            double2[] times = [(0, 0)]
        }
    }
)
{
    double3 xformOp:translate.timeSamples = { 1: (0, 0, 0) }
    uniform token[] xformOpOrder = ["xformOp:translate"]
    variantSet "v" = { "a" {} }
}
def PhysicsRevoluteJoint "Joint"
{
    rel physics:body0 = [</X>, </Y>]
    uniform token physics:axis = "Q"
    quatf physics:localRot0 = (0, 0, 0, 0)
}
def Xform "Values"
{
    asset inputs:a = @./tex_<UDIM>.png@
    custom double x.connect = </Nope.y>
    token visibility = "bogus"
    matrix4d xformOp:transform = ((0, 0, 0, 0), (0, 0, 0, 0), (0, 0, 0, 0), (0, 0, 0, 0))
    uniform token[] xformOpOrder = ["!invert!xformOp:transform", "xformOp:transform"]
}
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A submission with an odd stage and an odd starter."""
    top = tmp_path_factory.mktemp("odd")
    work = top / "student" / "work"
    work.mkdir(parents=True)
    build_checkpoint(None, "05", work / NAME)
    build_starter(work / "starter.usda")
    for name in (NAME, "starter.usda"):
        with (work / name).open("a") as file:
            file.write(ODD)
    for name, text in BESIDE.items():
        (work / name).write_text(text)
    shutil.copytree(work, top / "starter")
    build_starter(top / "plain.usda")
    return top


COMMANDS = {
    "check": ["check", f"student/work/{NAME}"],
    "check as JSON": ["check", f"student/work/{NAME}", "--format", "json"],
    "check as HTML": ["check", f"student/work/{NAME}", "--format", "html"],
    "check the folder": ["check", "student"],
    "check with a starter": [
        *("check", f"student/work/{NAME}"),
        *("--starter", "starter/starter.usda"),
    ],
    "check with maps": [
        *("check", f"student/work/{NAME}", "--checkpoint", "07"),
        *("--maps", "student"),
    ],
    "tf": ["tf", f"student/work/{NAME}"],
    "topics": ["topics", f"student/work/{NAME}"],
    "draw": ["draw", f"student/work/{NAME}", "-o", "pictures"],
    "map": ["map", f"student/work/{NAME}", "-o", "map"],
    "build": ["build", "student/work/starter.usda", "--out", "built"],
    "grade": ["grade", "student", "--starter", "plain.usda", "-o", "book"],
    "grade with an odd starter": [
        *("grade", "student", "--starter", "starter/starter.usda"),
        *("-o", "odd book"),
    ],
}


@pytest.mark.usefixtures("forked_workers")
@pytest.mark.parametrize("arguments", COMMANDS.values(), ids=COMMANDS)
def test_no_command_lets_usd_core_speak(
    arguments: list[str],
    folder: Path,
    capfd: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(folder)
    try:
        text = invoke(*arguments).output
    except Lab3Error as error:
        text = str(error)
    said = "".join((text, *capfd.readouterr()))
    assert [raw for raw in RAW if raw in said] == []


def test_the_library_does_not_let_usd_core_speak(
    folder: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    check_stage(folder / "student" / "work" / NAME, "05")
    assert "".join(capfd.readouterr()) == ""


def test_usd_core_itself_speaks_of_the_odd_stage(
    folder: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """Without that, the other tests would show nothing."""
    copy = folder / "again.usda"
    shutil.copy(folder / "student" / "work" / NAME, copy)
    stage = Usd.Stage.Open(str(copy))
    assert stage.GetPrimAtPath("/Clips").GetAttribute("xformOp:translate").Get() is None
    assert "Warning: in " in capfd.readouterr().err


ESCAPE = "\x1b[31m"


@pytest.mark.parametrize(
    "words",
    [
        ("draw", "STAGE", "-o", "FOLDER"),
        ("build", "--only", "00", "-o", "FOLDER"),
        ("demo", "FOLDER"),
        ("nav2", "-o", "FOLDER"),
        ("lab", "schema", "--out", "FOLDER"),
        ("collect", "-o", f"{ESCAPE}collect.sh"),
        ("starter", "-o", f"{ESCAPE}starter.usda"),
    ],
)
def test_no_command_prints_what_a_terminal_obeys(
    words: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    shutil.copy(stage("01"), tmp_path / f"{ESCAPE}Lab3_01_ros_clock.usda")
    named = {"STAGE": f"{ESCAPE}Lab3_01_ros_clock.usda", "FOLDER": f"{ESCAPE}folder"}
    done = invoke(*(named.get(word, word) for word in words))
    assert done.exit_code == 0
    assert r"\x1b[31m" in done.output
    assert "\x1b" not in done.output


def test_an_error_that_names_a_file_shows_what_a_terminal_would_obey(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sys.argv", ["lab3", "lint", str(tmp_path / f"{ESCAPE}no.usda")])
    with pytest.raises(SystemExit):
        cli.main()
    assert r"\x1b[31mno.usda: there is no such" in capsys.readouterr().err


def test_a_system_without_threads_is_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fail(**_parameters: object) -> None:
        raise RuntimeError("can't start new thread")

    monkeypatch.setattr("lab3_usd.features.doctor.doctor.command.callback", fail)
    monkeypatch.setattr("sys.argv", ["lab3", "doctor"])
    with pytest.raises(SystemExit) as ended:
        cli.main()
    assert ended.value.code == 3
    assert "starts no more threads" in capsys.readouterr().err
