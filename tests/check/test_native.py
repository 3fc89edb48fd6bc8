"""`--native`: OpenUSD's own validators as rules of the family UV."""

from __future__ import annotations

import subprocess
import sys
import zipfile
from pathlib import Path
from typing import Any

import pytest
import quick_yaml
from breaking import correct_stage
from in_process import invoke as lab3
from menu_graphs import MENUS, with_menus
from places import TESTS
from pxr import Usd, UsdGeom, UsdValidation
from report_examples import assert_valid

import lab3_usd.stage.read.native_validators as reading
from lab3_usd.check.registry import all_rules
from lab3_usd.check.rule_runs import run_family
from lab3_usd.check.rules.native import OTHER, VALIDATORS, rule_of
from lab3_usd.errors import UsageError
from lab3_usd.model.native import FAMILY, NativeError, NativeErrors
from lab3_usd.pipeline.stage import JudgeSettings, lint_stage
from lab3_usd.stage.read.native_validators import native_errors

EXAMPLE = TESTS.parent / "docs" / "examples" / "carter.usda"
FAULTS: dict[str, dict[str, Any]] = quick_yaml.load(
    (TESTS / "check/native_faults.yaml").read_text()
)
HEADER = ('defaultPrim = "World"', "metersPerUnit = 1", 'upAxis = "Z"')
KNOWN = {each.name for each in UsdValidation.ValidationRegistry().GetAllValidatorMetadata()}
NATIVE = JudgeSettings(native=True)
SPHERE = '    def Sphere "shape" (prepend apiSchemas = ["PhysicsCollisionAPI"])'
SCALE = """
    {
        float3 xformOp:scale = (1, 2, 3)
        uniform token[] xformOpOrder = ["xformOp:scale"]
    }
"""


def layer(body: str, *header: str) -> str:
    lines = "\n    ".join(header or HEADER)
    return f"#usda 1.0\n(\n    {lines}\n)\n{body}"


def written(path: Path, body: str, *header: str) -> Path:
    path.write_text(layer(body, *header))
    return path


def told_by(rule: str, path: Path) -> set[str]:
    """Return what one rule says of a stage, as `severity prim property`."""
    stage = Usd.Stage.Open(str(path))
    found = run_family(
        "native", FAMILY, NativeErrors(native_errors(stage, str(path))), None
    ).findings
    return {
        f"{each.severity} {each.prim} {each.property or ''}".strip()
        for each in found
        if each.rule == rule
    }


@pytest.fixture
def scaled(tmp_path: Path) -> Path:
    """A stage with one fault of a collider, at line 9."""
    body = f'def Xform "World"\n{{\n{SPHERE}{SCALE}}}\n'
    return written(tmp_path / "scaled.usda", body)


@pytest.mark.parametrize("rule", FAULTS)
def test_a_validator_tells_its_fault_as_its_rule(rule: str, tmp_path: Path) -> None:
    if VALIDATORS[rule] not in KNOWN:
        pytest.skip("a validator of a newer usd-core")
    case = FAULTS[rule]
    broken = written(tmp_path / "broken.usda", case["usda"], *case.get("header", ()))
    assert told_by(rule, broken) == {case["expect"]}
    assert told_by(rule, written(tmp_path / "clear.usda", case["clear"])) == set()


def packed(path: Path, files: dict[str, str], how: int = zipfile.ZIP_STORED) -> Path:
    with zipfile.ZipFile(path, "w", how) as package:
        for name, text in files.items():
            entry = zipfile.ZipInfo(name)
            entry.compress_type = how if name != "root.usda" else zipfile.ZIP_STORED
            used = package.fp.tell() + 30 + len(name) + 4  # type: ignore[union-attr]
            gap = -used % 64
            entry.extra = (0x1986).to_bytes(2, "little") + gap.to_bytes(2, "little") + bytes(gap)
            package.writestr(entry, text)
    return path


ROOT = layer('def Xform "World"\n{\n}\n')
TEXT = "nothing " * 40


