"""A complete submission has no fault; each single fault in it gives its finding and no other."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from pxr import Sdf, Usd
from report_examples import assert_valid
from sabotage import Fault as GraphFault
from sabotage import graph_faults
from submission_faults import ALL, Case, heavy, link
from submissions import (
    LAB,
    ROBOT,
    SPEC,
    STARTER,
    checked,
    copy,
    delete,
    edit,
    edit_stage,
    faults,
    notes,
    put,
    rename,
    said,
    stage_name,
    write_submission,
)

from lab3_usd.check.registry import rules_of
from lab3_usd.data import data_folder
from lab3_usd.deliverables import submission_files as listing
from lab3_usd.errors import StageError
from lab3_usd.model.finding import Report
from lab3_usd.model.folder import SubmissionSubject
from lab3_usd.pipeline.deliverables import map_findings
from lab3_usd.pipeline.folder import check_folder, is_submission
from lab3_usd.pipeline.stage import JudgeSettings
from lab3_usd.report.formats.json_report import report_json
from lab3_usd.stage.graph_signature import files_read

LAST = list(LAB.checkpoints)[-1]
SOME_GRAPH_FAULTS = list(graph_faults(LAB, LAB.checkpoints[LAST]))[7::150]


CONCLUDING = ("report.pdf", "video.txt")
SOME = ("00", "04", LAST)  # checkpoints


def leave(folder: Path, *numbers: str) -> None:
    """Leave the stages of some checkpoints of a submission in the middle of the lab."""
    for number in LAB.checkpoints:
        if number not in numbers:
            (folder / stage_name(number)).unlink()
    for name in CONCLUDING:
        (folder / name).unlink()


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A complete, correct submission."""
    return write_submission(tmp_path / "ana")


# -- the whole


def test_a_complete_submission_has_no_fault(folder: Path) -> None:
    result = checked(folder)
    assert faults(result) == []
    assert notes(result) == []
    assert [each.checkpoint for each in result.results] == list(LAB.checkpoints)
    assert {each.verdict for each in result.results} == {"pass"}
    assert all(each.score.earned == each.score.possible for each in result.results)


def test_what_the_cases_below_judge_once_is_judged_as_ever(folder: Path) -> None:
    leave(folder, "03", LAST)
    assert checked(folder) == check_folder(folder, JudgeSettings())
    edit_stage(folder / STARTER, heavy)
    edit("03", heavy)(folder)
    given = folder / STARTER
    assert checked(folder, starter=given) == check_folder(folder, JudgeSettings(starter=given))


@pytest.mark.parametrize("case", ALL, ids=lambda case: case.name)
def test_a_fault_gives_its_finding_and_no_other(folder: Path, case: Case) -> None:
    case.fault(folder)
    assert faults(checked(folder)) == sorted(case.said)


@pytest.mark.parametrize("fault", SOME_GRAPH_FAULTS, ids=lambda fault: fault.name)
def test_a_fault_of_a_graph_is_found_in_its_stage_alone(folder: Path, fault: GraphFault) -> None:
    edit(LAST, fault.break_it)(folder)
    found = said(checked(folder), "error")
    assert {each.split()[1].partition(":")[0] for each in found} == {LAST}
    assert any(each.partition(":")[2] in fault.sites for each in found)


def test_faults_cover_every_rule_about_the_submission_and_the_starter() -> None:
    rules = [*rules_of("submission", "X"), *rules_of("starter", "U")]
    covered = {site.split()[0] for case in ALL for site in case.said}
    elsewhere = {"X06", "X10", "X12"}
    assert {rule.id for rule in rules} - covered == elsewhere


def test_there_are_more_than_sixty_faults() -> None:
    assert len({case.name for case in ALL}) == len(ALL) > 60


def test_judging_leaves_the_folder_as_it_was(folder: Path) -> None:
    before = {path: path.stat().st_mtime_ns for path in folder.rglob("*")}
    checked(folder)
    assert {path: path.stat().st_mtime_ns for path in folder.rglob("*")} == before


def test_the_report_as_json_is_as_the_schema_says(folder: Path) -> None:
    delete(stage_name("03"))(folder)
    result = checked(folder)
    report = assert_valid(report_json(Report(result.results, (result.submission,))))
    (submission,) = report["submissions"]
    assert [each["rule"] for each in submission["findings"]] == ["X01", "M09"]
    assert len(submission["checklist"]) == len(SPEC.checklist)


