"""A dry run as one HTML page: maps of the run, the drive over time, and the checks that failed.

Each graph is drawn with how often its nodes computed.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path, PurePath

from markupsafe import Markup
from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.check.explanations import explaining_finding, rules_named
from lab3_usd.errors import Lab3Error
from lab3_usd.facts.domains import Domain
from lab3_usd.facts.frames import Edge
from lab3_usd.model.dry_run import Behaviour, Check, HeardFrame, Replay
from lab3_usd.model.finding import Finding
from lab3_usd.report.behaviour.charts import chart_svg, cursor_places
from lab3_usd.report.behaviour.map_pictures import first_moment, map_svg, near_svg, room_svg
from lab3_usd.report.behaviour.text import (
    ONLY_SHOWN,
    WHAT_A_RECORDING_IS,
    WHAT_IT_IS,
    leg_text,
    passed_texts,
    rate,
    sum_text,
)
from lab3_usd.report.html.templates import fill_page, own_markup
from lab3_usd.report.picture.model import Box, port_id
from lab3_usd.report.picture.svg import svg
from lab3_usd.report.pictures.graph_picture import stage_pictures
from lab3_usd.report.pictures.tf_picture import published_frames_picture
from lab3_usd.report.tf_tree import FAULT, TreeReport, as_lines
from lab3_usd.spec.lab import Lab


class DrawnPlay(Struct, frozen=True):
    """The drawings of a play, of the robot `name` where there are several; markup of our own.

    Of each leg there is a text, and whether it is wrong. `shown` is the number of the moment that
    is shown first.
    """

    name: str
    replay: Replay
    shown: int
    room: Markup
    near: Markup
    legs: tuple[tuple[str, bool], ...]

    @property
    def has_scans(self) -> bool:
        """Whether points of a lidar are drawn."""
        return bool(self.replay.moments[-1].points)

    @property
    def has_odometry(self) -> bool:
        """Whether there is a place by odometry."""
        return self.replay.moments[-1].odometry is not None


class DryRunSummary(Struct, frozen=True):
    """What a report shows of the dry run of one stage."""

    summary: str
    plays: tuple[DrawnPlay, ...]
    sizes: tuple[str, ...]
    wrong: tuple[Check, ...]


def dry_run_summary(behaviour: Behaviour, replays: Mapping[str, Replay]) -> DryRunSummary | None:
    """Return what a report shows, None where nothing was played."""
    if not replays:
        return None
    return DryRunSummary(
        sum_text(behaviour),
        tuple(_plays(behaviour, replays, still=True)),
        behaviour.sizes,
        tuple(check for check in behaviour.checks if check.verdict != "ok"),
    )


_DRAWN = 8  # robots


def _plays(
    behaviour: Behaviour, replays: Mapping[str, Replay], *, still: bool = False
) -> Iterator[DrawnPlay]:
    """Yield the drawings of each robot: one moment of a `still` one, else all."""
    for name, replay in list(replays.items())[:_DRAWN]:
        own = _of_robot(behaviour, name)
        shown = first_moment(own, replay)
        yield DrawnPlay(
            name,
            replay,
            shown,
            Markup(room_svg(replay, shown, still=still)),  # noqa: S704 - no name is in it
            Markup(near_svg(replay, shown, still=still)),  # noqa: S704
            tuple(
                (f"{leg.name}: {leg.fault}" if leg.fault else leg_text(leg), bool(leg.fault))
                for leg in own.legs
            ),
        )


def _of_robot(behaviour: Behaviour, name: str) -> Behaviour:
    """Return what is said of one of several robots; all of it without a name."""
    if not name:
        return behaviour
    lead = f"{name}: "
    own = (leg for leg in behaviour.legs if leg.name.startswith(lead))
    legs = tuple(replace(leg, name=leg.name.removeprefix(lead)) for leg in own)
    checks = tuple(check for check in behaviour.checks if check.of in ("", name))
    return replace(behaviour, legs=legs, checks=checks)


_ABOVE = 6  # pixels between a node and its count

# In the order of the page.
VERDICTS = {"bad": "something is wrong", "not judged": "not judged", "ok": "all right"}


class FailedCheck(Struct, frozen=True):
    """A check that failed, its id on the page, and how what it names is repaired."""

    check: Check
    id: str
    repairs: tuple[str, ...]


class GraphDrawing(Struct, frozen=True):
    """A graph as it is drawn; `nodes` are the ids of its elements by the prims of the nodes."""

    path: str
    title: str
    drawing: str
    nodes: Mapping[str, str]


def render(
    behaviour: Behaviour, replays: Mapping[str, Replay], lab: Lab, findings: Sequence[Finding] = ()
) -> str:
    """Return the page; without a replay of a robot it says why there is none.

    `findings` are what the rules say of the stage: they know the repair of what failed.
    """
    plays = list(_plays(behaviour, replays))
    computed: Counter[str] = Counter()  # how often each node did, in all plays
    for replay in replays.values():
        computed.update(replay.computed)
    checks = sorted(behaviour.checks, key=lambda check: list(VERDICTS).index(check.verdict))
    rule_of = rules_named(behaviour, findings)
    failing = list(_failed_checks(checks, findings))
    graphs = (
        []
        if behaviour.recording
        else list(_graph_drawings(Path(behaviour.stage), lab, computed, failing))
    )
    edges = tuple(heard_edges(behaviour, plays[0].replay if plays else None))
    tree = TreeReport("", edges, tops=_tops(behaviour))
    return fill_page(
        "sim.html.j2",
        ("sim.css", "maps.css", "picture.css", "picture.js", "sim.js"),
        behaviour=behaviour,
        what=WHAT_A_RECORDING_IS if behaviour.recording else WHAT_IT_IS,
        name=PurePath(behaviour.recording or behaviour.stage).name,
        passed=passed_texts(behaviour),
        verdicts=VERDICTS,
        failing=failing,
        others=[check for check in checks if check.verdict != "bad"],
        nodes={prim: element for graph in graphs for prim, element in graph.nodes.items()},
        faulty=[
            graph.path
            for graph in graphs
            if any(failed.check.prim in graph.nodes for failed in failing)
        ],
        rule_of=rule_of,
        only_shown="" if behaviour.recording else ONLY_SHOWN,
        rate=rate,
        summary=sum_text(behaviour),
        plays=plays,
        fit=behaviour.fit,
        on_map=own_markup(map_svg(behaviour.fit)) if behaviour.fit is not None else "",
        chart=lambda replay: own_markup(chart_svg(replay)),
        places=cursor_places,
        tree=tree_lines(tree),
        tree_picture=own_markup(svg(published_frames_picture(tree), "tf-")) if edges else "",
        graphs=graphs,
    )


def _failed_checks(checks: Sequence[Check], findings: Sequence[Finding]) -> Iterator[FailedCheck]:
    """Yield the failed checks with their repairs: of errors at the prim, else of what explains."""
    failing = [check for check in checks if check.verdict == "bad"]
    for number, check in enumerate(failing):
        there = [each for each in findings if each.prim == check.prim and each.severity == "error"]
        explained = explaining_finding(check, findings)
        if not there and explained is not None:
            there = [explained]
        repairs = dict.fromkeys(finding.hint for finding in there if finding.hint)
        yield FailedCheck(check, f"check-{number}", tuple(repairs))


def heard_edges(behaviour: Behaviour, replay: Replay | None) -> Iterator[Edge]:
    """Yield the transforms of a run, each with who hears it where that is known."""
    heard = replay.frames if replay is not None else ()
    for frame in heard or (HeardFrame(f.parent, f.child, f.static) for f in behaviour.frames):
        yield Edge(
            frame.parent,
            frame.child,
            frame.publisher,
            frame.publisher,
            frame.topic,
            frame.static,
            domain=Domain(str(frame.domain)),
        )


def _tops(behaviour: Behaviour) -> frozenset[str]:
    """Return the tops of the trees of robots: all where the check of the tree finds no fault."""
    is_right = any(check.name == "tree" and check.verdict == "ok" for check in behaviour.checks)
    children = {frame.child for frame in behaviour.frames}
    parents = {frame.parent for frame in behaviour.frames}
    return frozenset(parents - children if is_right else ())


def tree_lines(tree: TreeReport) -> list[tuple[str, bool]]:
    """Return the lines of the TF trees, and whether each says that something is wrong."""
    lines = as_lines(tree) if tree.edges else ()
    return [(line, line.startswith("! ") or FAULT in line) for line in lines]


def _graph_drawings(
    path: Path, lab: Lab, computed: Mapping[str, int], failing: Sequence[FailedCheck]
) -> Iterator[GraphDrawing]:
    """Yield the drawing of each graph of a stage; none where it can no longer be read."""
    from lab3_usd.stage.read.stage_reader import read_stage

    try:
        pictures = list(stage_pictures(lab, None, read_stage(path, lab.platform)))
    except (Lab3Error, OSError):
        return
    for number, picture in enumerate(pictures):
        if picture.kind == "graph":
            marks = "".join(
                (_count_svg(box, computed.get(box.key)) if box.inputs or box.outputs else "")
                + _fault_svg(box, [failed for failed in failing if failed.check.prim == box.key])
                for box in picture.boxes
            )
            drawing = svg(picture, f"g{number}-").removesuffix("</svg>")
            if "<a " in marks:  # what has links is no image
                drawing = drawing.replace('role="img"', 'role="group"', 1)
            nodes = {box.key: f"g{number}-{port_id(box.key)}" for box in picture.boxes}
            yield GraphDrawing(picture.path, picture.title, f"{drawing}{marks}</svg>", nodes)


def _count_svg(box: Box, times: int | None) -> str:
    text = "not simulated" if times is None else f"{times} times" if times else "never"
    kind = "fired" if times else "fired none"
    x, y = box.x + box.w, box.y - _ABOVE
    return f'<text class="{kind}" text-anchor="end" x="{x:.0f}" y="{y:.0f}">{text}</text>'


def _fault_svg(box: Box, failing: Sequence[FailedCheck]) -> str:
    """Return a frame around a node at fault, and below it the checks that fail by it, as a link."""
    if not failing:
        return ""
    names = ", ".join(failed.check.name for failed in failing)
    size = f'width="{box.w + 6:.0f}" height="{box.h + 6:.0f}"'
    frame = f'<rect class="faulty" x="{box.x - 3:.0f}" y="{box.y - 3:.0f}" {size} rx="10"/>'
    place = f'x="{box.x:.0f}" y="{box.y + box.h + 20:.0f}"'
    text = f'<text class="fired none" {place}>bad: {names}</text>'
    return f'{frame}<a href="#{failing[0].id}">{text}</a>'
