"""The text of a layer after an edit: what changed, and that nothing else did."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from fixing import Outcome, has_errors, repaired, repaired_edit, second_faults
from fuzzed_edits import fault_of
from pxr import Sdf

from lab3_usd.errors import StageError
from lab3_usd.fix.source_tree import read_blocks
from lab3_usd.fix.text_editor import new_bytes, new_text
from lab3_usd.model.changes import (
    Activate,
    ApplySchema,
    ClearValue,
    Connect,
    Edit,
    MovePrim,
    RemovePrim,
    RenameProperty,
    Retarget,
    SetValue,
)
from lab3_usd.spec.load.loader import load_lab
from lab3_usd.stage.edit.repairs import apply_edit
from lab3_usd.stage.edit.session import EditSession
from lab3_usd.stage.read.opening import open_stage

Editing = Callable[..., str]


@pytest.fixture
def edited(tmp_path: Path) -> Editing:
    """What a text becomes by edits."""

    def edit(text: str, *edits: Edit) -> str:
        path = tmp_path / "stage.usda"
        path.write_bytes(f"#usda 1.0\n{text}".encode())
        session = EditSession(open_stage(path), load_lab().platform)
        try:
            for edit in edits:
                apply_edit(session, edit)
            ((_, found),) = session.edited.items()
            return new_bytes(found, path.read_bytes()).decode().removeprefix("#usda 1.0\n")
        finally:
            session.close()

    return edit


CASES: dict[str, tuple[str, Edit, str]] = {
    "a value is replaced": (
        'def "A"\n{\n  int  x=1 # why\n}\n',
        SetValue("/A", "x", "int", 2),
        'def "A"\n{\n  int  x=2 # why\n}\n',
    ),
    "a value is added before the metadata": (
        'def "A"\n{\n  int x ( # why\n    doc = "y"\n  )\n}\n',
        SetValue("/A", "x", "int", 2),
        'def "A"\n{\n  int x = 2 ( # why\n    doc = "y"\n  )\n}\n',
    ),
    "a property is renamed where it stands": (
        'def "A"\n{\n  int xx = 1 # int xx\n  int y\n  int xx.connect = </A.y>\n}\n',
        RenameProperty("/A", "xx", "inputs:x"),
        'def "A"\n{\n  int inputs:x = 1 # int xx\n  int y\n  int inputs:x.connect = </A.y>\n}\n',
    ),
    "where a statement goes, its comment stays in its place": (
        'def "A" (\n  active = false  # why\n)\n{\n}\n',
        Activate("/A"),
        'def "A" (\n  # why\n)\n{\n}\n',
    ),
    "a value is cleared, its comment stays": (
        'def "A"\n{\n  int x = 1 # why\n}\n',
        ClearValue("/A", "x"),
        'def "A"\n{\n  int x # why\n}\n',
    ),
    "a type is replaced": (
        'def "A"\n{\n  custom string x = "1" # why\n}\n',
        SetValue("/A", "x", "double", 2.5),
        'def "A"\n{\n  custom double x = 2.5 # why\n}\n',
    ),
    "a connection comes behind its attribute": (
        'def "A"\n{\n  int x = 1\n  int y = 1\n}\n',
        Connect("/A", "x", "int", ("/B.z",)),
        'def "A"\n{\n  int x = 1\n  prepend int x.connect = </B.z>\n  int y = 1\n}\n',
    ),
    "a connection is taken out with its line": (
        'def "A"\n{\n  int x = 1\n  int x.connect = </B.z>\n  int y = 1\n}\n',
        Connect("/A", "x", "int"),
        'def "A"\n{\n  int x = 1\n  int y = 1\n}\n',
    ),
    "targets are replaced": (
        'def "A"\n{\n  rel x = [</B>, </C>] # why\n}\n',
        Retarget("/A", "x", ("/D",)),
        'def "A"\n{\n  rel x = </D> # why\n}\n',
    ),
    "an item of a list is replaced, its comments stay": (
        'def "A"\n{\n  rel x = [\n    </B>, # b\n    </C>, # c\n  ]\n}\n',
        Retarget("/A", "x", ("/B", "/D")),
        'def "A"\n{\n  rel x = [\n    </B>, # b\n    </D>, # c\n  ]\n}\n',
    ),
    "an item of a list is added, its comments stay": (
        'def "A"\n{\n  rel x = [</B>, # b\n    </C> # c\n  ]\n}\n',
        Retarget("/A", "x", ("/B", "/C", "/D")),
        'def "A"\n{\n  rel x = [</B>, # b\n    </C>, </D> # c\n  ]\n}\n',
    ),
    "an item of a list is added before the others, their comments stay": (
        'def "A"\n{\n  rel x = [\n    # b\n    </B>,\n  ]\n}\n',
        Retarget("/A", "x", ("/D", "/B")),
        'def "A"\n{\n  rel x = [\n    # b\n    </D>, </B>,\n  ]\n}\n',
    ),
    "an item of a list is taken out, the comments of others stay": (
        'def "A"\n{\n  rel x = [\n    # all\n    </B>,\n    </C>, # c\n    </D> /* d */ ]\n}\n',
        Retarget("/A", "x", ("/C",)),
        'def "A"\n{\n  rel x = [\n    # all\n    </C>, # c\n     /* d */ ]\n}\n',
    ),
    "a new attribute comes last": (
        'def "A"\n{\n  int x = 1\n\n  def "B"\n  {\n  }\n}\n',
        SetValue("/A", "inputs:y", "int", 2),
        'def "A"\n{\n  int x = 1\n  custom int inputs:y = 2\n\n  def "B"\n  {\n  }\n}\n',
    ),
    "a statement among others on its line is replaced alone": (
        'def "A" { int x = 1 ; int y = 1 ; }\n',
        SetValue("/A", "x", "int", 2),
        'def "A" { int x = 2 ; int y = 1 ; }\n',
    ),
    "a schema is applied": (
        'def "A"\n{\n}\n',
        ApplySchema("/A", "PhysicsMassAPI"),
        'def "A" (\n    prepend apiSchemas = ["PhysicsMassAPI"]\n)\n{\n}\n',
    ),
    "a prim is activated": (
        'def "A" (\n  doc = "y"\n  active = false\n)\n{\n}\n',
        Activate("/A"),
        'def "A" (\n  doc = "y"\n)\n{\n}\n',
    ),
    "a prim is defined": ('over "A"\n{\n}\n', Activate("/A"), 'def "A"\n{\n}\n'),
    "a prim is removed with the line above": (
        'def "A"\n{\n}\n\ndef "B"\n{\n  int x\n}\n\ndef "C"\n{\n}\n',
        RemovePrim("/B"),
        'def "A"\n{\n}\n\ndef "C"\n{\n}\n',
    ),
    "a prim is renamed where it stands": (
        'def "A" # one\n{\n  int x.connect = </A/B.y> # </A/B.y>\n  def "B"\n  {\n  }\n}\n',
        MovePrim("/A/B", "/A/C"),
        'def "A" # one\n{\n  int x.connect = </A/C.y> # </A/B.y>\n  def "C"\n  {\n  }\n}\n',
    ),
    "line ends stay": (
        'def "A"\r\n{\r\n  int x\r\n}\r\n',
        Connect("/A", "x", "int", ("/B.z",)),
        'def "A"\r\n{\r\n  int x\r\n  prepend int x.connect = </B.z>\r\n}\r\n',
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_the_editor_changes_what_is_asked_and_nothing_else(case: str, edited: Editing) -> None:
    before, edit, after = CASES[case]
    assert edited(before, edit) == after


def test_a_moved_prim_takes_its_comments_along(edited: Editing) -> None:
    text = 'def "A"\n{\n    # about B\n    def "B"\n    {\n        int x = 1 # why\n    }\n}\n'
    assert edited(text, MovePrim("/A/B", "/B")).endswith('def "B"\n{\n    int x = 1 # why\n}\n')


def test_a_string_keeps_its_lines_when_its_prim_moves(edited: Editing) -> None:
    text = 'def "A"\n{\n    def "B"\n    {\n        string x = """a\n    b"""\n    }\n}\n'
    assert '    string x = """a\n    b"""' in edited(text, MovePrim("/A/B", "/B"))


def test_several_edits_of_one_line_do_not_collide(edited: Editing) -> None:
    text = 'def "A" { int x = 1 ; int y = 1 ; }\n'
    both = (SetValue("/A", "x", "int", 22), SetValue("/A", "y", "int", 33))
    assert edited(text, *both) == 'def "A" { int x = 22 ; int y = 33 ; }\n'


def test_a_text_that_would_say_something_else_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "stage.usda"
    path.write_text('#usda 1.0\ndef "A"\n{\n  int x = 1\n}\n')
    session = EditSession(open_stage(path), load_lab().platform)
    apply_edit(session, SetValue("/A", "x", "int", 2))
    monkeypatch.setattr(
        "lab3_usd.fix.text_editor.new_text", lambda *given: new_text(*given).replace("2", "3")
    )
    with pytest.raises(StageError, match="does not say what the repairs ask for"):
        new_bytes(session.edited[session.stage.GetRootLayer().identifier], path.read_bytes())


def test_blocks_have_their_places() -> None:
    text = '#usda 1.0\ndef "A" (active = true) { int x = 1; }\n'
    block = read_blocks(text)["/A"]
    (statement,) = block.statements
    assert text[slice(*block.meta or ())] == "active = true"
    assert text[slice(*statement.value or ())] == "1"


# More of all these: benchmarks/bench_fix.py.
def test_random_edits_of_random_layers_change_nothing_else(tmp_path: Path) -> None:
    found = [fault_of(seed, tmp_path) for seed in range(0, 100, 3)]
    assert [each for each in found if each] == []


KINDS = ("graph", "node", "value", "wire", "target", "scene")


@pytest.mark.parametrize("kind", KINDS)
def test_faults_of_the_second_author_are_repaired(kind: str, tmp_path: Path) -> None:
    faults = [fault for fault in second_faults("03") if fault.kind == kind]
    some = faults[len(faults) // 3 :: len(faults)]
    found = [repaired("03", each, tmp_path, load_lab()) for each in some]
    outcomes = [each for each in found if isinstance(each, Outcome)]
    assert outcomes
    assert [
        (outcome.fault.name, outcome.elsewhere, outcome.lost_comments)
        for outcome in outcomes
        if not outcome.passes or outcome.elsewhere or outcome.lost_comments
    ] == []


def test_edits_by_chance_are_repaired(tmp_path: Path) -> None:
    found = [repaired_edit(number, tmp_path, load_lab()) for number in (1, 3, 4, 5)]  # all errors
    assert [told for told, fixed in found if fixed is None or has_errors(fixed.after)] == []


def test_an_edit_leaves_the_open_layers_as_they_were(edited: Editing, tmp_path: Path) -> None:
    edited('def "A"\n{\n  int x = 1\n}\n', SetValue("/A", "x", "int", 2))
    layer = Sdf.Layer.FindOrOpen(str(tmp_path / "stage.usda"))
    assert layer.GetAttributeAtPath("/A.x").default == 1