def test_findings_about_files_name_the_file_to_open(folder: Path) -> None:
    put("maps/turtlebot3_map.yaml", "image: 1")(folder)
    found = [finding for finding in checked(folder).submission.findings if finding.rule == "M02"]
    assert [each.layer for each in found] == [str(folder / "maps" / "turtlebot3_map.yaml")]


# -- what is a submission


def test_a_folder_with_work_is_a_submission(tmp_path: Path) -> None:
    (tmp_path / "Work").mkdir()
    assert is_submission(tmp_path)


def test_a_folder_of_several_checkpoints_is_a_submission(tmp_path: Path) -> None:
    for number in ("01", "02"):
        (tmp_path / f"{LAB.checkpoints[number].file}.usda").touch()
    assert is_submission(tmp_path)


def test_a_folder_with_one_checkpoint_is_none(tmp_path: Path) -> None:
    (tmp_path / f"{LAB.checkpoints['01'].file}.usda").touch()
    (tmp_path / "scene.usda").touch()
    assert not is_submission(tmp_path)


def test_a_folder_that_does_not_exist_is_none(tmp_path: Path) -> None:
    assert not is_submission(tmp_path / "nowhere")


def test_a_bare_folder_of_stages_has_no_fault(folder: Path) -> None:
    result = checked(folder / "work")
    assert (faults(result), notes(result)) == ([], [])


def test_a_bare_folder_of_stages_that_is_handed_in_lacks_the_rest(folder: Path) -> None:
    result = checked(folder / "work", handed_in=True)
    assert faults(result) == []
    assert [note.split()[0] for note in notes(result)] == ["E01", "M10", *["X10"] * 5]


def test_in_the_middle_of_the_lab_nothing_is_missing(folder: Path) -> None:
    missing = tuple(number for number in LAB.checkpoints if number not in {"00", "02"})
    for number in missing:
        (folder / stage_name(number)).unlink()
    for name in ("maps", "results", "assets"):
        shutil.rmtree(folder / name)
    finished = checked(folder)
    for name in CONCLUDING:
        (folder / name).unlink()
    result = checked(folder)
    assert {finding.rule for finding in finished.submission.findings} >= {
        "X01",
        "X06",
        "X10",
        "E01",
    }
    assert (faults(result), notes(result)) == ([], [])
    assert result.submission.to_come == missing
    assert result.submission.checklist == checked(folder, handed_in=True).submission.checklist


@pytest.mark.parametrize("other", CONCLUDING)
def test_a_report_or_a_video_says_that_a_folder_is_handed_in(folder: Path, other: str) -> None:
    (folder / stage_name("08")).unlink()
    (folder / other).unlink()
    assert f"X01 {stage_name('08')}" in faults(checked(folder))


# -- stages


def test_binary_stages_are_as_good(folder: Path) -> None:
    for number in LAB.checkpoints:
        path = folder / stage_name(number)
        Sdf.Layer.FindOrOpen(str(path)).Export(str(path.with_suffix(".usd")))
        path.unlink()
    assert faults(checked(folder)) == []


def test_a_later_repair_is_no_fault(folder: Path) -> None:
    edit("03", lambda stage: stage.RemovePrim("/World/ROS_Clock"))(folder)
    assert faults(checked(folder)) == ["G01 03:/World/ROS_Clock", f"X08 {stage_name('03')}"]


def test_work_is_compared_across_a_missing_stage(folder: Path) -> None:
    delete(stage_name("04"))(folder)
    edit("05", lambda stage: stage.RemovePrim("/World/ROS_Clock"))(folder)
    assert f"X08 {stage_name('05')}" in faults(checked(folder))


def test_the_last_stages_may_be_the_same(folder: Path) -> None:
    for number in ("06", "07", "08"):
        copy(stage_name("05"), stage_name(number))(folder)
    assert faults(checked(folder)) == []


def test_a_copy_that_is_no_stage_of_the_lab_is_left_alone(folder: Path) -> None:
    copy(stage_name("03"), "work/Lab3_03_lidar_backup.usda")(folder)
    copy(stage_name("03"), "work/test.usda")(folder)
    assert faults(checked(folder)) == []


def test_the_stage_in_work_goes_before_one_elsewhere(folder: Path) -> None:
    copy(stage_name("01"), f"logs/{Path(stage_name('05')).name}")(folder)
    assert faults(checked(folder)) == []


