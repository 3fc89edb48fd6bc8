"""Rules about single TF frames, and about the frames that messages name."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from lab3_usd.check.lab_frames import (
    FrameSource,
    TfView,
    frame_list_text,
    frame_sources,
    frames_of_missing_assets,
    lacks_only_the_camera,
    lists_its_parent,
    missing_frames,
)
from lab3_usd.check.match.rule_inputs import JudgedStage
from lab3_usd.check.registry import frame_places, rule
from lab3_usd.check.repairs import edits_in_stage, removal_or_repair
from lab3_usd.facts.frame_targets import (
    LINK_API,
    NAME_OVERRIDE,
    ROBOT_API,
    expands,
    frame_of_prim,
    tf_ports,
)
from lab3_usd.facts.frames import Edge, certain_edges, unknown_publishers
from lab3_usd.facts.tree import tree_of
from lab3_usd.model.changes import ClearValue, Edit, SetValue
from lab3_usd.model.finding import Finding, Place, Problem, Requirement, Severity, display
from lab3_usd.model.physics import rigid_bodies
from lab3_usd.model.prims import is_at_or_below
from lab3_usd.spec.contradictions.names import file_of, graph_frames


@rule("T01", "missing-frame", scope="frames")
def missing_frame(view: TfView) -> Iterator[Problem]:
    """A required frame is not published.

    Why: whoever receives data cannot place it without a transform: without the frame of a sensor
    its data is dropped, or has no place. The robot root as a target gives only the prims below it
    with IsaacLinkAPI, IsaacSiteAPI or IsaacReferencePointAPI. The links in its robot schema do not
    matter. A target with the articulation root gives the bodies at and below it. If the links are
    beside that body, it gives only itself.

    Fix: select the Isaac Compute Transform Tree node and add the prim of the frame to Target Prims.
    If the prim has a name override, clear it.

    Example: `inputs:targetPrims` names all links but `{robot}/{link}`. Nothing publishes `{link}`.
    """
    for maker in frame_sources(view):
        if not lists_its_parent(maker.node, view) and not lacks_only_the_camera(maker, view):
            frames = [*missing_frames(maker, view), *_exchanged_frames(maker, view)]
            yield from _missing_of(maker, frames, view)
        for frame, asset in frames_of_missing_assets(maker, view).items():
            message = f"nothing publishes the frame '{frame}'"
            unmet = tuple(place for place, _ in frame_places(frame))
            yield Problem(
                maker.prims[frame], message, handout=maker.handout, unmet=unmet, rests_on=asset
            )


def _exchanged_frames(maker: FrameSource, view: TfView) -> list[str]:
    """Return the required frames that are those of other prims, by the overrides of both."""
    of_maker = [edge for edge in view.edges if edge.cause == maker.node.path]
    names = {edge.prim: edge.child for edge in of_maker}
    places = {edge.child: edge.prim for edge in of_maker}
    return [
        frame
        for _, frame in view.subject.lab.frames.edges
        if (home := maker.prims.get(frame)) is not None
        and frame_of_prim(home, view.stage) != frame
        and names.get(home, frame) != frame
        and places.get(frame, home) != home
    ]


def _missing_of(maker: FrameSource, missing: list[str], view: TfView) -> Iterator[Problem]:
    stage = view.subject.stage
    targets = maker.node.targets(maker.port)
    renamed = {frame for frame in missing if frame_of_prim(maker.prims[frame], stage) != frame}
    for frame in sorted(renamed):
        prim, actual = maker.prims[frame], frame_of_prim(maker.prims[frame], stage)
        is_own = prim.endswith(f"/{actual}")
        hint = f"give {prim} the attribute {NAME_OVERRIDE}, of type string, with the value {frame}"
        yield Problem(
            prim,
            f"the prim's frame is named '{actual}'{'' if is_own else ' by its override'}",
            property=NAME_OVERRIDE,
            expected=frame,
            actual=actual,
            handout=maker.handout,
            hint=None if prim.endswith(f"/{frame}") else hint,
            fix=(_naming(prim, frame),),
            covers=frame_places(frame, actual),
        )
    rest = [frame for frame in missing if frame not in renamed]
    why = _why_not_all(maker, rest, view)
    stands = [path for path in maker.asked if path not in maker.prims.values()]
    together = len(rest) == len(maker.prims) or (bool(why or stands) and bool(rest))
    strangers = [path for path in targets if stage.prim(path) is None and not stage.unknown(path)]
    nowhere = f"; {', '.join(strangers)} is not in the scene" if strangers else ""
    for frames in [rest] if together else [[frame] for frame in rest]:
        yield Problem(
            maker.node.path,
            f"nothing publishes {frame_list_text(frames)}{nowhere}{why}",
            property=maker.port,
            expected=", ".join(maker.asked if stands else [maker.prims[name] for name in frames]),
            actual=", ".join(targets) or "no targets",
            handout=maker.handout,
            fix=edits_in_stage(view.subject, maker.node.path, maker.port),
            covers=(
                *((maker.node.path, f"{maker.port}[{path}]") for path in strangers),
                *frame_places(*frames),
            ),
        )


def _naming(prim: str, frame: str) -> Edit:
    """Return the edit by which a prim gets the name of its frame."""
    if prim.endswith(f"/{frame}"):
        return ClearValue(prim, NAME_OVERRIDE)
    return SetValue(prim, NAME_OVERRIDE, "string", frame)


def _why_not_all(maker: FrameSource, missing: list[str], view: TfView) -> str:
    """Say why a robot, which is one of the targets, does not give all of its links."""
    targets = maker.node.targets(maker.port)
    robots = (robot.path for robot in view.subject.lab.scene.robots if robot.path in targets)
    robot = next(robots, "")
    prim = view.subject.stage.prim(robot) if robot else None
    if prim is None:
        return ""
    homes = [maker.prims[frame] for frame in missing]
    if not expands(robot, maker.node, view.subject.stage):
        lack = "links of Isaac Sim's robot schema" if ROBOT_API in prim.apis else ROBOT_API
        return f"; {robot} gives only its own frame, because it has no {lack}"
    bodies = rigid_bodies(view.subject.stage)
    links = [home for home in homes if is_at_or_below(home, robot) and home in bodies]
    return f"; {robot} does not give {', '.join(links)} without {LINK_API}" if links else ""


@rule("T02", "wrong-parent-frame", scope="frames")
def wrong_parent_frame(view: TfView) -> Iterator[Problem]:
    """A required frame has another parent.

    Why: the robot's frames must come together in `{base}`. A frame with another parent stays behind
    when the robot moves.

    Fix: set Parent Prim of Isaac Compute Transform Tree to `{base}`, and publish each frame only
    there. If the parent prim has a name override, clear it.

    Example: `/Graph/tf` publishes `world -> {link}`, and the lab's own node no longer names
    `{link}`.
    """
    wrong: dict[tuple[str, str], list[Edge]] = {}
    for parent, child in view.subject.lab.frames.edges:
        edges = view.children.get(child, [])
        may_be_deeper = parent in view.subject.lab.frames.deeper
        if edges and not any(
            edge.parent == parent or (may_be_deeper and _hangs_below(edge, parent, view))
            for edge in edges
        ):
            wrong.setdefault((edges[0].cause, edges[0].parent), []).append(edges[0])
    for (cause, actual), edges in wrong.items():
        yield _wrong_parent(cause, actual, edges, view)


def _hangs_below(edge: Edge, top: str, view: TfView) -> bool:
    """Whether the node that gives this frame leads from it up to `top`, as with a robot's links."""
    own = tree_of(other for other in view.edges if other.cause == edge.cause)
    return top in own.above(edge.child)


