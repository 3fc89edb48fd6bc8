"""Rules about the starter: who speaks of a change, how gravely, and who keeps silent."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from golden import assert_golden, problems_text
from msgspec.structs import replace
from pxr import Gf, Sdf, Usd, UsdGeom, UsdPhysics
from scene_stages import MATERIALS, slick
from submissions import LAB, ROBOT, SPEC, edit_stage

from lab3_usd.check.registry import rules_of
from lab3_usd.model.changes import KINDS, Change, Difference, Kind, Site, StarterSubject
from lab3_usd.model.finding import Finding, Problem, StageResult
from lab3_usd.pipeline.stage import check_stage
from lab3_usd.pipeline.starter_comparison import against_starter, open_starter
from lab3_usd.stage.write.builder import build_checkpoint
from lab3_usd.stage.write.starter import build_starter

RULES = {found.id: found for found in rules_of("starter", "U")}
WALL = "/Environment/Walls/East"
JOINT = f"{ROBOT}/joints/wheel_left_joint"
Edit = Callable[[Usd.Stage], None]
BASE = f"{ROBOT}/base_link"


def differing(kind: Kind, name: str = "", *, physics: bool = True) -> Difference:
    return Difference(kind, name, "before", "after", physics)


def change(prim: str, *differences: Difference, body: str = "") -> Change:
    return Change(prim, "Cube", differences, body=body)


def gone(prim: str, *, physics: bool = True, related: tuple[str, ...] = ()) -> Change:
    return Change(prim, "Xform", absent="missing", count=3, physics=physics, related=related)


def said(*changes: Change, blamed: tuple[Site, ...] = ()) -> list[tuple[str, Problem]]:
    subject = StarterSubject(SPEC.starter, changes, frozenset(blamed))
    return [
        (rule_id, each) for rule_id, found in RULES.items() for each in list(found.check(subject))
    ]


def rules_said(*changes: Change, blamed: tuple[Site, ...] = ()) -> list[str]:
    return [rule_id for rule_id, _ in said(*changes, blamed=blamed)]


# -- who speaks, and how gravely


def test_what_is_said_of_each_difference_is_as_it_was() -> None:
    names = ("mass", "size")
    changes = {
        f"{kind} {physics}": change(WALL, *(differing(kind, n, physics=physics) for n in names))
        for kind in KINDS
        for physics in (True, False)
    }
    changes |= {
        "an unnamed one": change(WALL, differing("type")),
        "of a body": change(WALL, differing("physics", "physics:mass"), body=BASE),
        "gone": gone(WALL),
        "gone alone": replace(gone(WALL), count=1),
        "gone with one": replace(gone(WALL), count=2, physics=False),
        "deactivated": replace(gone(WALL), absent="deactivated"),
    }
    shown = {}
    for name, found in changes.items():
        problems: dict[str, list[Problem]] = {}
        for rule_id, problem in said(found):
            problems.setdefault(rule_id, []).append(problem)
        shown[name] = problems_text(problems, LAB)
    assert_golden("starter-faults", shown)


@pytest.mark.parametrize(
    ("kind", "rule_id"),
    [("type", "U02"), ("schema", "U03"), ("physics", "U04"), ("place", "U05"), ("look", "U06")],
)
def test_each_kind_of_difference_has_its_rule(kind: Kind, rule_id: str) -> None:
    ((found, problem),) = said(change(WALL, differing(kind, "size")))
    assert (found, problem.prim, problem.property) == (rule_id, WALL, "size")
    assert (problem.expected, problem.actual) == ("before", "after")


def test_the_gravest_difference_of_a_prim_speaks_for_all() -> None:
    ((found, problem),) = said(
        change(
            WALL,
            differing("look", "visibility", physics=False),
            differing("place", "xformOp:translate"),
            differing("physics", "physics:mass"),
        )
    )
    assert (found, problem.property, problem.severity) == ("U04", "physics:mass", "error")
    assert "visibility" in problem.message


def test_a_long_list_of_differences_is_cut_short() -> None:
    many = [differing("physics", f"physics:p{number}") for number in range(9)]
    ((_, problem),) = said(change(WALL, *many))
    assert "physics:p3" in problem.message
    assert "physics:p4" not in problem.message
    assert "5 more" in problem.message


@pytest.mark.parametrize(("physics", "severity"), [(True, "error"), (False, "warning")])
def test_physics_is_an_error_and_what_is_seen_a_warning(*, physics: bool, severity: str) -> None:
    ((_, moved),) = said(change(WALL, differing("place", physics=physics)))
    ((_, missing),) = said(gone(WALL, physics=physics))
    assert (moved.severity, missing.severity) == (severity, severity)


def test_a_subtree_that_vanished_is_one_finding_that_counts() -> None:
    ((found, problem),) = said(gone("/Environment/Walls"))
    assert found == "U01"
    assert "2 prims below" in problem.message


def test_without_changes_nothing_is_said() -> None:
    assert said() == []


# -- who keeps silent

SILENT: list[tuple[str, Change, Site]] = [
    (
        "the same property",
        change(BASE, differing("physics", "physics:mass")),
        (BASE, "physics:mass"),
    ),
    ("the whole prim", change(BASE, differing("look", "visibility")), (BASE, None)),
    ("the schema of a value", change(BASE, differing("schema")), (BASE, "physics:mass")),
    (
        "the schema on a shape of a body",
        change(f"{BASE}/collisions/body", differing("schema"), body=BASE),
        (BASE, "physics:collisionEnabled"),
    ),
    (
        "the place of a shape of a body",
        change(f"{BASE}/collisions/body", differing("place"), body=BASE),
        (BASE, None),
    ),
    (
        "another way to turn",
        change(BASE, differing("place", "xformOp:orient")),
        (BASE, "xformOp:rotateXYZ"),
    ),
    (
        "the other half of an axis",
        change(JOINT, differing("physics", "physics:localRot0")),
        (JOINT, "physics:axis"),
    ),
    ("a missing prim", gone(JOINT), (JOINT, None)),
    ("a prim below", gone(f"{ROBOT}/joints"), (JOINT, None)),
    ("a prim above", gone("/Environment/GroundPlane"), ("/Environment", None)),
    ("a link left loose", gone(f"{ROBOT}/joints/scan_joint", related=(BASE,)), (BASE, None)),
    (
        "a link tied elsewhere",
        change(JOINT, Difference("physics", "physics:body1", BASE, WALL, physics=True)),
        (BASE, None),
    ),
]


@pytest.mark.parametrize(
    ("found", "site"), [each[1:] for each in SILENT], ids=[s[0] for s in SILENT]
)
def test_what_another_rule_has_said_is_not_said_again(found: Change, site: Site) -> None:
    assert len(rules_said(found)) == 1
    assert rules_said(found, blamed=(site,)) == []


@pytest.mark.parametrize(
    "site",
    [("/", None), ("/", "upAxis"), (WALL, "physics:mass"), (f"{BASE}/collisions", None)],
)
def test_a_fault_elsewhere_silences_nothing(site: Site) -> None:
    found = change(BASE, differing("physics", "physics:diagonalInertia"))
    assert rules_said(found, gone("/World/ObservationCamera"), blamed=(site,)) == ["U01", "U04"]


def test_of_two_differences_the_one_that_is_known_is_left_out() -> None:
    both = change(
        BASE, differing("physics", "physics:mass"), differing("physics", "physics:density")
    )
    ((_, problem),) = said(both, blamed=((BASE, "physics:mass"),))
    assert problem.property == "physics:density"
    assert "mass" not in problem.message


# -- on files


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A starter, and the finished lab made from it."""
    folder = tmp_path_factory.mktemp("files")
    build_starter(folder / "starter.usda")
    return folder / "starter.usda", build_checkpoint(
        folder / "starter.usda", "08", folder / "s.usda"
    )


