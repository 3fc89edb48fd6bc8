"""No output of a lab speaks of what the lab does not have, or calls the program otherwise."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path

import pytest
from dry_runs import BRIEFLY
from in_process import invoke
from other_labs import describe, files_below, write_stages
from places import REPOSITORY
from pxr import Usd
from workers_here import workers_here

from lab3_usd.commands.table import all_commands
from lab3_usd.data import PROGRAMS
from lab3_usd.report.formats.registry import all_formats
from lab3_usd.stage.read.opening import kept_open

JETBOT = REPOSITORY / "docs" / "examples" / "labs" / "jetbot"
_NO_MAP = r"camera(?!Prim)|AMCL|Nav2|/map\b|map server|turtlebot|burger|tb3|/camera"
# What each lab does not have, and the names by which the program was not started.
FOREIGN = {
    "jetbot": rf"\b({_NO_MAP})",
    "arm": rf"\b({_NO_MAP}|lidar|laser|scans?|wheels?|odometry|odom|cmd_vel|"
    r"(robot|it|arm) drives)\b",
}
OTHER_NAME = r"(?<![\w./-])lab3 [a-z]|(?<![\w#] )\blab3: "
MARKUP = re.compile(r"<style.*?</style>|<script.*?</script>|class=\"[^\"]*\"", re.DOTALL)


@pytest.fixture(scope="module", params=FOREIGN)
def outputs(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> tuple[str, Mapping[str, str]]:
    """Everything that the program says of a lab and of a stage with faults, by what says it."""
    name, folder = request.param, tmp_path_factory.mktemp(request.param)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", [f"/usr/bin/{PROGRAMS[1]}"])
        lab, stages = _lab_of(name, folder)
        return name, {what: MARKUP.sub("", text) for what, text in _said(lab, stages, folder)}


def _lab_of(name: str, folder: Path) -> tuple[Path, list[Path]]:
    if name == "jetbot":
        invoke("--lab", JETBOT, "build", "--out", folder / "stages")
        return JETBOT, sorted((folder / "stages").iterdir())
    stages = write_stages(folder)
    return describe(stages, folder / "lab"), stages


def _said(lab: Path, stages: list[Path], folder: Path) -> Iterator[tuple[str, str]]:
    def ran(*arguments: object) -> str:
        result = invoke("--lab", lab, *arguments)
        assert result.exit_code in {0, 1}, result.output
        return result.output

    rules = ran("rules")
    yield "rules", rules
    listed = set(re.findall(r"^  ([A-Z]\d\d) ", rules, re.MULTILINE))
    for manual in ran("rule", "--all").split("\n\n\n"):
        if manual[:3] in listed:
            yield f"rule {manual[:3]}", manual
    student = folder / "class" / "ann"
    for path in (stages[0], stages[-2], stages[-1]):
        with_faults(path, student / "stages" / path.name)
    (student / "output").mkdir()
    (student / "output" / "topics.txt").write_text("$ ros2 topic list\n/rosout\n")
    last = student / "stages" / stages[-1].name
    with kept_open():
        yield "check", ran("check", "--verbose", student)
        for form in ("html", "json"):
            yield f"check --format {form}", ran("check", "--format", form, student)
        for form in (name for name in all_formats() if name not in {"html", "json"}):
            yield f"check --format {form}", ran("check", "--format", form, last)
        for command in ("tf", "topics"):
            yield command, ran(command, last)
        yield "sim", ran("sim", last, "--drive", BRIEFLY, "--page", folder / "sim.html")
        yield "sim --format json", ran("sim", "--drive", BRIEFLY, "--format", "json", last)
        ran("draw", last, "--out", folder / "pictures")
        yield "diff", ran("diff", stages[0], last)
    yield "fix", ran("fix", last)
    ran("collect", "-o", folder / "collect.sh")
    yield "lab check", ran("lab", "check")
    with workers_here():
        ran("grade", folder / "class", "--starter", stages[0], "-o", folder / "book")
    made = (folder / "sim.html", folder / "collect.sh")
    yield from ((path.name, path.read_text()) for path in made)
    for place in ("book", "pictures"):
        for name, content in files_below(folder / place).items():
            yield f"{place}/{name}", content.decode(errors="replace")


def with_faults(path: Path, target: Path) -> None:
    """Write a copy of a stage with a fault of each kind that its graphs can have."""
    stage = Usd.Stage.Open(str(path))
    target.parent.mkdir(parents=True, exist_ok=True)
    stage.Export(str(target))
    stage = Usd.Stage.Open(str(target))
    nodes = [prim for prim in stage.Traverse() if prim.GetTypeName() == "OmniGraphNode"]
    for number, node in enumerate(nodes):
        for attribute in node.GetAttributes():
            if attribute.HasAuthoredConnections() and number % 3 == 0:
                attribute.ClearConnections()
                break
        topic = node.GetAttribute("inputs:topicName")
        if topic and topic.Get() and number % 2 == 0:
            topic.Set("other")
        for relationship in node.GetRelationships():
            if relationship.GetTargets() and number % 5 == 0:
                relationship.SetTargets([])
    body = next(prim for prim in stage.Traverse() if prim.GetAttribute("physics:mass"))
    body.GetAttribute("physics:mass").Set(50.0)
    stage.GetRootLayer().Save()


def found(pattern: str, outputs: Mapping[str, str]) -> dict[str, set[str]]:
    """Return what of a pattern each output says, with what stands before and behind it."""
    sought = re.compile(f"(?i){pattern}")
    said = {
        name: {text[max(0, at.start() - 30) : at.end() + 30] for at in sought.finditer(text)}
        for name, text in outputs.items()
    }
    return {name: words for name, words in said.items() if words}


def test_no_output_speaks_of_what_the_lab_does_not_have(
    outputs: tuple[str, Mapping[str, str]],
) -> None:
    name, texts = outputs
    assert found(FOREIGN[name], texts) == {}


def test_every_output_calls_the_program_as_it_was_typed(
    outputs: tuple[str, Mapping[str, str]],
) -> None:
    assert found(OTHER_NAME, outputs[1]) == {}


@pytest.mark.parametrize("command", sorted({*all_commands()} - {"nav2", "add", "remove"}))
def test_the_help_of_a_command_names_nothing_of_the_bundled_lab(command: str) -> None:
    help_text = invoke(command, "--help").output
    assert re.findall(r"(?i)AMCL|Nav2|/scan|/cmd_vel|/map\b|turtlebot|camera", help_text) == []
