"""What nodes send and receive in a play of any stage: who does, on which topics, and when."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from itertools import pairwise

from lab3_usd.isaac.topics import CLOCK, TRANSFORMS
from lab3_usd.model.qos import unmatched
from lab3_usd.sim.commands import domain_of
from lab3_usd.sim.execution.recording import Message
from lab3_usd.sim.execution.world import NOT_OPENED, SUBSCRIBER
from lab3_usd.sim.judge.expectations import Cause, RunFault, Trial, caused

STUCK = 0.1  # part of the stamps of a node that may be no later than the ones before
PUBLISHING = ("publisher", "helper")


def unheard_clock(seen: Trial, topics: Collection[tuple[str, int, str]]) -> Iterator[RunFault]:
    """Yield the clock of a domain that is not where programs listen: where its node has it.

    rclcpp subscribes to /clock in no namespace (rclcpp/src/rclcpp/time_source.cpp, humble).
    """
    message = seen.recording.messages[0]
    node = seen.nodes.get(message.node)
    usual = node.type.port(node.type.topics[0]) if node is not None else None
    heard = f"/{usual.default}" if usual is not None else message.topic
    if message.topic != heard and (CLOCK, seen.wanted.domain, heard) not in topics:
        text = f"the clock is on {message.topic}, and programs with use_sim_time listen to {heard}"
        yield RunFault(text, "wrong-topic", message.node)


def untold(trial: Trial) -> Iterator[RunFault]:
    """Yield the nodes whose transforms tf2 does not hear as they are offered."""
    told: dict[tuple[str, str], str] = {}
    for message in trial.recording.messages:
        if message.type == TRANSFORMS and (message.node, message.topic) not in told:
            why = unmatched("publishes", message.type, message.profile)
            told[message.node, message.topic] = why
    for (node, topic), why in told.items():
        if why:
            yield RunFault(f"nobody receives {topic}: {why}", "unmatched-peer", node)


def publishers(trial: Trial) -> Iterator[tuple[str, Cause | None]]:
    """Yield the nodes that are to publish, each with what keeps it from doing so."""
    causes = trial.causes
    if causes is None:
        return
    for node in causes.program.nodes.values():
        cause = causes.broken(node) if node.type.role in PUBLISHING else None
        if cause is None and 0 < node.count <= len(trial.drive):
            reason = "its only signal opened its topic"
            cause = Cause(node.path, reason, "not-executed")
        if node.type.role in PUBLISHING and (cause is None or cause.kind != "switched-off"):
            yield node.path, cause


def spoken_of(trial: Trial) -> bool:
    """Whether nodes are to publish or to listen, played or not."""
    return any(publishers(trial)) or any(closed(trial)) or any(unplayed(trial))


def unheard(trial: Trial) -> Iterator[RunFault]:
    """Yield what keeps messages of publishers and subscribers from coming."""
    for faults in (published, repeated, closed, untold):
        yield from faults(trial)


def published(trial: Trial) -> Iterator[RunFault]:
    """Every publisher that is not switched off sends."""
    sent = {message.node for message in trial.recording.messages}
    for path, cause in publishers(trial):
        if path in sent:
            continue
        if cause is None:
            yield RunFault(f"{path} sends nothing", "silent-topic", path, sure=False)
        else:
            yield caused(f"{path} sends nothing", "silent-topic", cause)
    for path, reason in unplayed(trial):
        yield RunFault(f"{path}: not simulated is {reason}", "silent-topic", path, sure=False)


def unplayed(trial: Trial) -> Iterator[tuple[str, str]]:
    """Yield the publishers of graphs that are not simulated, each with what is not."""
    if trial.causes is None:
        return
    program = trial.causes.program
    for path, kind in program.unwritten.items():
        reason = program.not_simulated.get(path.rpartition("/")[0])
        if reason and kind is not None and kind.role in PUBLISHING:
            yield path, reason


def repeated(trial: Trial) -> Iterator[RunFault]:
    """One node sends the messages of a type that come on a topic, but transforms."""
    senders: dict[tuple[str, str, int], dict[str, None]] = {}
    for message in trial.recording.messages:
        if message.type != TRANSFORMS:
            key = (message.topic, message.type, domain_of(message, trial))
            senders.setdefault(key, {})[message.node] = None
    for (topic, _, _), nodes in senders.items():
        if len(nodes) > 1:
            text = f"{len(nodes)} nodes publish {topic}"
            yield RunFault(text, "duplicate-publisher", [*nodes][1])


def closed(trial: Trial) -> Iterator[RunFault]:
    """Yield the subscribers that are never opened, or never run."""
    causes = trial.causes
    if causes is None:
        return
    for node in causes.program.nodes.values():
        if SUBSCRIBER not in node.type.role:
            continue
        text, cause = f"{node.path} receives nothing", causes.broken(node)
        if node.failure is not None and node.failure.kind in NOT_OPENED:
            yield RunFault(text, node.failure.kind, node.path, node.failure.reason)
        elif cause is not None and cause.kind == "not-executed":
            yield RunFault(text, cause.kind, cause.prim, cause.reason)


def stamped(trial: Trial) -> Iterator[tuple[str, list[Message]]]:
    """Yield the nodes whose messages have stamps, with those of a topic of the first session."""
    sent: dict[tuple[str, str], list[Message]] = {}
    for message in trial.recording.messages:
        if not (message.session or message.static or message.type == CLOCK):
            sent.setdefault((message.node, message.topic), []).append(message)
    yield from ((node, messages) for (node, _), messages in sent.items() if len(messages) > 1)


def advancing(trial: Trial) -> Iterator[RunFault]:
    """Later messages of a node have later stamps; from when these count, is up to the stage."""
    for node, messages in stamped(trial):
        # Transforms that come again are dropped by whoever hears them.
        pairs = [
            (one, two)
            for one, two in pairwise(messages)
            if two.at > one.at or two.type != TRANSFORMS
        ]
        stuck = [two for one, two in pairs if two.stamp <= one.stamp]
        if len(stuck) > STUCK * len(pairs):
            text = f"{len(stuck)} of {len(pairs)} stamps of {stuck[0].topic} do not advance"
            text += f": {stuck[0].stamp:.2f} s"
            yield RunFault(text, "stamp-not-advancing", node)
