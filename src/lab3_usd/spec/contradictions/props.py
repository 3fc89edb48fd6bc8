"""Contradictions in the things of a scene: paths, targets, assets that nothing has or makes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import PurePosixPath

from lab3_usd.spec.contradictions.names import LabFault, nearest_name
from lab3_usd.spec.contradictions.scene import KnownScene
from lab3_usd.spec.lab import CHECKPOINTS, SCENE, Lab
from lab3_usd.spec.props import PropSpec
from lab3_usd.spec.scene import stands_within


def prop_faults(lab: Lab, scenes: Sequence[KnownScene]) -> Iterator[LabFault]:
    """Yield what props and removals name that no known scene has and `build` does not make."""
    for name, prop in lab.scene.props.items():
        yield from _needless_values(lab, name, prop)
        yield from _other_asset(lab, name, prop, scenes)
        if scenes:
            yield from _unmade(lab, name, prop, scenes)
            yield from _absent_targets(lab, name, prop, scenes)
    if scenes:
        yield from _absent_removals(lab, scenes)


def _absent_removals(lab: Lab, scenes: Sequence[KnownScene]) -> Iterator[LabFault]:
    """Yield paths that a checkpoint removes, and that no scene, graph, sensor or thing has.

    A warning: students may have made it in an earlier part that the lab does not describe.
    """
    prims = frozenset[str]().union(*(scene.prims for scene in scenes))
    made = {graph.path for graph in lab.graphs.values()}
    made |= {sensor.path for sensor in lab.sensors.values()}
    told = set[str]()
    for point in lab.checkpoints.values():
        for path in point.removed:
            is_thing = any(prop.stands_at(path) for prop in lab.scene.props.values())
            is_made = is_thing or any(stands_within(path, own) for own in made)
            if path in prims or path in told or is_made or _is_open(lab, path, scenes):
                continue
            told.add(path)
            meant = nearest_name(path, prims)
            message = f"'{path}' is not a prim" + (f", '{meant}' is" if meant else "")
            key = f"checkpoints: '{lab.key_of(point.id)}': removes"
            yield LabFault(CHECKPOINTS, key, message, _names(scenes), "warning")


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


def _unmade(
    lab: Lab, name: str, prop: PropSpec, scenes: Sequence[KnownScene]
) -> Iterator[LabFault]:
    """Yield a thing without type and asset, or of the first stage, that is not there."""
    beside = [other for other in lab.scene.props.values() if other is not prop]
    is_made = _makes(prop) or any(
        _makes(other) and (other.stands_at(prop.path) or prop.stands_at(other.path))
        for other in beside
    )
    is_there = any(prop.stands_at(path) for scene in scenes for path in scene.prims)
    if is_made or is_there or prop.count == 0 or _is_open(lab, prop.path, scenes):
        return
    prims = {path for scene in scenes for path in scene.prims}
    meant = nearest_name(prop.path, (*prims, *(other.path for other in beside if _makes(other))))
    hint = f", '{meant}' is" if meant else ""
    then = "; `build` makes what has a `type`" if prop.since else ""
    message = f"'{prop.path}' is not a prim{hint}{then}"
    yield LabFault(SCENE, f"props: {name}: path", message, _names(scenes), "warning")


def _makes(prop: PropSpec) -> bool:
    """Whether `build` makes the thing, not only completes it."""
    return prop.since != "" and bool(prop.type or prop.asset)


def _absent_targets(
    lab: Lab, name: str, prop: PropSpec, scenes: Sequence[KnownScene]
) -> Iterator[LabFault]:
    things = [thing for thing in lab.scene.props.values() if "*" not in thing.path]
    made = {thing.path for thing in things} | {sensor.path for sensor in lab.sensors.values()}
    prims = made.union(*(scene.prims for scene in scenes))
    graphs = [graph.path for graph in lab.graphs.values()]
    for key, paths in prop.targets.items():
        for target in paths:
            path = target.partition(".")[0]
            is_thing = any(each.stands_at(path) for each in lab.scene.props.values())
            is_ours = is_thing or any(stands_within(path, graph) for graph in graphs)
            if path in prims or is_ours or _is_open(lab, path, scenes):
                continue
            meant = nearest_name(path, prims)
            message = f"'{path}' is not a prim" + (f", '{meant}' is" if meant else "")
            yield LabFault(SCENE, f"props: {name}: targets: {key}", message, _names(scenes))


def _other_asset(
    lab: Lab, name: str, prop: PropSpec, scenes: Sequence[KnownScene]
) -> Iterator[LabFault]:
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
    for scene in scenes:
        users = {prim: assets for prim, assets in scene.assets.items() if prop.stands_at(prim)}
        if users and not any(map(prop.refers, users.values())):
            prim, assets = next(iter(users.items()))
            message = f"{prim} does not refer to '{prop.asset}', but to '{assets[0]}'"
            yield LabFault(SCENE, key, message, scene.name)
            return


def _is_open(lab: Lab, path: str, scenes: Sequence[KnownScene]) -> bool:
    """Whether a prim may come with what another one refers to."""
    names = path.split("/")
    above = ["/".join(names[:length]) for length in range(2, len(names))]
    assets = [prop for prop in lab.scene.props.values() if prop.asset]
    return path.startswith(tuple(prefix for scene in scenes for prefix in scene.open_below)) or any(
        prop.stands_at(place) for prop in assets for place in above
    )


def _names(scenes: Sequence[KnownScene]) -> str:
    return ", ".join(scene.name for scene in scenes)
