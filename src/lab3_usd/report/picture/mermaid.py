"""Pictures as Mermaid flowcharts, which code forges and notebooks draw from text."""

from __future__ import annotations

from lab3_usd.report.picture.model import Box, Picture
from lab3_usd.report.safe_text import visible

# Named once, given to nodes by `class` and to wires by `linkStyle`.
STYLES = {
    "wrong": "stroke:#b3101d,stroke-width:3px",
    "missing": "stroke:#b3101d,stroke-width:2px,stroke-dasharray:6 4",
    "extra": "stroke:#7d5200,stroke-width:3px",
    "warned": "stroke:#7d5200,stroke-width:3px",
}
PLAIN = frozenset(" _-./,()=+*")


def mermaid(picture: Picture) -> str:
    """Return the picture as a flowchart: nodes with their values, wires with their ports.

    Dotted arrows carry execution. Every string from a stage is written with entity codes where
    it holds anything but letters, digits and harmless signs.
    """
    names = {box.key: f"n{place}" for place, box in enumerate(picture.boxes)}
    lines = [f"%% {visible(picture.title)}: {visible(picture.subtitle)}", "flowchart LR"]
    lines += [f'  {names[box.key]}["{_label(box)}"]' for box in picture.boxes]
    for curve in picture.curves:
        arrow = "-.->" if curve.dashed else "-->"
        ports = (end.port.partition(":")[2] or end.port for end in (curve.source, curve.target))
        label = " → ".join(coded(port) for port in ports if port)
        text = f'|"{label}"|' if label else ""
        lines.append(f"  {names[curve.source.key]} {arrow}{text} {names[curve.target.key]}")
    for state, style in STYLES.items():
        boxes = [names[box.key] for box in picture.boxes if box.frame == state]
        wires = [str(place) for place, curve in enumerate(picture.curves) if curve.state == state]
        if boxes:
            lines += [f"  classDef {state} {style}", f"  class {','.join(boxes)} {state}"]
        if wires:
            lines.append(f"  linkStyle {','.join(wires)} {style}")
    return "\n".join(lines) + "\n"


def _label(box: Box) -> str:
    parts = [f"<b>{coded(box.title)}</b>", coded(box.subtitle)]
    for row in box.settings:
        if row.value or row.expected:
            expected = f", should be {coded(', '.join(row.expected))}" if row.expected else ""
            parts.append(f"{coded(row.label)} = {coded(', '.join(row.value))}{expected}")
    return "<br/>".join(part for part in parts if part)


def coded(text: str) -> str:
    """Return a text for a label: entity codes for every sign that could end it or be markup."""
    return "".join(
        sign if sign.isalnum() or sign in PLAIN else f"#{ord(sign)};" for sign in visible(text)
    )
