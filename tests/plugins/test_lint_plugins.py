"""The same findings through every door: the command, OpenUSD's framework, NVIDIA's validator."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import quick_yaml
from breaking import correct_stage
from linting import broken_robot
from menu_graphs import MENUS, with_menus
from places import REPOSITORY, TESTS
from pxr import Sdf, Usd

from lab3_usd.pipeline.stage import check_stage, judge_open_stage, lint_stage
from lab3_usd.plugins import findings as adapter
from lab3_usd.plugins import nvidia

EXAMPLE = REPOSITORY / "docs" / "examples" / "carter.usda"
CONTROLLER = "/turtlebot3_burger/ROS_Drive/differential_controller"
CLOCK_NODE = "/World/ROS_Clock/ros2_publish_clock"
PLUGIN = Path(nvidia.__file__).with_name("openusd")
Told = list[tuple[str, str]]


def by_command(path: Path) -> Told:
    return sorted((finding.rule, finding.prim) for finding in lint_stage(path).findings)


OPENUSD = """
import json, sys
from pxr import Usd, UsdValidation
registry = UsdValidation.ValidationRegistry()
names = [each.name for each in registry.GetValidatorMetadataForKeyword("Lab3")]
context = UsdValidation.ValidationContext(registry.GetOrLoadValidatorsByName(names))
def told(path):
    stage = Usd.Stage.Open(path)
    for error in context.Validate(stage):
        (site,) = error.GetSites()
        prim = site.GetPrim() if site.IsPrim() else site.GetProperty().GetPrim()
        yield error.GetName(), str(prim.GetPath())
print(json.dumps([[*told(path)] for path in sys.argv[1:]]))
"""


def by_openusd(paths: list[Path]) -> list[Told]:
    validation = pytest.importorskip("pxr.UsdValidation")
    if not hasattr(validation.ValidationRegistry, "RegisterPluginStageValidator"):
        pytest.skip("this usd-core takes no validators of Python")
    done = subprocess.run(
        [sys.executable, "-c", OPENUSD, *map(str, paths)],
        env={**os.environ, "PXR_PLUGINPATH_NAME": str(PLUGIN)},
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    said = json.loads(done.stdout.splitlines()[-1])
    return [sorted((rule, prim) for rule, prim in told) for told in said]


def by_nvidia(paths: list[Path]) -> list[Told]:
    module = pytest.importorskip(
        "usd_validation_nvidia", reason="the extra 'nvidia' is not installed"
    )
    return [told_by(validated(path, nvidia.rule_class(module))) for path in paths]


def validated(path: Path, rule: type) -> Any:
    """Return what NVIDIA's validator tells with one rule."""
    import usd_validation_nvidia as module

    engine = module.ValidationEngine(init_rules=False, variants=False)
    engine.enable_rule(rule)
    return engine.validate(str(path)).issues()


def told_by(issues: Any) -> Told:
    return sorted((each.message.split()[0], str(each.at.path)) for each in issues)


FAULTS = quick_yaml.load((TESTS / "lint_faults.yaml").read_text())
MANY = (
    "the clock has no time",
    "the source of a wire was deleted",
    "a joint name is misspelt",
    "the wheels hold a position",
    "ROS 2 refuses the topic",
    "the graph was copied",
)


STAGES = ("vendor", "menus", "faults")


