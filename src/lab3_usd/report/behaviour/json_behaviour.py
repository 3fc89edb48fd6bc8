"""The behaviour of a stage as JSON in the form of `schema/sim-1.json`."""

from __future__ import annotations

import json
from typing import Any

from msgspec.structs import asdict

from lab3_usd.model.dry_run.behaviour import Behaviour, Check, Topic
from lab3_usd.report.safe_text import truncated_values
from lab3_usd.report.tool import NAME, tool_version

VERSION = 1


def render(found: Behaviour) -> str:
    """Return the behaviour as JSON text in ASCII."""
    return json.dumps(truncated_values(behaviour_json(found)), indent=1) + "\n"


def behaviour_json(found: Behaviour) -> dict[str, Any]:
    """Return the behaviour as plain data, keys in the order of the schema."""
    more = [] if found.differences is None else [asdict(each) for each in found.differences]
    return {
        "version": VERSION,
        "tool": {"name": NAME, "version": tool_version()},
        **({"recording": found.recording} if found.recording else {"stage": found.stage}),
        "seconds": round(found.seconds, 3),
        "verdict": found.verdict,
        "topics": [_topic(each) for each in found.topics],
        "frames": [asdict(each) for each in found.frames],
        "checks": [_check(each) for each in found.checks],
        "path": [list(each) for each in found.path],
        "not_simulated": [asdict(each) for each in found.not_simulated],
        **({} if found.differences is None else {"differences": more}),
    }


def _topic(topic: Topic) -> dict[str, Any]:
    """Return a topic; only a recording has a rate of arrival and QoS."""
    said = asdict(topic)
    arrival, qos = said.pop("arrival_hz"), said.pop("qos")
    return said if arrival is None else {**said, "arrival_hz": arrival, "qos": list(qos)}


def _check(check: Check) -> dict[str, str]:
    return {
        "name": check.name,
        "verdict": check.verdict,
        "prim": check.prim,
        "message": check.text,
        "rule": check.rule,
    }
