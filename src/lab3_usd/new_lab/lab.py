"""Writes every file of a new lab from its stages."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from itertools import chain
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.errors import UsageError, unwritten
from lab3_usd.facts.endpoints import namespaces_above
from lab3_usd.facts.frame_targets import frame_of_prim
from lab3_usd.facts.frames import edges_on
from lab3_usd.isaac.platform import Platform
from lab3_usd.isaac.releases import order
from lab3_usd.isaac.topics import STATIC
from lab3_usd.model.prims import upwards
from lab3_usd.model.stage import GraphModel, StageModel
from lab3_usd.new_lab.changes import (
    added_prims,
    holds_prim,
    optional_stages,
    removed_prims,
    steady_scene,
    steady_sensors,
    with_changes,
)
from lab3_usd.new_lab.checkpoints import (
    FileNames,
    Step,
    checkpoints_text,
    describe_steps,
    file_names,
    names_of_stages,
    ros_text,
    rubric_text,
    steps_of_stages,
    submission_text,
)
from lab3_usd.new_lab.graphs import GraphText, catalog_text, describe_graphs, running_graphs
from lab3_usd.new_lab.props import Props, describe_props
from lab3_usd.new_lab.robot import PART, has_robot
from lab3_usd.new_lab.scene import (
    Source,
    appearance_below,
    describe_scene,
    describe_sensors,
    describe_starter,
    holds_graphs_alone,
    named_prims,
    read_described,
)
from lab3_usd.new_lab.yaml_text import document
from lab3_usd.spec.contradictions.names import (
    graph_frames,
    graph_topics,
    named_frames,
    transform_topics,
)
from lab3_usd.spec.graph import GraphSpec
from lab3_usd.spec.lab import CATALOG, CHECKPOINTS, ROS, RUBRIC, SCENE, STARTER, SUBMISSION, Lab
from lab3_usd.spec.load.lab import parse_scene
from lab3_usd.stage.read.stage_reader import read_stage
from lab3_usd.stage.things import read_things

_SCENE_HEAD = """\
Requirements of the scene: units, robot, world, sensors.
`handout` names the section of each item. Lengths in metres, angles in degrees, masses in kg."""
_UNSAID = ("ui:*", "state:*", "omni:*", "isaac:*")  # what an editor writes for itself
_SCENE_NOTES = {
    "tolerance": "Tolerances of the numbers below.",
    "robot": "The links are the bodies right below the robot's path.",
    "robots": "The links are the bodies below the paths of the robots.",
    "world": "Recognised by type, wherever they stand; `usual` is where the stage has them.",
    "props": "Things, each with what is asked of it: values under `set` as USD has them, lengths\n"
    "there in units of the stage; a `place` in the world in metres.",
    "sensors": "By the names that checkpoints add them under. Only what is `required` is checked.",
}


class Description(Struct, frozen=True):
    """The files of a new lab by name, its checkpoints, and what of the stage they leave out."""

    files: Mapping[str, str]
    steps: tuple[Step, ...]
    left_out: tuple[str, ...]


class _Parts(Struct, frozen=True):
    """What the files are made of: graphs, their scene, the names of stages, and the TF tree.

    `differing` says what is not the same in all stages, `optional` are the numbers of those on
    which no later one builds.
    """

    texts: tuple[GraphText, ...]
    names: FileNames
    scene: Mapping[str, Any]
    frames: Mapping[str, Any]
    lab: Lab
    outside: tuple[str, ...]
    differing: tuple[str, ...]
    optional: tuple[int, ...]

    @property
    def has_frames(self) -> bool:
        """Whether a checkpoint can ask for the tree: all messages are in its frames."""
        return bool(self.frames["edges"]) and not self.outside


def describe_lab(paths: Sequence[Path], lab: Lab) -> Description:
    """Describe a lab after stages: one for each checkpoint, or a single one with all graphs.

    `lab` is the bundled one, whose platform has all public node types.

    Raises:
        StageError: a stage cannot be read.
        UsageError: the last one has no prim, or lacks what an earlier one has.
    """
    lab = replace(lab, platform=in_release_of(paths, lab.platform))
    sources = [read_described(path, lab) for path in paths]
    parts = _parts(sources)
    if len(sources) > 1:
        steps = _steps(sources, parts)
    else:
        by_graph: dict[str, list[str]] = {}
        for name, sensor in parts.lab.sensors.items():
            home = _home(sensor.path, parts.texts)
            by_graph.setdefault("" if home is None else home.name, []).append(name)
        has_frames = parts.has_frames
        steps = describe_steps(parts.names, parts.lab.graphs, by_graph, frames=has_frames)
    graphs = parts.lab.graphs.values()
    above = {parent for graph in graphs for parent in [*upwards(graph.path)][1:]}
    made = [parent for parent in above if holds_graphs_alone(sources[0].stage, parent)]
    starter, no_starter = describe_starter(paths[0], parts.lab, made)
    described = {*made, *(graph.path for source in sources for graph in source.stage.graphs)}
    described |= {sensor.path for sensor in parts.lab.sensors.values()}
    props = _props(paths, parts, described)
    described |= {*props.paths}
    scene = {**parts.scene, **({"props": props.data} if props.data else {})}
    files = _files(sources[-1], replace(parts, scene=scene), steps, lab.platform)
    return Description(
        files={**files, **({STARTER: starter} if starter else {})},
        steps=steps,
        left_out=(
            *(line for text in parts.texts for line in text.left_out),
            *parts.differing,
            *props.left_out,
            *added_prims([source.stage for source in sources], parts.names.ids, described),
            *dict.fromkeys(parts.outside),
            *filter(None, (no_starter,)),
        ),
    )


def _parts(sources: Sequence[Source]) -> _Parts:
    """Return what the last stage describes, which distinguishes the others."""
    source, stage = sources[-1], sources[-1].stage
    held = [running_graphs(each.stage) for each in sources]
    optional = optional_stages(held)
    graph_models = {**{p: g for n in optional for p, g in held[n].items()}, **held[-1]}
    texts = describe_graphs(
        graph_models.values(), source.lab, _first_stages(sources, held, optional)
    )
    graphs = {text.spec.name: text.spec for text in texts}
    stems = [source.stem for source in sources]
    names = names_of_stages(stems) if len(stems) > 1 else file_names(source.stem, graphs)
    stage_ids = names.ids[-len(sources) :]
    texts = tuple(with_changes(text, held, stage_ids, source.lab) for text in texts)
    graphs = {text.spec.name: text.spec for text in texts}
    # A stage tells of the scene that has all of its assets, and a robot where the last one has one.
    needs_robot = has_robot(stage, graphs.values())
    scenes = {
        id_: describe_scene(each.stage, sources[0].stage, graphs, source.lab, names.ids[-1])
        for id_, each in zip(stage_ids, sources, strict=True)
        if each is source
        or (
            not each.stage.unresolved
            and (not needs_robot or has_robot(each.stage, graphs.values()))
        )
    }
    scene, differing = steady_scene(scenes.pop(names.ids[-1]), scenes)
    homes = {prim.path: _home(prim.path, texts) for prim in source.sensors}
    sections = {path: PART if home is None else home.handout for path, home in homes.items()}
    sensors_at = {
        id_: describe_sensors(
            each, dict.fromkeys((prim.path for prim in each.sensors), "") | sections
        ).values()
        for id_, each in zip(stage_ids, sources[:-1], strict=False)
    }
    sensors, changing = steady_sensors(describe_sensors(source, sections), sensors_at)
    scene |= {"sensors": sensors} if sensors else {}
    places = [graph.path for graph in graphs.values()] + [prim.path for prim in source.sensors]
    namespaces = dict(s for path in places for s in namespaces_above(path, stage))
    scene |= {"namespaces": namespaces} if namespaces else {}
    lab = replace(source.lab, graphs=graphs, scene=parse_scene(scene))
    robots = [scene["robot"]] if "robot" in scene else scene.get("robots", {}).values()
    for path, shown in appearance_below(source, lab).items():
        next(robot for robot in robots if robot["path"] == path)["appearance_below"] = shown
    overrides = dict(_frame_names(stage, replace(lab, scene=parse_scene(scene))))
    frame_spec = replace(lab.frames, names=overrides, localization=None)
    lab = replace(lab, scene=parse_scene(scene), frames=frame_spec)
    built_on = {name: graph for name, graph in graphs.items() if graph.path in held[-1]}
    last = replace(lab, graphs=built_on)
    published = _published(stage, last)
    edges = {child: edge for tree in published.values() for child, edge in tree.items()}
    for frame in graph_frames(last):  # what missing assets would add
        if frame.parent:
            edges.setdefault(frame.child, (frame.parent, frame.child))
    bases = [lab.frame_of(robot.base) for robot in lab.scene.robots]
    frames: dict[str, Any] = {
        "handout": texts[-1].spec.handout if texts else PART,
        **_tree(edges.values(), bases),
    }
    if sum(map(len, published.values())) > len({*chain(*published.values())}):
        # Several trees have frames of the same names.
        frames["trees"] = [
            {"topic": topic, **_tree(tree.values(), bases)} for topic, tree in published.items()
        ]
    frames = {key: value for key, value in frames.items() if value or key == "edges"}
    frames |= {"names": overrides} if overrides else {}
    tree = {name for edge in frames["edges"] for name in edge.split(" -> ")}
    outside = tuple(
        f"{frame.place}: '{frame.child}' is not a frame of the stage's tree"
        for frame in named_frames(lab)
        if tree and frame.child not in tree
    )
    differing += changing
    return _Parts(texts, names, scene, frames, lab, outside, differing, optional)


def _props(paths: Sequence[Path], parts: _Parts, described: Collection[str]) -> Props:
    """Describe what stages add or change beside robots, and what is described already.

    Raises:
        StageError: a stage cannot be read.
    """
    rules, lab, ids = parts.lab.submission.starter, parts.lab, parts.names.ids[-len(paths) :]
    without = {*described, *rules.ignored_prims, *(robot.path for robot in lab.scene.robots)}
    things = {
        id_: read_things(path, without, _UNSAID) for id_, path in zip(ids, paths, strict=True)
    }
    optional = [ids[number] for number in parts.optional]
    return describe_props(things, optional, whole=not (lab.scene.robots or lab.graphs))


def _first_stages(
    sources: Sequence[Source], held: Sequence[Mapping[str, GraphModel]], optional: Collection[int]
) -> dict[str, int]:
    """Return the number of the first stage that holds each graph, by path; {} for one stage alone.

    Raises:
        UsageError: a stage lacks a graph that an earlier one has, on which others build.
    """
    if len(sources) == 1:
        return {}
    since: dict[str, int] = {}
    for number, (source, graphs) in enumerate(zip(sources, held, strict=True)):
        for path, first in since.items():
            if path not in graphs and first not in optional:
                raise UsageError(
                    f"{source.stem} has no graph {path}, which {sources[first].stem} has; a "
                    "checkpoint holds what those before it hold, name the stages in their order"
                )
        for path in graphs:
            since.setdefault(path, number)
    return since


def in_release_of(paths: Sequence[Path], platform: Platform) -> Platform:
    """Return the first release, from that of the platform on, whose nodes all stages hold.

    Raises:
        StageError: a stage cannot be read.
    """
    nodes = [node for path in paths for node in read_stage(path, platform).nodes()]
    later = [name for name in platform.known_releases if order(name) > order(platform.release)]
    for candidate in (platform, *map(platform.in_release, later)):
        kinds = ((candidate.get(node.type_name), node.version or 0) for node in nodes)
        if all(kind is None or version <= kind.version for kind, version in kinds):
            return candidate
    return platform


def _steps(sources: Sequence[Source], parts: _Parts) -> tuple[Step, ...]:
    """Return the checkpoints: what each stage holds of the last one."""
    held = [running_graphs(source.stage) for source in sources]
    specs = [text.spec for text in parts.texts]
    frames = {frame.child for frame in graph_frames(parts.lab)}
    edges_of = [edges_on(transform_topics(parts.lab), source.stage) for source in sources]
    published = [
        {(edge.parent, edge.child) for edge in edges if edge.child in frames} for edges in edges_of
    ]
    trees: list[Collection[tuple[str, str]]] = []
    for number, edges in enumerate(published):
        later = [
            other
            for other, each in enumerate(published[number + 1 :], start=number + 1)
            if other not in parts.optional and not each <= published[-1]
        ]
        is_steady = edges <= published[-1] and not later
        trees.append(edges if parts.has_frames and is_steady else ())
    sensors = parts.lab.sensors.items()
    return steps_of_stages(
        parts.names,
        [[spec.name for spec in specs if spec.path in graphs] for graphs in held],
        [
            [name for name, sensor in sensors if holds_prim(source.stage, sensor.path)]
            for source in sources
        ],
        trees,
        parts.optional,
        removed=removed_prims([source.stage for source in sources], parts.optional),
        speaks=any(graph_topics(parts.lab)),
    )


def _home(sensor: str, texts: Sequence[GraphText]) -> GraphSpec | None:
    """Return the graph with which a sensor comes: the first that names it, else the last."""
    graphs = [text.spec for text in texts]
    return next((graph for graph in graphs if sensor in named_prims(graph)), [None, *graphs][-1])


def _files(
    source: Source, parts: _Parts, steps: tuple[Step, ...], bundled: Platform
) -> dict[str, str]:
    """Return the text of every file by name; `bundled` are the bundled lab's node types."""
    title = parts.names.shared or " ".join(source.stem.replace("_", " ").split())
    nodes = source.stage.nodes()
    used = {node.saved_type: node.type.type for node in nodes if node.type is not None}
    types = catalog_text(used, bundled, source.unknown)
    furnished = {prop["from"] for prop in parts.scene.get("props", {}).values() if "from" in prop}
    return {
        CHECKPOINTS: checkpoints_text(parts.names, title, steps, parts.frames, parts.lab),
        **{f"{text.spec.name}.yaml": _graph_text(text) for text in parts.texts},
        SCENE: document(_SCENE_HEAD, parts.scene, _SCENE_NOTES),
        **({ROS: ros_text(parts.lab, steps)} if any(graph_topics(parts.lab)) else {}),
        SUBMISSION: submission_text(steps),
        RUBRIC: rubric_text(title, steps, furnished, parts.lab),
        **({CATALOG: types} if types else {}),
    }