def found_in(files: tuple[Path, Path], tmp_path: Path, *edits: object) -> StageResult:
    path = tmp_path / "Lab3_08.usda"
    path.write_bytes(files[1].read_bytes())
    for edit in edits:
        edit_stage(path, edit)  # type: ignore[arg-type]
    return against_starter(check_stage(path), open_starter(files[0], LAB), LAB)


def test_a_change_fails_the_stage_and_names_its_line(
    files: tuple[Path, Path], tmp_path: Path
) -> None:
    inertia = lambda stage: inertia_of(stage).Set(Gf.Vec3f(1, 1, 1))  # noqa: E731 - one deed
    result = found_in(files, tmp_path, inertia)
    (found,) = [finding for finding in result.findings if finding.severity != "note"]
    assert (found.rule, found.prim, found.property) == ("U04", BASE, "physics:diagonalInertia")
    assert result.verdict == "fail"
    assert found.layer == str(tmp_path / "Lab3_08.usda")
    assert found.line is not None
    line = Path(found.layer).read_text().splitlines()[found.line - 1]
    assert "physics:diagonalInertia" in line


def inertia_of(stage: Usd.Stage) -> Usd.Attribute:
    return stage.GetPrimAtPath(BASE).GetAttribute("physics:diagonalInertia")


