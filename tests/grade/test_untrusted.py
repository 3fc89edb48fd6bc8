"""One submission of a stranger: `lab3 grade --format gradescope`, and `lab3 check --untrusted`."""

from __future__ import annotations

import json
import re
import shutil
import zipfile
from collections.abc import Generator
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner, Result
from other_labs import LAB, MINI, copied, cut_wire, stage, starter, submission
from pxr import Usd
from workers_here import workers_here

from lab3_usd.cli import lab3
from lab3_usd.errors import UsageError
from lab3_usd.grade.rubric import load_rubric
from lab3_usd.grade.workers.worker_messages import TOOL_FAILED, Answer, Task

pytestmark = pytest.mark.usefixtures("equal_judged_once")

ALL = tuple(LAB.checkpoints)
POINTS = load_rubric(None, LAB).points


def run(*arguments: str | Path) -> Result:
    with workers_here():
        return CliRunner().invoke(lab3, [*map(str, arguments)])


def autograded(folder: Path, *options: str | Path) -> dict[str, Any]:
    """Return the results that Gradescope is given."""
    ran = run("grade", "--format", "gradescope", "--starter", starter(), folder, *options)
    assert ran.exit_code == 0, ran.output
    document = json.loads(ran.stdout)
    assert isinstance(document, dict)
    assert sum(test.get("max_score", 0) for test in document["tests"]) == POINTS
    return document


def checked(folder: Path) -> dict[str, Any]:
    """Return the report of a check that trusts nothing in a folder."""
    ran = run("check", "--untrusted", "--starter", starter(), "--format", "json", folder)
    document = json.loads(ran.stdout)
    assert isinstance(document, dict)
    return document


def rules(document: dict[str, Any]) -> set[str]:
    found = [*document["results"], *document["submissions"]]
    return {finding["rule"] for part in found for finding in part["findings"]}


def verdicts(document: dict[str, Any]) -> dict[str, str]:
    return {result["checkpoint"]: result["verdict"] for result in document["results"]}


def test_a_right_submission_has_all_points_of_the_rubric(tmp_path: Path) -> None:
    folder = submission(tmp_path / "ana")
    assert autograded(folder)["score"] == POINTS
    assert verdicts(checked(folder)) == dict.fromkeys(ALL, "pass")


def test_what_is_missing_gives_nothing(tmp_path: Path) -> None:
    assert 0 < autograded(submission(tmp_path / "ana", *ALL[:2]))["score"] < POINTS
    (tmp_path / "nothing").mkdir()
    assert autograded(tmp_path / "nothing")["score"] == 0


@pytest.mark.parametrize("where", ["absolute", "relative"])
def test_stages_that_refer_to_a_solution_elsewhere_get_nothing_of_it(
    where: str, tmp_path: Path
) -> None:
    solution = submission(tmp_path / "solution") / "work"
    for student in ("ana", "without"):
        folder = tmp_path / student / "work"
        folder.mkdir(parents=True)
        for number in ALL:
            name = stage(number).name
            path = f"{solution}/{name}" if where == "absolute" else f"../../solution/work/{name}"
            asset = path if student == "ana" else path.replace("solution", "nowhere")
            (folder / name).write_text(f"#usda 1.0\n(\n    subLayers = [@{asset}@]\n)\n")
    assert autograded(tmp_path / "ana")["score"] == autograded(tmp_path / "without")["score"]
    assert set(verdicts(checked(tmp_path / "ana")).values()) == {"fail"}


def with_configuration(folder: Path) -> None:
    lab = copied(folder / "lab")
    (lab / "checkpoints.yaml").unlink()
    (folder / "lab3.toml").write_text('lab = "lab"\nignore = ["W", "N", "X"]\n')


def with_notes_in_custom_data(folder: Path) -> None:
    for path in folder.rglob("*.usda"):
        opened = Usd.Stage.Open(str(path))
        for prim in opened.GetPseudoRoot().GetChildren():
            prim.SetCustomDataByKey("lab3:ignore", "W, N, G, P, X")
        opened.Save()


def with_notes_in_comments(folder: Path) -> None:
    for path in folder.rglob("*.usda"):
        lines = path.read_text().splitlines()
        head, rest = lines[:1], lines[1:]
        path.write_text("\n".join([*head, *(f"{line} # lab3: ignore[W]" for line in rest)]))


@pytest.mark.parametrize(
    "obey", [with_configuration, with_notes_in_custom_data, with_notes_in_comments]
)
def test_nothing_that_a_stranger_wrote_changes_the_judgement(obey: Any, tmp_path: Path) -> None:
    plain, sly = (submission(tmp_path / name, "01", "02") for name in ("plain", "sly"))
    for folder in (plain, sly):
        cut_wire(folder / "work" / stage("01").name)
    obey(sly)
    assert autograded(sly)["score"] == autograded(plain)["score"]
    assert verdicts(checked(sly)) == verdicts(checked(plain)) == {"01": "fail", "02": "pass"}
    assert "W01" in rules(checked(sly))