@pytest.mark.parametrize(
    ("rule", "files", "how"),
    [
        ("UV71", {"root.usda": ROOT, "notes.txt": TEXT}, zipfile.ZIP_STORED),
        ("UV73", {"root.usda": ROOT, "more.usda": ROOT}, zipfile.ZIP_DEFLATED),
    ],
)
def test_packages_are_looked_into(
    rule: str, files: dict[str, str], how: int, tmp_path: Path
) -> None:
    (found,) = told_by(rule, packed(tmp_path / "bad.usdz", files, how))
    assert found.startswith("error /")
    good = packed(tmp_path / "good.usdz", {"root.usda": ROOT, "more.usda": ROOT})
    assert told_by(rule, good) == set()


def test_a_package_that_refers_outside_is_told(tmp_path: Path) -> None:
    (tmp_path / "outside").mkdir()
    part = written(tmp_path / "outside" / "part.usda", 'def Xform "World"\n{\n}\n')
    text = layer(f'def Xform "World" (references = @{part}@)\n{{\n}}\n')
    found = told_by("UV72", packed(tmp_path / "open.usdz", {"root.usda": text}))
    assert {each.split()[0] for each in found} == {"warning"}
    assert told_by("UV72", packed(tmp_path / "closed.usdz", {"root.usda": ROOT})) == set()


def test_a_package_that_a_stage_uses_is_looked_into(tmp_path: Path) -> None:
    body = 'def Xform "World" (references = @part.usdz@)\n{\n}\n'
    stage = written(tmp_path / "stage.usda", body)
    packed(tmp_path / "part.usdz", {"root.usda": ROOT, "more.usda": ROOT})
    assert told_by("UV74", stage) == set()
    files = {"root.usda": ROOT, "more.usda": ROOT}
    packed(tmp_path / "squeezed.usdz", files, zipfile.ZIP_DEFLATED)
    other = written(tmp_path / "other.usda", body.replace("part.usdz", "squeezed.usdz"))
    assert {each.split()[0] for each in told_by("UV74", other)} == {"error"}


def test_every_validator_of_this_usd_core_is_a_rule() -> None:
    native = {each for each in KNOWN if not each.startswith("lab3")}
    assert native <= {*VALIDATORS.values()}
    rules = {rule.id for rule in all_rules().values() if rule.family == FAMILY}
    assert rules == {*VALIDATORS, OTHER}


def test_a_manual_names_the_validator() -> None:
    whys = {rule: all_rules()[rule].section("Why") for rule in VALIDATORS}
    assert [rule for rule, name in VALIDATORS.items() if f"`{name}`" not in whys[rule]] == []


def test_a_validator_that_nobody_knows_is_told_under_its_own_name() -> None:
    assert rule_of("usdNewValidators:Odd") == OTHER
    errors = (NativeError("usdNewValidators:Odd", "Odd", "warning", "/World", None, "is odd"),)
    (found,) = run_family("native", FAMILY, NativeErrors(errors), None).findings
    assert (found.rule, found.severity) == (OTHER, "warning")
    assert found.message == "usdNewValidators:Odd: is odd"


def test_findings_have_our_lines_and_formats(scaled: Path) -> None:
    done = lab3("lint", "--native", "--format", "json", scaled)
    assert done.exit_code == 1
    (result,) = assert_valid(done.stdout)["results"]
    (found,) = result["findings"]
    assert (found["rule"], found["prim"], found["line"]) == ("UV21", "/World/shape", 9)
    assert str(scaled) in lab3("lint", "--native", "--format", "github", scaled).stdout