def test_a_stage_that_changed_nothing_stays_as_it_was(
    files: tuple[Path, Path], tmp_path: Path
) -> None:
    result = found_in(files, tmp_path)
    assert result == check_stage(tmp_path / "Lab3_08.usda")
    assert result.verdict == "pass"


def test_an_unreadable_stage_is_not_compared(files: tuple[Path, Path], tmp_path: Path) -> None:
    path = tmp_path / "Lab3_08.usda"
    path.write_text("no stage")
    result = check_stage(path)
    assert against_starter(result, open_starter(files[0], LAB), LAB) is result


def test_sites_that_are_blamed_already_are_left_out(
    files: tuple[Path, Path], tmp_path: Path, subtests: pytest.Subtests
) -> None:
    path = tmp_path / "Lab3_08.usda"
    path.write_bytes(files[1].read_bytes())
    edit_stage(path, lambda stage: inertia_of(stage).Set(Gf.Vec3f(1, 1, 1)))
    blamed = Finding("S16", "inertia", "error", BASE, "is odd", "physics:diagonalInertia")
    result, starter = check_stage(path), open_starter(files[0], LAB)
    for known, told in (((), ["U04"]), ((blamed,), ["S16"])):
        with subtests.test(known=known, told=told):
            found = against_starter(replace(result, findings=known), starter, LAB)
            assert [finding.rule for finding in found.findings] == told


# -- units that are the starter's fault


def in_centimetres(stage: Usd.Stage) -> None:
    UsdGeom.SetStageMetersPerUnit(stage, 0.01)


def lying(stage: Usd.Stage) -> None:
    UsdGeom.SetStageUpAxis(stage, "Y")


def units_told(
    folder: Path, files: tuple[Path, Path], starters: list[Edit], stages: list[Edit]
) -> list[str]:
    """The severities of what is said of units, for a starter and a stage that were edited."""
    starter = folder / "own_starter.usda"
    starter.write_bytes(files[0].read_bytes())
    for edit in starters:
        edit_stage(starter, edit)
    path = folder / "Lab3_08.usda"
    path.write_bytes(files[1].read_bytes())
    for edit in stages:
        edit_stage(path, edit)
    result = against_starter(check_stage(path), open_starter(starter, LAB), LAB)
    return [finding.severity for finding in result.findings if finding.rule == "S02"]


def test_units_of_the_starter_are_one_warning(files: tuple[Path, Path], tmp_path: Path) -> None:
    both = [in_centimetres, lying]
    assert units_told(tmp_path, files, both, both) == ["warning"]


