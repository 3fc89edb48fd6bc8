"""The picture of a TF tree: what a stage publishes, compared with the tree of the lab."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from types import MappingProxyType

from msgspec import Struct

from lab3_usd.facts.frame_targets import UnresolvedFrames
from lab3_usd.facts.frames import Edge
from lab3_usd.facts.tree import Tree, frame_faults, tree_of
from lab3_usd.report.picture.canvas import on_canvas
from lab3_usd.report.picture.layered import Placed, layered
from lab3_usd.report.picture.model import (
    STATES,
    Box,
    Curve,
    End,
    Picture,
    State,
    clip_end,
    sized,
    state_word,
)
from lab3_usd.report.tf_tree import TreeReport, tree_name
from lab3_usd.spec.lab import FrameSpec, LocalizationSpec

Pair = tuple[str, str]
MOST_TITLE = 40
WORDS: Mapping[State, str] = {"warned": f"in {state_word('warned', 'frames')}"}
GRAVE: tuple[State, ...] = ("wrong", "extra", "warned")


class DrawnEdge(Struct, frozen=True):
    """One edge of the drawn tree: its publishers, whether they are certain, and its state.

    `unknown` is the reason why the child is unknown; the child is then not a frame name. `apart`
    is the top of the largest tree, where nothing connects the parent, which is a top, with it.
    """

    parent: str
    child: str
    publishers: tuple[str, ...]
    state: State = "ok"
    external: bool = False
    sure: bool = True
    unknown: str = ""
    apart: str = ""


def spec_frames_picture(frames: FrameSpec) -> Picture:
    """Return the tree that the lab asks for, with the part that localization adds."""
    branches = [DrawnEdge(*edge, ()) for edge in frames.edges]
    if frames.localization is not None:
        branches.insert(0, _localization(frames.localization))
    return _picture("TF", "the required tree", branches, judged=False)


def frames_picture(
    frames: FrameSpec,
    edges: Sequence[Edge],
    hidden: Sequence[UnresolvedFrames] = (),
    *,
    required: bool = True,
    localized: bool = False,
) -> Picture:
    """Return the tree of a stage, with missing, extra and conflicting edges marked.

    Without `required` (before the checkpoint that adds the tree) nothing is missing or extra.
    `localized` adds what localization publishes. What is `hidden` is drawn as unknown, and no
    frame is missing that could be among it.
    """
    branches = [
        branch
        for branch in _branches(frames, edges, required=required)
        if branch.state != "missing"
        or not any(unresolved.may_be(branch.child) for unresolved in hidden)
    ]
    branches += _hidden_branches(hidden)
    if localized and frames.localization is not None:
        branches.insert(0, _localization(frames.localization))
    return _picture("TF", _counts_text(branches), branches, judged=True)


def published_frames_picture(report: TreeReport, not_judged: str = "") -> Picture:
    """Return the tree of any stage; transforms that tf2 rejects, and further trees, are marked.

    `not_judged` says in words what else is not known.
    """
    trees, branches = report.heard, list[DrawnEdge]()
    for heard in trees:
        where = f" ({tree_name(heard, trees)})" if len(trees) > 1 else ""
        wrong = {fault.frame for fault in frame_faults(heard.tree, report.reserved)}
        islands, main = report.islands(heard)
        published: dict[Pair, list[Edge]] = {}
        for edge in heard.tree.edges:
            published.setdefault((edge.parent, edge.child), []).append(edge)
        for (parent, child), sent in published.items():
            branch = DrawnEdge(
                parent + where,
                child + where,
                tuple(dict.fromkeys(edge.publisher for edge in sent)),
                "wrong" if child in wrong else "warned" if child in islands else "ok",
                sure=any(edge.sure for edge in sent),
                apart=main if islands.get(child) == parent else "",
            )
            branches.append(branch)
    branches += _hidden_branches(report.hidden)
    subtitle = "  ·  ".join(filter(None, [_counts_text(branches), not_judged]))
    return _picture("TF", subtitle, branches, judged=True, rates=report.rates)


def _hidden_branches(hidden: Sequence[UnresolvedFrames]) -> Iterator[DrawnEdge]:
    for unresolved in hidden:
        reason = f"asset not found: {unresolved.asset}"
        publishers = (unresolved.publisher,)
        yield DrawnEdge(unresolved.parent, unresolved.what, publishers, unknown=reason)


def _localization(spec: LocalizationSpec) -> DrawnEdge:
    return DrawnEdge(*spec.edge, (spec.by,), external=True)


def _branches(frames: FrameSpec, edges: Sequence[Edge], *, required: bool) -> Iterator[DrawnEdge]:
    """Yield the required edges in the order of the lab, then the others as they are published."""
    published: dict[Pair, list[str]] = {}
    for edge in edges:
        published.setdefault((edge.parent, edge.child), []).append(edge.publisher)
    certain = {(edge.parent, edge.child) for edge in edges if edge.sure}
    heard = tree_of(edges)
    for edge_of_lab in frames.edges:
        if (
            edge_of_lab not in published
            and required
            and not {*frames.deeper} & {*heard.above(edge_of_lab[1])}
        ):
            yield DrawnEdge(*edge_of_lab, (), "missing")
    order: list[Pair] = [pair for pair in frames.edges if pair in published]
    order += [pair for pair in published if pair not in frames.edges]
    for pair in order:
        publishers = tuple(dict.fromkeys(published[pair]))
        state = _state(pair, frames, heard)
        if len(publishers) > 1:
            state = "wrong"
        elif not required and not {*frames.roots} & {*pair}:
            state = "ok"
        yield DrawnEdge(*pair, publishers, state, sure=pair in certain)


def _state(pair: Pair, frames: FrameSpec, heard: Tree[Edge]) -> State:
    """Judge a published edge; where a frame has two parents the one that is asked for is right."""
    if pair in frames.edges:
        return "ok"
    parent, child = pair
    if child in {parent, *frames.roots, *heard.several_parents}:
        return "wrong"
    above = {*heard.above(child)}
    if above & {*frames.deeper}:
        return "ok"
    return "extra" if above & {*frames.roots} else "wrong"


def _counts_text(branches: Sequence[DrawnEdge]) -> str:
    states = Counter(branch.state for branch in branches)
    unknown = sum(bool(branch.unknown) for branch in branches)
    published = sum(branch.state != "missing" for branch in branches) - unknown
    parts = [f"{published} transform{'s' * (published != 1)}"]
    parts += [f"{unknown} unknown"] if unknown else []
    parts += [
        f"{states[state]} {WORDS.get(state, state)}"
        for state in STATES
        if state != "ok" and states[state]
    ]
    return "  ·  ".join(parts)


def _picture(
    title: str,
    subtitle: str,
    branches: Sequence[DrawnEdge],
    *,
    judged: bool,
    rates: Mapping[str, str] = MappingProxyType({}),
) -> Picture:
    names = dict.fromkeys(name for branch in branches for name in (branch.parent, branch.child))
    apart = {branch.parent: branch.apart for branch in branches if branch.apart}
    into: dict[str, list[DrawnEdge]] = {}
    for branch in branches:
        into.setdefault(branch.child, []).append(branch)
    boxes = [_box(name, into.get(name, ()), rates, apart.get(name)) for name in names]
    curves: list[Curve] = []
    for branch in branches:
        note = f"{branch.parent} → {branch.child}"
        if branch.publishers:
            surely = "published" if branch.sure else "perhaps published"
            note += f", {surely} by {' and '.join(branch.publishers)}"
        ends = (End(branch.parent, ""), End(branch.child, ""))
        dashed = branch.external or not branch.sure
        curves.append(Curve(*ends, dashed=dashed, state=branch.state, note=note))
    placed = _placed(tuple(boxes), tuple(curves))
    return on_canvas(Picture(title, subtitle, *placed, judged=judged, kind="frames"))


@lru_cache(maxsize=16)  # most stages of a class publish the same tree
def _placed(boxes: tuple[Box, ...], curves: tuple[Curve, ...]) -> Placed:
    return layered(boxes, curves)


def _box(
    name: str, edges_into: Sequence[DrawnEdge], rates: Mapping[str, str], apart: str | None
) -> Box:
    """Return the box of a frame; `edges_into` are the edges that lead to it.

    `apart` is the frame with which nothing connects it, where it is the top of a further tree.
    """
    if apart:
        subtitle = f"not connected to {clip_end(apart, MOST_TITLE)}"
        title = clip_end(name, MOST_TITLE)
        return sized(Box(name, title, subtitle, family="frame", state="warned", note=subtitle))
    unknown = next((branch.unknown for branch in edges_into if branch.unknown), "")
    if unknown:
        kind, _, path = name.partition(" /")
        title = clip_end(f"{kind} {path.rpartition('/')[2]}", MOST_TITLE)
        reason = unknown.partition(":")[0]
        note = f"{name}: {unknown}"
        return sized(Box(key=name, title=title, subtitle=reason, family="absent", note=note))
    states = {branch.state for branch in edges_into}
    state: State = "missing" if states == {"missing"} else "ok"
    state = next((grave for grave in GRAVE if grave in states), state)
    publishers = dict.fromkeys(path for branch in edges_into for path in branch.publishers)
    surely = "by" if all(branch.sure for branch in edges_into) else "perhaps by"
    published_by = " and ".join(
        clip_end(path.rpartition("/")[2], MOST_TITLE)
        + (f", {clip_end(rates[path], MOST_TITLE)}" if path in rates else "")
        for path in publishers
    )
    subtitle = "missing" if state == "missing" else ""
    subtitle = f"{surely} {published_by}" if published_by else subtitle
    note = "\n".join(publishers)
    title = clip_end(name, MOST_TITLE)
    return sized(Box(name, title, subtitle, family="frame", state=state, note=note))