@pytest.mark.parametrize(
    "second", ["work/Lab3_03_lidar (1).usda", "logs/Lab3_03_lidar.usda", "Lab3_3.usd"]
)
def test_a_second_file_of_a_checkpoint_is_named_with_the_one_that_is_judged(
    folder: Path, second: str
) -> None:
    copy(stage_name("03"), second)(folder)
    found = [finding for finding in checked(folder).submission.findings if finding.rule == "X05"]
    assert [(each.prim, each.severity, each.related) for each in found] == [
        (second, "note", (stage_name("03"),))
    ]


def test_a_misnamed_stage_is_judged_all_the_same(folder: Path) -> None:
    rename(stage_name("03"), "work/lidar_Lab3_03.usda")(folder)
    rename(stage_name("04"), "work/LAB3_4.usda")(folder)
    result = checked(folder)
    assert "04" in {each.checkpoint for each in result.results}
    assert "X02 work/LAB3_4.usda" in faults(result)


# -- starter


def test_without_a_starter_nothing_is_compared(folder: Path) -> None:
    delete("assets")(folder)
    edit(LAST, lambda stage: stage.RemovePrim("/Environment/Walls/East"))(folder)
    result = checked(folder)
    assert faults(result) == []
    assert notes(result) == [f"X06 {STARTER}"]


def test_the_supplied_starter_goes_before_the_submitted_one(folder: Path, tmp_path: Path) -> None:
    supplied = Path(shutil.copy(folder / STARTER, tmp_path))
    leave(folder, *SOME)
    for number in SOME:
        edit(number, lambda stage: stage.RemovePrim("/Environment/Walls/East"))(folder)
    edit_stage(folder / STARTER, lambda stage: stage.RemovePrim("/Environment/Walls/East"))
    assert faults(checked(folder)) == []
    walls = [f"U01 {number}:/Environment/Walls/East" for number in SOME]
    assert faults(checked(folder, starter=supplied)) == [*walls, f"X07 {STARTER}"]


def test_a_supplied_starter_that_cannot_be_opened_is_said(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "starter.usda").write_text("no stage")
    with pytest.raises(StageError, match=r"starter\.usda"):
        checked(folder, starter=tmp_path / "starter.usda")


def test_the_faults_of_the_supplied_starter_are_not_the_students(
    folder: Path, tmp_path: Path
) -> None:
    leave(folder, *SOME)
    for path in (folder / STARTER, *(folder / stage_name(number) for number in SOME)):
        edit_stage(path, heavy)
    supplied = Path(shutil.copy(folder / STARTER, tmp_path))
    assert faults(checked(folder)) == [f"S04 {number}:{ROBOT}/base_link" for number in SOME]
    result = checked(folder, starter=supplied)
    assert faults(result) == []
    assert all(each.score.earned == each.score.possible for each in result.results)


def test_another_value_than_the_supplied_starters_is_the_students(
    folder: Path, tmp_path: Path
) -> None:
    edit_stage(folder / STARTER, heavy)
    supplied = Path(shutil.copy(folder / STARTER, tmp_path))
    edit(LAST, lambda stage: mass_of(stage).Set(0.5))(folder)
    unlike = [f"U04 {number}:{ROBOT}/base_link" for number in LAB.checkpoints if number != LAST]
    found = faults(checked(folder, starter=supplied))
    assert found == [f"S04 {LAST}:{ROBOT}/base_link", *unlike]


def mass_of(stage: Usd.Stage) -> Usd.Attribute:
    return stage.GetPrimAtPath(f"{ROBOT}/base_link").GetAttribute("physics:mass")


# -- maps, saved output, other deliverables


def test_a_map_may_be_given_beside_the_submission(folder: Path, tmp_path: Path) -> None:
    shutil.copytree(data_folder("maps"), tmp_path / "supplied")
    delete("maps")(folder)
    assert faults(checked(folder, maps=tmp_path / "supplied")) == []


def test_a_map_is_not_handed_in_before_a_stage_needs_it(folder: Path) -> None:
    delete("maps")(folder)
    for number in list(LAB.checkpoints)[7:]:
        delete(stage_name(number))(folder)
    found = [
        finding for finding in checked(folder).submission.findings if finding.rule.startswith("M")
    ]
    assert [(each.rule, each.message) for each in found] == [
        ("M10", "map is not given, so not checked")
    ]