def test_without_the_option_nothing_of_it_is_said_or_imported(scaled: Path) -> None:
    code = (
        "import sys; from lab3_usd.cli import main\n"
        "try: main()\n"
        "finally: print([m for m in sys.modules if 'alidation' in m or m.endswith('native')])"
    )
    command = [sys.executable, "-c", code, "lint", str(scaled)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert "scaled.usda: pass" in done.stdout
    assert done.stdout.splitlines()[-1] == "[]"


@pytest.mark.parametrize(
    ("options", "found"),
    [
        (["--select", "UV"], True),
        (["--select", "UV21"], True),
        (["--select", "UV22"], False),
        (["--select", "U"], False),
        (["--native", "--ignore", "UV"], False),
        (["--native", "--ignore", "U"], True),
        (["--native", "--select", "K"], False),
    ],
)
def test_rules_and_the_family_are_selected_and_ignored(
    options: list[str], *, found: bool, scaled: Path
) -> None:
    assert ("UV21" in lab3("lint", *options, scaled).stdout) is found


def test_a_note_in_the_stage_ignores_one_of_them(scaled: Path) -> None:
    text = scaled.read_text().replace(SPHERE, f"    # lab3: ignore[UV21] on purpose\n{SPHERE}")
    scaled.write_text(text)
    assert lab3("lint", "--native", scaled).exit_code == 0


def test_a_configuration_may_ask_for_them_and_set_their_severity(scaled: Path) -> None:
    settings = 'select = ["K", "UV"]\n[severity]\nUV = "warning"\nU = "note"\n'
    (scaled.parent / "lab3.toml").write_text(settings)
    done = lab3("lint", scaled)
    assert done.exit_code == 0
    assert "warning UV21 collider-shape" in done.stdout


def test_what_rests_on_assets_elsewhere_is_a_note(tmp_path: Path) -> None:
    body = 'def Xform "World" (references = @https://far.example/robot.usd@)\n{\n}\n'
    findings = lint_stage(written(tmp_path / "far.usda", body), NATIVE).findings
    told = {
        finding.rule: finding.severity for finding in findings if finding.rule.startswith(FAMILY)
    }
    assert told == {"UV01": "note", "UV70": "note"}


def test_a_shader_of_a_kind_that_only_the_application_has_is_a_note(tmp_path: Path) -> None:
    body = (
        'def Shader "World"\n{\n    uniform token info:implementationSource = "sourceAsset"\n'
        "    uniform asset info:mdl:sourceAsset = @OmniPBR.mdl@\n}\n"
    )
    assert {each.split()[0] for each in told_by("UV36", written(tmp_path / "a.usda", body))} == {
        "note"
    }


def test_a_fault_in_another_layer_is_told_where_the_stage_shows_it(tmp_path: Path) -> None:
    part = 'def Xform "World"\n{\n    def PhysicsScene "scene"\n    {\n        '
    written(tmp_path / "part.usda", f"{part}token physics:gravityDirection\n    }}\n}}\n")
    body = 'def Xform "World"\n{\n    def "room" (references = @part.usda@)\n    {\n    }\n}\n'
    (found,) = lint_stage(written(tmp_path / "whole.usda", body), NATIVE).findings
    assert (found.rule, found.prim) == ("UV02", "/World/room/scene")
    assert (found.property, found.line) == ("physics:gravityDirection", 11)
    assert found.layer == str(tmp_path / "part.usda")


def test_messages_name_files_as_they_were_given_and_nothing_of_one_run(tmp_path: Path) -> None:
    stage = written(tmp_path / "ring.usda", FAULTS["UV01"]["usda"])
    opened = [native_errors(Usd.Stage.Open(str(stage)), "ring.usda") for _ in range(2)]
    assert opened[0] == opened[1]
    (error,) = opened[0]
    assert "@ring.usda@" in error.message
    assert "anon:" not in error.message


def test_time_samples_are_judged_as_they_are_saved(tmp_path: Path) -> None:
    body = 'def Xform "World"\n{\n    double size.timeSamples = {1: 1, 2: 2}\n}\n'
    assert lint_stage(written(tmp_path / "moving.usda", body), NATIVE).findings == ()


def natively(path: Path) -> set[tuple[str, str]]:
    """Return rule and prim of what the framework itself says, as `usdchecker` runs it."""
    registry = UsdValidation.ValidationRegistry()
    context = UsdValidation.ValidationContext(registry.GetOrLoadAllValidators())
    stage = Usd.Stage.Open(str(path))  # errors name it and do not hold it
    return {
        (rule_of(str(each.GetValidator().GetMetadata().name)), _prim(each.GetSites()[0]))
        for each in context.Validate(stage)
    }


def _prim(site: Any) -> str:
    if site.IsValid() and site.IsPrim():
        return str(site.GetPrim().GetPath())
    if site.IsValid() and site.IsProperty():
        return str(site.GetProperty().GetPrimPath())
    return str(site.GetPropertySpec().path.GetPrimPath()) if site.IsValidSpecInLayer() else "/"


@pytest.fixture(params=["vendor", "menus", "odd"])
def any_stage(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    if request.param == "vendor":
        return EXAMPLE
    if request.param == "menus":
        path = tmp_path / "menus.usda"
        menus = with_menus(*MENUS)
        menus.GetRootLayer().Export(str(path))
        return path
    parts = [FAULTS[each]["usda"] for each in ("UV02", "UV11", "UV23", "UV32", "UV36")]
    named = [part.replace("World", f"Part{n}") for n, part in enumerate(parts)]
    return written(tmp_path / "odd.usda", "".join(named).replace("Paint", "Paint0"))


def test_the_framework_itself_says_the_same(any_stage: Path) -> None:
    told = lint_stage(any_stage, NATIVE).findings
    ours = {(each.rule, each.prim) for each in told if each.rule.startswith(FAMILY)}
    assert ours == natively(any_stage)


def test_check_runs_them_too_and_asks_no_requirement_of_them(tmp_path: Path) -> None:
    stage = correct_stage("00")
    UsdGeom.Cube.Define(stage, "/World/outer")
    UsdGeom.Sphere.Define(stage, "/World/outer/inner")
    path = tmp_path / "Lab3_00_mine.usda"
    stage.GetRootLayer().Export(str(path))
    (without,) = assert_valid(lab3("check", "--format", "json", path).stdout)["results"]
    (with_them,) = assert_valid(lab3("check", "--native", "--format", "json", path).stdout)[
        "results"
    ]
    told = [each for each in with_them["findings"] if each["rule"].startswith(FAMILY)]
    assert [(each["rule"], each["prim"]) for each in told] == [("UV11", "/World/outer/inner")]
    assert [each for each in with_them["findings"] if each not in told] == without["findings"]
    assert with_them["score"] == without["score"]


def test_a_submission_is_judged_by_them(tmp_path: Path) -> None:
    for number in ("00", "01"):
        stage = correct_stage(number)
        UsdGeom.Cube.Define(stage, "/World/outer")
        UsdGeom.Sphere.Define(stage, "/World/outer/inner")
        stage.GetRootLayer().Export(str(tmp_path / f"Lab3_{number}_mine.usda"))
    results = assert_valid(lab3("check", "--native", "--format", "json", tmp_path).stdout)[
        "results"
    ]
    told = [{each["rule"] for each in result["findings"]} for result in results]
    assert [FAMILY + "11" in each for each in told] == [True, True]


def test_a_file_that_cannot_be_read_stays_one_finding(tmp_path: Path) -> None:
    (tmp_path / "bad.usda").write_text("#usda 1.0\ndef {\n")
    result = lint_stage(tmp_path / "bad.usda", NATIVE)
    assert (result.verdict, [finding.rule for finding in result.findings]) == (
        "unreadable",
        ["F01"],
    )


@pytest.fixture
def old_usd(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delattr("pxr.UsdValidation")
    monkeypatch.setitem(sys.modules, "pxr.UsdValidation", None)


@pytest.mark.usefixtures("old_usd")
@pytest.mark.parametrize("command", ["lint", "check"])
def test_an_older_usd_core_is_refused_with_one_line(command: str) -> None:
    with pytest.raises(UsageError, match=r"usd-core has from 25\.5 on; here is \d") as refused:
        lab3(command, "--native", EXAMPLE)
    assert "\n" not in str(refused.value)


@pytest.mark.usefixtures("old_usd")
def test_without_the_option_an_older_usd_core_is_enough() -> None:
    assert lab3("lint", "--quiet", EXAMPLE).exit_code == 1


def test_validators_written_in_python_are_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[list[str]] = []
    module = reading.native_validation()

    class Registry:
        def __init__(self) -> None:
            self.real = module.ValidationRegistry()

        def GetAllValidatorMetadata(self) -> list[Any]:  # noqa: N802
            plugin = type("Plugin", (), {"isPythonModule": True})
            ours = type("Meta", (), {"name": "ours:One", "isSuite": False, "plugin": plugin})
            return [*self.real.GetAllValidatorMetadata(), ours]

        def GetOrLoadValidatorsByName(self, names: list[str]) -> Any:  # noqa: N802
            asked.append(names)
            return self.real.GetOrLoadValidatorsByName(names)

    fake = type("Module", (), {**vars(module), "ValidationRegistry": Registry})
    monkeypatch.setattr(reading, "native_validation", lambda: fake)
    native_errors(Usd.Stage.Open(str(EXAMPLE)), "carter.usda")
    assert asked[0]
    assert "ours:One" not in asked[0]
