"""The rule that names the frames which are lost through what other rules say."""

from __future__ import annotations

from collections.abc import Iterator

from lab3_usd.check.absence import is_at_or_below
from lab3_usd.check.finding import Finding, Problem
from lab3_usd.check.registry import rule
from lab3_usd.check.subject import Outcome

_FAMILY = "T"


@rule("T20", "lost-frames", scope="outcome", severity="note")
def lost_frames(outcome: Outcome) -> Iterator[Problem]:
    """Frames of the required TF tree are not published, for faults that are told elsewhere.

    Why: every frame is a requirement of its own, so that one cut wire can cost all of them. This
    names those that no other finding names.

    Fix: repair what else is said of the graph; the frames come back with it.

    Example: Isaac Compute Transform Tree is missing, and with it six frames.
    """
    told = [each for each in outcome.findings if each.severity != "note"]
    lost = [
        each.title.partition(" is ")[0]
        for each in outcome.requirements
        if each.kind == "frame" and not each.met and not _is_named(each.id, told)
    ]
    for path in _publishers(outcome) if lost else ():
        faults = [each.prim for each in told if is_at_or_below(each.prim, path)]
        yield Problem(
            path,
            f"through other faults, not published: {', '.join(lost)}",
            expected=", ".join(lost),
            handout=outcome.subject.lab.frames.handout,
            related=tuple(dict.fromkeys(prim for prim in faults if prim != path)),
        )


def _is_named(requirement: str, told: list[Finding]) -> bool:
    frame = requirement.rpartition("/")[2]
    quoted = f"'{frame}'"
    return any(
        each.prim.endswith(f"/{frame}")
        or each.expected == quoted
        or (each.rule[0] == _FAMILY and quoted in each.message)
        for each in told
    )


def _publishers(outcome: Outcome) -> Iterator[str]:
    """Yield where the graphs of the lab that publish frames are, or should be."""
    for name, roles in outcome.subject.roles.items():
        spec = outcome.subject.lab.graphs[name]
        if any(node.type.tf is not None for node in spec.nodes.values()):
            yield spec.path if roles.graph is None else roles.graph.path
