"""Students with one mistake or a chain of them, carried along, and which points are explained."""

from __future__ import annotations

import random
import shutil
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cache, lru_cache
from pathlib import Path
from tempfile import TemporaryDirectory

from breaking import Step, the_lab
from fault_stages import STAGES, steps
from grade_files import LAB, stage, starter
from msgspec import Struct
from msgspec.structs import replace
from pxr import Sdf, Usd
from quick_yaml import load
from scene_sabotage import scene_sabotage
from scene_stages import Change

from lab3_usd.check.checker import judge
from lab3_usd.check.match.graphs import match_all
from lab3_usd.check.match.rule_inputs import Roles
from lab3_usd.check.robot.location import relocated_lab, relocated_spec, robot_relocations
from lab3_usd.check.robot.sensors import sensor_relocations
from lab3_usd.grade.dry_runs import with_dry_runs
from lab3_usd.grade.rubric import Rubric, load_rubric
from lab3_usd.grade.scoring import Grade, StageFacts, SubmissionFacts, facts_of, grade_facts
from lab3_usd.model.finding import Finding, Requirement
from lab3_usd.model.stage import StageModel
from lab3_usd.pipeline.stage import check_stage
from lab3_usd.pipeline.starter_comparison import Starter, against_starter, open_starter
from lab3_usd.spec.lab import Lab
from lab3_usd.stage.read.stage_reader import read_model


def unexplained(
    lab: Lab,
    stage: StageModel,
    requirements: Iterable[Requirement],
    findings: Iterable[Finding],
) -> list[str]:
    """Return the ids of the unmet requirements that no finding speaks of."""
    told = list(findings)
    placed = relocated_lab(lab, robot_relocations(lab, stage))
    relocations = sensor_relocations(placed, stage)
    specs = {name: relocated_spec(spec, relocations) for name, spec in placed.graphs.items()}
    roles = match_all(specs, stage)
    return [
        requirement.id
        for requirement in requirements
        if not requirement.met and not any(_speaks(found, requirement, roles) for found in told)
    ]


def _speaks(found: Finding, asked: Requirement, roles: Mapping[str, Roles]) -> bool:
    if asked.kind == "scene":
        return found.severity == "error"  # met unless an error concerns it
    if asked.kind == "frame":
        return _speaks_of_frame(found, asked.id.rpartition("/")[2])
    if _names_graph(found, asked.group):
        return True
    ends = list(_ends(asked))
    own = roles[asked.group]
    if any(_says_gone(found, role, own) for role, _ in ends):
        return True
    return asked.kind != "node" and any(_names(found, role, port, own) for role, port in ends)


def _names_graph(found: Finding, name: str) -> bool:
    if found.rule == "G01":
        return f"graph {name} is missing" in found.message
    return name in found.message.partition("; missing with it: ")[2].split(", ")


def _ends(asked: Requirement) -> Iterator[tuple[str, str]]:
    """Yield the roles and ports that a requirement of a graph is about."""
    ends = asked.title.split(" -> ") if asked.kind == "wire" else [asked.id.rpartition("/")[2]]
    for end in ends:
        role, _, port = end.partition(".")
        yield role, port


def _says_gone(found: Finding, role: str, roles: Roles) -> bool:
    if found.rule == "N01":
        return roles.graph is not None and (
            found.prim == roles.graph.path and f"({role})" in found.message
        )
    other = roles.retyped.get(role)
    return found.rule == "N03" and other is not None and found.prim == other.path


def _names(found: Finding, role: str, port: str, roles: Roles) -> bool:
    node = roles.node_of[role]
    if node is None:
        return False
    site = f"{node.path}.inputs:{port}"
    return site == f"{found.prim}.{found.property}" or site in found.related


def _speaks_of_frame(found: Finding, frame: str) -> bool:
    return frame in f"{found.prim} {found.message} {found.expected}"


LONGEST = 4
TRIED = 60  # mistakes for one chain


@cache
def _known() -> tuple[Mistake, ...]:
    return tuple(mistake for mistake in mistakes() if mistake.changes)


@cache
def opened_starter() -> Starter:
    return open_starter(starter(), LAB)


@cache
def rubric() -> Rubric:
    return load_rubric(None, LAB)


def chain(number: int, checkpoint: str) -> Iterator[tuple[str, Grade]]:
    """Yield the grades of a submission as its stage of a checkpoint gets one mistake after another.

    The same ones for the same number; first without any. What is no fault by itself is left out.
    So is what changes the same as another, which it could repair, and what leaves nothing of
    another: the mistakes of a stage are then not one more. Where little is left to break, a chain
    is shorter.
    """
    chance = random.Random(f"{number} {checkpoint}")  # noqa: S311 - no secret
    made: list[Mistake] = []
    yield "right", grade_with(checkpoint)
    for mistake in chance.sample(_known(), TRIED):
        if _stands_beside(mistake, made, checkpoint) and judged(checkpoint, mistake).faults:
            made.append(mistake)
            yield mistake.name, grade_with(checkpoint, *made)
        if len(made) == LONGEST:
            return