def _wrong_parent(cause: str, actual: str, edges: list[Edge], view: TfView) -> Problem:
    frames = [edge.child for edge in edges]
    expected = next(p for p, child in view.subject.lab.frames.edges if child == frames[0])
    node = view.live_nodes[cause]
    ports = tf_ports(node)
    port = next(iter(ports.names or ports.prims))
    severity: Severity | None = None if certain_edges(edges) else "warning"
    site: tuple[str, str] = (cause, port)
    fix = removal_or_repair(view.subject, cause, port, severity)
    prim = next(iter(node.targets(port)), None)
    assumed: tuple[Place, ...] = ()
    if cause in view.role_specs and prim and frame_of_prim(prim, view.subject.stage) != expected:
        site = (prim, NAME_OVERRIDE)
        fix = (_naming(prim, expected),)
        lab = view.subject.lab  # whose links of this frame may be the target, renamed
        links = [path for robot in lab.scene.robots for path in robot.link_paths]
        assumed = tuple((path, None) for path in links if lab.frame_of(path) == expected)
    return Problem(
        site[0],
        f"'{actual}' is the parent of {frame_list_text(frames)}, expected '{expected}'",
        property=site[1],
        expected=expected,
        actual=actual,
        handout=view.subject.lab.frames.handout,
        severity=severity,
        fix=fix,
        covers=frame_places(actual, expected, *frames),
        assumes=(
            *assumed,
            *(
                (path, port)
                for path in dict.fromkeys((cause, *(edge.publisher for edge in edges)))
                for port in tf_ports(view.live_nodes[path]).inputs
            ),
        ),
    )


