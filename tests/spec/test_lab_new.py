"""`lab3 lab new`: a lab described after a stage, by which the stage passes."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
import yaml
from golden import assert_golden_text
from in_process import invoke
from msgspec.structs import replace
from other_labs import OWN, OWN_WIRES, files_below, write_stage
from places import REPOSITORY, SHARED, TESTS
from pxr import Sdf, Usd

from lab3_usd.check.robot.sensors import sensor_group
from lab3_usd.errors import Lab3Error
from lab3_usd.features.new_lab.lab import chosen_stages
from lab3_usd.grade.lab_schemas import schema_texts, with_schema
from lab3_usd.new_lab.checkpoints import (
    FileNames,
    file_names,
    names_of_stages,
    rubric_text,
    steps_of_stages,
)
from lab3_usd.new_lab.lab import describe_lab, write_folder
from lab3_usd.new_lab.yaml_text import as_typed, document
from lab3_usd.pipeline.stage import check_stage
from lab3_usd.report.options import tool_version
from lab3_usd.spec.lab import Lab
from lab3_usd.spec.load.loader import load_lab
from lab3_usd.spec.submission import named_checkpoint

CORPUS = SHARED / "corpus" / "stages"
JETBOT = REPOSITORY / "docs" / "examples" / "labs" / "jetbot"
PASSING = [
    "keenan88-isaacsim_ros2_greenhouse__arm_only--5363ff6ad0.usd",
    "keenan88-isaacsim_ros2_greenhouse__drive_wheel_test--4ddf70052f.usd",
    "keenan88-isaacsim_ros2_greenhouse__greenhouse_worker_v1--c734468427.usd",
]


def ran(*arguments: object) -> tuple[int, str]:
    result = invoke(*arguments)
    return result.exit_code, result.output


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The stage of checkpoint 05, which the bundled lab builds."""
    folder = tmp_path_factory.mktemp("built")
    return Path(ran("build", "--only", "05", "--out", folder)[1].strip())


@pytest.fixture(scope="module")
def described(built: Path) -> Path:
    """The lab that is described after it."""
    folder = built.parent / "lab"
    write_lab(folder, [built])
    return folder


def write_lab(folder: Path, stages: list[Path]) -> None:
    """Describe a lab as `lab new` does, which also checks and plays each stage by it."""
    files = describe_lab(stages, load_lab()).files
    named = {name: with_schema(name, text) for name, text in files.items()}
    write_folder(folder, {**named, **schema_texts()})


