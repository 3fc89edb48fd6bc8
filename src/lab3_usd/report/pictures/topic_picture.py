"""The picture of nodes and topics, as rqt_graph draws them."""

from __future__ import annotations

from collections.abc import Sequence

from lab3_usd.facts.endpoints import Endpoint
from lab3_usd.model.stage import Node
from lab3_usd.report.picture.canvas import on_canvas
from lab3_usd.report.picture.layered import layered
from lab3_usd.report.picture.model import (
    Box,
    Curve,
    End,
    Family,
    Picture,
    clip_end,
    clip_path,
    sized,
)

MOST_TITLE = 40
_TOPIC = "topic "  # before a name: no prim has such a path


def topics_picture(
    title: str, endpoints: Sequence[Endpoint], unknown: Sequence[Node], not_judged: str = ""
) -> Picture:
    """Return the nodes of a stage with their topics between them.

    What is sent perhaps, or never, is dashed. `unknown` are nodes with unknown topics,
    `not_judged` says in words what else is not known.
    """
    ends = [end for end in endpoints if end.topic is not None]
    refused = len(endpoints) - len(ends)
    boxes = []
    for path, end in {end.node.path: end for end in ends}.items():
        above = clip_path(path.rpartition("/")[0], MOST_TITLE)
        boxes.append(_box(path, end.node.name, above, "ros", f"{path}\n{_rate(end)}"))
    types: dict[str | None, dict[str, None]] = {}
    for end in ends:
        types.setdefault(end.topic, {})[end.type or "?"] = None
    for name, names in types.items():
        subtitle = clip_end(" and ".join(names), MOST_TITLE)
        boxes.append(_box(f"{_TOPIC}{name}", str(name), subtitle, "data", "\n".join(names)))
    for absent in unknown:
        subtitle = clip_end(f"not judged: {absent.type_name}", MOST_TITLE)
        note = f"{absent.path}\n{absent.type_name}"
        boxes.append(_box(absent.path, absent.name, subtitle, "absent", note))
    curves = []
    for end in ends:
        node, topic = End(end.node.path, ""), End(f"{_TOPIC}{end.topic}", "")
        source, target = (node, topic) if end.direction == "publishes" else (topic, node)
        surely = "" if end.sure else "perhaps " if end.runs else "never: "
        note = f"{end.node.path} {surely}{end.direction} {end.topic}, {_rate(end)}"
        curves.append(Curve(source, target, dashed=not end.sure, note=note))
    topics = len({end.topic for end in ends})
    parts = [f"{topics} topic{'s' * (topics != 1)}"]
    parts += [f"{refused} without a valid name"] if refused else []
    parts += [not_judged] if not_judged else []
    placed = layered(tuple(boxes), tuple(dict.fromkeys(curves)))
    return on_canvas(Picture(title, "  ·  ".join(parts), *placed, kind="topics"))


def _rate(end: Endpoint) -> str:
    return end.rate if end.runs else "never"


def _box(key: str, title: str, subtitle: str, family: Family, note: str) -> Box:
    return sized(Box(key, clip_end(title, MOST_TITLE), subtitle, family, note=note))
