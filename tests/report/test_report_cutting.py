"""No value makes a report large: texts are cut where they are reported, in every format."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from grade_files import LAB, stage, submission
from in_process import invoke
from msgspec.structs import replace
from pxr import Sdf
from report_examples import MISSING_WIRE

from lab3_usd.check.registry import all_rules
from lab3_usd.model.finding import (
    ChecklistItem,
    Crash,
    NodeCoverage,
    NotJudged,
    Report,
    StageResult,
    Submission,
)
from lab3_usd.pipeline.folder import check_folder
from lab3_usd.pipeline.stage import JudgeSettings, check_stage
from lab3_usd.report.formats.registry import all_formats, render
from lab3_usd.report.options import Options
from lab3_usd.report.safe_text import LONGEST, truncated, truncated_values
from lab3_usd.stage.read.opening import kept_open

HUGE = "<" * (1 << 16)
NAME = "n" * (1 << 16)
MOST = 110_000  # without a huge value the largest page has a little less
PRINTED = 40_000  # and what a command prints has half of this


def test_a_text_that_is_read_whole_stays() -> None:
    assert truncated("x" * LONGEST) == "x" * LONGEST


def test_a_longer_one_says_how_long_it_was() -> None:
    assert truncated(HUGE) == f"{HUGE[:LONGEST]}... (65536 characters)"


def test_numbers_lists_and_what_is_absent_stay_what_they_are() -> None:
    data = {"a": [HUGE, 1, None], "b": ("x", 2.5), "c": True}
    assert truncated_values(data) == {"a": [truncated(HUGE), 1, None], "b": ("x", 2.5), "c": True}


def test_every_text_of_a_report_is_cut_but_the_names_of_files() -> None:
    path = "p" * 2000
    finding = replace(MISSING_WIRE, message=HUGE, prim=HUGE, related=(HUGE,), layer=path)
    result = StageResult(
        path,
        "05",
        (finding,),
        (),
        (Crash("X", HUGE),),
        (NotJudged("K14", HUGE, None, HUGE),),
        NodeCoverage(1, unknown={HUGE: 1}),
        (HUGE,),
    )
    line = ChecklistItem("1", "text", "person", HUGE)
    report = truncated_values(Report((result,), (Submission(path, (finding,), (line,)),)))
    (found,) = report.results
    (about,) = report.submissions
    short = truncated(HUGE)
    assert (found.path, found.findings[0].layer) == (path, path)
    assert found.findings[0].message == found.findings[0].prim == short
    assert found.findings[0].related == (short,)
    assert (found.not_judged[0].prim, found.gaps) == (short, (short,))
    assert found.coverage == NodeCoverage(1, unknown={short: 1})
    assert (found.crashes[0].error, about.checklist[0].because) == (short, short)


def _strings(layer: Sdf.Layer) -> None:
    """Give every text of every graph node and sensor a huge value."""

    def change(path: Sdf.Path) -> None:
        spec = layer.GetObjectAtPath(path)
        if isinstance(spec, Sdf.AttributeSpec) and isinstance(spec.default, str):
            spec.default = HUGE

    layer.Traverse(Sdf.Path.absoluteRootPath, change)


def _one_string(layer: Sdf.Layer) -> None:
    def change(path: Sdf.Path) -> None:
        spec = layer.GetObjectAtPath(path)
        if isinstance(spec, Sdf.AttributeSpec) and path.name in {
            "inputs:frameId",
            "inputs:topicName",
            "inputs:nodeNamespace",
            "inputs:childFrameId",
        }:
            spec.default = HUGE

    layer.Traverse(Sdf.Path.absoluteRootPath, change)


def _names(layer: Sdf.Layer) -> None:
    """Give a node, a graph, and a frame a huge name."""
    for number, path in enumerate(spec.path for spec in LAB.graphs.values()):
        prim = layer.GetPrimAtPath(path)
        if prim is not None and number % 2:
            prim.name = f"{NAME}{number}"
        elif prim is not None:
            next(iter(prim.nameChildren)).name = NAME


def _frames(layer: Sdf.Layer) -> None:
    """Give every prim that is a frame a huge one, which the TF tree shows."""
    for path in ("/turtlebot3_burger/base_link", "/turtlebot3_burger/base_scan"):
        prim = layer.GetPrimAtPath(path)
        Sdf.AttributeSpec(prim, "isaac:nameOverride", Sdf.ValueTypeNames.String).default = (
            HUGE + path
        )


def _arcs(layer: Sdf.Layer) -> None:
    """Refer to a huge name, and target one."""
    prim = layer.GetPrimAtPath("/World")
    prim.referenceList.Prepend(Sdf.Reference(f"./{NAME}.usda"))
    prim.SetInfo("documentation", HUGE)
    layer.subLayerPaths.append(f"./{NAME}")
    for spec in LAB.graphs.values():
        graph = layer.GetPrimAtPath(spec.path)
        for node in graph.nameChildren if graph is not None else ():
            for relation in node.relationships:
                relation.targetPathList.explicitItems = [Sdf.Path(f"/{NAME}")]


Change = Callable[[Sdf.Layer], None]


@pytest.fixture(scope="module", params=[_strings, _one_string, _names, _frames, _arcs])
def huge(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Path]:
    """A stage with huge values, which is read once for all who ask."""
    change: Change = request.param
    layer = Sdf.Layer.OpenAsAnonymous(str(stage("05")))
    change(layer)
    target = tmp_path_factory.mktemp("huge") / stage("05").name
    layer.Export(str(target))
    assert target.stat().st_size > 1 << 16
    with kept_open():
        yield target


def test_no_format_is_large(huge: Path) -> None:
    report = Report((check_stage(str(huge), "05", LAB),))
    sizes = {
        name: len(render(name, report, all_rules(), Options(verbosity="verbose")))
        for name in all_formats()
    }
    (result,) = report.results
    entries = len(result.findings) + len(result.not_judged)
    most = MOST + 12_500 * entries  # of markup: message, two values
    assert {name: size for name, size in sizes.items() if size > most} == {}


@pytest.mark.parametrize(
    "command",
    [
        ["topics"],
        ["topics", "--format", "json"],
        ["topics", "--format", "csv"],
        ["tf"],
        ["tf", "--format", "json"],
        ["tf", "--format", "dot"],
    ],
)
def test_no_command_prints_a_huge_text(huge: Path, command: list[str]) -> None:
    done = invoke(command[0], huge, *command[1:])
    assert done.exit_code in {0, 1}
    assert len(done.output) < PRINTED


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("maps/turtlebot3_map.yaml", f"image: {NAME}\nmode: {NAME}\norigin: [{NAME}]\n"),
        ("params.yaml", f"amcl:\n  ros__parameters:\n    base_frame_id: {NAME}\n    {NAME}: 1\n"),
        ("results/type.txt", f"$ ros2 topic type /scan\n{NAME}/msg/{NAME}\n"),
        ("results/list.txt", f"$ ros2 topic list\n/{NAME}\n/clock\n"),
        ("results/echo.txt", f"$ ros2 topic echo /scan\nheader:\n  frame_id: {NAME}\n---\n"),
        ("results/state.txt", f"$ ros2 lifecycle get /amcl\n{NAME} [3]\n"),
        ("results/frames.gv", f'digraph G {{\n"{NAME}" -> "odom"\n}}\n'),
    ],
)
def test_what_lies_beside_the_stages_makes_no_report_large(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, text: str
) -> None:
    submission(tmp_path, "08")
    file = tmp_path / name
    file.parent.mkdir(exist_ok=True)
    file.write_text(text)
    monkeypatch.chdir(tmp_path)
    found = check_folder(Path(), JudgeSettings())
    report = Report(found.results, (found.submission,))
    for each in all_formats():
        assert len(render(each, report, all_rules(), Options(verbosity="verbose"))) < MOST, each


def test_a_cut_text_is_still_json() -> None:
    result = StageResult("a", "05", (replace(MISSING_WIRE, message=HUGE),))
    (printable,) = json.loads(render("json", Report((result,))))["results"]
    assert printable["findings"][0]["message"] == truncated(HUGE)
