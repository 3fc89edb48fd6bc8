"""Contradictions in the things of a scene: paths, targets, assets that nothing has or makes."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import PurePosixPath

from lab3_usd.spec.contradictions.names import LabFault, nearest_name
from lab3_usd.spec.contradictions.scene import KnownScenes
from lab3_usd.spec.lab import CHECKPOINTS, SCENE, Lab
from lab3_usd.spec.props import PropSpec
from lab3_usd.spec.scene import stands_within


def prop_faults(lab: Lab, scenes: KnownScenes) -> Iterator[LabFault]:
    """Yield what props and removals name that no known scene has and `build` does not make."""
    for name, prop in lab.scene.props.items():
        yield from _needless_values(lab, name, prop)
        yield from _other_asset(lab, name, prop, scenes)
        if scenes.scenes:
            yield from _unmade(name, prop, scenes)
            yield from _absent_targets(name, prop, scenes)
    if scenes.scenes:
        yield from _absent_removals(lab, scenes)


def _absent_removals(lab: Lab, scenes: KnownScenes) -> Iterator[LabFault]:
    """Yield paths that a checkpoint removes, and that no scene, graph, sensor or thing has.

    A warning: students may have made it in an earlier part that the lab does not describe.
    """
    told = set[str]()
    for point in lab.checkpoints.values():
        for path in point.removed:
            is_inside = any(stands_within(path, own) for own in scenes.made)
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


def _absent_targets(name: str, prop: PropSpec, scenes: KnownScenes) -> Iterator[LabFault]:
    for key, paths in prop.targets.items():
        for target in paths:
            path = target.partition(".")[0]
            if not scenes.has(path):
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
