"""An existing gradebook: sums, another rubric, exports of platforms."""

from __future__ import annotations

import csv
import json
import shutil
from pathlib import Path

import pytest
import quick_yaml
from html_pages import read
from in_process import invoke
from msgspec import to_builtins
from msgspec.structs import replace
from other_labs import LAB, LAST, MINI, cut_wire, files_below, stage, starter, submission
from pxr import Gf, Sdf, Usd
from workers_here import graded_here

from lab3_usd.commands.shared import options
from lab3_usd.errors import SpecError, UsageError
from lab3_usd.grade.class_run import ClassSettings
from lab3_usd.grade.gradebook import HTML, read_gradebook
from lab3_usd.grade.regrade import regrade, student_in, sum_of
from lab3_usd.grade.scoring import Deduction

pytestmark = pytest.mark.usefixtures("equal_judged_once")


@pytest.fixture(scope="module")
def graded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A class of two with its gradebook: one whole, one with a wire cut in the clock."""
    folder = tmp_path_factory.mktemp("graded")
    submission(folder / "class" / "jane")
    cut_wire(submission(folder / "class" / "joe") / "work" / stage("01").name)
    graded_here(ClassSettings(folder / "class", starter(), folder / "book"))
    return folder


@pytest.fixture
def book(graded: Path, tmp_path: Path) -> Path:
    """A copy of the gradebook, beside a copy of the class."""
    shutil.copytree(graded, tmp_path, dirs_exist_ok=True)
    return tmp_path / "book"


def another(tmp_path: Path) -> Path:
    """The rubric with twice the points for the clock."""
    data = quick_yaml.load((MINI / "rubric.yaml").read_text(encoding="utf-8"))
    data["items"]["clock"]["points"] = 20
    path = tmp_path / "new.yaml"
    path.write_text(quick_yaml.dump(data), encoding="utf-8")
    return path


def test_a_misspelt_student_is_guessed(book: Path) -> None:
    of_class = read_gradebook(book)
    with pytest.raises(UsageError, match=r"no student is called 'janes'; did you mean jane\?"):
        student_in(of_class, "janes")
    with pytest.raises(
        UsageError, match=r"no student is called 'xavier'; give the number of grades.csv$"
    ):
        student_in(of_class, "xavier")


def test_the_sum_of_a_student_names_every_item_and_deduction(book: Path) -> None:
    of_class = read_gradebook(book)
    lines = list(sum_of(of_class, student_in(of_class, "joe")))
    assert lines[0] == "joe: graded, 98.17 of 100.00 points, 98.17 %"
    row = student_in(of_class, "joe")
    shown = [line for line in lines if line.startswith("    -")]
    assert len(shown) == len(row["lost"]) == 1
    assert "-1.83" in shown[0]
    assert f"(W01 work/{stage('01').name}:" in shown[0]
    assert lines[-1].split() == ["total", "98.17", "of", "100.00"]


def test_a_terminal_has_the_sum_folded(book: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = invoke("grade", "-o", book, "--explain", "joe").stdout
    monkeypatch.setattr(options, "terminal_width", lambda: 60)
    shown = invoke("grade", "-o", book, "--explain", "joe").stdout
    assert max(map(len, whole.splitlines())) > 60 >= max(map(len, shown.splitlines()))
    assert shown.split() == whole.split()


def test_a_student_who_is_not_there_is_named(book: Path) -> None:
    with pytest.raises(UsageError, match="no student is called 'nobody'"):
        student_in(read_gradebook(book), "nobody")


def test_another_rubric_needs_no_submission_and_says_who_changed(
    book: Path, tmp_path: Path
) -> None:
    (tmp_path / "class").rename(tmp_path / "gone")
    regraded = regrade(book, another(tmp_path), LAB)
    assert [each.text for each in regraded.changed] == [
        "jane: 100.00 of 100 -> 110.00 of 110 (+10.00)",
        "joe: 98.17 of 100 -> 106.33 of 110 (+8.16)",
    ]
    row = student_in(read_gradebook(book), "joe")
    assert (row["earned"], row["possible"]) == (106.33, 110.0)
    with (book / "grades.csv").open(newline="") as file:
        assert [line["earned"] for line in csv.DictReader(file)] == ["110.00", "106.33"]
    page = read((book / "students" / "joe" / HTML).read_text(encoding="utf-8"))
    assert "106.33 of 110" in page.one("header", "hero").text
    assert page.one("title").text == "joe: 106.33 of 110 points"
    assert "execIn" in page.text
    scored = json.loads((book / "students" / "joe" / "results.json").read_text())
    assert scored["score"] == 106.33


def test_the_same_rubric_changes_nobody_and_nothing(book: Path) -> None:
    page = (book / "students" / "joe" / HTML).read_bytes()
    assert regrade(book, MINI / "rubric.yaml", LAB).changed == ()
    assert (book / "students" / "joe" / HTML).read_bytes() == page


def test_after_another_rubric_the_class_is_judged_again_by_it(book: Path, tmp_path: Path) -> None:
    regrade(book, another(tmp_path), LAB)
    rows = graded_here(ClassSettings(tmp_path / "class", starter(), book, resume=True))
    assert [row["earned"] for row in rows] == [110.0, 106.33]


def test_a_gradebook_stays_with_the_rubric_that_made_it(graded: Path, tmp_path: Path) -> None:
    rubric, out = another(tmp_path), tmp_path / "by mine"
    settings = ClassSettings(graded / "class", starter(), out, rubric=rubric)
    list(graded_here(settings))
    assert (out / "rubric.yaml").read_bytes() == rubric.read_bytes()
    rubric.unlink()
    before = files_below(out)
    assert regrade(out, None, LAB).changed == ()
    graded_here(replace(settings, rubric=None, resume=True))
    assert files_below(out) == before


def test_of_the_own_rubric_of_the_lab_no_copy_is_kept(book: Path) -> None:
    assert regrade(book, None, LAB).changed == ()
    assert not (book / "rubric.yaml").exists()


def test_a_copy_that_somebody_broke_is_refused_before_anything_is_written(
    book: Path, tmp_path: Path
) -> None:
    (book / "rubric.yaml").write_text("items: {}\ntitle: mine\n")
    before = files_below(book)
    with pytest.raises(SpecError, match="'items' is empty"):
        regrade(book, None, LAB)
    with pytest.raises(SpecError, match="'items' is empty"):
        graded_here(ClassSettings(tmp_path / "class", starter(), book, resume=True))
    assert files_below(book) == before


def test_a_sum_is_only_read(book: Path, tmp_path: Path) -> None:
    before = files_below(book)
    for counted in (["--regrade", book], [tmp_path / "class", "--starter", starter(), "-o", book]):
        with pytest.raises(UsageError, match="--explain only reads a gradebook"):
            invoke("grade", *counted, "--explain", "joe")
    assert files_below(book) == before


def test_a_result_without_what_was_found_is_refused(book: Path, tmp_path: Path) -> None:
    path = book / "students" / "joe" / "result.json"
    row = json.loads(path.read_text())
    del row["facts"]
    path.write_text(json.dumps(row))
    with pytest.raises(UsageError, match="joe does not say what was found"):
        regrade(book, another(tmp_path), LAB)


EXPORT = (
    "Student,ID,SIS Login ID,Section,Mini (77)\n    Points Possible,,,,100\n"
    '"Roe, Joe",5,JOE,A,88.00\n"Doe, Jane",6,jane,A,\n"Fox, Al",7,al,A,12.00\n'
)


def lab3(*arguments: object) -> tuple[int, str]:
    result = invoke("grade", *arguments)
    return result.exit_code, result.stdout


def test_an_export_is_filled_in_shown_and_recorded(book: Path, tmp_path: Path) -> None:
    roster = tmp_path / "export.csv"
    roster.write_text(EXPORT)
    before = read_gradebook(book)
    code, shown = lab3("-o", book, "--gradebook", "canvas", "--roster", roster)
    assert (code, shown.splitlines()[0]) == (0, str(book / "canvas.csv"))
    assert (book / "canvas.csv").read_text() == EXPORT.replace("88.00", "98.17").replace(
        "jane,A,", "jane,A,100.00"
    )
    assert "    1 changed:\n        Roe, Joe (5)  88.00 -> 98.17  joe\n" in shown
    after = read_gradebook(book)
    record = after.pop("exports")["canvas"]
    assert after == before
    assert [decision["outcome"] for decision in record.pop("decisions")] == [
        "changed", "filled", "without a submission",
    ]  # fmt: skip
    assert record == {"export": "export.csv", "column": "Mini (77)", "maximum": 100.0}
    regraded = regrade(book, MINI / "rubric.yaml", LAB)
    assert (regraded.changed, "exports" in read_gradebook(book)) == ((), False)


def test_a_dry_run_shows_the_same_table_and_writes_nothing(book: Path, tmp_path: Path) -> None:
    roster = tmp_path / "export.csv"
    roster.write_text(EXPORT)
    options = ["-o", book, "--gradebook", "canvas", "--roster", roster]
    before = files_below(book)
    code, dry = lab3(*options, "--preview")
    assert (code, files_below(book)) == (0, before)
    _, wet = lab3(*options)
    assert dry.splitlines()[0] == f"{book / 'canvas.csv'}: not written (--preview)"
    assert dry.splitlines()[1:] == wet.splitlines()[1:]


def test_an_export_with_points_of_before_is_named_unless_it_is_filled_in_again(
    book: Path, tmp_path: Path
) -> None:
    roster = tmp_path / "export.csv"
    roster.write_text(EXPORT)
    filled = ["--gradebook", "canvas", "--roster", roster]
    (tmp_path / "hand.csv").write_text("student,item,points,text\njane,drive,-1,wall\n")
    (tmp_path / "none.csv").write_text("student,item,points,text\n")
    invoke("grade", "-o", book, *filled, "--feedback")
    told = [
        invoke("grade", "--regrade", book, "--adjust", tmp_path / table, *more).stderr.splitlines()
        for table, more in (("hand.csv", []), ("hand.csv", []), ("none.csv", filled))
    ]
    old = "has the points of before; fill it in again with --gradebook canvas"
    of_feedback = [
        f"lab3: {book / name}: {old} --feedback"
        for name in ("canvas-rubric.csv", "canvas-feedback.zip")
    ]
    assert told[0] == [f"lab3: {book / 'canvas.csv'}: {old}", *of_feedback]
    assert told[1] == []
    assert told[2][-2:] == of_feedback
    assert f"lab3: {book / 'canvas.csv'}: {old}" not in told[2]


def test_the_filled_export_is_never_written_over_the_export(book: Path) -> None:
    (book / "canvas.csv").write_text(EXPORT)
    with pytest.raises(UsageError, match="is read by this command"):
        invoke("grade", "-o", book, "--gradebook", "canvas", "--roster", book / "canvas.csv")
    assert (book / "canvas.csv").read_text() == EXPORT


def test_a_class_is_graded_again_beside_the_filled_export(book: Path, tmp_path: Path) -> None:
    roster = tmp_path / "export.csv"
    roster.write_text(EXPORT)
    lab3("-o", book, "--gradebook", "canvas", "--roster", roster)
    rows = graded_here(ClassSettings(tmp_path / "class", starter(), book, resume=True))
    assert [row["earned"] for row in rows] == [100.0, 98.17]


def test_a_folder_without_a_gradebook_is_refused(tmp_path: Path) -> None:
    (tmp_path / "grades.json").write_text('{"students": [1], "items": []}')
    with pytest.raises(UsageError, match="contains no readable gradebook"):
        read_gradebook(tmp_path)


def renamed(path: Path) -> None:
    """Name a node otherwise, move it in the editor, and write a comment."""
    stage = Usd.Stage.Open(str(path))
    clock = LAB.graphs["ROS_Clock"].path
    editor = Usd.NamespaceEditor(stage)
    editor.MovePrimAtPath(f"{clock}/ros2_context", f"{clock}/mine")
    editor.ApplyEdits()
    node = stage.GetPrimAtPath(f"{clock}/mine")
    node.GetAttribute("ui:nodegraph:node:pos").Set(Gf.Vec2f(7, 8))
    stage.GetRootLayer().comment = "my own work"
    stage.Save()


def in_layers(path: Path, topic: str) -> None:
    """Move a stage into a layer, below a root layer that says nothing of its own."""
    layers = path.parent / "layers"
    layers.mkdir(exist_ok=True)
    path.rename(layers / path.name)
    values = Sdf.Layer.CreateNew(str(layers / f"values_{path.name}"))
    node = Sdf.CreatePrimInLayer(values, f"{LAB.graphs['ROS_Clock'].path}/ros2_publish_clock")
    Sdf.AttributeSpec(node, "inputs:topicName", Sdf.ValueTypeNames.String).default = topic
    values.Save()
    root = Sdf.Layer.CreateNew(str(path))
    root.subLayerPaths[:] = [f"layers/values_{path.name}", f"layers/{path.name}"]
    root.Save()


def test_the_same_root_layer_over_other_layers_is_not_the_same_work(tmp_path: Path) -> None:
    place = tmp_path / "class"
    for student in ("ann", "bob"):
        in_layers(submission(place / student) / "work" / stage(LAST).name, f"/{student}")
    list(graded_here(ClassSettings(place, starter(), tmp_path / "book")))
    found = read_gradebook(tmp_path / "book")["alike"]
    assert all(LAST not in group["checkpoints"] for group in found)
    assert {group["what"] for group in found} == {"the same files"}


def test_the_same_work_is_listed_and_not_judged(tmp_path: Path) -> None:
    place = tmp_path / "class"
    for student in ("ann", "bob", "cem"):
        submission(place / student)
    other = cut_wire(submission(place / "dan") / "work" / stage(LAST).name)
    assert other.is_file()
    for path in (place / "cem" / "work").iterdir():
        if path.name != stage("00").name:
            renamed(path)
    rows = list(graded_here(ClassSettings(place, starter(), tmp_path / "book")))
    assert {row["earned"] for row in rows[:3]} == {100.0}
    stages = [number for number in LAB.checkpoints if number != "00"]
    assert read_gradebook(tmp_path / "book")["alike"] == [
        {"students": ["ann", "bob"], "what": "the same files", "checkpoints": [LAST]},
        {
            "students": ["ann", "bob", "cem"],
            "what": "the same graphs, except names",
            "checkpoints": [],
        },
        {"students": ["ann", "bob", "dan"], "what": "the same files", "checkpoints": stages[:-1]},
    ]
    page = read((tmp_path / "book" / "index.html").read_text(encoding="utf-8"))
    assert "ann, bob, cem: the same graphs, except names" in page.text


def test_the_sum_says_once_what_was_carried_over(book: Path) -> None:
    of_class = read_gradebook(book)
    row = student_in(of_class, "joe")
    again = Deduction("clock", "", "carried over: A: b", 0.5, "W01", "a.usda", "b", "The clock")
    lines = list(sum_of(of_class, {**row, "lost": [to_builtins(again), to_builtins(again)]}))
    assert lines[-3:] == ["", "carried over into 1 item: -1.00", "    The clock: b (W01)"]