@pytest.mark.parametrize(
    ("starters", "stages", "told"),
    [
        ([], [lying], ["error"]),
        ([lying], [lying, in_centimetres], ["error", "warning"]),
        ([lying], [], []),
    ],
)
def test_units_that_the_starter_does_not_have_are_an_error(
    starters: list[Edit],
    stages: list[Edit],
    told: list[str],
    files: tuple[Path, Path],
    tmp_path: Path,
) -> None:
    assert units_told(tmp_path, files, starters, stages) == told


def test_a_target_velocity_is_a_command(files: tuple[Path, Path], tmp_path: Path) -> None:
    def command(stage: Usd.Stage) -> None:
        joint = stage.GetPrimAtPath(JOINT)
        joint.GetAttribute("drive:angular:physics:targetVelocity").Set(500.0)

    assert found_in(files, tmp_path, command).verdict == "pass"


@pytest.mark.parametrize(
    ("path", "home", "rule"),
    [
        (ROBOT, f"/World{ROBOT}", "S01"),
        (JOINT, f"{ROBOT}/joints/left", "S07"),
    ],
)
def test_what_stands_elsewhere_is_not_missing_as_well(
    files: tuple[Path, Path], tmp_path: Path, path: str, home: str, rule: str
) -> None:
    def move(stage: Usd.Stage) -> None:
        editor = Usd.NamespaceEditor(stage)
        assert editor.MovePrimAtPath(path, home)
        assert editor.ApplyEdits()

    found = [
        finding
        for finding in found_in(files, tmp_path, move).findings
        if finding.severity == "error"
    ]
    assert [(each.rule, each.prim) for each in found] == [(rule, home)]


def test_what_was_deactivated_is_told_though_a_finding_relates_to_it(
    subtests: pytest.Subtests,
) -> None:
    off = Change(WALL, "Cube", absent="deactivated", physics=True)
    for absent, expected in ((off, ["U01"]), (gone(WALL), [])):
        with subtests.test(absent=absent, expected=expected):
            subject = StarterSubject(SPEC.starter, (absent,), related_prims=frozenset({WALL}))
            found = [name for name, rule in RULES.items() for _ in list(rule.check(subject))]
            assert found == expected


# -- what another rule tells by its effect


GROUND = "/Environment/GroundPlane"
SCAN_JOINT = f"{ROBOT}/joints/scan_joint"


def raised(height: float) -> Edit:
    def put(stage: Usd.Stage) -> None:
        UsdGeom.XformCommonAPI(stage.GetPrimAtPath(GROUND)).SetTranslate(Gf.Vec3d(0, 0, height))

    return put


def switched_off(stage: Usd.Stage) -> None:
    stage.GetPrimAtPath(SCAN_JOINT).GetAttribute("physics:jointEnabled").Set(False)  # noqa: FBT003


def tied_to_itself(stage: Usd.Stage) -> None:
    joint = stage.GetPrimAtPath(SCAN_JOINT)
    joint.GetRelationship("physics:body0").SetTargets([f"{ROBOT}/base_scan"])


def articulated_elsewhere(stage: Usd.Stage) -> None:
    stage.GetPrimAtPath(f"{ROBOT}/base_footprint").RemoveAppliedSchema(ARTICULATION)
    stage.GetPrimAtPath(f"{ROBOT}/base_link").AddAppliedSchema(ARTICULATION)


def in_the_dark(stage: Usd.Stage) -> None:
    for light in ("Sun", "Sky"):
        prim = stage.GetPrimAtPath(f"/Environment/Lights/{light}")
        prim.GetAttribute("inputs:intensity").Set(0.0)


def another_shape_switched_off(stage: Usd.Stage) -> None:
    wheel = f"{ROBOT}/wheel_left_link"
    stage.GetPrimAtPath(f"{wheel}/collisions").SetActive(False)  # noqa: FBT003
    shape = UsdGeom.Cylinder.Define(stage, f"{wheel}/shape").GetPrim()
    UsdPhysics.CollisionAPI.Apply(shape).CreateCollisionEnabledAttr(False)  # noqa: FBT003


