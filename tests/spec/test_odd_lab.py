"""A lab that shares nothing with the bundled one: every command takes it and speaks of it."""

from __future__ import annotations

import csv
import json
import re
import runpy
import shutil
from pathlib import Path

import in_process
import pytest
from click.testing import Result
from in_process import invoke
from places import TESTS
from pxr import Sdf, Usd
from workers_here import workers_here

from lab3_usd.data import LAB_VARIABLE
from lab3_usd.errors import Lab3Error
from lab3_usd.spec.load.loader import load_lab

LAB = TESTS / "labs" / "rig"
IDS = ["s", "W9", "W10", "007", "7", "rear", "A", "B", "C", "D", "E", "final"]
LAST = "hand in.final.usda"
RIG = "/Yard/Rig/post"
# What only the bundled lab has.
FOREIGN = re.compile(
    r"Lab ?3[_ ]\w|[Tt]urtle[Bb]ot|\bnine\b|base_footprint|/scan_|\b[A-J]\d\b|RAS545"
)


def run(*arguments: object) -> Result:
    return invoke("--lab", LAB, *arguments)


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("rig") / "scenes"
    assert run("build", "--out", out).exit_code == 0
    return out


@pytest.fixture
def broken(built: Path, tmp_path: Path) -> Path:
    """All stages with five early mistakes, as far as a stage has what they are made in."""
    folder = tmp_path / "mine" / "scenes"
    shutil.copytree(built, folder)
    for path in folder.iterdir():
        stage = Usd.Stage.Open(str(path))
        for site, value in {
            f"{RIG}.physics:mass": 2.0,
            "/Yard/Clock/context.inputs:domain_id": 3,
            f"{RIG}/Front.omni:sensor:tickRate": 5.0,
            f"{RIG}/Rear.xformOp:translate": (0.0, 0.0, 0.0),
        }.items():
            if prim := stage.GetPrimAtPath(Sdf.Path(site).GetPrimPath()):
                prim.GetAttribute(Sdf.Path(site).name).Set(value)
        if stage.GetPrimAtPath(f"{RIG}/Rear/Scan/once"):
            stage.RemovePrim(f"{RIG}/Rear/Scan/once")
        stage.GetRootLayer().Save()
    return folder.parent


def test_its_stages_have_its_names_and_pass(built: Path) -> None:
    files = load_lab(LAB).files
    assert sorted(path.stem for path in built.iterdir()) == sorted(files.values())
    found = json.loads(run("check", "--format", "json", built).stdout)
    assert [each["checkpoint"] for each in found["results"]] == IDS
    assert {each["verdict"] for each in found["results"]} == {"pass"}
    assert {f["rule"] for each in found["results"] for f in each["findings"]} == set()


@pytest.mark.parametrize(
    ("given", "built"), [("7", "front again.7"), ("007", "front.007"), ("07", "front.007")]
)
def test_an_id_that_is_there_is_taken_before_one_of_the_same_number(
    given: str, built: str, tmp_path: Path
) -> None:
    assert run("build", "--only", given, "-o", tmp_path).exit_code == 0
    assert [path.stem for path in tmp_path.iterdir()] == [built]