def _graph_text(text: GraphText) -> str:
    head = f"The graph {text.spec.path}. A node's key is its role; `set` has what the stage sets."
    if text.left_out:
        lines = "\n".join(f"  {line}" for line in text.left_out)
        head += f"\nNot described, because a lab cannot contain it:\n{lines}"
    return document(head, text.data)


def _frame_names(stage: StageModel, lab: Lab) -> Iterator[tuple[str, str]]:
    """Yield the prims whose frames an override names, of links, sensors and targets of TF."""
    named = {path for robot in lab.scene.robots for path in (robot.path, *robot.link_paths)}
    named |= {sensor.path for sensor in lab.sensors.values()}
    for graph in lab.graphs.values():
        nodes = (node for node in graph.nodes.values() if node.type.tf is not None)
        named |= {prim for node in nodes for target in node.targets for prim in target.prims}
    for path in sorted(named):
        if frame_of_prim(path, stage) != path.rpartition("/")[2]:
            yield path, frame_of_prim(path, stage)


def _published(stage: StageModel, lab: Lab) -> dict[str, dict[str, tuple[str, str]]]:
    """Return the transforms of the lab's frames that a stage publishes, by topic and child."""
    frames = {frame.child for frame in graph_frames(lab)}
    trees: dict[str, dict[str, tuple[str, str]]] = {}
    for edge in edges_on(transform_topics(lab), stage):
        if edge.child in frames and edge.parent != edge.child:
            own = trees.setdefault(edge.topic.removesuffix(STATIC), {})
            own[edge.child] = (edge.parent, edge.child)
    return trees