def unlit(stage: Usd.Stage) -> None:
    for light in ("Sun", "Sky"):
        prim = stage.GetPrimAtPath(f"/Environment/Lights/{light}")
        for share in ("inputs:diffuse", "inputs:specular"):
            prim.CreateAttribute(share, Sdf.ValueTypeNames.Float).Set(0.0)


def in_a_scene_without_gravity(stage: Usd.Stage) -> None:
    UsdPhysics.Scene.Define(stage, "/other").CreateGravityMagnitudeAttr(0.0)
    for link in stage.GetPrimAtPath(ROBOT).GetChildren():
        if link.HasAPI(UsdPhysics.RigidBodyAPI):
            UsdPhysics.RigidBodyAPI(link).CreateSimulationOwnerRel().SetTargets(["/other"])


def on_a_floor_that_looks_down(stage: Usd.Stage) -> None:
    home = "/Environment/GroundPlane"
    stage.GetPrimAtPath(f"{home}/CollisionPlane").SetActive(False)  # noqa: FBT003
    floor = UsdGeom.Mesh.Define(stage, f"{home}/Floor")
    floor.CreatePointsAttr([(-9, -9, 0), (9, -9, 0), (9, 9, 0), (-9, 9, 0)])
    floor.CreateFaceVertexCountsAttr([4])
    floor.CreateFaceVertexIndicesAttr([3, 2, 1, 0])
    UsdPhysics.CollisionAPI.Apply(floor.GetPrim())


ARTICULATION = "PhysicsArticulationRootAPI"


@pytest.mark.parametrize(
    ("edit", "rule"),
    [
        (unlit, "S14"),
        (in_a_scene_without_gravity, "S15"),
        (on_a_floor_that_looks_down, "S13"),
        (switched_off, "S12"),
        (tied_to_itself, "S12"),
        (raised(-0.1), "S19"),
        (articulated_elsewhere, "S11"),
        (slick(*MATERIALS), "S25"),
        (in_the_dark, "S14"),
        (another_shape_switched_off, "S06"),
    ],
)
def test_a_change_is_told_once_by_the_rule_of_its_effect(
    tmp_path: Path, edit: Edit, rule: str
) -> None:
    starter = tmp_path / "starter.usda"
    build_starter(starter)
    edit_stage(starter, raised(0.0))
    stage = build_checkpoint(starter, "00", tmp_path / "Lab3_00_student_start.usda")
    edit_stage(stage, edit)
    result = against_starter(check_stage(stage), open_starter(starter, LAB), LAB)
    assert [finding.rule for finding in result.findings if finding.severity != "note"] == [rule]


TYRE = f"{ROBOT}/wheel_left_link/collisions/tyre"


def larger_tyre(stage: Usd.Stage) -> None:
    stage.GetPrimAtPath(TYRE).GetAttribute("radius").Set(0.05)


def lower_link(stage: Usd.Stage) -> None:
    link = stage.GetPrimAtPath(f"{ROBOT}/wheel_left_link")
    link.GetAttribute("xformOp:translate").Set(Gf.Vec3d(0, 0.08, -0.1))


@pytest.mark.parametrize(("edit", "rules"), [(larger_tyre, ["U04"]), (lower_link, ["S19"])])
def test_a_link_off_the_ground_is_told_unless_a_changed_shape_is_why(
    tmp_path: Path, edit: Edit, rules: list[str]
) -> None:
    starter = tmp_path / "starter.usda"
    build_starter(starter)
    stage = build_checkpoint(starter, "00", tmp_path / "Lab3_00_student_start.usda")
    edit_stage(stage, edit)
    result = against_starter(check_stage(stage), open_starter(starter, LAB), LAB)
    assert [finding.rule for finding in result.findings if finding.severity == "error"] == rules
