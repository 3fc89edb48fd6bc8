"""The small parts of an SVG picture: numbers, texts, ports, marks."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape

from msgspec import Struct

from lab3_usd.report.picture import State, port_id
from lab3_usd.report.safe_text import visible

# From the middle of a mark to where its stroke starts, and the stroke.
STROKES: Mapping[State, tuple[float, float, str]] = {
    "wrong": (-3, -3, "l6 6m0-6-6 6"),
    "missing": (-4, 0, "h8"),
    "extra": (-4, 0, "h8m-4-4v8"),
}
MARK = 8


class ElementIds(Struct, frozen=True):
    """The ids of elements: the prefix of all, and where each one links to.

    With `links` only the ids it names are written; without, every port and node has its id.
    """

    prefix: str = ""
    links: Mapping[str, str] | None = None

    def id(self, prim: str, prop: str | None = None) -> str:
        """Return the id attribute of a node or port, with the space before it; '' without one."""
        name = port_id(prim, prop)
        if self.links is not None and name not in self.links:
            return ""
        return f' id="{markup(self.prefix + name)}"'

    def linked(self, content: str, prim: str, prop: str | None = None) -> str:
        """Return the part as a link where there is one for its id."""
        target = None if self.links is None else self.links.get(port_id(prim, prop))
        return content if target is None else f'<a href="{markup(target)}">{content}</a>'


def markup(text: str) -> str:
    """Return any string as text or attribute value: what does not print, and markup, is escaped."""
    return escape(visible(text))


def note(text: str) -> str:
    """Return the tooltip of a part; it may have several lines."""
    return f"<title>{chr(10).join(map(markup, text.splitlines()))}</title>" if text else ""


def number(value: float) -> str:
    """Write a coordinate with at most one decimal."""
    return f"{value:.1f}".removesuffix(".0")


def text(content: str, x: float, y: float, kind: str = "") -> str:
    """Return one line of text, its baseline at `y`."""
    look = f' class="{kind}"' if kind else ""
    return f'<text x="{number(x)}" y="{number(y)}"{look}>{markup(content)}</text>'


def rect(x: float, y: float, size: tuple[float, float], kind: str, corner: float = 0) -> str:
    """Return a rectangle, `size` being width and height."""
    round_off = f' rx="{number(corner)}"' if corner else ""
    return (
        f'<rect class="{kind}" x="{number(x)}" y="{number(y)}"'
        f' width="{number(size[0])}" height="{number(size[1])}"{round_off}/>'
    )


def port(x: float, y: float, *, execution: bool, wired: bool) -> str:
    """Return a port: a disc for data, an arrowhead for execution, hollow without a wire."""
    full = " f" if wired else ""
    if execution:
        return f'<path class="p px{full}" d="M{number(x - 4)} {number(y - 5)}l9 5-9 5z"/>'
    return f'<circle class="p{full}" cx="{number(x)}" cy="{number(y)}" r="4.5"/>'


def mark(x: float, y: float, state: State) -> str:
    """Return the round mark of a fault: a cross, a minus or a plus."""
    kind = " extra" if state == "extra" else ""
    left, top, stroke = STROKES[state]
    return (
        f'<circle class="k{kind}" cx="{number(x)}" cy="{number(y)}" r="{MARK}"/>'
        f'<path class="g{kind}" d="M{number(x + left)} {number(y + top)}{stroke}"/>'
    )