def _tree(edges: Collection[tuple[str, str]], bases: Iterable[str]) -> dict[str, Any]:
    """Return how a tree is written: its edges, and the bases below which it may be deeper."""
    deeper = list(dict.fromkeys(base for base in bases if any(base in edge for edge in edges)))
    below = {"deeper_under": deeper if deeper[1:] else deeper[0]} if deeper else {}
    return {"edges": [f"{parent} -> {child}" for parent, child in edges], **below}


def refuse_existing_folder(folder: Path) -> None:
    """Refuse a place where something is.

    Raises:
        UsageError: a file or folder exists at this path.
    """
    if folder.exists() or folder.is_symlink():
        raise UsageError(f"{folder} exists; name a new folder")


def write_folder(folder: Path, files: Mapping[str, str]) -> None:
    """Write the files to a new folder beside `folder`, then rename it to `folder`.

    Raises:
        UsageError: `folder` exists, or cannot be written.
    """
    refuse_existing_folder(folder)
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        with TemporaryDirectory(dir=folder.parent, prefix=f".{folder.name}.") as temporary:
            whole = Path(temporary) / folder.name
            for name, text in files.items():
                (whole / name).parent.mkdir(parents=True, exist_ok=True)
                (whole / name).write_text(text, encoding="utf-8")
            whole.rename(folder)
    except OSError as error:
        raise unwritten(folder, error) from error