def test_the_walls_of_the_stage_are_compared_with_the_map(folder: Path) -> None:
    (found,) = [finding for finding in checked(folder).submission.findings if finding.rule == "M09"]
    assert found.severity == "note"
    assert found.actual == "1.000"


def test_a_folder_of_maps_in_capitals_is_found(folder: Path) -> None:
    rename("maps", "Maps")(folder)
    assert faults(checked(folder)) == []


def test_missing_output_is_a_note_unless_required(folder: Path) -> None:
    delete("results/topic_hz_scan.txt")(folder)
    assert faults(checked(folder)) == []
    assert notes(checked(folder)) == ["E01 results"]
    assert faults(checked(folder, require_evidence=True)) == ["E01 results"]


def test_output_may_lie_in_logs(folder: Path) -> None:
    rename("results", "logs/friday")(folder)
    assert notes(checked(folder)) == []


def test_output_of_later_parts_is_not_asked_for_yet(folder: Path) -> None:
    for number in list(LAB.checkpoints)[3:]:
        delete(stage_name(number))(folder)
    for path in (folder / "results").iterdir():
        if not path.name.startswith(("node_list", "topic_list", "topic_type_c", "topic_hz_c")):
            path.unlink()
    assert notes(checked(folder)) == ["E01 results"]
    put("results/topic_echo_clock.txt", "clock:\n  sec: 1\n  nanosec: 0\n---\n")(folder)
    assert notes(checked(folder)) == []


@pytest.mark.parametrize(
    ("gone", "handout"),
    [("report.pdf", "6.2"), ("images/00.png", "6.2"), ("video.txt", "6.3"), ("config", "6.4")],
)
def test_a_deliverable_that_is_not_there_is_a_note(folder: Path, gone: str, handout: str) -> None:
    delete(gone)(folder)
    result = checked(folder)
    assert faults(result) == []
    found = [finding for finding in result.submission.findings if finding.rule == "X10"]
    assert [each.handout for each in found] == [handout]


@pytest.mark.parametrize(
    "name",
    ["results/frames.pdf", "evidence/frames.pdf", "logs/frames_2026-11-20_10.10.10.pdf"],
)
def test_a_drawn_tree_is_no_report(folder: Path, name: str) -> None:
    delete("report.pdf")(folder)
    (folder / name).parent.mkdir(exist_ok=True)
    (folder / name).write_bytes(b"%PDF-1.7\n")
    found = listing.list_submission(folder, LAB, SPEC).deliverables
    assert found["report"] == ()
    assert (name in found["logs"]) is not name.startswith("evidence")


def test_a_report_among_the_results_is_no_log(folder: Path) -> None:
    delete("report.pdf")(folder)
    (folder / "results" / "Lab3_report.pdf").write_bytes(b"%PDF-1.7\n")
    found = listing.list_submission(folder, LAB, SPEC).deliverables
    assert found["report"] == ("results/Lab3_report.pdf",)
    assert "results/Lab3_report.pdf" not in found["logs"]


def test_a_text_without_a_link_to_a_video_does_not_count(folder: Path) -> None:
    put("video.txt", "see https://docs.ros.org/en/humble/ and youtube")(folder)
    assert notes(checked(folder)) == ["X10 ."]


def test_a_lone_stage_of_localization_gets_one_note() -> None:
    (note,) = map_findings(None, LAB)
    assert (note.rule, note.severity, note.prim) == ("M10", "note", "/")


def test_the_map_of_a_lone_stage_is_judged_at_the_stage(folder: Path) -> None:
    assert [*map_findings(folder / "maps", LAB)] == []
    put("maps/turtlebot3_map.yaml", "image: turtlebot3_map.pgm\n")(folder)
    found = [*map_findings(folder / "maps", LAB)]
    assert {(each.rule, each.prim) for each in found} == {("M06", "/"), ("M07", "/")}
    assert {each.layer for each in found} == {str(folder / "maps" / "turtlebot3_map.yaml")}


# -- hostile folders


def test_a_link_to_a_file_of_the_submission_is_followed(folder: Path) -> None:
    link(stage_name("06"), Path(stage_name("05")).name)(folder)
    assert faults(checked(folder)) == []