def _stands_beside(mistake: Mistake, made: list[Mistake], checkpoint: str) -> bool:
    """Whether a stage with a mistake more has all of them, in whatever order they are made."""
    lines = _lines(checkpoint, *made, mistake)
    without = ([other for other in made if other is not one] for one in made)
    return (
        lines != _lines(checkpoint, *made)
        and lines == _lines(checkpoint, mistake, *made)
        and all(lines != _lines(checkpoint, *others, mistake) for others in without)
    )


def _lines(checkpoint: str, *made: Mistake) -> list[str]:
    return sorted(_broken(checkpoint, *made)[1].splitlines())


@lru_cache(200)
def _broken(checkpoint: str, *made: Mistake) -> tuple[Sdf.Layer, str]:
    """Return the right stage of a checkpoint after mistakes, to be copied, and its text."""
    if not made:
        layer = Sdf.Layer.FindOrOpen(str(stage(checkpoint)))
        return layer, layer.ExportToString()
    before, text = _broken(checkpoint, *made[:-1])
    layer = Sdf.Layer.CreateAnonymous(".usda")
    layer.TransferContent(before)
    return layer, made[-1].made_in(Usd.Stage.Open(layer), text)


@cache
def grade_with(checkpoint: str, *made: Mistake) -> Grade:
    """Return the grade of a submission of right stages, with mistakes in that of a checkpoint."""
    stages = [StageFacts(other, other, readable=True) for other in LAB.checkpoints]
    stages[[*LAB.checkpoints].index(checkpoint)] = played(checkpoint, *made)
    return grade_facts(rubric(), SubmissionFacts(tuple(stages)))


@cache
def judged(checkpoint: str, *made: Mistake) -> StageFacts:
    """Return what a grade needs to know of a stage with mistakes, without a dry run."""
    with _judged(checkpoint, made) as facts:
        return facts.stages[0]


def played(checkpoint: str, *made: Mistake) -> StageFacts:
    """Return what a grade needs to know of a stage with mistakes."""
    with _judged(checkpoint, made) as facts:
        return with_dry_runs(facts, LAB, {}).stages[0]


@contextmanager
def _judged(checkpoint: str, made: Sequence[Mistake]) -> Iterator[SubmissionFacts]:
    with TemporaryDirectory() as folder:
        path = Path(folder) / stage(checkpoint).name
        path.write_text(_broken(checkpoint, *made)[1])
        result = against_starter(check_stage(path, checkpoint, LAB), opened_starter(), LAB)
        yield facts_of([result], rubric().required)


def drops(number: int, checkpoint: str) -> list[str]:
    """Return where a chain does not hold: a mistake more earned more."""
    found = []
    names: list[str] = []
    last: Grade | None = None
    for name, grade in chain(number, checkpoint):
        names.append(name)
        if last is not None and (
            grade.earned > last.earned or (grade.percent or 0) > (last.percent or 0)
        ):
            steps = " + ".join(names)
            items = [
                f"{after.id} {before.earned:g} -> {after.earned:g}"
                for before, after in zip(last.items, grade.items, strict=True)
                if after.earned > before.earned
            ]
            found.append(f"{checkpoint}: {steps}: {', '.join(items)}")
        last = grade
    return found


CASES = Path(__file__).resolve().parents[1] / "cases"
GRAPHS = ("ROS_Clock", "ROS_Drive", "ROS_Lidar2D", "ROS_Camera", "ROS_OdomTF")
PUBLISHERS = (
    "ROS_Clock/ros2_publish_clock",
    "ROS_Drive/ros2_subscribe_twist",
    "ROS_Lidar2D/ros2_rtx_lidar_helper",
    "ROS_Camera/ros2_camera_helper",
    "ROS_OdomTF/ros2_publish_odometry",
)
MENU = load((CASES / "N12.yaml").read_text(encoding="utf-8"))["break"]


class Mistake(Struct, frozen=True):
    """A mistake of a student: what it is called, and how to make it in a stage.

    `changes` are made one by one, in each stage that has what they change. Those that are `gross`
    stop what the lab is about.
    """

    name: str
    changes: tuple[Change, ...]
    gross: bool = False

    def make(self, stage: Usd.Stage) -> bool:
        """Make it as far as the stage has what it is about, and return whether anything is."""
        before = stage.GetRootLayer().ExportToString() if self.changes else ""
        return self.made_in(stage, before) != before

    def made_in(self, stage: Usd.Stage, text: str) -> str:
        """Make it in a stage of this text, as far as it can be made, and return the text then."""
        layer = stage.GetRootLayer()
        for change in self.changes:
            try:
                change(stage)
            except Exception:  # noqa: BLE001, PERF203 - usd-core raises whatever it likes for what is not there
                layer.ImportFromString(text)
            else:
                text = layer.ExportToString()
        return text


