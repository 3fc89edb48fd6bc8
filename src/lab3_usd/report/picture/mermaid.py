"""Pictures as Mermaid flowcharts, which code forges and notebooks draw from text."""

from __future__ import annotations

from collections.abc import Iterator

from lab3_usd.report.picture.model import Box, Curve, Picture, Row
from lab3_usd.report.safe_text import visible

# Named once, given to nodes by `class` and to wires by `linkStyle`.
STYLES = {
    "wrong": "stroke:#b3101d,stroke-width:3px",
    "missing": "stroke:#b3101d,stroke-width:2px,stroke-dasharray:6 4",
    "extra": "stroke:#7d5200,stroke-width:3px",
}
PLAIN = frozenset(" _-./,()=+*")


def mermaid(picture: Picture) -> str:
    """Return the picture as a flowchart: nodes with their values, wires with their ports.

    Dotted arrows carry execution. Every string from a stage is written with entity codes where
    it holds anything but letters, digits and harmless signs.
    """
    names = {box.key: f"n{place}" for place, box in enumerate(picture.boxes)}
    lines = [
        f"%% {_comment(picture.title)}: {_comment(picture.subtitle)}",
        "flowchart LR",
        *(f'  {names[box.key]}["{_label(box)}"]' for box in picture.boxes),
        *(_arrow(curve, names) for curve in picture.curves),
        *_styles(picture, names),
    ]
    return "\n".join(lines) + "\n"


def _label(box: Box) -> str:
    parts = [f"<b>{coded(box.title)}</b>", coded(box.subtitle)]
    parts += [_setting(row) for row in box.settings if row.value or row.expected]
    return "<br/>".join(part for part in parts if part)


def _setting(row: Row) -> str:
    should = f", should be {coded(', '.join(row.expected))}" if row.expected else ""
    return f"{coded(row.label)} = {coded(', '.join(row.value))}{should}"


def _arrow(curve: Curve, names: dict[str, str]) -> str:
    arrow = "-.->" if curve.dashed else "-->"
    ports = [_short(curve.source.port), _short(curve.target.port)]
    label = " → ".join(coded(port) for port in ports if port)
    text = f'|"{label}"|' if label else ""
    return f"  {names[curve.source.key]} {arrow}{text} {names[curve.target.key]}"


def _styles(picture: Picture, names: dict[str, str]) -> Iterator[str]:
    for state, style in STYLES.items():
        boxes = [names[box.key] for box in picture.boxes if box.state == state]
        curves = [str(place) for place, curve in enumerate(picture.curves) if curve.state == state]
        if boxes:
            yield f"  classDef {state} {style}"
            yield f"  class {','.join(boxes)} {state}"
        if curves:
            yield f"  linkStyle {','.join(curves)} {style}"


def coded(text: str) -> str:
    """Return a text for a label: entity codes for every sign that could end it or be markup."""
    return "".join(
        sign if sign.isalnum() or sign in PLAIN else f"#{ord(sign)};" for sign in visible(text)
    )


def _comment(text: str) -> str:
    return visible(text)


def _short(port: str) -> str:
    return port.partition(":")[2] or port