def test_the_folder_is_one_submission_whatever_lies_in_it(tmp_path: Path) -> None:
    submission(tmp_path / "submission" / "Lab3")
    submission(tmp_path / "submission" / "Backup", "00")
    document = autograded(tmp_path / "submission")
    assert document["score"] == POINTS
    assert re.search("left out.*Backup", json.dumps(document))


@pytest.mark.parametrize("inside", [False, True])
def test_an_archive_is_a_submission_too(*, inside: bool, tmp_path: Path) -> None:
    folder = submission(tmp_path / "made")
    place = tmp_path / "submission"
    place.mkdir()
    with zipfile.ZipFile(place / "Lab3.zip", "w") as packed:
        for path in folder.rglob("*.usda"):
            packed.write(path, path.relative_to(folder))
    given = place if inside else place / "Lab3.zip"
    assert autograded(given)["score"] == POINTS
    assert verdicts(checked(given)) == dict.fromkeys(ALL, "pass")


def test_a_submission_that_cannot_be_judged_has_no_points_and_a_reason(tmp_path: Path) -> None:
    (tmp_path / "Lab3.zip").write_bytes(b"PK\3\4 cut")
    document = autograded(tmp_path / "Lab3.zip")
    assert document["score"] == 0
    assert "damaged" in json.dumps(document)
    assert rules(checked(tmp_path / "Lab3.zip")) == {"Z01"}


def test_the_result_is_written_where_gradescope_looks(tmp_path: Path) -> None:
    folder, out = submission(tmp_path / "submission"), tmp_path / "results" / "results.json"
    out.parent.mkdir()
    ran = run(
        "grade", "--format", "gradescope", "--starter", starter(), folder, "--output", out
    )  # fmt: skip
    assert (ran.exit_code, ran.output) == (0, f"lab3: the report is in {out}\n")
    assert json.loads(out.read_text())["score"] == POINTS


def test_a_failure_of_the_program_is_no_grade(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    students: set[str] = set()

    def fail(tasks: list[Task], _settings: object) -> Generator[Answer]:
        for task in tasks:
            students.add(task.student)
            yield task, {"failed": f"{TOOL_FAILED}: ours"}

    folder, out = submission(tmp_path / "ana", "00"), tmp_path / "results.json"
    monkeypatch.setattr("lab3_usd.grade.class_run.run_tasks", fail)
    ran = run(
        "grade", "--format", "gradescope", "--starter", starter(), folder, "--output", out
    )  # fmt: skip
    assert (ran.exit_code, out.exists()) == (3, False)
    assert run("check", "--untrusted", "--starter", starter(), folder).exit_code == 3
    assert students == {"ana"}


def refused(*arguments: str | Path) -> str:
    ran = run(*arguments)
    error = ran.exception
    assert isinstance(error, UsageError) or ran.exit_code == 2
    return f"{error} {ran.output}"


def test_the_starter_is_required(tmp_path: Path) -> None:
    folder = submission(tmp_path / "ana", "00")
    (folder / "assets").mkdir()
    shutil.copyfile(starter(), folder / "assets" / "student_handout_turtlebot3_ros2_scene.usda")
    assert "--starter" in refused("check", "--untrusted", folder)
    assert "--starter" in refused("grade", "--format", "gradescope", folder)


@pytest.mark.parametrize(
    "option",
    [
        ("--checkpoint", "01"),
        ("--maps", MINI),
        ("--sim",),
        ("--native",),
        ("--watch",),
        ("--require-evidence",),
        ("--config", "lab3.toml"),
        ("--format", "html"),
    ],
)
def test_what_opens_or_obeys_files_of_strangers_is_refused(
    option: tuple[str | Path, ...], tmp_path: Path
) -> None:
    folder = submission(tmp_path / "ana", "00")
    said = refused("check", "--untrusted", "--starter", starter(), folder, *option)
    assert str(option[0]) in said


@pytest.mark.parametrize("option", [("--resume",), ("--force",), ("--merge-uploads",), ("-j", "2")])
def test_options_for_a_class_are_refused_for_one_submission(
    option: tuple[str, ...], tmp_path: Path
) -> None:
    folder = submission(tmp_path / "ana", "00")
    refused("grade", "--format", "gradescope", "--starter", starter(), folder, *option)


def test_a_single_stage_is_no_submission(tmp_path: Path) -> None:
    path = submission(tmp_path / "ana", "00") / "work" / stage("00").name
    assert "folder" in refused("check", "--untrusted", "--starter", starter(), path)


def test_a_result_is_not_written_into_what_is_graded(tmp_path: Path) -> None:
    folder = submission(tmp_path / "ana", "00")
    said = refused(
        "grade", "--format", "gradescope", "--starter", starter(), folder, "-o", folder / "r.json"
    )
    assert "choose another" in said


def test_files_go_by_where_they_lie_from_here(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    cut_wire(submission(tmp_path / "ana" / "Lab3", "01") / "work" / stage("01").name)
    monkeypatch.chdir(tmp_path)
    (result,) = checked(Path("ana"))["results"]
    assert result["path"] == f"ana/Lab3/work/{stage('01').name}"
    assert result["findings"][0]["layer"] == result["path"]
    monkeypatch.chdir(tmp_path / "ana" / "Lab3")
    (result,) = checked(Path())["results"]
    assert result["path"] == f"work/{stage('01').name}"