def _each(step: Callable[[str], list[Step]], names: tuple[str, ...]) -> tuple[Change, ...]:
    return tuple(steps(*step(name)) for name in names)


def _gross() -> Iterator[Mistake]:
    """Yield what stops a whole stage from working, with every graph that it has."""
    on_demand = {"pipelineStage": "pipelineStageOnDemand"}
    yield Mistake(
        "all graphs on demand",
        _each(lambda g: [{"set": [f"{g}.{k}", v]} for k, v in on_demand.items()], GRAPHS),
    )
    yield Mistake("no tick", _each(lambda g: [{"remove": f"{g}/on_playback_tick"}], GRAPHS))
    yield Mistake(
        "no tick wired", (lambda stage: _cut_all(stage, "on_playback_tick.outputs:tick"),)
    )
    yield Mistake("no context wired", (lambda stage: _cut_all(stage, "ros2_context.outputs:"),))
    yield Mistake(
        "all five topics wrong",
        _each(lambda node: [{"set": [f"{node}.inputs:topicName", "/wrong"]}], PUBLISHERS),
    )
    yield Mistake(
        "a namespace at every node",
        _each(
            lambda node: [{"declare": [f"{node}.inputs:nodeNamespace", "string", "robot1"]}],
            PUBLISHERS,
        ),
    )
    yield Mistake("a second controller", (steps(*MENU),))
    for graph in GRAPHS:
        yield Mistake(f"{graph} twice", (steps({"copy": [graph, f"/World/{graph}_copy"]}),))
        yield Mistake(f"a script in {graph}", (steps({
            "node": [f"{graph}/script", "omni.graph.scriptnode.ScriptNode"]
        }),))  # fmt: skip
        yield Mistake(f"{graph} removed", (steps({"remove": graph}),))
        yield Mistake(f"{graph} on demand", (steps({
            "set": [f"{graph}.pipelineStage", "pipelineStageOnDemand"]
        }),))  # fmt: skip
    yield Mistake("garbage maps", ())


def _cut_all(stage: Usd.Stage, source: str) -> None:
    for prim in stage.Traverse():
        for attribute in prim.GetAttributes():
            if any(source in str(path) for path in attribute.GetConnections()):
                attribute.ClearConnections()


def mistakes() -> Iterator[Mistake]:
    """Yield gross mistakes, those of the case files, of the dry run, and of the scene."""
    yield from (replace(mistake, gross=True) for mistake in _gross())
    for path in sorted(CASES.glob("*.yaml")):
        data = load(path.read_text(encoding="utf-8"))
        yield Mistake(f"case {path.stem}", (steps(*data["break"]),))
        for name, more in data.get("more", {}).items():
            yield Mistake(f"case {path.stem} {name}", (steps(*more["break"]),))
    for kind, (change, _) in STAGES.items():
        yield Mistake(f"fault {kind}", (change,))
    for sabotage in scene_sabotage():
        yield Mistake(f"scene {sabotage.name}", (sabotage.apply,))


def failing_at(checkpoint: str, right: Path) -> Iterator[Mistake]:
    """Yield the mistakes with which `check` fails the right stage of a checkpoint."""
    lab = the_lab()
    layer = Sdf.Layer.FindOrOpen(str(right))
    for mistake in mistakes():
        copy = Sdf.Layer.CreateAnonymous(".usda")
        copy.TransferContent(layer)
        stage = Usd.Stage.Open(copy)
        if not mistake.changes:
            yield mistake
        elif mistake.make(stage):
            judged = judge(
                lab, lab.checkpoints[checkpoint], read_model(stage, lab.platform, right.name)
            )
            if any(finding.severity == "error" for finding in judged.findings):
                yield mistake


def hand_in(mistake: Mistake, right: Path, folder: Path) -> None:
    """Write the submission of a student who made it: the right one, with it in every stage."""
    shutil.copytree(right, folder)
    for path in sorted(folder.glob("maps/*")) if not mistake.changes else ():
        path.write_bytes(b"garbage")
    for path in sorted(folder.glob("work/*.usda")):
        layer = Sdf.Layer.CreateAnonymous(".usda")
        layer.TransferContent(Sdf.Layer.FindOrOpen(str(path)))
        if mistake.make(Usd.Stage.Open(layer)):
            layer.Export(str(path))
