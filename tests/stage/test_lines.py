from __future__ import annotations

import re
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pxr import Sdf, Usd, UsdUtils
from usda_measure import Spot, build_text_stages, measure, spec_paths, spots_of, text_files

from lab3_usd.stage import statements
from lab3_usd.stage.layer_text import Site, SourceLocation, locate
from lab3_usd.stage.read.opening import quiet
from lab3_usd.stage.statements import scan_text

# In a marked text, «path» stands where the spec at that path begins.
MARK = re.compile("«(.*?)»")
TRICKY = (Path(__file__).parent / "layers" / "tricky.usda.marked").read_text(encoding="utf-8")
MIN_SHARE = 0.99  # two of the saved files were indented by hand


def unmarked(marked: str) -> tuple[str, dict[str, Spot]]:
    """Take the marks out of a text; return it, and where they were."""
    spots: dict[str, Spot] = {}
    text = ""
    for index, piece in enumerate(MARK.split(marked)):
        if index % 2:
            spots[piece] = (text.count("\n") + 1, len(text) - text.rfind("\n"))
        else:
            text += piece
    return text, spots


def paths_in(text: str) -> list[str]:
    """Return the paths that OpenUSD itself finds in a text."""
    layer = Sdf.Layer.CreateAnonymous(".usda")
    assert layer.ImportFromString(text)
    return spec_paths(layer)


def without_metadata(spots: dict[str, Spot]) -> dict[str, Spot]:
    return {path: spot for path, spot in spots.items() if not path.startswith("/.")}


@pytest.mark.parametrize("line_end", ["\n", "\r\n"])
def test_every_kind_of_statement_is_found_where_it_is_marked(line_end: str) -> None:
    text, spots = unmarked(TRICKY.replace("\n", line_end))
    assert spots_of(text) == spots


def test_the_marks_name_all_that_openusd_finds() -> None:
    text, spots = unmarked(TRICKY)
    assert paths_in(text) == sorted(without_metadata(spots))


NAMES = st.sampled_from(["a", "def", "inputs:x", "ü", "B", "timeSamples", "rel", "a:b:c"])
VALUES = (
    "int @",
    "custom uniform token[] @ = []",
    'string @ = "} ] ) \\" \' # // ;"',
    "string @ = '{ [ ( \\' \" /*'",
    'string @ = """a " b\n} def "X" {\n \\""" int z = 1\n"""',
    "asset @ = @a)}];#'.usd@",
    "asset @ = @@@a@b\"@@@@@ (doc = ')')",
    "point3f[] @ = [(1, 2, 3),\n(4, 5, 6), # ) ]\n(7, 8, 9)]",
    'int @ = 1 (\n    customData = { string s = "}" }\n)',
    "double @.timeSamples = { 0: 1, # }\n 1: None }",
    "prepend int @.connect = [</A.b>,\n</C/D.inputs:x>]",
    "delete rel @ = </A>",
    "custom rel @ = [</A>, </B>] (doc = 'x')",
)
BLANKS = ("", "  ", "\t", "\n\n", '# } "\n', "// { '\n", "/* ( \n ' */ ", "  /* } */ ")
ENDS = (";", "\n", " # } '\n", " ;  ", " // {\n", '/* " */ ;\n')


@st.composite
def bodies(draw: st.DrawFn, parent: str, depth: int = 3) -> str:
    """Draw the marked inside of a prim."""
    text = draw(st.sampled_from(BLANKS))
    for name in draw(st.lists(NAMES, unique=True, max_size=4)):
        value = draw(st.sampled_from(VALUES)).replace("@", name, 1)
        blank, end = draw(st.sampled_from(BLANKS)), draw(st.sampled_from(ENDS))
        text += f"{blank}«{parent}.{name}»{value}{end}"
    for name in draw(st.lists(st.sampled_from(["P", "Q", "Ö"]), unique=True, max_size=depth)):
        text += draw(prims(parent, name, depth - 1))
    return text


@st.composite
def prims(draw: st.DrawFn, parent: str, name: str, depth: int) -> str:
    path = f"{parent}{name}" if parent.endswith("}") else f"{parent}/{name}"
    head = draw(st.sampled_from(["def", "over", "class", "def Xform", 'over /* " */ A.B']))
    data = draw(st.sampled_from(["", '(doc = "}")', "\n(\n    kind = 'x' # )\n)\n"]))
    inside = draw(bodies(path, depth))
    if depth and draw(st.booleans()):
        variant = draw(bodies(f"{path}{{v=x}}", depth - 1))
        inside += f'«{path}{{v=}}»variantSet "v" = {{ «{path}{{v=x}}»"x" {{ {variant} }} }}\n'
    blank = draw(st.sampled_from(BLANKS))
    return f'{blank}«{path}»{head} "{name}" {data} {{ {inside} }}\n'


