"""Pictures as SVG: a file of its own, or a piece of an HTML page."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from lab3_usd.report.layout.canvas import (
    ENTRY_TEXT,
    LEGEND_LINE,
    MARGIN,
    REMARK_LINE,
    SUBTITLE_LINE,
    TITLE_LINE,
)
from lab3_usd.report.layout.curves import on_longest
from lab3_usd.report.picture import STATES, Bezier, Curve, LegendEntry, Picture
from lab3_usd.report.picture_formats.svg_box import box_svg
from lab3_usd.report.picture_formats.svg_elements import (
    ElementIds,
    mark,
    markup,
    note,
    number,
    rect,
    text,
)
from lab3_usd.report.picture_formats.svg_style import Theme, stylesheet

FAMILIES = {
    "event": "event",
    "ros": "ros",
    "action": "action",
    "family-data": "data",
    "absent": "absent",
}


def svg(picture: Picture, ids_prefix: str = "", links: Mapping[str, str] | None = None) -> str:
    """Return the picture as an element for an HTML page, which has to hold `stylesheet()` once.

    Every node and port is a group with the id `ids_prefix` + `port_id(prim, property)`; the
    prefix keeps several pictures of one page apart. With `links`, from `port_id` to an address,
    only those have ids, and each is a link. The row that the page's address names is lit, and so
    is one that a script gives the class `lit`.
    """
    return _element(picture, ElementIds(ids_prefix, links), style="")


def svg_file(picture: Picture, theme: Theme = "auto") -> str:
    """Return the picture as a whole SVG file; the theme `auto` follows the reader's system."""
    style = f"<style>\n{stylesheet(theme)}</style>"
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{_element(picture, ElementIds(), style)}\n'


def _element(picture: Picture, ids: ElementIds, style: str) -> str:
    # Faulty wires lie on top, boxes above all wires, marks of wires above everything.
    curves = sorted(picture.curves, key=lambda curve: curve.state != "ok")
    parts = [
        _opening(picture),
        style,
        rect(0, 0, (picture.width, picture.height), "canvas"),
        f"<g{ids.id(picture.path)}>{''.join(_head(picture))}</g>",
        *(_wire(curve) for curve in curves),
        *(box_svg(box, ids) for box in picture.boxes),
        *_marks(picture),
        *_legend(picture),
        "</svg>",
    ]
    return "\n".join(part for part in parts if part)


def _opening(picture: Picture) -> str:
    width, height = number(picture.width), number(picture.height)
    spoken = markup(f"{picture.title}: {picture.subtitle.replace('  ·  ', ', ')}")
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" class="lab3" role="img" aria-label="{spoken}"'
        f' width="{width}" height="{height}" viewBox="0 0 {width} {height}">'
    )


def _head(picture: Picture) -> Iterator[str]:
    yield text(picture.title, MARGIN, TITLE_LINE, "h1")
    yield text(picture.subtitle, MARGIN, SUBTITLE_LINE, "h2")
    for number_of_line, remark in enumerate(picture.remarks, start=1):
        y = SUBTITLE_LINE + 4 + REMARK_LINE * number_of_line
        if remark.state != "ok":
            yield mark(MARGIN + 8, y - 4, remark.state)
        kind = " extra" if remark.state == "extra" else ""
        yield text(
            remark.text, MARGIN + ENTRY_TEXT, y, "h2" if remark.state == "ok" else f"h3{kind}"
        )


def _marks(picture: Picture) -> Iterator[str]:
    """Yield a mark for each faulty wire, except those of nodes that are missing as a whole."""
    missing = {box.key for box in picture.boxes if box.state == "missing"}
    for curve in picture.curves:
        if curve.state != "ok" and not {curve.source.key, curve.target.key} & missing:
            # A missing wire often runs beside the wrong one: their marks stand apart.
            place = on_longest(curve.path, 0.35 if curve.state == "missing" else 0.6)
            yield mark(*place, curve.state)


def _wire(curve: Curve) -> str:
    state = "" if curve.state == "ok" else f" {curve.state}"
    dashes = " x" if curve.dashed else ""
    path = f'<path class="w{dashes}{state}" d="{path_data(curve.path)}"'
    return f"{path}>{note(curve.note)}</path>" if curve.note else f"{path}/>"


def path_data(path: tuple[Bezier, ...]) -> str:
    """Return the curves of a path, which follow each other, as SVG path data."""
    start = path[0][0]
    data = [f"M{number(start[0])} {number(start[1])}"]
    data += [_piece(curve) for curve in path]
    return "".join(data)


def _piece(curve: Bezier) -> str:
    if len({point[1] for point in curve}) == 1:
        return f"H{number(curve[3][0])}"
    return "C" + " ".join(f"{number(x)} {number(y)}" for x, y in curve[1:])


def _legend(picture: Picture) -> Iterator[str]:
    y = picture.legend[0].y - LEGEND_LINE
    yield f'<path class="rule" d="M{number(MARGIN)} {number(y)}H{number(picture.width - MARGIN)}"/>'
    for entry in picture.legend:
        yield _legend_symbol(entry)
        yield text(entry.text, entry.x + ENTRY_TEXT, entry.y + 4, "h2")


def _legend_symbol(entry: LegendEntry) -> str:
    if entry.kind in {"data", "execution"}:
        dashes = " x" if entry.kind == "execution" else ""
        return f'<path class="w{dashes}" d="M{number(entry.x)} {number(entry.y)}h22"/>'
    if entry.kind in FAMILIES:
        return rect(entry.x + 4, entry.y - 7, (14, 14), f"f-{FAMILIES[entry.kind]}", 3)
    return mark(entry.x + 11, entry.y, next(state for state in STATES if state == entry.kind))
