"""Stages that are read one after the other are read as if each were alone."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from grade_files import CLOCK, LAB, starter
from msgspec.structs import asdict
from pxr import Usd
from sabotage import graph_faults
from scene_changes import Change
from scene_sabotage import scene_sabotage
from sensor_sabotage import sensor_sabotage

from lab3_usd.check.model import StageModel
from lab3_usd.stage.builder import build_checkpoint
from lab3_usd.stage.compare import compare_starter
from lab3_usd.stage.opening import memory, open_stage
from lab3_usd.stage.own_text import own_texts
from lab3_usd.stage.reader import read_model, read_stage

LAST = LAB.checkpoints["05"]
FAULTS: dict[str, Change] = {
    **{each.name: each.apply for each in (*scene_sabotage(), *sensor_sabotage())},
    **{each.name: each.break_it for each in [*graph_faults(LAB, LAST)][::9]},
}


@pytest.fixture
def remembering() -> Iterator[None]:
    """Let stages be remembered as while a submission is judged."""
    token = memory.set({})
    yield
    memory.reset(token)


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build_checkpoint(None, "05", tmp_path_factory.mktemp("built") / "Lab3_05.usda")


@pytest.fixture(scope="module")
def original() -> Usd.Stage:
    return open_stage(starter())


def alone(path: Path) -> StageModel:
    token = memory.set(None)
    model = read_stage(path, LAB)
    memory.reset(token)
    return model


def parts(model: StageModel) -> dict[str, Any]:
    return {**asdict(model), "path": "", "prims": dict(model.prims), "order": [*model.prims]}


def written(path: Path, text: str) -> Path:
    path.write_text(f"#usda 1.0\n\n{text}")
    return path


@pytest.mark.usefixtures("remembering")
@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_is_seen_between_clean_stages(
    name: str, built: Path, original: Usd.Stage, tmp_path: Path
) -> None:
    faulty = tmp_path / "faulty.usda"
    stage = Usd.Stage.Open(str(built))
    FAULTS[name](stage)
    stage.GetRootLayer().Export(str(faulty))
    stage.GetRootLayer().Reload()
    kept = [open_stage(path) for path in (built, faulty, built)]
    for path, each in zip((built, faulty, built), kept, strict=True):
        assert parts(read_model(each, LAB, "")) == parts(alone(path))
    found = compare_starter(original, kept[1], LAB, "05").changes
    token = memory.set(None)
    expected = compare_starter(original, open_stage(faulty), LAB, "05").changes
    memory.reset(token)
    assert found == expected


ROOT = """def Xform "World"
{
    double3 xformOp:translate = (0, 0, 1)
    uniform token[] xformOpOrder = ["xformOp:translate"]

    def Xform "arm"
    {
        double3 xformOp:translate = (1, 0, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]

        def Xform "hand" (
            prepend apiSchemas = ["PhysicsRigidBodyAPI"]
        )
        {
            double physics:mass = 2
        }
    }

    def Xform "other"
    {
    }
}
"""
OTHER = """    def Xform "other"
    {
    }