@rule("T20", "lost-frames", scope="requirements", severity="note")
def lost_frames(judged: JudgedStage) -> Iterator[Problem]:
    """Required frames are not published.

    Why: every frame is a requirement, so one deleted connection can cost all of them. This note
    lists the frames that no other finding names. Where no other error explains their absence, it
    is an error itself.

    Fix: repair the other findings about the graph. The frames come back with them. Without other
    findings, compare the target prims and frame names of the graph with those that the lab asks
    for.

    Example: Isaac Compute Transform Tree is missing, and with it six frames.
    """
    faults = [finding for finding in judged.findings if finding.severity != "note"]
    lost = [
        requirement.title.partition(" is ")[0]
        for requirement in judged.requirements
        if requirement.kind == "frame"
        and not requirement.met
        and not _is_named(requirement, faults)
    ]
    publishers = _publishers(judged, lost) if lost else {}
    silent = [path for path in _graphs(judged, publish=False) if path not in publishers]
    has_cause = any(
        finding.severity == "error"
        and not any(is_at_or_below(finding.prim, path) for path in silent)
        for finding in faults
    )
    because = "because of other faults, " if has_cause else ""
    for path, own in publishers.items():
        sites = [finding.prim for finding in faults if is_at_or_below(finding.prim, path)]
        yield Problem(
            path,
            f"{because}not published: {', '.join(own)}",
            severity=None if has_cause else "error",
            expected=", ".join(own),
            handout=judged.subject.lab.frames.handout,
            related=tuple(dict.fromkeys(prim for prim in sites if prim != path)),
        )


def _publishers(judged: JudgedStage, lost: Sequence[str]) -> dict[str, list[str]]:
    """Map the graphs that should send transforms to those, all of them where none is told."""
    files = {edge.child: edge.file for edge in graph_frames(judged.subject.lab)}
    of_graph: dict[str, list[str]] = {}
    for transform in lost:
        file = files.get(transform.partition(" -> ")[2], "")
        own = [*_graphs(judged, publish=True, file=file)]
        for path in own or _graphs(judged, publish=True):
            of_graph.setdefault(path, []).append(transform)
    return of_graph


def _is_named(requirement: Requirement, findings: list[Finding]) -> bool:
    """Whether a finding is about a frame, its prim, or a setting that should name it."""
    frame = requirement.title.partition(" is ")[0].partition(" -> ")[2]
    return any(
        finding.prim.endswith(f"/{frame}")
        or finding.expected == display(frame)
        or (requirement.id, None) in finding.covers
        for finding in findings
    )


def _graphs(judged: JudgedStage, *, publish: bool, file: str = "") -> Iterator[str]:
    """Yield where the graphs of the lab that publish frames are, or should be, or the others.

    With a file it is the graph that this describes.
    """
    for name, roles in judged.subject.roles.items():
        spec = judged.subject.lab.graphs[name]
        if file in ("", file_of(spec)) and publish == any(
            node.type.tf is not None for node in spec.nodes.values()
        ):
            yield spec.path if roles.graph is None else roles.graph.path


@rule("T12", "unknown-frames", scope="frames", severity="warning")
def unknown_frames(view: TfView) -> Iterator[Problem]:
    """A node publishes frames that are not in the stage.

    Why: the names are computed while the simulation runs. They may include a frame of the lab,
    which then has two publishers and jumps between them.

    Fix: type the frame ids into the node, or delete it if the lab does not need it. Otherwise check
    the tree with view_frames while the simulation runs.

    Example: a Publish Raw Transform Tree whose Child Frame ID is connected to a node that computes
    it.
    """
    subject = view.subject
    for path in unknown_publishers(view.topics, subject.stage):
        yield Problem(
            path,
            "publishes transforms between frames that the stage does not define",
            handout=subject.lab.frames.handout,
            assumes=((path, "node:type"),),
        )