@pytest.fixture(scope="module")
def pair(described: Path) -> tuple[Lab, Lab]:
    """The described lab, and the bundled one."""
    return load_lab(described), load_lab()


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A stage of another robot, and the lab that is described after it."""
    made = tmp_path_factory.mktemp("robot")
    stage, folder = write_stage(made), made / "lab"
    assert "checkpoint yard, pass, " in ran("lab", "new", folder, "--from", stage)[1]
    return stage, folder


def test_the_stage_passes_by_the_lab_described_after_it(built: Path, described: Path) -> None:
    status, shown = ran("--lab", described, "check", "--quiet", built)
    assert status == 0
    assert re.search(r"checkpoint 05, pass, (\d+) of \1 met", shown)


def test_the_files_of_the_described_labs_are_as_they_were(
    described: Path, robot: tuple[Path, Path]
) -> None:
    for name, lab in {"bundled": described, "another-robot": robot[1]}.items():
        for path in sorted(lab.rglob("*.yaml")):
            text = path.read_text(encoding="utf-8").replace(tool_version(), "VERSION")
            assert_golden_text(f"described/{name}-{path.name}", text)


def test_the_described_lab_does_not_contradict_itself(described: Path) -> None:
    assert ran("lab", "check", described) == (0, "Lab3 05 odometry tf: 0 errors, 0 warnings\n")


def test_the_graphs_are_those_of_the_lab_that_built_the_stage(pair: tuple[Lab, Lab]) -> None:
    new, old = pair
    for name in old.checkpoints["05"].graphs:
        found, graph = new.graphs[name], old.graphs[name]
        assert found.path == graph.path
        assert {str(wire) for wire in found.wires} == {str(wire) for wire in graph.wires}
        for role, node in graph.nodes.items():
            made = found.nodes[role]
            assert (made.type.type, made.frames_from) == (node.type.type, node.frames_from)
            assert {target.port: target.prims for target in made.targets} == {
                target.port: target.prims for target in node.targets
            }
            assert {setting.port: setting.value for setting in made.settings} == {
                setting.port: setting.value for setting in node.settings
            }


def test_the_robot_is_measured(pair: tuple[Lab, Lab]) -> None:
    assert set(pair[0].frames.edges) == set(pair[1].frames.edges)
    new, old = (lab.scene.robot for lab in pair)
    assert (new.path, new.base_frame) == (old.path, old.base_frame)
    masses = {name: link.mass for name, link in old.links.items() if link.mass}
    found = {name: new.links[name].mass for name in masses}
    assert found == pytest.approx(masses, rel=1e-6)
    assert replace(new.wheels, handout=old.wheels.handout) == old.wheels


@pytest.mark.parametrize("name", ["lidar", "camera"])
def test_sensors_are_described_with_what_is_required_of_them(
    name: str, pair: tuple[Lab, Lab], subtests: pytest.Subtests
) -> None:
    new, old = (lab.sensors[name] for lab in pair)
    assert (new.kind, new.path, new.type) == (old.kind, old.path, old.type)
    assert new.pose.translate == old.pose.translate
    assert new.pose.rotate == old.pose.rotate
    for attribute, said in old.attributes.items():
        with subtests.test(attribute=attribute):
            found = new.attributes[attribute]
            assert (found.value, found.required) == (said.value, said.required)


def test_a_student_s_mistake_is_found_by_the_described_lab(
    built: Path, described: Path, tmp_path: Path
) -> None:
    stage = Usd.Stage.Open(str(built))
    clock = stage.GetPrimAtPath("/World/ROS_Clock/ros2_publish_clock")
    clock.GetAttribute("inputs:timeStamp").ClearConnections()
    stage.GetPrimAtPath("/turtlebot3_burger/base_link").GetAttribute("physics:mass").Set(2.0)
    wrong = tmp_path / built.name
    stage.Export(str(wrong))
    found = check_stage(wrong, lab=load_lab(described)).findings
    assert {each.rule for each in found if each.severity == "error"} == {"W01", "S04"}


def test_the_stages_that_the_described_lab_builds_pass_by_it(
    described: Path, tmp_path: Path
) -> None:
    starter = tmp_path / "starter.usda"
    ran("starter", "-o", starter)
    made = ran("--lab", described, "build", starter, "--out", tmp_path / "out")[1].split()
    assert Path(made[-1]).name == "Lab3_05_odometry_tf.usda"
    shown = ran("--lab", described, "check", "--quiet", *made)[1]
    assert shown.count(", pass, ") == len(made) == 6


def test_a_stage_of_another_robot_passes_by_its_lab(robot: tuple[Path, Path]) -> None:
    stage, folder = robot
    said = ran("lab", "check", folder)[1]  # the stage itself publishes what nothing measures
    assert said.count("(K10, in the stage that is built for checkpoint yard)") == 3
    assert said.endswith("0 errors, 3 warnings\n")
    shown = ran("--lab", folder, "check", "--quiet", stage)[1]
    assert "checkpoint yard, pass, 69 of 69 met" in shown


def test_a_node_of_an_unknown_type_is_described_by_its_ports(tmp_path: Path) -> None:
    path, folder = write_stage(tmp_path, OWN, OWN_WIRES), tmp_path / "lab"
    stage = Usd.Stage.Open(str(path))
    node = stage.GetPrimAtPath("/World/Inertia/filter")
    node.CreateAttribute("inputs:cutoff", Sdf.ValueTypeNames.Double).Set(4.0)
    stage.Save()
    assert "checkpoint yard, pass, " in ran("lab", "new", folder, "--from", path)[1]
    lab = load_lab(folder)
    kind = lab.platform.types["acme.filters.LowPass"]
    assert {name: port.ogn_type for name, port in kind.ports.items()} == {
        "inputs:execIn": "execution",
        "inputs:signal": "union",
        "inputs:cutoff": "double",
    }
    assert "imu.angVel -> filter.signal" in map(str, lab.graphs["Inertia"].wires)


def test_a_frame_that_no_tree_has_leaves_the_tree_unasked(built: Path, tmp_path: Path) -> None:
    stage = Usd.Stage.Open(str(built))
    graph = "/turtlebot3_burger/base_footprint/Camera_1/ROS_Camera"
    helper = stage.GetPrimAtPath(f"{graph}/ros2_camera_helper")
    helper.GetAttribute("inputs:frameId").Set("lens")
    other = tmp_path / built.name
    stage.Export(str(other))
    description = describe_lab([other], load_lab())
    place = "ROS_Camera.yaml: ros2_camera_helper: frameId"
    (left_out,) = (line for line in description.left_out if line.startswith(place))
    assert left_out.startswith(f"{place}: 'lens' is not a frame of the stage's tree")
    write_folder(tmp_path / "lab", description.files)
    assert not load_lab(tmp_path / "lab").checkpoints["05"].frames


@pytest.mark.parametrize("name", PASSING)
@pytest.mark.skipif(not CORPUS.is_dir(), reason="the stages of others are not here")
def test_stages_of_others_meet_what_their_labs_ask(name: str, tmp_path: Path) -> None:
    """Their robots are elsewhere, which is no pass."""
    status, shown = ran("lab", "new", tmp_path / "lab", "--from", CORPUS / name)
    assert (status, ", not judged, " in shown, "\nerror " in shown) == (1, True, False), shown
    assert ran("lab", "check", tmp_path / "lab")[0] == 0


def test_a_base_above_its_root_is_where_the_described_lab_has_it(
    repository: Path, tmp_path: Path
) -> None:
    carter = tmp_path / "carter.usda"
    shutil.copyfile(repository / "docs" / "examples" / "carter.usda", carter)
    lab = tmp_path / "lab"
    assert "checkpoint carter, pass, " in ran("lab", "new", lab, "--from", carter)[1]
    assert ran("--lab", lab, "check", carter)[1].endswith(" 0 errors, 0 warnings, 0 notes\n")
    stage = Usd.Stage.Open(str(carter))
    base = stage.GetPrimAtPath("/World/Carter/chassis_link")
    base.GetAttribute("xformOp:translate").Set((1.0, 0.0, 0.14))
    stage.GetRootLayer().Save()
    said = ran("--lab", lab, "check", carter)[1]
    assert "note S22 starts-elsewhere /World/Carter/chassis_link.xformOp:translate" in said


def test_a_rig_that_nothing_moves_is_described_by_its_body(tmp_path: Path) -> None:
    rig = TESTS / "labs" / "rig"
    stage = ran("--lab", rig, "build", "--only", "rear", "-o", tmp_path)[1].strip()
    assert "checkpoint rear, pass, " in ran("lab", "new", tmp_path / "lab", "--from", stage)[1]
    robot = load_lab(tmp_path / "lab").scene.robot
    assert (robot.path, robot.base_frame) == ("/Yard/Rig", "post")
    assert robot.articulation.target == ""
    assert ran("--lab", tmp_path / "lab", "check", stage)[1].endswith(" 0 warnings, 0 notes\n")


def test_a_stage_that_does_not_pass_is_said_with_its_errors(tmp_path: Path) -> None:
    right = Path(ran("build", "--only", "01", "--out", tmp_path / "right")[1].strip())
    other = tmp_path / right.name
    layer = (
        f'(\n    subLayers = [@{right}@, @gone.usda@]\n    upAxis = "Z"\n    metersPerUnit = 1\n)'
    )
    other.write_text(f"#usda 1.0\n{layer}\n")
    status, shown = ran("lab", "new", tmp_path / "lab", "--from", other)
    assert status == 1
    assert "error F03 /: sublayer gone.usda cannot be found" in shown
    assert (tmp_path / "lab" / "scene.yaml").is_file()


def refusal(folder: Path, stage: Path) -> str:
    with pytest.raises(Lab3Error) as refused:
        invoke("lab", "new", folder, "--from", stage)
    return str(refused.value)


def test_a_folder_that_exists_is_kept(built: Path, tmp_path: Path) -> None:
    assert refusal(tmp_path, built) == f"{tmp_path} exists; name a new folder"
    assert list(tmp_path.iterdir()) == []


def test_a_stage_without_a_graph_gives_a_scene_and_an_empty_course(tmp_path: Path) -> None:
    starter, folder = tmp_path / "starter.usda", tmp_path / "lab"
    ran("starter", "-o", starter)
    code, said = ran("lab", "new", folder, starter)
    assert code == 0
    assert "checkpoint starter, pass, " in said
    lab = load_lab(folder)
    assert not lab.graphs
    assert lab.scene.robot.path == "/turtlebot3_burger"


def test_a_parent_that_holds_graphs_alone_comes_with_them(tmp_path: Path) -> None:
    stage = Usd.Stage.Open(str(write_stage(tmp_path)))
    layer = stage.GetRootLayer()
    Sdf.CreatePrimInLayer(layer, "/Graph").specifier = Sdf.SpecifierDef
    Sdf.CopySpec(layer, "/World/Wheels", layer, "/Graph/Wheels")
    stage.RemovePrim("/World/Wheels")
    stage.Save()
    folder = tmp_path / "lab"
    ran("lab", "new", folder, tmp_path / "carter_yard.usda")
    assert "/Graph" not in [
        f"/{name}" for name in yaml.safe_load((folder / "starter.yaml").read_text())["prims"]
    ]
    parent = load_lab(folder).scene.world.graph_parent
    assert parent is not None
    assert parent.path == "/World"


def test_a_stage_that_is_not_there_is_said(tmp_path: Path) -> None:
    gone = tmp_path / "gone.usda"
    assert refusal(tmp_path / "lab", gone) == f"{gone}: there is no such file"


@pytest.mark.parametrize(
    ("stem", "pattern", "ids"),
    [
        ("Lab3_05_odometry", "Lab3_{id}_{name}", ("03", "04", "05")),
        ("Lab3_01_odometry", "Lab3_{id}_{name}", ("start", "ROSTF", "01")),
        ("carter_yard", "carter_{id}", ("start", "ROSTF", "yard")),
        ("room(v2)", "room({id})", ("start", "ROSTF", "v2")),
        ("start", "{id}", ("startx", "ROSTF", "start")),
    ],
)
def test_the_last_checkpoint_has_the_name_of_the_stage(
    stem: str, pattern: str, ids: tuple[str, ...]
) -> None:
    found = file_names(stem, ("ROS_TF", "Odometry"))
    assert (found.pattern, tuple(each.upper() for each in found.ids)) == (
        pattern,
        tuple(each.upper() for each in ids),
    )
    last = found.pattern.replace("{id}", found.ids[-1]).replace("{name}", found.names[-1])
    assert last == stem


@pytest.mark.parametrize(
    "value",
    [
        "on",
        "No",
        "~/lab",
        "07",
        "1e3",
        "a: b",
        "# no comment",
        "- x",
        "two\nlines",
        "Ü ß",
        "",
        " x",
        "odom -> base",
        "/scan",
        "omni:sensor",
        1e-05,
        1e22,
        -0.0,
        3,
        True,
        [],
        {},
        [[1.0, 2.0], ["y"]],
        {"y": {"00": ["a", {"b": True}]}},
        ["long " * 12, "longer " * 12],
    ],
)
def test_what_is_written_is_read_again(value: object) -> None:
    text = document("A head.", {"key": value, "n": {"inner": value}}, {"n.inner": "A note."})
    assert yaml.safe_load(text) == {"key": value, "n": {"inner": value}}


@pytest.mark.parametrize(
    ("stems", "pattern", "ids"),
    [
        (("Week5_1_start", "Week5_2_clock"), "Week5_{id}_{name}", ("1", "2")),
        (("lab08", "lab09", "lab10"), "lab{id}", ("08", "09", "10")),
        (("start", "jet_a", "jet_b"), "{id}", ("start", "jet_a", "jet_b")),
        (("jet", "jet_a", "jet-b2"), "{id}", ("jet", "jet_a", "jet-b2")),
        (("arm_clock_v2", "arm_joints_v2"), "arm_{id}_v2", ("clock", "joints")),
        (("clear", "clock"), "{id}", ("clear", "clock")),
    ],
)
def test_checkpoints_are_called_as_their_stages(
    stems: tuple[str, ...], pattern: str, ids: tuple[str, ...]
) -> None:
    names = names_of_stages(stems)
    assert (names.pattern, names.ids) == (pattern, ids)
    files = {
        id_: pattern.replace("{id}", id_).replace("{name}", name)
        for id_, name in zip(names.ids, names.names, strict=True)
    }
    assert tuple(files.values()) == stems
    assert [named_checkpoint(stem, files) for stem in stems] == list(ids)


@pytest.mark.parametrize("stems", [("a/b", "c"), ("clock", "clock"), ("the arm", "the clock, too")])
def test_names_that_tell_no_checkpoints_apart_are_refused(stems: tuple[str, ...]) -> None:
    with pytest.raises(Lab3Error):
        names_of_stages(stems)


@pytest.mark.parametrize(
    ("saved", "typed"),
    [
        (1.2999999523162842, 1.3),
        (1.29999995, 1.3),
        (0.10000000149011612, 0.1),
        (0.1 + 0.2, 0.3),
        (0.1125, 0.1125),
        (1234.5678, 1234.5678),
        (0.0, 0.0),
        (7, 7),
        (True, True),
        ((0.699999988079071, 2.0), (0.7, 2.0)),
    ],
)
def test_numbers_are_written_as_people_type_them(saved: object, typed: object) -> None:
    assert as_typed(saved) == typed


@pytest.fixture(scope="module")
def week(tmp_path_factory: pytest.TempPathFactory) -> tuple[list[Path], Path]:
    """The stages of the second lab, and the lab described after all of them."""
    folder = tmp_path_factory.mktemp("week")
    stages = [Path(line) for line in ran("--lab", JETBOT, "build", "--out", folder)[1].split()]
    write_lab(folder / "lab", stages)
    return stages, folder / "lab"


def changed(path: Path, folder: Path, change: Callable[[Usd.Stage], object]) -> Path:
    """Write a stage again, changed, under its name."""
    other = folder / path.name
    shutil.copyfile(path, other)
    stage = Usd.Stage.Open(str(other))
    change(stage)
    stage.GetRootLayer().Save()
    return other


def from_all(stages: list[Path]) -> list[object]:
    return [word for stage in stages for word in ("--from", stage)]


def test_the_second_lab_is_the_one_that_its_stages_describe(
    week: tuple[list[Path], Path],
) -> None:
    assert files_below(week[1]) == files_below(JETBOT)


def test_every_stage_is_shown_as_checked_and_played(
    week: tuple[list[Path], Path], tmp_path: Path
) -> None:
    stages = week[0][:3]
    status, shown = ran("lab", "new", tmp_path / "lab", *from_all(stages))
    results = [line for line in shown.splitlines() if ": checkpoint " in line]
    assert len(results) == len(stages)
    assert all(", pass, " in line for line in results)
    assert [line.endswith("; sim ok") for line in results] == [False, True, True]
    assert (status, "Week 5: 0 errors, 0 warnings" in shown) == (0, True), shown


def test_stages_that_are_no_checkpoints_in_this_order_are_refused(
    week: tuple[list[Path], Path], tmp_path: Path
) -> None:
    stages = week[0]
    with pytest.raises(Lab3Error, match="Week5_2_clock has no graph /World/Jetbot/Drive"):
        invoke("lab", "new", tmp_path / "lab", *from_all([stages[2], stages[1]]))


def hangs_links_on_the_world(stage: Usd.Stage) -> None:
    graph = stage.GetPrimAtPath("/World/Jetbot/Odometry")
    graph.GetChild("publish_base").GetAttribute("inputs:childFrameId").Set("robot")
    graph.GetChild("publish_odometry").GetAttribute("inputs:chassisFrameId").Set("robot")
    graph.GetChild("links").GetRelationship("inputs:parentPrim").SetTargets([])


def test_a_lab_that_nothing_loads_passes_no_stage_and_says_what_to_decide(
    week: tuple[list[Path], Path], tmp_path: Path
) -> None:
    other, lab = changed(week[0][-1], tmp_path, hangs_links_on_the_world), tmp_path / "lab"
    status, shown = ran("lab", "new", lab, "--from", other)
    assert status == 1
    lines = (lab / "scene.yaml").read_text().splitlines()
    number = lines.index("  base_frame: chassis") + 1
    assert f"to be decided by you: {lab}/scene.yaml:{number}:15: robot: base_frame" in shown
    assert ", pass, " not in shown


def test_the_starter_is_written_without_graphs_and_sensors(
    week: tuple[list[Path], Path], tmp_path: Path
) -> None:
    stages, lab = week
    (made,) = ran("--lab", lab, "build", "--only", "7", "--out", tmp_path)[1].split()
    assert ran("diff", stages[-1], made)[1].endswith("no differences\n")


def brings_an_asset(stage: Usd.Stage) -> None:
    stage.GetPrimAtPath("/World/Room").GetReferences().AddInternalReference("/World/Jetbot/mast")


def has_a_mesh(stage: Usd.Stage) -> None:
    points = stage.DefinePrim("/World/Room/Rock", "Mesh").GetAttribute("points")
    points.Set([(0.0, 0.0, float(number)) for number in range(100)])


def has_no_robot(stage: Usd.Stage) -> None:
    stage.RemovePrim("/World/Jetbot")


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (brings_an_asset, "/World/Room brings in an asset"),
        (has_a_mesh, "/World/Room/Rock.points has more than 64 entries"),
        (has_no_robot, "/World/Jetbot is not in Week5_1_start"),
    ],
)
def test_a_starter_that_is_no_plain_text_is_left_out_with_its_reason(
    change: Callable[[Usd.Stage], None],
    reason: str,
    week: tuple[list[Path], Path],
    tmp_path: Path,
) -> None:
    first, *_, last = week[0]
    other = changed(first, tmp_path, change)
    described = describe_lab([other, last], load_lab())
    starter = [line for line in described.left_out if line.startswith("starter.yaml: ")]
    assert starter == [f"starter.yaml: {reason}; give the starter to every build"]
    assert "starter.yaml" not in described.files


def test_stages_of_a_folder_come_in_the_order_of_their_numbers(tmp_path: Path) -> None:
    for name in ("w10_b.usda", "w2_a.usda", "notes.txt", "w1_start.usd"):
        (tmp_path / name).touch()
    ordered = ["w1_start.usd", "w2_a.usda", "w10_b.usda"]
    assert [path.name for path in chosen_stages([tmp_path])] == ordered
    assert [path.name for path in chosen_stages([tmp_path / "w*.usda"])] == ordered[1:]
    named = [tmp_path / "w10_b.usda", tmp_path / "w2_a.usda"]
    assert [*chosen_stages(named)] == named


def test_a_sensor_that_is_called_as_a_graph_is_scored_apart(pair: tuple[Lab, Lab]) -> None:
    lab, _ = pair
    sensor = next(iter(lab.sensors))
    group = sensor_group(lab, sensor)
    graph = next(iter(lab.graphs.values()))
    assert group not in (*lab.graphs, sensor)
    assert sensor_group(replace(lab, graphs={**lab.graphs, group: graph}), sensor) == sensor


def test_the_tree_is_asked_for_from_its_first_part_on(pair: tuple[Lab, Lab]) -> None:
    names = FileNames("{id}", ("1", "2", "3"), ("1", "2", "3"))
    first, second = ("odom", "base"), ("base", "imu")
    trees = [(), (first,), (first, second)]
    graphs = [[], ["Clock"], ["Clock", "Imu"]]
    steps = steps_of_stages(names, graphs, [[], [], []], trees, (2,), removed={})
    assert [step.frames for step in steps] == [False, True, False]
    items = yaml.safe_load(rubric_text("Title", steps, (), pair[0]))["items"].values()
    assert [item["groups"] for item in items][1:] == [["Clock", "TF"], ["Imu", "TF"]]
