"""Describes what differs between the stages of a new lab, or says that no lab can hold it."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from typing import Any

from msgspec.structs import replace

from lab3_usd.isaac.node_types import INPUT
from lab3_usd.model.prims import is_at_or_below
from lab3_usd.model.stage import GraphModel, Node, StageModel
from lab3_usd.new_lab.graphs import GraphText, describe_graph
from lab3_usd.new_lab.yaml_text import as_typed
from lab3_usd.spec.lab import SCENE, Lab
from lab3_usd.spec.load.graph_file import parse_graph

_Values = dict[str, dict[str, Any]]  # of a node: `set` and `targets`, by input
_KEYS = ("set", "targets")


def optional_stages(graphs: Sequence[Mapping[str, GraphModel]]) -> tuple[int, ...]:
    """Return the numbers of the stages on which no later one builds: no later graph is theirs.

    `graphs` are those of each stage by path.
    """
    numbers: list[int] = []
    earlier: set[str] = set()
    for number, held in enumerate(graphs[:-1]):
        new = held.keys() - earlier
        if new and not any(new & later.keys() for later in graphs[number + 1 :]):
            numbers.append(number)
        else:
            earlier |= held.keys()
    return tuple(numbers)


def removed_prims(
    stages: Sequence[StageModel], optional: Collection[int]
) -> dict[int, tuple[str, ...]]:
    """Return the supplied prims that a stage has no more, nor any later one, by its number."""
    required = [number for number in range(len(stages)) if number not in optional]
    removed: dict[int, tuple[str, ...]] = {}
    gone = [path for path in _present(stages[0]) if not holds_prim(stages[-1], path)]
    for path in gone:
        if path.rpartition("/")[0] in gone:
            continue
        first = next(
            n for n in required if not any(holds_prim(stages[m], path) for m in required if m >= n)
        )
        removed[first] = (*removed.get(first, ()), path)
    return removed


def added_prims(
    stages: Sequence[StageModel], ids: Sequence[str], described: Collection[str]
) -> Iterator[str]:
    """Say of each stage but the first which prims it adds that the lab does not describe."""
    for before, stage, id_ in zip(stages, stages[1:], ids[1:], strict=False):
        new = [path for path in _present(stage) if not holds_prim(before, path)]
        own = [path for path in new if not any(is_at_or_below(path, each) for each in described)]
        tops = [path for path in own if path.rpartition("/")[0] not in own]
        if tops:
            more = f" and {len(tops) - 1} more" if tops[1:] else ""
            verb = "come" if tops[1:] else "comes"
            yield f"{SCENE}: props: {tops[0]}{more}, which {verb} with checkpoint {id_}"


def _present(stage: StageModel) -> list[str]:
    return [path for path in stage.prims if holds_prim(stage, path)]


def holds_prim(stage: StageModel, path: str) -> bool:
    """Whether a prim of a stage is there, and not switched off."""
    prim = stage.prim(path)
    return prim is not None and prim.present


def with_changes(
    text: GraphText, held: Sequence[Mapping[str, GraphModel]], ids: Sequence[str], lab: Lab
) -> GraphText:
    """Return a graph with what the stages before the last one with it have otherwise.

    `held` are the graphs of each stage by path, `ids` its checkpoint.
    """
    path = text.spec.path
    earlier = {id_: graphs[path] for id_, graphs in zip(ids, held, strict=True) if path in graphs}
    last = [*earlier][-1]
    del earlier[last]
    if not earlier:
        return text
    stages = {
        id_: describe_graph(text.spec.name, graph, text.spec.handout[0], lab)
        for id_, graph in earlier.items()
    }
    by_path = {id_: {node.path: node for node in graph.nodes} for id_, graph in earlier.items()}
    left_out = list(text.left_out)
    nodes: dict[str, dict[str, Any]] = {}
    for role, data in text.data["nodes"].items():
        path = text.prims[role]
        there = {id_: by_path[id_][path] for id_ in stages if path in by_path[id_]}
        since = next(iter(there), last)
        until: dict[str, _Values] = {}
        final = {key: dict(data.get(key, {})) for key in _KEYS}
        values_at = {
            id_: _otherwise(final, stages[id_].data["nodes"].get(role, {}), node, left_out, id_)
            for id_, node in there.items()
        }
        after = [*list(values_at.values())[1:], {}]
        for (id_, values), later in zip(values_at.items(), after, strict=False):
            if values != later:
                until[id_] = values
        kept = {key: final.get(key, value) for key, value in data.items()}
        nodes[role] = {
            **{key: value for key, value in kept.items() if value or key not in _KEYS},
            **({"from": since} if since != next(iter(stages)) else {}),
            **({"until": until} if until else {}),
        }
    required, optional = _steady_wires(text, stages, by_path, left_out)
    changed = {**text.data, "nodes": nodes, "wires": required}
    changed |= {"optional_wires": optional} if optional else {}
    spec = parse_graph(changed, lab.platform, f"{text.spec.name}.yaml")
    return replace(text, data=changed, spec=spec, left_out=tuple(dict.fromkeys(left_out)))


def _otherwise(
    final: _Values, data: Mapping[str, Any], node: Node, left_out: list[str], id_: str
) -> _Values:
    """Return the earlier values of a node; take out of `final` what a lab cannot describe."""
    other: _Values = {}
    for key in _KEYS:
        before = data.get(key, {})
        for name in [*dict.fromkeys((*final[key], *before))]:
            if final[key].get(name) == before.get(name):
                continue
            value = before.get(name, [] if key == "targets" else _unset(node, name))
            if value is None:
                left_out.append(f"{node.path}.{INPUT}{name}: has no value in checkpoint {id_}")
                final[key].pop(name, None)
            else:
                other.setdefault(key, {})[name] = value
    return other


def _unset(node: Node, name: str) -> Any:
    """Return what an input has that a stage does not set, None where a wire brings it."""
    state = node.ports.get(f"{INPUT}{name}")
    if state is not None and state.sources:
        return None
    value = node.value(f"{INPUT}{name}")
    return None if value is None else as_typed(value)


def _steady_wires(
    text: GraphText,
    stages: Mapping[str, GraphText],
    by_path: Mapping[str, Mapping[str, Node]],
    left_out: list[str],
) -> tuple[list[str], list[str]]:
    """Return the wires that all stages with both of their nodes have, and those of only some."""
    required = [*text.data["wires"]]
    optional: list[str] = []
    for id_, stage in stages.items():
        roles = {role for role, path in text.prims.items() if path in by_path[id_]}
        for wire in (*required, *stage.data["wires"]):
            is_there = wire in stage.data["wires"]
            if (is_there and wire in required) or wire in optional:
                continue
            if {end.partition(".")[0] for end in wire.split(" -> ")} <= roles:
                optional.append(wire)
                what = "is only in checkpoint" if is_there else "is missing in checkpoint"
                left_out.append(f"{text.spec.path}: wire {wire}: {what} {id_}, so not required")
        required = [wire for wire in required if wire not in optional]
    return required, optional


_DIFFERS = "differs between checkpoints, so not required"
_OF_LINKS = ("mass", "offset", "collision", "held")
_OF_JOINTS = ("axis", "limits", "stiffness", "damping", "max_force")


def steady_scene(
    scene: Mapping[str, Any], scenes: Mapping[str, Mapping[str, Any]]
) -> tuple[dict[str, Any], tuple[str, ...]]:
    """Return a scene with what all stages have, and a line for each thing that some have otherwise.

    `scenes` are the scenes of the other stages by checkpoint, in their order.
    """
    lines: list[str] = []
    data = dict(scene)
    for id_, other in scenes.items():
        if other["stage"] != scene["stage"]:
            lines.append(f"{SCENE}: stage: is otherwise in checkpoint {id_}")
    data["world"] = dict(scene["world"])
    for part in [part for part in scene["world"] if part != "graph_parent"]:
        lacking = next((id_ for id_, other in scenes.items() if part not in other["world"]), None)
        if lacking is not None:
            lines.append(f"{SCENE}: world: {part}: is not in checkpoint {lacking}")
            del data["world"][part]
    for key, robots in (("robot", {"": scene.get("robot")}), ("robots", scene.get("robots", {}))):
        steady = {}
        for name, robot in robots.items():
            if robot is None:
                continue
            own: dict[str, Mapping[str, Any]] = {}
            for id_, other in scenes.items():
                theirs = (other.get("robot"), *other.get("robots", {}).values())
                at_path = (each for each in theirs if each and each["path"] == robot["path"])
                own[id_] = next(at_path, {})
            steady[name] = _steady_robot(robot, own, f"{key}: {name}" if name else key, lines)
        if steady:
            data[key] = steady if key == "robots" else steady[""]
    return data, tuple(lines)


def _steady_robot(
    robot: Mapping[str, Any],
    robots: Mapping[str, Mapping[str, Any]],
    key: str,
    lines: list[str],
) -> dict[str, Any]:
    """Return a robot with what it has in all stages, at its pose in the first of them."""
    data = dict(robot)
    absent = [id_ for id_, other in robots.items() if not other]
    lines += [f"{SCENE}: {key}: is not in checkpoint {id_}" for id_ in absent]
    there = {id_: other for id_, other in robots.items() if other}
    first = next(iter(there.values()), robot)
    if first["pose"] != robot["pose"]:
        stood = [id_ for id_, other in there.items() if other["pose"] == first["pose"]]
        data |= {"pose": first["pose"], "pose_is_error_until": stood[-1]}
    for part in ("articulation", "wheels"):
        if any(other.get(part) != robot.get(part) for other in there.values()) and part in data:
            lines.append(f"{SCENE}: {key}: {part}: {_DIFFERS}")
            del data[part]
    needed = {*robot.get("wheels", {}).get("joints", {}).values(), robot["base_frame"]}
    for part, keys in (("links", _OF_LINKS), ("joints", _OF_JOINTS)):
        kept = {}
        for name, values in robot.get(part, {}).items():
            place = f"{key}: {part}: {name}"
            own = {id_: other.get(part, {}).get(name, {}) for id_, other in there.items()}
            gone = next((id_ for id_, other in own.items() if not other), "")
            if gone and name not in needed:
                lines.append(f"{SCENE}: {place}: is not in checkpoint {gone}, so not required")
                continue
            kept[name] = _steady(values, [*own.values()], keys, place, lines)
        if part in data:
            data[part] = kept
    joints = data.get("joints", {})
    ends = {name: [end for end in joint["links"] if end] for name, joint in joints.items()}
    link_names = data.get("links", {})
    lost = [name for name, links in ends.items() if not all(link in link_names for link in links)]
    if lost:
        data["joints"] = {name: joint for name, joint in joints.items() if name not in lost}
    return data


def _steady(
    values: Mapping[str, Any],
    descriptions: Iterable[Mapping[str, Any]],
    keys: Iterable[str],
    place: str,
    lines: list[str],
) -> dict[str, Any]:
    """Return what is the same in all stages of a part."""
    differing = [
        name
        for name in keys
        if name in values
        and any(other.get(name) != values[name] for other in descriptions if other)
    ]
    lines += [f"{SCENE}: {place}: {name}: {_DIFFERS}" for name in differing]
    return {name: value for name, value in values.items() if name not in differing}


def steady_sensors(
    sensors: Mapping[str, Mapping[str, Any]], sensors_at: Mapping[str, Iterable[Mapping[str, Any]]]
) -> tuple[dict[str, dict[str, Any]], tuple[str, ...]]:
    """Return sensors of which only what all stages have alike is required, and what is not.

    `sensors_at` are the sensors of the other stages by checkpoint.
    """
    lines: list[str] = []
    steady = {}
    for name, sensor in sensors.items():
        data = dict(sensor)
        for id_, descriptions in sensors_at.items():
            other = next((each for each in descriptions if each["path"] == sensor["path"]), None)
            if other is None:
                continue
            if other["pose"]["translate"] != sensor["pose"]["translate"]:
                lines.append(f"{SCENE}: sensors: {name}: pose: is otherwise in checkpoint {id_}")
            values = other.get("attributes", {})
            differing = [
                name
                for name, attribute in data.get("attributes", {}).items()
                if attribute.get("required")
                and values.get(name, {}).get("value") != attribute["value"]
            ]
            lines += [f"{SCENE}: sensors: {name}: {each}: {_DIFFERS}" for each in differing]
            if differing:
                data["attributes"] = {
                    key: {k: v for k, v in value.items() if key not in differing or k != "required"}
                    for key, value in data["attributes"].items()
                }
        steady[name] = data
    return steady, tuple(lines)