def test_a_link_to_a_folder_is_not_followed(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere" / "report.pdf").touch()
    delete("report.pdf")(folder)
    (folder / "papers").symlink_to(tmp_path / "elsewhere")
    result = checked(folder)
    assert faults(result) == ["X11 papers"]
    assert notes(result) == ["X10 ."]


def test_stages_behind_a_link_are_not_judged(folder: Path, tmp_path: Path) -> None:
    (folder / "work").rename(tmp_path / "work")
    (folder / "work").symlink_to(tmp_path / "work")
    result = checked(folder)
    assert result.results == ()
    assert "X11 work" in faults(result)


def test_a_ring_of_links_ends(folder: Path) -> None:
    (folder / "ring").symlink_to("ring")
    assert faults(checked(folder)) == ["X11 ring"]


def test_folders_nested_too_deep_are_not_entered(folder: Path) -> None:
    deep = folder.joinpath(*["deep"] * (listing.DEEPEST + 5))
    deep.mkdir(parents=True)
    assert faults(checked(folder)) == [f"X11 {'/'.join(['deep'] * (listing.DEEPEST + 1))}"]


def test_a_file_that_may_not_be_read_is_not_opened(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    real = listing.os.access
    secret = str(folder / "maps" / "turtlebot3_map.yaml")
    monkeypatch.setattr(listing.os, "access", lambda p, mode: str(p) != secret and real(p, mode))
    assert faults(checked(folder)) == ["X11 maps/turtlebot3_map.yaml"]


def test_hidden_files_are_left_out(folder: Path) -> None:
    (folder / ".git").mkdir()
    (folder / ".git" / "pipe").symlink_to("/dev/zero")
    (folder / "__MACOSX").mkdir()
    (folder / "__MACOSX" / "link").symlink_to("/dev/zero")
    assert faults(checked(folder)) == []


def test_of_too_many_files_the_first_are_looked_at(folder: Path) -> None:
    (folder / "build").mkdir()
    for number in range(100):
        (folder / "build" / f"{number}.o").touch()
    found = listing.list_submission(folder, LAB, SPEC, most=100)
    assert (len(found.entries), [*found.stages]) == (100, [*LAB.checkpoints])
    (rule,) = (each for each in rules_of("submission", "X") if each.id == "X12")
    (problem,) = rule.check(SubmissionSubject(LAB, SPEC, found, {}, {}))
    assert problem.message == "only the first 100 files were looked at"
    whole = listing.list_submission(folder, LAB, SPEC)
    assert [*rule.check(SubmissionSubject(LAB, SPEC, whole, {}, {}))] == []


def test_an_empty_folder_of_work_lacks_every_stage(tmp_path: Path) -> None:
    (tmp_path / "work").mkdir()
    result = checked(tmp_path, handed_in=True)
    assert result.results == ()
    missing = [f"X01 {stage_name(number)}" for number in LAB.checkpoints]
    assert faults(result) == ["M01 maps/turtlebot3_map.yaml", *missing]


def test_the_layers_of_a_stage_are_named_nowhere(folder: Path) -> None:
    stage = folder / stage_name("03")
    (folder / "work" / "parts").mkdir()
    stage.rename(folder / "work" / "parts" / "all.usda")
    root = Sdf.Layer.CreateNew(str(stage))
    root.subLayerPaths.append("parts/all.usda")
    root.Save()
    (folder / "work" / "notes.usda").write_text("#usda 1.0\n")
    assert [line for line in notes(checked(folder)) if line.startswith("X13")] == [
        "X13 work/notes.usda"
    ]


def test_what_is_known_to_be_a_layer_is_not_asked_for_its_own_layers(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    parts = folder / "work" / "parts"
    parts.mkdir()
    stage = folder / stage_name("03")
    stage.rename(parts / "0.usda")
    for number in range(1, 4):
        between = Sdf.Layer.CreateNew(str(parts / f"{number}.usda"))
        between.subLayerPaths.append(f"{number - 1}.usda")
        between.Save()
    root = Sdf.Layer.CreateNew(str(stage))
    root.subLayerPaths.append("parts/3.usda")
    root.Save()
    asked: list[Path] = []

    def asking(path: Path) -> tuple[str, ...]:
        asked.append(path)
        return files_read(path)

    monkeypatch.setattr("lab3_usd.stage.graph_signature.files_read", asking)
    checked(folder)
    assert asked
    assert [path for path in asked if path.parent == parts] == []