def test_single_faults_are_found_at_their_place(
    repository: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(LAB_VARIABLE, str(LAB))
    sweep = runpy.run_path(str(repository / "benchmarks" / "sweep.py"))["sweep"]
    outcomes = [*sweep("s", 3), *sweep("rear", 7, 1)]
    assert len(outcomes) > 30
    assert [outcome.fault.name for outcome in outcomes if not outcome.at_place] == []
    assert sum(len(outcome.errors) for outcome in outcomes) <= len(outcomes)


COMMANDS = [  # with the exit code
    (["tf", LAST], 0),
    (["topics", LAST], 0),
    (["sim", LAST], 0),
    (["draw", LAST, "-o", "pictures"], 0),
    (["diff", "front.007.usda", LAST], 1),
    (["fix", LAST, "-o", "fixed.usda"], 0),
    (["lint", LAST], 0),
    (["check", LAST, "--format", "html"], 0),
    (["check", LAST, "--format", "sarif"], 0),
    (["check", LAST, "--starter", "yard.usda"], 0),
    (["lab", "check"], 1),
    (["lab", "new", "described", "--from", LAST], 0),  # which plays it as well
    (["collect", "-o", "collect.sh"], 0),
    (["rules"], 0),
    (["config"], 0),
    (["build", "yard.usda", "-o", "again"], 0),
    (["build", "-o", "again", "--only", "00"], 2),
    (["map", LAST, "-o", "map"], 2),
    (["nav2", "-o", "nav2"], 2),
    (["check", "x.usda"], 2),
    (["--help"], 0),
    *(([name, "--help"], 0) for name in ("build", "check", "collect", "nav2", "starter", "grade")),
]


def test_every_command_takes_it_and_names_nothing_of_another_lab(
    built: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, subtests: pytest.Subtests
) -> None:
    for path in built.iterdir():
        shutil.copyfile(path, tmp_path / path.name)
    shutil.copyfile(built / LAST, tmp_path / "x.usda")
    monkeypatch.chdir(tmp_path)
    assert run("starter", "-o", "yard.usda").exit_code == 0
    for arguments, code in COMMANDS:
        with subtests.test(command=arguments[0]):
            done = in_process.lab3("--lab", LAB, *arguments)
            text = done.stdout + done.stderr
            assert (arguments, done.returncode) == (arguments, code), text
            said = re.sub(r"<style>.*?</style>", "", text, flags=re.DOTALL)
            assert (arguments, FOREIGN.findall(said)) == (arguments, [])
    assert "final, pass" in run("--lab", "described", "check", "--checkpoint", "final", LAST).output


def test_what_a_lab_lacks_is_said_in_one_line(
    built: Path, tmp_path: Path, subtests: pytest.Subtests
) -> None:
    shutil.copytree(LAB, tmp_path / "lab")
    (tmp_path / "lab" / "starter.yaml").unlink()
    (tmp_path / "lab" / "rubric.yaml").unlink()
    for arguments in (["build", "-o", tmp_path / "out"], ["starter", "-o", tmp_path / "a.usda"]):
        with (
            subtests.test(command=arguments[0]),
            pytest.raises(
                Lab3Error, match=r"has no starter\.yaml: pass your own starter scene to lab3 build"
            ),
        ):
            run("--lab", tmp_path / "lab", *arguments)
    arguments = ["grade", built, "--starter", built / "empty yard.s.usda", "-o", tmp_path / "book"]
    with pytest.raises(Lab3Error, match=r"^Scanning a yard has no rubric\.yaml; name a rubric"):
        run("--lab", tmp_path / "lab", *arguments)
    assert run("--lab", tmp_path / "lab", "check", built).exit_code == 0


def test_stages_are_built_with_the_ending_that_the_lab_asks_for(tmp_path: Path) -> None:
    shutil.copytree(LAB, tmp_path / "lab")
    path = tmp_path / "lab" / "submission.yaml"
    path.write_text(
        path.read_text().replace(
            "endings: [.usda], openable: [.usd,", "endings: [.usd], openable: ["
        )
    )
    built = run("--lab", tmp_path / "lab", "build", "-o", tmp_path / "out").stdout.splitlines()
    assert {Path(each).suffix for each in built} == {".usd"}
    assert run("--lab", tmp_path / "lab", "check", tmp_path / "out").exit_code == 0


def test_the_hints_name_what_the_panel_shows(broken: Path) -> None:
    found = json.loads(run("check", "--format", "json", broken / "scenes" / LAST).stdout)
    hints = {f["rule"] + f["prim"]: f["hint"] for f in found["results"][0]["findings"]}
    assert hints[f"L04{RIG}/Rear"] == (
        "select Rear and set Translate to (-10, 150, 0) in the Property panel"
    )
    assert hints[f"N01{RIG}/Rear/Scan"] == (
        f"add Isaac Run One Simulation Frame to {RIG}/Rear/Scan and connect tick.tick -> execIn, "
        "step -> product.execIn"
    )


def test_five_early_mistakes_in_twelve_stages_are_five_faults(broken: Path) -> None:
    said = run("check", broken).output
    places = re.findall(r"(?ms)^error (\w+) .*?\(((?:since|in) [^;)]*)", said)
    faults = [(rule, " ".join(place.split())) for rule, place in places]
    assert faults == [
        ("S04", "since s, also in W9 to final"),
        ("P01", "since W9, also in W10 to final"),
        ("L05", "since 007, also in 7 to final"),
        ("L04", "since rear, also in A to final"),
        ("N01", "since rear, also in A to final"),
    ]
    assert said.index("Repair these first") < said.index("\nerror")


def test_flat_files_of_canvas_are_graded(built: Path, tmp_path: Path) -> None:
    files = tmp_path / "files"
    files.mkdir()
    for number, path in enumerate(sorted(built.iterdir())):
        shutil.copyfile(path, files / f"doejane_111_{number}_{path.name}")
        if path.name != "look.W10.usda":
            shutil.copyfile(path, files / f"leekim_LATE_222_{number}_{path.name}")
    assert run("starter", "-o", tmp_path / "yard.usda").exit_code == 0
    book = tmp_path / "book"
    with workers_here():
        result = run("grade", files, "--starter", tmp_path / "yard.usda", "-o", book)
    assert result.exit_code == 0, result.output
    rows = list(csv.DictReader((book / "grades.csv").read_text().splitlines()))
    assert [(row["name"], row["earned"], row["look"]) for row in rows] == [
        ("doejane", "22.00", "3.00"),
        ("leekim", "19.00", "0.00"),
    ]
    page = (book / "index.html").read_text()
    assert "Yard" in page
    assert not re.search("TurtleBot|Lab 3|Lab3_", page)


@pytest.mark.parametrize(
    ("count", "said"),
    [
        (5, ""),
        (4, "the handout has no section Ex 3.5 (checkpoints.yaml: handout: sections)"),
        (6, "checkpoints.yaml: handout: sections: Ex 3: no item names section Ex 3.6"),
    ],
)
def test_sections_of_any_form_are_compared(count: int, said: str, tmp_path: Path) -> None:
    folder = tmp_path / "lab"
    shutil.copytree(LAB, folder)
    sections = f'handout: {{sections: {{"Ex 2": 3, "Ex 3": {count}}}}}\n'
    path = folder / "checkpoints.yaml"
    path.write_text(path.read_text() + sections)
    found = run("--lab", folder, "lab", "check").output
    assert found.count("section Ex") == bool(said)
    assert said in found