@settings(max_examples=12)
@given(prims("", "A", 3))
def test_any_mixture_of_statements_and_blanks_is_found(body: str) -> None:
    text, spots = unmarked(f"#usda 1.0\n{body}")
    assert paths_in(text) == sorted(spots)
    assert spots_of(text) == spots


@settings(max_examples=5)
@given(prims("", "A", 2), prims("", "B", 2))
def test_what_is_asked_for_alone_is_found_where_it_is_among_all(one: str, other: str) -> None:
    text, spots = unmarked(f"#usda 1.0\n{one}{other}")
    whole = scan_text(text)
    assert {path: scan_text(text, [path]).get(path) for path in spots} == whole


def test_a_body_that_holds_nothing_asked_for_is_passed_over() -> None:
    passed = 'def "A" {\n    int a = 1 # }\n    def "B" {\n    }\n}\n'
    found = scan_text(f'#usda 1.0\n{passed}def "C" {{\n    int c\n}}\n', ["/C.c"])
    assert [*found] == ["/A", "/C", "/C.c"]


@pytest.mark.parametrize(
    "cut", ['"A" (', '"A" ( doc = "}', '"A"', '"A" { variantSet "v" = { "x" (']
)
def test_text_that_ends_too_early_keeps_what_comes_before_the_end(cut: str) -> None:
    assert scan_text(f"#usda 1.0\ndef {cut}")["/A"] == len("#usda 1.0\n")


@given(st.text(st.sampled_from("()[]{}\"'@#/<>;=.:\\*, \n\rab"), max_size=60))
def test_damaged_text_keeps_what_comes_before_the_damage(text: str) -> None:
    assert scan_text(f'#usda 1.0\ndef "A" {{ {text}')["/A"] == len("#usda 1.0\n")