@pytest.fixture(scope="module")
def stages(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    folder = tmp_path_factory.mktemp("stages")
    steps = [step for name in MANY for step in FAULTS[name]["rover"]["break"]]
    made = {"menus": with_menus(*MENUS), "faults": broken_robot("rover", steps)}
    for name, stage in made.items():
        stage.GetRootLayer().Export(str(folder / f"{name}.usda"))
    return [EXAMPLE, *(folder / f"{name}.usda" for name in made)]


@pytest.fixture(scope="module", params=[by_openusd, by_nvidia])
def shown(request: pytest.FixtureRequest, stages: list[Path]) -> list[Told]:
    """What another door shows of each stage."""
    door: Callable[[list[Path]], list[Told]] = request.param
    return door(stages)


@pytest.mark.parametrize("number", range(len(STAGES)), ids=STAGES)
def test_every_door_shows_the_same(number: int, shown: list[Told], stages: list[Path]) -> None:
    told = by_command(stages[number])
    assert len(told) > 3
    assert shown[number] == told


def test_a_stage_that_is_open_elsewhere_stays_as_it_is() -> None:
    stage = Usd.Stage.Open(str(EXAMPLE))
    stage.GetPrimAtPath("/World").CreateAttribute("size", Sdf.ValueTypeNames.Double).Set(1.0, 5.0)
    before = stage.GetSessionLayer().ExportToString()
    judge_open_stage(stage)
    assert stage.GetSessionLayer().ExportToString() == before


def test_what_could_not_be_judged_is_a_finding() -> None:
    stage = Usd.Stage.CreateInMemory()
    assert adapter.findings_of(stage) == ()
    stage.GetRootLayer().subLayerPaths.append("./gone.usda")
    found = [finding for finding in adapter.findings_of(stage) if finding.severity == "warning"]
    assert [(finding.rule, finding.prim) for finding in found] == [("F02", "/")]
    assert "./gone.usda" in adapter.text_of(found[0])


def test_a_crash_is_a_finding_and_ends_no_run() -> None:
    (found,) = adapter.findings_of(None)  # which is no stage
    assert (found.severity, found.prim) == ("error", "/")
    assert "Error" in adapter.text_of(found)


@pytest.mark.parametrize("decorator", ["register_rule", "registerRule"])
def test_both_names_of_the_decorator_are_known(
    decorator: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    registered: list[tuple[str, type]] = []

    def register(category: str) -> Any:
        return lambda rule: registered.append((category, rule))

    module = SimpleNamespace(BaseRuleChecker=object, **{decorator: register})
    monkeypatch.setitem(sys.modules, "usd_validation_nvidia", module)  # type: ignore[arg-type]
    nvidia.plugin.on_startup()
    nvidia.plugin.on_shutdown()
    assert [(category, rule.__name__) for category, rule in registered] == [
        ("Lab3", "IsaacGraphChecker"),
        ("Lab3Check", "LabCheckpointChecker"),
    ]


@pytest.fixture
def mistaken(tmp_path: Path) -> Path:
    """A stage of the lab with a wrong value, a lost wire and a node too many."""
    stage = correct_stage("02")
    stage.GetAttributeAtPath(f"{CONTROLLER}.inputs:wheelRadius").Set(0.033)
    stage.GetAttributeAtPath("/World/ROS_Clock/ros2_publish_clock.inputs:execIn").ClearConnections()
    Sdf.CopySpec(stage.GetRootLayer(), CLOCK_NODE, stage.GetRootLayer(), f"{CLOCK_NODE}_01")
    path = tmp_path / "Lab3_02_mine.usda"
    stage.GetRootLayer().Export(str(path))
    return path


def checked_by_nvidia(path: Path) -> Any:
    module = pytest.importorskip("usd_validation_nvidia")
    return validated(path, nvidia.checkpoint_rule_class(module))


def test_a_stage_of_the_lab_is_checked_as_the_command_does(mistaken: Path) -> None:
    told = sorted((finding.rule, finding.prim) for finding in check_stage(mistaken).findings)
    assert len(told) == 3
    assert told_by(checked_by_nvidia(mistaken)) == told


def test_safe_repairs_are_suggestions_which_repair(mistaken: Path) -> None:
    module = pytest.importorskip("usd_validation_nvidia")
    issues = checked_by_nvidia(mistaken)
    repairs = {finding.rule: finding.fix for finding in check_stage(mistaken).findings}
    suggested = {issue.message.split()[0]: issue.suggestion for issue in issues}
    assert {rule for rule, each in suggested.items() if each} == {"P01", "W01"}
    assert suggested["P01"].message == repairs["P01"].title
    fixer = module.IssueFixer(str(mistaken))
    results = fixer.fix([issue for issue in issues if issue.suggestion])
    assert {result.status.name for result in results} == {"SUCCESS"}
    fixer.save()
    assert [finding.rule for finding in check_stage(mistaken).findings] == ["N02"]


def test_a_validator_without_suggestions_gets_the_findings_alone(mistaken: Path) -> None:
    said: list[str] = []

    class Rule:
        def _AddFailedCheck(self, message: str, at: Any) -> None:  # noqa: N802
            assert at
            said.append(message.partition(" ")[0])

        _AddWarning = _AddFailedCheck

    rule = nvidia.checkpoint_rule_class(SimpleNamespace(BaseRuleChecker=Rule))()
    rule.CheckStage(Usd.Stage.Open(str(mistaken)))
    assert sorted(said) == ["N02", "P01", "W01"]


def test_a_stage_of_another_name_is_none_of_the_lab() -> None:
    assert list(checked_by_nvidia(EXAMPLE)) == []


def test_without_a_validator_the_plugin_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("usd_validation_nvidia", "omni.asset_validator", "omni.asset_validator.core"):
        monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(ImportError, match="no validator"):
        nvidia.plugin.on_startup()


def test_the_program_imports_no_validator() -> None:
    code = "import sys, lab3_usd.pipeline.stage; print([m for m in sys.modules if 'plugins' in m])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "lab3_usd.plugins" not in done.stdout
