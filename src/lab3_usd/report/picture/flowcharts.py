"""Pictures as text that other programs lay out: Graphviz, and Mermaid in forges and notebooks."""

from __future__ import annotations

from lab3_usd.report.picture.model import Box, Picture, Row, State, state_word
from lab3_usd.report.safe_text import dot_string, printable, visible

COLOURS: dict[State, str] = {
    "ok": "#4a5663",
    "wrong": "#b3101d",
    "missing": "#b3101d",
    "extra": "#7d5200",
    "warned": "#7d5200",
}
# Named once, given to nodes by `class` and to wires by `linkStyle`.
STYLES = {
    "wrong": "stroke:#b3101d,stroke-width:3px",
    "missing": "stroke:#b3101d,stroke-width:2px,stroke-dasharray:6 4",
    "extra": "stroke:#7d5200,stroke-width:3px",
    "warned": "stroke:#7d5200,stroke-width:3px",
}
PLAIN = frozenset(" _-./,()=+*")


def graphviz(picture: Picture) -> str:
    """Return the picture as a directed graph: nodes as records, a cell per port.

    Dashed edges carry execution; missing parts are dotted and red.
    """
    names = {box.key: f"n{place}" for place, box in enumerate(picture.boxes)}
    cells: dict[tuple[str, str], str] = {}
    for box in picture.boxes:
        for place, row in enumerate(box.rows):
            cells.setdefault((box.key, row.port), f":p{place}")
    lines = [
        f"digraph {dot_string(picture.title)} {{",
        f"  graph [rankdir=LR, label={dot_string(f'{picture.title}: {picture.subtitle}')}];",
        '  node [shape=record, fontname="sans-serif", fontsize=11];',
        '  edge [fontname="sans-serif", fontsize=10];',
    ]
    for box in picture.boxes:
        style = ', style="dashed"' if box.state == "missing" else ""
        colour = COLOURS[box.frame]
        lines.append(
            f'  {names[box.key]} [label="{_record(box)}",'
            f' color="{colour}", fontcolor="{colour}"{style}];'
        )
    for curve in picture.curves:
        source, target = (
            names[end.key] + cells.get((end.key, end.port), "")
            for end in (curve.source, curve.target)
        )
        style = f'color="{COLOURS[curve.state]}"'
        if curve.state == "missing":
            style += ", style=dotted"
        elif curve.dashed:
            style += ", style=dashed"
        if curve.state != "ok":
            style += f', penwidth=2, label="{state_word(curve.state, picture.kind)}"'
        lines.append(f"  {source} -> {target} [{style}];")
    return "\n".join([*lines, "}"]) + "\n"


def _record(box: Box) -> str:
    """Return the cells of a record: the title above, inputs left, outputs right, settings below.

    From left to right, a record stacks its cells, and braces turn that by a quarter.
    """
    places = {row.port: place for place, row in enumerate(box.rows)}
    title = "\\n".join(celled(part) for part in (box.title, box.subtitle) if part)
    columns = ["|".join(_cell(row, places) for row in rows) for rows in (box.inputs, box.outputs)]
    sides = "|".join(f"{{{column}}}" for column in columns if column)
    settings = [_cell(row, places) for row in box.settings]
    return "|".join([title, *([f"{{{sides}}}"] if sides else []), *settings])


def _cell(row: Row, places: dict[str, int]) -> str:
    value = f" = {', '.join(row.value)}" if row.value else ""
    expected = f" (should be {', '.join(row.expected)})" if row.expected else ""
    return f"<p{places[row.port]}> {celled(row.label + value + expected)}"


def celled(text: str) -> str:
    """Return a text for the cell of a record, in which the signs of records are escaped."""
    flat = printable(text).replace("\\", "\\\\")
    for sign in '"{}|<>':
        flat = flat.replace(sign, f"\\{sign}")
    return flat


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
