"""The play of a stage that a later one holds by value: what the later play shows of it.

Checkpoints add graphs and sensors. What they add here may only look on: then all that was there
before does what it does alone. A student with faults costs 137 ms, and 209 ms without it
(`bench_class.py`).
"""

from __future__ import annotations

from collections.abc import Collection
from copy import copy

from msgspec.structs import replace

from lab3_usd.isaac.platform import Platform
from lab3_usd.model.dry_run import RENDER_PRODUCT, Scene, SceneNode, ScenePrim
from lab3_usd.sim.execution.drive import RATE
from lab3_usd.sim.execution.program import Program, is_within
from lab3_usd.sim.execution.recording import Recording
from lab3_usd.sim.judge.expectations import Expected
from lab3_usd.sim.timeline import Player

_OF_PARTS = ("Phys", "Isaac")  # how the schemas of bodies, joints, robots and links begin
_CAMERA = "Camera"
_HANDLES = ("context", "renderProductPath", "renderProductPathRight")  # numbered as they are made
_ASKED = ("domain", "commands", "limits", "robot", "has_ground")  # what a play depends on


def held_play(
    scene: Scene, wanted: Expected, later: Player, of_later: Expected, platform: Platform
) -> Player | None:
    """Return a scene as played, taken from the play of a later one; None where that may differ."""
    if any(getattr(wanted, name) != getattr(of_later, name) for name in _ASKED):
        return None
    whole, program = later.world.scene, later.program
    added = _added(scene, whole)
    if added is None or not _only_look_on(added, scene, later, platform):
        return None

    def is_kept(path: str) -> bool:
        return not is_within(path.partition(".")[0], added)

    part = copy(later)
    part.program = _part_of(program, scene, added)
    if not _runs_in_order(part, later):
        return None
    world = later.world
    part.world = replace(
        world,
        scene=scene,
        not_simulated={path: why for path, why in world.not_simulated.items() if is_kept(path)},
        gives={path: given for path, given in world.gives.items() if is_kept(path)},
        network=replace(
            world.network, sent=[sent for sent in world.network.sent if is_kept(sent.node)]
        ),
    )
    played = later.recording
    part.recording = Recording(played.seconds, path=played.path, held=played.held)
    return part


def _added(scene: Scene, whole: Scene) -> tuple[str, ...] | None:
    """Return the prims that a later scene adds; None where anything else differs, or is unknown."""
    if (scene.meters_per_unit, scene.up) != (whole.meters_per_unit, whole.up):
        return None
    if scene.missing or whole.missing:
        return None
    if [path for path in whole.prims if path in scene.prims] != [*scene.prims]:
        return None
    if any(whole.prims[path] != prim for path, prim in scene.prims.items()):
        return None
    paths = {graph.path for graph in scene.graphs}
    if tuple(graph for graph in whole.graphs if graph.path in paths) != scene.graphs:
        return None
    return tuple(path for path in whole.prims if path not in scene.prims)


def _only_look_on(added: Collection[str], scene: Scene, later: Player, platform: Platform) -> bool:
    """Whether what is added moves, hides and feeds nothing that was there before."""
    whole, program, world = later.world.scene, later.program, later.world
    nodes = [node for graph in whole.graphs if graph.path in added for node in graph.nodes]
    stops = any(failure.kind == "simulation-stopped" for _, failure in program.dead)
    if stops or world.unplayed or world.assumed:
        return False
    if not all(_is_unseen(whole.prims[path]) for path in added):
        return False
    if not all(  # simulated, and only reads and publishes
        (running := program.nodes.get(node.path)) is not None
        and running.type.drives is None
        and node.type not in platform.writers
        for node in nodes
    ):
        return False
    before = [node for graph in scene.graphs for node in graph.nodes]
    own = {node.path for node in before}
    if any(source in own for node in nodes for source in _sources(node)):
        return False
    named = [
        *(source for node in before for source in _sources(node)),
        *(to for node in before for paths in node.targets.values() for to in paths),
        *(to for prim in scene.prims.values() for paths in prim.targets.values() for to in paths),
    ]
    return not any(is_within(path.partition(".")[0], added) for path in named)


def _is_unseen(prim: ScenePrim) -> bool:
    """Whether nothing runs into a prim, sees it, or takes it for a part of a robot."""
    schemas = (prim.type, *prim.apis)
    return (
        not any(name.startswith(_OF_PARTS) for name in schemas)
        and not (prim.seen and prim.type != _CAMERA)
        and prim.type != RENDER_PRODUCT
        and not prim.targets
    )


def _sources(node: SceneNode) -> list[str]:
    return [wire.rpartition(".")[0] for state in node.inputs.values() for wire in state.sources]


def _part_of(program: Program, scene: Scene, added: Collection[str]) -> Program:
    """Return a program without the graphs that are added."""
    own = {node.path for graph in scene.graphs for node in graph.nodes}

    def is_own(path: str) -> bool:
        return not is_within(path.partition(".")[0], added)

    return replace(
        program,
        events={
            event: kept
            for event, nodes in program.events.items()
            if (kept := [node for node in nodes if node.path in own])
        },
        pushed=[node for node in program.pushed if node.path in own],
        nodes={path: node for path, node in program.nodes.items() if path in own},
        not_simulated={path: why for path, why in program.not_simulated.items() if is_own(path)},
        idle={path: why for path, why in program.idle.items() if is_own(path)},
        unwritten={path: kind for path, kind in program.unwritten.items() if is_own(path)},
        dead=[(path, failure) for path, failure in program.dead if is_own(path)],
        before={path: nodes for path, nodes in program.before.items() if path in own},
        guessed={name: why for name, why in program.guessed.items() if is_own(name)},
    )


def _runs_in_order(part: Player, later: Player) -> bool:
    """Whether no node of the part depends on how many others there are.

    Cycles of wires run as often as there are nodes. Handles that a file names by number are of
    contexts and products in the order in which these are made.
    """
    most = len(later.recording.path) + 1
    return later.rate == RATE and all(
        node.count <= most
        and not any(node.values.get(name) for name in _HANDLES if name not in node.wires)
        for node in part.program.nodes.values()
    )
