"""What differs between two stages over ROS: topics and the transforms of the TF tree."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

from lab3_usd.check.ros.topics import Endpoint, endpoints
from lab3_usd.check.tf.frames import published_edges
from lab3_usd.diff.pairs import StagePairs
from lab3_usd.model.stage import StageModel
from lab3_usd.model.stage_diff import StageChange
from lab3_usd.spec.lab import Lab


def topic_changes(
    before: StageModel, after: StageModel, lab: Lab, pairs: StagePairs
) -> Iterator[StageChange]:
    """Yield the topics that came, went or are not what they were."""
    ours = {(pairs.path(each.node.path), each.port): each for each in endpoints(before, lab)}
    theirs = {(each.node.path, each.port): each for each in endpoints(after, lab)}
    for place, was in ours.items():
        if place not in theirs:
            yield StageChange("topic", "removed", _name(was), was=_words(was))
            continue
        now, old = _facts(theirs[place]), _facts(was)
        for fact in old:
            if old[fact] != now[fact]:
                name = _name(theirs[place])
                yield StageChange("topic", "changed", name, fact, old[fact], now[fact])
    for place, endpoint in theirs.items():
        if place not in ours:
            yield StageChange("topic", "added", _name(endpoint), now=_words(endpoint))


def _name(endpoint: Endpoint) -> str:
    return endpoint.topic or endpoint.written


def _words(endpoint: Endpoint) -> str:
    return f"{endpoint.node.path} {endpoint.direction} {endpoint.type or 'an unknown type'}"


def _facts(endpoint: Endpoint) -> dict[str, str]:
    return {
        "name": _name(endpoint),
        "type": endpoint.type or "unknown",
        "frames": ", ".join(endpoint.frames) or "none",
        "qos": "unknown" if endpoint.qos is None else str(endpoint.qos),
        "rate": endpoint.rate if endpoint.runs else "never",
    }


def frame_changes(before: StageModel, after: StageModel, lab: Lab) -> Iterator[StageChange]:
    """Yield the transforms that came or went, as often as they did."""
    ours, theirs = _transforms(before, lab), _transforms(after, lab)
    for child, words in (ours - theirs).elements():
        yield StageChange("frame", "removed", child, was=words)
    for child, words in (theirs - ours).elements():
        yield StageChange("frame", "added", child, now=words)


def _transforms(stage: StageModel, lab: Lab) -> Counter[tuple[str, str]]:
    edges = published_edges(stage, lab)
    return Counter((each.child, f"{each.parent} -> {each.child} on {each.topic}") for each in edges)
