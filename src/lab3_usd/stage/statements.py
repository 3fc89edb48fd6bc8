"""The grammar of text layers: where the statement of each prim and property begins."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Iterator

STRING = (
    r'"""[^"\\]*(?:(?:\\.|"(?!""))[^"\\]*)*"""'
    r"|'''[^'\\]*(?:(?:\\.|'(?!''))[^'\\]*)*'''"
    r'|"[^"\\\r\n]*(?:\\.[^"\\\r\n]*)*"'
    r"|'[^'\\\r\n]*(?:\\.[^'\\\r\n]*)*'"
)
# Three to five @ close an asset path that three opened; all but the last three belong to the path.
ASSET = r"@@@(?:\\@@@|[^\r\n])*?@@@@{0,2}|@[^@\r\n]*@"
BLOCK_COMMENT = r"/\*[^*]*\*+(?:[^/*][^*]*\*+)*/"
LINE_COMMENT = r"(?:\#|//)[^\r\n]*"
# Strings and paths of assets come first: what looks like a comment inside of them is none.
TOKEN = rf"{STRING}|{ASSET}|{BLOCK_COMMENT}|(?P<comment>{LINE_COMMENT})"
_PAD = rf"(?:[ \t]|{BLOCK_COMMENT})*"
_WORD = r"""[^\s"'@<>=()\[\]{};,.\#/]+"""

BLANK = re.compile(rf"(?:[\s;]+|{LINE_COMMENT}|{BLOCK_COMMENT})*")
OPENING = re.compile(
    rf"""(?:def|over|class)(?=[ \t/])(?:[^"'/\r\n]|{BLOCK_COMMENT})*(?P<prim>{STRING})"""
    rf"|variantSet(?=[ \t/]){_PAD}(?P<set>{STRING}){_PAD}=",
    re.DOTALL,
)
VARIANT = re.compile(rf"(?P<variant>{STRING})", re.DOTALL)
ORDER = re.compile(rf"reorder(?=[ \t/]){_PAD}(?:nameChildren|properties|rootPrims){_PAD}=")
# Qualifiers, type and name are words; the group `name` keeps the last, `first` a lone one.
HEAD = re.compile(
    rf"(?P<first>{_WORD})(?:(?:[ \t]|{BLOCK_COMMENT}|\[{_PAD}\])*(?P<name>{_WORD}))*{_PAD}"
)
LIST_EDITS = frozenset({"add", "append", "delete", "prepend", "reorder"})

# A run of plain text and what ends it. A bracket with only plain text in it goes in one step.
PIECE = re.compile(
    rf"""[^()\[\]{{}}"'@\#/;\r\n]*
    (?:[(\[{{][^()\[\]{{}}"'@\#/]*[)\]}}]
    |(?P<open>[(\[{{])|(?P<close>[)\]}}])|(?P<end>[;\r\n])
    |{STRING}|{ASSET}|{LINE_COMMENT}|{BLOCK_COMMENT}|.)""",
    re.DOTALL | re.VERBOSE,
)
_BODY = re.compile(r"[/{=}.]")  # around what can stand in the path of something that has a body


def scan_text(text: str, paths: Iterable[str] | None = None) -> dict[str, int]:
    """Return the offset of the statement that opens each spec, by the spec's path in the layer.

    Where paths are asked for, bodies that hold none of them are passed over, and what is in them
    is left out. The paths are Sdf's: `/A/B.size`, `/A{shape=box}B`. A property's declaration
    counts before statements that wire it, sample it or edit its list. The fields of the layer's
    metadata stand as properties of the root (`/.upAxis`).

    The text is one that OpenUSD accepts. Of any other the result is what could be made out.
    """
    around = None
    if paths is not None:
        cuts = ((path, match.span()) for path in paths for match in _BODY.finditer(path))
        around = {path[:end] for path, span in cuts for end in span}
    declared: dict[str, int] = {}
    edited: dict[str, int] = {}
    for path, offset, is_edit in _statements(text, around):
        (edited if is_edit else declared).setdefault(path, offset)
    return edited | declared


def _statements(text: str, around: Collection[str] | None) -> Iterator[tuple[str, int, bool]]:
    """Yield path and offset of each statement, and whether it only edits what stands elsewhere.

    Of the bodies only those `around` what is asked for are looked into, else all.
    `bodies` holds the paths of the bodies that are open; that of a variant set ends in `=`.
    """
    bodies = [""]
    pos = after_blank(text, 0)
    while bodies and pos < len(text):
        body = bodies[-1]
        if text[pos] in ")]}":
            bodies.pop()
            pos += 1
        elif text[pos] == "(":
            bodies.append("/")
            pos += 1
        elif opening := (VARIANT if body.endswith("=") else OPENING).match(text, pos):
            path = opened_path(body, opening)
            yield (f"{path}}}" if path.endswith("=") else path), pos, False
            pos = after_blank(text, opening.end())
            if text.startswith("(", pos):  # the metadata before the body
                pos = after_blank(text, group_end(text, pos))
            if around is None or path in around:
                bodies.append(path)
                pos += 1
            else:
                pos = group_end(text, pos)
        else:
            head = HEAD.match(text, pos)
            if head and not (head["first"] == "reorder" and ORDER.match(text, pos)):
                is_edit = head["first"] in LIST_EDITS or text.startswith(".", head.end())
                yield f"{body}.{head['name'] or head['first']}", pos, is_edit
            pos = statement_end(text, pos)
        pos = after_blank(text, pos)


def opened_path(body: str, opening: re.Match[str]) -> str:
    """Return the path of what opens in a body; that of a variant set ends in `=`."""
    kind = str(opening.lastgroup)
    quoted = opening[kind]
    width = 3 if quoted[:3] in ('"""', "'''") else 1
    name = quoted[width:-width]
    if kind == "set":
        return f"{body}{{{name}="
    if kind == "variant":
        return f"{body}{name}}}"
    return f"{body}{name}" if body.endswith("}") else f"{body}/{name}"


def after_blank(text: str, pos: int) -> int:
    """Return the position after white space and comments."""
    blank = BLANK.match(text, pos)
    return blank.end() if blank else pos


def group_end(text: str, pos: int) -> int:
    """Return the position after the bracket that closes the one at `pos`."""
    depth = 0
    for piece in PIECE.finditer(text, pos):
        depth += (piece.lastgroup == "open") - (piece.lastgroup == "close")
        if depth <= 0:
            return piece.end()
    return len(text)


def statement_end(text: str, pos: int) -> int:
    """Return the position after the statement at `pos`: past its `;` or line end, if it has one."""
    depth = 0
    for piece in PIECE.finditer(text, pos):
        if piece.lastgroup == "end" and not depth:
            return piece.end()
        if piece.lastgroup == "close" and not depth:
            return piece.end() - 1
        depth += (piece.lastgroup == "open") - (piece.lastgroup == "close")
    return len(text)