"""
MASS = "mass = 2"
LATER = "    double physics:mass = 7\n"
VARIANT = """"arm" (
        variants = {
            string v = "a"
        }
        prepend variantSets = "v"
    )
    {
        variantSet "v" = {
            "a" {
                over "hand"
                {
                    double physics:other = 1
                }
            }
        }
"""
ORDER = '{\n    reorder nameChildren = ["other", "arm"]\n    d'
REFERENCES = """    def Xform "other" (
        references = </World/third>
    )
    {
    }

    def Xform "third" (
        references = </World/arm>
    )
    {
    }
"""
HEIR = '"arm" (\n        inherits = </_c>\n    )\n'
CLASS = """
class "_c"
{
    over "hand"
    {
        double physics:other = 1
    }
}
"""
STRING = """mass = 3
            string s = \"\"\"
    def Xform "x"
    {
    }
\"\"\""""
COMMENT = """mass = 3
/*
    def Xform "x"
    {
    }
*/"""


def other(old: str, new: str) -> str:
    """Return the text of a stage that differs in one place."""
    assert old in ROOT
    return ROOT.replace(old, new)


# Stages in which much of the text is the same.
OTHERS = {
    "an ancestor moved": other("(0, 0, 1)", "(0, 0, 2)"),
    "the parent is another": other('"arm"', '"leg"'),
    "the parent is only an over": other('def Xform "arm"', 'over Xform "arm"'),
    "an ancestor is a class": other('def Xform "World"', 'class Xform "World"'),
    "the parent is inactive": other('"arm"\n', '"arm" (\n        active = false\n    )\n'),
    "a value changed": other(MASS, "mass = 3"),
    "a value after the children": other(OTHER, OTHER + LATER),
    "a brace on the line": other(OTHER, OTHER.replace("\n    {\n    }", "\n    {}") + LATER),
    "a prim in a string": other(MASS, STRING),
    "a prim in a comment": other(MASS, COMMENT),
    "a reference": other('"other"\n', '"other" (\n        references = </World/arm>\n    )\n'),
    "a reference to what changed": other(MASS, "mass = 3").replace(
        '"other"\n', '"other" (\n        references = </World/arm>\n    )\n'
    ),
    "a reference beside what it brings": other(
        '"other"\n    {\n',
        '"other" (\n        references = </World/arm>\n    )\n    {\n'
        '        over "hand"\n        {\n            double physics:mass = 9\n        }\n',
    ),
    "a reference to a reference": other(OTHER, REFERENCES),
    "a class to inherit from": other('"arm"\n', HEIR) + CLASS,
    "a variant": other('"arm"\n    {\n', VARIANT),
    "children in another order": other("{\n    d", ORDER),
    "another layout": other("    ", "  "),
    "tabs": other("    ", "\t"),
    "line ends of Windows": other("\n", "\r\n"),
    "a namespace above": other("{\n    d", '{\n    string isaac:namespace = "robot"\n    d'),
}


@pytest.mark.usefixtures("remembering")
@pytest.mark.parametrize("name", OTHERS)
def test_a_stage_that_only_looks_alike_is_read_anew(name: str, tmp_path: Path) -> None:
    first = open_stage(written(tmp_path / "first.usda", ROOT))
    path = written(tmp_path / "second.usda", OTHERS[name])
    second = open_stage(path)
    third = open_stage(written(tmp_path / "third.usda", ROOT))
    expected = parts(read_model(first, LAB, ""))
    assert parts(read_model(second, LAB, "")) == parts(alone(path))
    assert parts(read_model(third, LAB, "")) == expected


@pytest.mark.usefixtures("remembering")
@pytest.mark.parametrize("name", OTHERS)
def test_every_stage_may_come_after_this_one(name: str, tmp_path: Path) -> None:
    paths = [written(tmp_path / f"{i}.usda", text) for i, text in enumerate(OTHERS.values())]
    before = written(tmp_path / "before.usda", OTHERS[name])
    kept = []
    for path in paths:
        kept += [open_stage(before), open_stage(path)]
        read_model(kept[-2], LAB, "")
        assert parts(read_model(kept[-1], LAB, "")) == parts(alone(path))


def test_a_prim_that_refers_to_others_stands_for_their_text_as_well(tmp_path: Path) -> None:
    first, second = (
        own_texts(open_stage(written(tmp_path / f"{i}.usda", OTHERS[name])))
        for i, name in enumerate(("a reference", "a reference to what changed"))
    )
    assert first["/World/other"] == first["/World/other/hand"]
    assert first["/World/other"] != second["/World/other"]
    assert first["/World"] == second["/World"]


# Two stages each: in the second the file's layout hides a difference from whoever reads lines.
PARENT = """def Xform "P"
{
    double physics:mass = 1

    def Xform "z"
    {
    }
}
"""
TWO = """def Xform "A"
{
}

def Xform "B"
{
    double physics:mass = 1
}
"""
TREES = """def Xform "R"
{
}

def Xform "T" (
    references = </R>
)
{
    def Xform "x"
    {
        def Xform "y"
        {
        }
%s
        def Xform "w"
        {
            double physics:mass = 2
        }
%s
    def Xform "z"
    {
        double physics:mass = 1
    }
}
"""
LOOKS_MIXED = """def Xform "T" (
    doc = "references"
)
{
 }

    def Xform "q"
    {
        double physics:mass = %s
        def 'h'
        {
            def 'i'
            {
    }
}

def Xform "q" (
    doc = "references"
)
{
 }
}
"""
HIDDEN = {
    "a property after a child": (
        PARENT,
        PARENT.replace("    }\n}", "     }\n    double physics:mass = 99\n    }"),
    ),
    "a property after a child, and a brace of its own": (
        PARENT,
        PARENT.replace(
            "    }\n}",
            "     }\n    double physics:mass = 99\n    double a.timeSamples = {\n"
            "        0: 1\n    }\n}",
        ),
    ),
    "a line end that is none in a comment": (
        TWO,
        TWO.replace("}", " }").replace('"B"', "'B'").replace("= 1", "= 99")
        + "# " + TWO[TWO.index('def Xform "B"'):].replace("\n", "\r") + "\n",
    ),
    "a comment that begins before the first prim": (
        TWO,
        "/*\n" + TWO.replace("    double physics:mass = 1\n}\n", "*/\n")
        + "def Xform 'A'\n{\n}\ndef Xform 'B'\n{\n    double physics:mass = 99\n}\n",
    ),
    "a brace that moved": (TREES % ("", "    }\n"), TREES % ("    }\n", "")),
    "a word in a string": (LOOKS_MIXED % 1, LOOKS_MIXED % 99),
}  # fmt: skip


@pytest.mark.usefixtures("remembering")
@pytest.mark.parametrize("name", HIDDEN)
@pytest.mark.parametrize("order", [1, -1], ids=["hidden", "hidden first"])
def test_the_layout_of_a_file_hides_nothing(name: str, order: int, tmp_path: Path) -> None:
    paths = [written(tmp_path / f"{i}.usda", text) for i, text in enumerate(HIDDEN[name])][::order]
    kept = [open_stage(path) for path in paths]
    for path, stage in zip(paths, kept, strict=True):
        assert parts(read_model(stage, LAB, "")) == parts(alone(path))
    assert parts(alone(paths[0])) != parts(alone(paths[1]))


@pytest.mark.usefixtures("remembering")
@pytest.mark.parametrize("name", HIDDEN)
def test_the_layout_of_a_file_hides_no_change_of_the_starter(name: str, tmp_path: Path) -> None:
    paths = [written(tmp_path / f"{i}.usda", text) for i, text in enumerate(HIDDEN[name])]
    first, second = (open_stage(path) for path in paths)
    read_model(second, LAB, "")
    found = compare_starter(first, second, LAB, "05").changes
    token = memory.set(None)
    expected = compare_starter(first, second, LAB, "05").changes
    memory.reset(token)
    assert found == expected


@pytest.mark.usefixtures("remembering")
def test_many_prims_that_refer_to_others_take_no_longer_than_opening_them(tmp_path: Path) -> None:
    below = "".join(f'    def "p{i}"\n    {{\n    }}\n' for i in range(200))
    users = "".join(f'def "u{i}" (\n    references = </R>\n)\n{{\n}}\n' for i in range(2000))
    text = f'def "R"\n{{\n{below}}}\n{users}'
    stage = Usd.Stage.Open(str(written(tmp_path / "a.usda", text)))
    texts = own_texts(stage)
    assert len(texts) == 2000 * 201 + 201
    assert max(map(len, texts.values())) < len(text) / 100


@pytest.mark.usefixtures("remembering")
def test_what_is_written_as_before_is_not_read_again(built: Path, tmp_path: Path) -> None:
    text = built.read_text().replace("physics:mass = 0.114", "physics:mass = 0.5")
    later = tmp_path / "later.usda"
    later.write_text(text)
    stages = [open_stage(path) for path in (built, later)]
    first, second = (read_model(stage, LAB, "") for stage in stages)
    again = {path for path, prim in second.prims.items() if prim is first.prims[path]}
    robot = LAB.scene["robot"]["path"]
    assert {robot, f"{robot}/base_link"} <= again
    assert not {f"{robot}/base_scan", f"{robot}/base_scan/Lidar2D"} & again
    one, two = (
        next(graph for graph in model.graphs if graph.path == CLOCK) for model in (first, second)
    )
    assert all(node is other for node, other in zip(one.nodes, two.nodes, strict=True))


def test_nothing_is_remembered_where_no_stage_stays_open(built: Path) -> None:
    first, second = (read_model(open_stage(built), LAB, "") for _ in range(2))
    assert not any(second.prims[path] is prim for path, prim in first.prims.items())


def test_each_prim_has_its_own_text_and_not_its_childrens(tmp_path: Path) -> None:
    texts = own_texts(open_stage(written(tmp_path / "a.usda", ROOT)))
    assert [*texts] == ["/World", "/World/arm", "/World/arm/hand", "/World/other"]
    assert texts["/World/other"] == '    def Xform "other"\n    {'
    assert "mass" in texts["/World/arm/hand"]
    assert "mass" not in texts["/World/arm"]


def test_what_an_arc_brings_something_to_has_no_text_of_its_own(tmp_path: Path) -> None:
    texts = own_texts(open_stage(written(tmp_path / "a.usda", OTHERS["a class to inherit from"])))
    assert [*texts] == ["/World", "/World/other", "/_c", "/_c/hand"]


@pytest.mark.parametrize("name", ["another layout", "tabs"])
def test_how_a_file_is_laid_out_does_not_matter(name: str, tmp_path: Path) -> None:
    first, second = (
        own_texts(open_stage(written(tmp_path / f"{i}.usda", text)))
        for i, text in enumerate((ROOT, OTHERS[name]))
    )
    assert first == second


@pytest.mark.parametrize("quotes", ['"""', "'''"])
def test_a_layer_with_a_string_of_several_lines_has_no_texts(quotes: str, tmp_path: Path) -> None:
    text = other(MASS, f"{MASS}\n            string s = {quotes}a\nb{quotes}")
    assert own_texts(open_stage(written(tmp_path / "a.usda", text))) == {}


def test_a_stage_with_a_prim_that_is_not_active_has_no_texts(tmp_path: Path) -> None:
    text = OTHERS["the parent is inactive"]
    assert own_texts(open_stage(written(tmp_path / "a.usda", text))) == {}


def test_a_stage_of_several_layers_has_no_texts(tmp_path: Path) -> None:
    written(tmp_path / "a.usda", ROOT)
    over = tmp_path / "b.usda"
    over.write_text("#usda 1.0\n(\n    subLayers = [@./a.usda@]\n)\n\n" + ROOT)
    assert own_texts(open_stage(over)) == {}


def test_a_binary_layer_has_no_texts(built: Path, tmp_path: Path) -> None:
    stage = Usd.Stage.Open(str(built))
    stage.GetRootLayer().Export(str(tmp_path / "a.usdc"))
    assert own_texts(open_stage(tmp_path / "a.usdc")) == {}
