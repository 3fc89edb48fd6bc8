"""Contradictions in a lab's scene: masses, wheels, kinds of sensors, targets, things."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from fnmatch import fnmatchcase
from pathlib import PurePosixPath
from typing import Any, Literal

from msgspec import Struct

from lab3_usd.data import data_folder
from lab3_usd.isaac.releases import is_release_within as is_in_releases
from lab3_usd.spec.contradictions.names import LabFault, file_of, likely, nearest_name
from lab3_usd.spec.lab import CHECKPOINTS, SCENE, STARTER, Lab
from lab3_usd.spec.props import PropSpec
from lab3_usd.spec.scene import RobotSpec, stands_within
from lab3_usd.yaml_file import read_yaml


class KnownScene(Struct, frozen=True):
    """A scene by the paths of its prims; unknown: what is below `open_below`.

    `assets` are those that prims of a stage refer to, by their paths.
    """

    name: str
    prims: frozenset[str]
    open_below: tuple[str, ...] = ()
    assets: Mapping[str, tuple[str, ...]] = {}


class KnownScenes(Struct, frozen=True):
    """All scenes that are known of a lab: its own starter, where it describes one, and stages.

    `made` are the prims that the lab itself makes, beside its `things`.
    """

    scenes: tuple[KnownScene, ...]
    prims: frozenset[str]
    made: frozenset[str]
    things: tuple[PropSpec, ...]

    def has(self, path: str) -> bool:
        """Whether a prim is in a scene, is made, or may be there."""
        is_there = path in self.prims or path in self.made
        return is_there or self.is_open(path) or any(t.stands_at(path) for t in self.things)

    def is_hidden(self, path: str) -> bool:
        """Whether a prim may come with what one of a scene refers to."""
        return any(f"{path}/".startswith(scene.open_below) for scene in self.scenes)

    def is_open(self, path: str) -> bool:
        """Whether a prim may come with what a prim of a scene or a thing refers to."""
        names = path.split("/")
        above = ["/".join(names[:length]) for length in range(2, len(names))]
        assets = [thing for thing in self.things if thing.asset]
        return self.is_hidden(path) or any(t.stands_at(place) for t in assets for place in above)

    def lacks(
        self,
        path: str,
        file: str,
        key: str,
        severity: Literal["error", "warning"] = "error",
        repair: str = "",
    ) -> LabFault:
        """Return the fault that a prim is in none of the scenes."""
        others = [other for other in self.prims | self.made if not stands_within(other, path)]
        message = f"'{path}' is not a prim{likely(path, others)}{repair}"
        return LabFault(file, key, message, self.names, severity)

    @property
    def names(self) -> str:
        """The names of the scenes."""
        return ", ".join(scene.name for scene in self.scenes)


def known_scenes(lab: Lab, stages: Sequence[KnownScene]) -> KnownScenes:
    """Return the lab's own starter, where it describes one, and stages of the lab.

    Raises:
        SpecError: the description of the starter is no YAML.
    """
    scenes = (*_starter_scene(lab), *stages)
    things = tuple(lab.scene.props.values())
    made = {thing.path for thing in things if _makes(thing) and "*" not in thing.path}
    made |= {sensor.path for sensor in lab.sensors.values()}
    for graph in lab.graphs.values():
        made |= {graph.path, *(f"{graph.path}/{role}" for role in graph.nodes)}
    prims = frozenset[str]().union(*(scene.prims for scene in scenes))
    return KnownScenes(scenes, prims, frozenset(made), things)


def scene_faults(lab: Lab, scenes: KnownScenes) -> Iterator[LabFault]:
    """Yield what no scene can have, and names that no scene has, where some are known."""
    for robot in lab.scene.robots:
        for name, link in robot.links.items():
            if link.mass is not None and link.mass < 0:
                message = f"{link.mass:g} kg is negative"
                yield LabFault(SCENE, f"{robot.key}: links: {name}: mass", message)
        for joint, name in robot.wheels.joints.items():
            if name not in robot.links:
                message = f"'{name}' is not a link{likely(name, robot.links)}"
                key = f"{robot.key}: wheels: joints: {joint}"
                yield LabFault(SCENE, key, message, f"{SCENE}: {robot.key}: links")
        if robot.wheels.joints and not any(robot.wheels.axle):
            yield LabFault(SCENE, f"{robot.key}: wheels: axle", "has no direction")
        yield from _joint_faults(robot)
    yield from _sensor_faults(lab)
    yield from _misspelt_scans(lab)
    yield from _unequal_sensors(lab)
    if scenes.scenes:
        yield from _target_faults(lab, scenes)
        for key, path, is_there in _parts(lab, scenes.prims):
            if not is_there and not scenes.is_hidden(path):
                yield scenes.lacks(path, SCENE, key)
        yield from _misspelled_parents(lab, scenes)


def _joint_faults(robot: RobotSpec) -> Iterator[LabFault]:
    """Yield what no joint can be, or is said twice of one."""
    for name, joint in robot.joints.items():
        key = f"{robot.key}: joints: {name}"
        if name in robot.wheels.joints:
            other = f"{SCENE}: {robot.key}: wheels: joints: {name}"
            yield LabFault(SCENE, key, f"'{name}' is the joint of a wheel", other)
        for link in joint.links:
            if link and link not in robot.links:
                message = f"'{link}' is not a link{likely(link, robot.links)}"
                yield LabFault(SCENE, f"{key}: links", message, f"{SCENE}: {robot.key}: links")
        if not (joint.type.startswith(_SCHEMA) and joint.type.endswith(_JOINT)):
            message = f"'{joint.type}' is not a type of joints, as {_SCHEMA}Revolute{_JOINT} is"
            yield LabFault(SCENE, f"{key}: type", message)
        if joint.limits is not None and not joint.limits[0] <= joint.limits[1]:
            low, high = joint.limits
            message = f"the lower limit, {low:g}, is not below the upper one, {high:g}"
            yield LabFault(SCENE, f"{key}: limits", message)
        for word, value in joint.drive.items():
            if value < 0:
                yield LabFault(SCENE, key, f"{word} is {value:g}, which is negative")


_SCHEMA, _JOINT = "Physics", "Joint"  # around the kind in the name of a type of USD


_NEARLY = 0.9  # how alike two names are of which one is taken for misspelled


def _misspelled_parents(lab: Lab, scenes: KnownScenes) -> Iterator[LabFault]:
    """Yield graphs below a prim that no scene has, and that is called almost as one that it has."""
    from difflib import get_close_matches

    for graph in lab.graphs.values():
        parent = graph.path.rpartition("/")[0]
        if not scenes.has(parent) and get_close_matches(parent, scenes.prims, 1, _NEARLY):
            yield scenes.lacks(parent, file_of(graph), "path", "warning")


def _parts(lab: Lab, paths: Collection[str]) -> Iterator[tuple[str, str, bool]]:
    """Yield key and path of what the scene is to hold, and whether it does."""
    for robot in lab.scene.robots:
        yield f"{robot.key}: path", robot.path, robot.path in paths
        for name, path in zip(robot.links, robot.link_paths, strict=True):
            yield f"{robot.key}: links: {name}", path, path in paths or robot.path not in paths
        target = robot.articulation.target
        if target:
            key = f"{robot.key}: articulation: target"
            yield key, target, target in paths or robot.path not in paths
        for name in (*robot.wheels.joints, *robot.joints):
            ends = (path for path in paths if path.endswith(f"/{name}"))
            is_there = any(stands_within(path, robot.path) for path in ends)
            of_wheel = name in robot.wheels.joints
            key = f"{robot.key}: {'wheels: ' if of_wheel else ''}joints: {name}"
            place = robot.joint_path(name) if of_wheel else f"{robot.path}/{name}"
            if of_wheel and is_there:
                key = f"{robot.key}: wheels: joints_below"
                is_there = place in paths
            yield key, place, is_there or robot.path not in paths
    world = lab.scene.world.graph_parent
    if world is not None:
        yield "world: graph_parent: path", world.path, world.path in paths
    made = {sensor.path for sensor in lab.sensors.values()}
    for name, sensor in lab.sensors.items():
        parent = sensor.path.rpartition("/")[0]
        yield f"sensors: {name}: path", parent, parent in paths or parent in made


def _sensor_faults(lab: Lab) -> Iterator[LabFault]:
    """Yield the sensors whose kind has rules of its own, about prims of another type."""
    bundled = data_folder("graphs")
    if lab.folder == bundled:
        return
    types = {
        sensor["kind"]: sensor["type"] for sensor in read_yaml(bundled / SCENE)["sensors"].values()
    }
    for name, sensor in lab.sensors.items():
        key, other = f"sensors: {name}: kind", f"{SCENE}: sensors: {name}: type"
        expected = types.get(sensor.kind, sensor.type)
        if sensor.type != expected:
            message = f"a {sensor.kind} is a prim of type {expected}, not {sensor.type}"
            yield LabFault(SCENE, key, message, other)
            continue
        kind = next((kind for kind, type_name in types.items() if type_name == sensor.type), "")
        if kind and sensor.kind != kind:
            message = f"'{sensor.kind}' omits the rules about prims of type {sensor.type},"
            yield LabFault(SCENE, key, f"{message} '{kind}' has them", other, "warning")


def _misspelt_scans(lab: Lab) -> Iterator[LabFault]:
    """Yield attributes that a scan names, and that are nearly those of a schema."""
    schemas = lab.platform.sensor_models.schemas.values()
    names = dict.fromkeys(name for schema in schemas for name in schema.attributes)
    for sensor, spec in lab.sensors.items():
        scan = spec.scan
        for name in () if scan is None else (*scan.keep, *scan.circle, *(scan.ranges or ())):
            is_known = any(fnmatchcase(name, each) for each in names)  # * is an instance
            is_odd = name.startswith(_SENSOR) and not is_known
            meant = nearest_name(name, names) if is_odd else None
            if meant is not None:
                message = f"'{name}' is not an attribute of a sensor, '{meant}' is"
                key = f"sensors: {sensor}: {name}"
                yield LabFault(SCENE, key, message, severity="warning")


_SENSOR = "omni:sensor:"


def _unequal_sensors(lab: Lab) -> Iterator[LabFault]:
    """Yield values of sensors that differ where the release of the lab crashes by that."""
    asked = {
        name: kind.types
        for kind in lab.platform.sensors.values()
        for name in kind.equal
        if is_in_releases(lab.platform.release, *kind.equal_in)
    }
    for name, types in asked.items():
        first: tuple[str, Any] | None = None
        for sensor, spec in lab.sensors.items():
            attribute = spec.attributes.get(name)
            if attribute is None or spec.type not in types:
                continue
            if first is not None and attribute.value != first[1]:
                message = f"{attribute.value} differs from {first[1]}: Isaac Sim"
                message += f" {lab.platform.release} crashes"
                other = f"{SCENE}: sensors: {first[0]}: {name}"
                yield LabFault(SCENE, f"sensors: {sensor}: {name}", message, other)
            first = first or (sensor, attribute.value)


def _target_faults(lab: Lab, scenes: KnownScenes) -> Iterator[LabFault]:
    """Yield the targets that `build` does not find: in no scene, no sensor, not in their graph."""
    sensors = {sensor.path for sensor in lab.sensors.values()}
    for graph in lab.graphs.values():
        paths = scenes.prims | sensors | {graph.path, *(f"{graph.path}/{r}" for r in graph.nodes)}
        for node in graph.nodes.values():
            for target in node.targets:
                key = f"{node.role}: {target.port.partition(':')[2]}"
                for path in target.prims:
                    if path not in paths and not scenes.is_hidden(path):
                        yield scenes.lacks(path, file_of(graph), key)


def prop_faults(lab: Lab, scenes: KnownScenes) -> Iterator[LabFault]:
    """Yield what props and removals name that no known scene has and `build` does not make."""
    for name, prop in lab.scene.props.items():
        yield from _needless_values(lab, name, prop)
        yield from _other_asset(lab, name, prop, scenes)
        if scenes.scenes:
            yield from _unmade(name, prop, scenes)
            yield from _absent_targets(lab, name, prop, scenes)
    if scenes.scenes:
        yield from _absent_removals(lab, scenes)


def _absent_removals(lab: Lab, scenes: KnownScenes) -> Iterator[LabFault]:
    """Yield paths that a checkpoint removes, and that no scene, graph, sensor or thing has.

    A warning: students may have made it in an earlier part that the lab does not describe.
    """
    told = set[str]()
    whole = [graph.path for graph in lab.graphs.values()]
    whole += (sensor.path for sensor in lab.sensors.values())
    for point in lab.checkpoints.values():
        for path in point.removed:
            is_inside = any(stands_within(path, own) for own in whole)
            if path not in told and not is_inside and not scenes.has(path):
                told.add(path)
                key = f"checkpoints: '{lab.key_of(point.id)}': removes"
                yield scenes.lacks(path, CHECKPOINTS, key, "warning")


def _needless_values(lab: Lab, name: str, prop: PropSpec) -> Iterator[LabFault]:
    """Yield values that a thing has until it comes, or until nothing comes after."""
    for last in (last for last in prop.until if last in lab.checkpoints):
        key = f"props: {name}: until: {last}"
        if prop.since in lab.checkpoints and lab.is_after(prop.since, last):
            message = f"it comes with checkpoint {lab.key_of(prop.since)}, which is later"
            yield LabFault(SCENE, key, message, f"{SCENE}: props: {name}: from")
        elif last == lab.last:
            message = "no later checkpoint changes it: write its values under `set`"
            yield LabFault(SCENE, key, message)


def _unmade(name: str, prop: PropSpec, scenes: KnownScenes) -> Iterator[LabFault]:
    """Yield a thing without type and asset, or of the first stage, that is not there."""
    is_made = _makes(prop) or any(
        _makes(other) and (other.stands_at(prop.path) or prop.stands_at(other.path))
        for other in scenes.things
        if other is not prop
    )
    is_there = any(prop.stands_at(path) for path in scenes.prims)
    if not (is_made or is_there or prop.count == 0 or scenes.is_open(prop.path)):
        repair = "; `build` makes what has a `type`" if prop.since else ""
        yield scenes.lacks(prop.path, SCENE, f"props: {name}: path", "warning", repair)


def _makes(prop: PropSpec) -> bool:
    """Whether `build` makes the thing, not only completes it."""
    return prop.since != "" and bool(prop.type or prop.asset)


def _absent_targets(lab: Lab, name: str, prop: PropSpec, scenes: KnownScenes) -> Iterator[LabFault]:
    for key, paths in prop.targets.items():
        for target in paths:
            path = target.partition(".")[0]
            is_inside = any(stands_within(path, graph.path) for graph in lab.graphs.values())
            if not is_inside and not scenes.has(path):
                yield scenes.lacks(path, SCENE, f"props: {name}: targets: {key}")


def _other_asset(lab: Lab, name: str, prop: PropSpec, scenes: KnownScenes) -> Iterator[LabFault]:
    """Yield an asset that is not the one of a stage, or not in the folder that the lab has for it.

    Where neither is there, nothing is known of it.
    """
    if not prop.asset:
        return
    key = f"props: {name}: asset"
    folder = (lab.folder / prop.asset).parent
    has_folder = len(PurePosixPath(prop.asset).parts) > 1 and folder.is_dir()
    if has_folder and not (lab.folder / prop.asset).exists():
        files = [f"{PurePosixPath(prop.asset).parent}/{file.name}" for file in folder.iterdir()]
        meant = nearest_name(prop.asset, sorted(files))
        message = f"there is no file '{prop.asset}'" + (f", '{meant}' is there" if meant else "")
        yield LabFault(SCENE, key, message, str(folder))
    for scene in scenes.scenes:
        users = {prim: assets for prim, assets in scene.assets.items() if prop.stands_at(prim)}
        if users and not any(map(prop.refers, users.values())):
            prim, assets = next(iter(users.items()))
            message = f"{prim} does not refer to '{prop.asset}', but to '{assets[0]}'"
            yield LabFault(SCENE, key, message, scene.name)
            return


def _starter_scene(lab: Lab) -> Iterator[KnownScene]:
    """Yield the lab's own starter, where it describes one."""
    if (lab.folder / STARTER).is_file():
        starter = read_yaml(lab.folder / STARTER)
        kinds = _entries(starter, "kinds")
        prims = dict(_prims_below("", _entries(starter, "prims"), kinds))
        referring = tuple(f"{path}/" for path, refers in prims.items() if refers)
        yield KnownScene(STARTER, frozenset(prims), referring)


def _prims_below(
    path: str, prims: Mapping[str, Any], kinds: Mapping[str, Any]
) -> Iterator[tuple[str, bool]]:
    """Yield the paths of the starter's prims, and whether each refers to another prim."""
    for name, prim in prims.items():
        place = f"{path}/{name}"
        like: Mapping[str, Any] = prim if isinstance(prim, dict) else {}
        refers = False
        for _ in range(len(kinds) + 1):  # a kind may be like another one
            refers = refers or bool(like.get("reference"))
            yield from _prims_below(place, _entries(like, "children"), kinds)
            like = _entries(kinds, str(like.get("like", "")))
            if not like:
                break
        yield place, refers


def _entries(data: Mapping[str, Any], key: str) -> Mapping[str, Any]:
    """Return a mapping of a file; its faults are reported when it is loaded."""
    entries = data.get(key)
    return entries if isinstance(entries, dict) else {}
