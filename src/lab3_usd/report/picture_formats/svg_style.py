"""The style of a picture as CSS: a light and a dark palette with a text contrast of 4.5."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Literal

Theme = Literal["auto", "light", "dark"]
THEMES: tuple[Theme, ...] = ("auto", "light", "dark")
FONT = "Inter,'Segoe UI',Roboto,'Helvetica Neue',Arial,'DejaVu Sans',sans-serif"
HEADERS = {
    "event": "#2b6b4b",
    "ros": "#27598f",
    "action": "#5a4894",
    "data": "#4a5663",
    "frame": "#27598f",
    "absent": "#55595f",
}
ON_HEADER = "#ffffff"
BELOW_TITLE = "#dfe5ec"
PALETTES: Mapping[str, Mapping[str, str]] = {
    "light": {
        "canvas": "#f3f5f8",
        "body": "#ffffff",
        "border": "#aab4c0",
        "line": "#d5dbe3",
        "text": "#1c2128",
        "muted": "#555f6b",
        "value": "#0a4f9e",
        "data": "#3b78b8",
        "execution": "#5b6570",
        "fault": "#b3101d",
        "fault_tint": "#fbe3e4",
        "extra": "#7d5200",
        "extra_tint": "#fbefd5",
        "lit": "#ffe27a",
    },
    "dark": {
        "canvas": "#1b1e23",
        "body": "#2b2f36",
        "border": "#565e6a",
        "line": "#414852",
        "text": "#e9edf2",
        "muted": "#aeb7c2",
        "value": "#8ec9ff",
        "data": "#6fa8dc",
        "execution": "#c3cad3",
        "fault": "#ff8a84",
        "fault_tint": "#452a2d",
        "extra": "#e8b64a",
        "extra_tint": "#40361f",
        "lit": "#6b5a12",
    },
}
SCOPE = ".lab3"  # the class of the element of a picture
RULES = """\
{s} text{{font-family:{font};font-size:12px;fill:{text}}}
{s} .canvas{{fill:{canvas}}}
{s} .h1{{font-size:18px;font-weight:700}}
{s} .h2{{fill:{muted}}}
{s} .rule{{stroke:{line};stroke-width:1;fill:none}}
{s} .b{{fill:{body};stroke:{border};stroke-width:1}}
{s} .t{{font-size:13px;font-weight:700;fill:{on_header}}}
{s} .u{{font-size:11px;fill:{below_title}}}
{s} .v{{font-size:11px;fill:{value};text-anchor:end}}
{s} .e{{text-anchor:end}}
{s} .m{{font-size:11px;fill:{muted}}}
{s} .p{{fill:{body};stroke:{data};stroke-width:1.5}}
{s} .p.f{{fill:{data}}}
{s} .px{{stroke:{execution};stroke-linejoin:round}}
{s} .px.f{{fill:{execution}}}
{s} .w{{fill:none;stroke:{data};stroke-width:2}}
{s} .x{{stroke:{execution};stroke-dasharray:7 4}}
{s} .hit{{fill:none}}
{s} .wrong .hit,{s} .missing .hit{{fill:{fault_tint}}}
{s} .extra .hit{{fill:{extra_tint}}}
{s} .r:target .hit,{s} .lit .hit{{fill:{lit}}}
{s} .wrong .p,{s} .missing .p,{s} .ghost .p{{stroke:{fault}}}
{s} .wrong .p.f,{s} .missing .p.f,{s} .ghost .p.f{{fill:{fault}}}
{s} .extra .p{{stroke:{extra}}}
{s} .extra .p.f{{fill:{extra}}}
{s} .r.wrong text,{s} .r.missing text{{fill:{fault};font-weight:700}}
{s} .r.extra text{{fill:{extra};font-weight:700}}
{s} .r text.s{{font-weight:400;fill:{text}}}
{s} .b.wrong{{stroke:{fault};stroke-width:2.5}}
{s} .b.extra{{stroke:{extra};stroke-width:2.5}}
{s} .b.missing{{fill:none;stroke:{fault};stroke-width:2;stroke-dasharray:6 4}}
{s} .n.ghost text,{s} .h3{{fill:{fault}}}
{s} .h3.extra{{fill:{extra}}}
{s} .w.wrong{{stroke:{fault};stroke-width:3}}
{s} .w.missing{{stroke:{fault};stroke-dasharray:1 6;stroke-linecap:round;stroke-width:2.5}}
{s} .w.x.missing{{stroke-dasharray:7 8;stroke-linecap:butt}}
{s} .w.extra{{stroke:{extra};stroke-width:3}}
{s} .k{{fill:{canvas};stroke:{fault};stroke-width:1.5}}
{s} .k.extra{{stroke:{extra}}}
{s} .g{{fill:none;stroke:{fault};stroke-width:2;stroke-linecap:round}}
{s} .g.extra{{stroke:{extra}}}
"""


def stylesheet(theme: Theme = "auto") -> str:
    """Return the rules for pictures; `auto` follows the reader's system, the others do not."""
    if theme != "auto":
        return _rules(theme)
    dark = _rules("dark")
    return f"{_rules('light')}@media (prefers-color-scheme:dark){{\n{dark}}}\n"


def _rules(theme: str) -> str:
    rules = RULES.format(
        s=SCOPE, font=FONT, on_header=ON_HEADER, below_title=BELOW_TITLE, **PALETTES[theme]
    )
    return rules + "".join(_headers())


def _headers() -> Iterator[str]:
    for family, colour in HEADERS.items():
        yield f"{SCOPE} .f-{family}{{fill:{colour}}}\n"