@pytest.fixture(scope="module")
def text_stages(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    return build_text_stages(tmp_path_factory.mktemp("text"))


def test_the_places_in_built_stages_are_those_of_openusd(
    text_stages: list[Path],
) -> None:
    some = [text_stages[3], *text_stages[-3:]]
    measures = [measure(file) for file in some]
    assert sum(each.paths for each in measures) > 2500
    assert {path for each in measures for path in each.wrong} == set()


def test_the_places_in_saved_stages_are_those_of_openusd(shared: Path) -> None:
    with quiet():
        measures = [measure(file) for file in text_files(shared / "corpus")]
    paths = sum(each.paths for each in measures)
    wrong = sum(len(each.wrong) for each in measures)
    assert paths > 2000
    assert 1 - wrong / paths >= MIN_SHARE


def write(file: Path, marked: str) -> dict[str, Spot]:
    """Write a text layer and return its marks."""
    text, spots = unmarked(f"#usda 1.0\n{marked}")
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_bytes(text.encode("utf-8"))
    return spots


def place_of(
    file: Path, prim: str, name: str | None = None, given_as: str = "in/lab.usda"
) -> SourceLocation:
    site: Site = (prim, name)
    stage = Usd.Stage.Open(str(file))
    return locate(stage, given_as, [site])[site]


@pytest.fixture
def layered(tmp_path: Path) -> tuple[Path, dict[str, dict[str, Spot]]]:
    """Write a stage of a root, a sublayer, a payload and a reference into a variant."""
    marks = {
        "": write(
            tmp_path / "in" / "lab.usda",
            """(
    subLayers = [@sub/base.usda@]
    «upAxis»upAxis = "Z"
)
«/World»over "World"
{
    «wire»prepend uint inputs:in.connect = </World.outputs:out>
    «strong»custom double declared (doc = "no opinion of its own")
    «/World/Robot»over "Robot" (payload = @../robot.usda@</Model>)
    {
        «mass»float mass = 2
    }
    def "Shaped" (references = @../robot.usda@</Box>; instanceable = true)
    {
    }
}
""",
        ),
        "in/sub/base.usda": write(
            tmp_path / "in" / "sub" / "base.usda",
            """
«/World»def Xform "World"
{
    «in»custom uint inputs:in = 1
    «weak»double declared = 2
    «only»int only.connect = </World.inputs:in>
    «/World/Leaf»def "Leaf"
    {
    }
    def "Off" (active = false)
    {
        def "Below" {}
    }
}
""",
        ),
        "robot.usda": write(
            tmp_path / "robot.usda",
            """
«/Model»def "Model"
{
    float mass = 1
    «size»float size = 1
    «/Model/Link»def "Link" { «wheel»rel wheel = </Model>; }
}
def "Box" (variants = { string form = "box" }; variantSets = "form")
{
    variantSet "form" = {
        "box" {
            «form»int form = 1
            «Inner»def "Inner" { «deep»int deep = 1; }
        }
    }
}
""",
        ),
    }
    return tmp_path / "in" / "lab.usda", marks


@pytest.mark.parametrize(
    ("prim", "name", "layer", "mark"),
    [
        ("/World", None, "", "/World"),
        ("/World", "inputs:in", "", "wire"),
        ("/World", "only", "in/sub/base.usda", "only"),
        ("/World", "declared", "in/sub/base.usda", "weak"),
        ("/World", "missing", "", "/World"),
        ("/World", "no name", "", "/World"),
        ("/World/Leaf", None, "in/sub/base.usda", "/World/Leaf"),
        ("/World/Leaf", "missing", "in/sub/base.usda", "/World/Leaf"),
        ("/World/Leaf/Missing/Deeper", "size", "in/sub/base.usda", "/World/Leaf"),
        ("/World/Missing", None, "", "/World"),
        ("/World//Missing", None, "", "/World"),
        ("/World/no path!", "x", "", "/World"),
        ("/World/Robot", None, "", "/World/Robot"),
        ("/World/Robot", "mass", "", "mass"),
        ("/World/Robot", "size", "robot.usda", "size"),
        ("/World/Robot/Link", None, "robot.usda", "/Model/Link"),
        ("/World/Robot/Link", "wheel", "robot.usda", "wheel"),
        ("/World/Shaped", "form", "robot.usda", "form"),
        ("/World/Shaped/Inner", None, "robot.usda", "Inner"),
        ("/World/Shaped/Inner", "deep", "robot.usda", "deep"),
        ("/", "upAxis", "", "upAxis"),
    ],
)
def test_a_site_is_where_its_strongest_opinion_begins(
    layered: tuple[Path, dict[str, dict[str, Spot]]],
    prim: str,
    name: str | None,
    layer: str,
    mark: str,
) -> None:
    file, marks = layered
    assert place_of(file, prim, name) == SourceLocation(layer or "in/lab.usda", *marks[layer][mark])


@pytest.mark.parametrize(
    ("prim", "name"),
    [("/Nowhere", None), ("/Nowhere/Below", "x"), ("/", None), ("/", "metersPerUnit"), ("", "x")],
)
def test_a_site_without_anything_above_it_is_in_the_root_layer_at_no_line(
    layered: tuple[Path, dict[str, dict[str, Spot]]], prim: str, name: str | None
) -> None:
    assert place_of(layered[0], prim, name) == SourceLocation("in/lab.usda", None, None)


def test_a_prim_below_a_deactivated_one_is_at_that_one(
    layered: tuple[Path, dict[str, dict[str, Spot]]],
) -> None:
    file, _ = layered
    assert place_of(file, "/World/Off/Below") == place_of(file, "/World/Off")


@pytest.mark.parametrize(
    ("given_as", "expected"),
    [
        ("lab.usda", "sub/base.usda"),
        ("./lab.usda", "sub/base.usda"),
        ("../in/lab.usda", "../in/sub/base.usda"),
        ("/some where/lab.usda", "/some where/sub/base.usda"),
    ],
)
def test_other_layers_are_named_from_where_the_root_was_named(
    layered: tuple[Path, dict[str, dict[str, Spot]]], given_as: str, expected: str
) -> None:
    file, _ = layered
    assert place_of(file, "/World/Leaf", given_as=given_as).layer == expected
    assert place_of(file, "/World", given_as=given_as).layer == given_as


def test_each_layer_is_scanned_once(
    layered: tuple[Path, dict[str, dict[str, Spot]]], monkeypatch: pytest.MonkeyPatch
) -> None:
    scanned: list[str] = []
    monkeypatch.setattr(statements, "scan_text", lambda text, _: scanned.append(text) or {})
    sites = [("/World", None), ("/World/Leaf", None), ("/World", "only"), ("/World", "inputs:in")]
    found = locate(Usd.Stage.Open(str(layered[0])), "lab.usda", sites)
    assert list(found) == sites
    assert len(scanned) == 2


def test_no_layer_is_scanned_without_a_site(
    layered: tuple[Path, dict[str, dict[str, Spot]]], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delattr(statements, "scan_text")
    assert locate(Usd.Stage.Open(str(layered[0])), "lab.usda", []) == {}


@pytest.mark.parametrize("ending", ["usdc", "usd"])
def test_a_binary_layer_has_a_name_and_no_lines(tmp_path: Path, ending: str) -> None:
    write(tmp_path / "a.usda", 'def "A" { int a; }\n')
    binary = tmp_path / f"a.{ending}"
    Sdf.Layer.FindOrOpen(str(tmp_path / "a.usda")).Export(str(binary))
    assert place_of(binary, "/A", "a", binary.name) == SourceLocation(binary.name, None, None)


def test_a_text_layer_may_be_named_usd(tmp_path: Path) -> None:
    spots = write(tmp_path / "a.usd", 'def "A" { «a»int a; }\n')
    assert place_of(tmp_path / "a.usd", "/A", "a", "a.usd") == SourceLocation("a.usd", *spots["a"])


def test_a_binary_sublayer_has_no_lines_while_its_root_has(tmp_path: Path) -> None:
    stage = Usd.Stage.CreateNew(str(tmp_path / "base.usdc"))
    stage.DefinePrim("/A")
    stage.Save()
    spots = write(tmp_path / "lab.usda", '( subLayers = [@base.usdc@] )\n«B»def "B" {}\n')
    assert place_of(tmp_path / "lab.usda", "/A", None, "lab.usda") == SourceLocation(
        "base.usdc", None, None
    )
    assert place_of(tmp_path / "lab.usda", "/B", None, "lab.usda") == SourceLocation(
        "lab.usda", *spots["B"]
    )


def test_a_layer_in_a_package_has_no_lines(tmp_path: Path) -> None:
    write(tmp_path / "a.usda", 'def "A" { int a; }\n')
    package = tmp_path / "a.usdz"
    assert UsdUtils.CreateNewUsdzPackage(str(tmp_path / "a.usda"), str(package))
    place = place_of(package, "/A", "a", "a.usdz")
    assert (place.line, place.column) == (None, None)


def test_a_layer_in_memory_has_neither_name_nor_lines() -> None:
    stage = Usd.Stage.CreateInMemory()
    stage.DefinePrim("/A")
    site: Site = ("/A", None)
    assert locate(stage, "", [site]) == {site: SourceLocation("", None, None)}


def test_a_sublayer_in_memory_has_neither_name_nor_lines(tmp_path: Path) -> None:
    write(tmp_path / "lab.usda", 'def "A" {}\n')
    stage = Usd.Stage.Open(str(tmp_path / "lab.usda"))
    with Usd.EditContext(stage, stage.GetSessionLayer()):
        stage.DefinePrim("/B")
    site: Site = ("/B", None)
    assert locate(stage, "lab.usda", [site]) == {site: SourceLocation("", None, None)}


def test_an_opinion_that_is_not_saved_yet_has_no_line(tmp_path: Path) -> None:
    write(tmp_path / "lab.usda", 'def "A" {}\n')
    stage = Usd.Stage.Open(str(tmp_path / "lab.usda"))
    stage.DefinePrim("/B")
    site: Site = ("/B", None)
    assert locate(stage, "lab.usda", [site]) == {site: SourceLocation("lab.usda", None, None)}


def test_a_layer_whose_file_is_gone_has_no_lines(tmp_path: Path) -> None:
    write(tmp_path / "lab.usda", 'def "A" {}\n')
    stage = Usd.Stage.Open(str(tmp_path / "lab.usda"))
    (tmp_path / "lab.usda").unlink()
    site: Site = ("/A", None)
    assert locate(stage, "lab.usda", [site]) == {site: SourceLocation("lab.usda", None, None)}


def test_a_layer_on_another_drive_keeps_its_own_path(
    layered: tuple[Path, dict[str, dict[str, Spot]]], monkeypatch: pytest.MonkeyPatch
) -> None:
    def no_way(path: str, start: str) -> str:
        raise ValueError(path, start)

    monkeypatch.setattr("os.path.relpath", no_way)
    file, _ = layered
    assert place_of(file, "/World/Leaf").layer == str(file.parent / "sub" / "base.usda")


def test_prims_shared_by_instances_are_found_below_each_instance(
    layered: tuple[Path, dict[str, dict[str, Spot]]],
) -> None:
    stage = Usd.Stage.Open(str(layered[0]))
    assert stage.GetPrimAtPath("/World/Shaped/Inner").IsInstanceProxy()
    assert place_of(layered[0], "/World/Shaped/Inner", "deep").line is not None
