"""Tells which part of a saved text is the output of which diagnostic command."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence

from msgspec import Struct

from lab3_usd.spec.ros_spec import Command, EvidenceKind, RosSpec, file_word

_COLOUR = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]")
_CONTINUED = re.compile(r"\\\s*\n\s*>?\s*")
_TYPED = re.compile(r"^(?:.*[$#%>:`]\s*)?(?P<line>ros2\s+[a-z]\w*\b.*?)`?\s*$")
_PROMPT = re.compile(r"^\S+@\S+[:\s].*[$#](\s|$)")
_END_OF_COMMAND = re.compile(r"\s(?:\||>|2>|&&|;|&)")
# What an output looks like, where neither its name nor a command line above it tells.
_LOOKS = (
    ("topic_hz", re.compile(r"average rate:")),
    ("topic_info", re.compile(r"Publisher count:")),
    ("view_frames", re.compile(r"digraph |frame_yaml=|^[ \t]+parent: '", re.MULTILINE)),
    ("tf2_echo", re.compile(r"- Translation: \[|Waiting for transform ")),
    ("lifecycle", re.compile(r"^\w+ \[\d\]\s*$", re.MULTILINE)),
    ("topic_type", re.compile(r"\A\s*\w+/msg/\w+\s*\Z")),
    ("names", re.compile(r"\A(\s*/[\w/]+( \[.*\])?[ \t]*(\n|\Z))+\s*\Z")),
    ("topic_echo", re.compile(r"^[a-z]\w*:", re.MULTILINE)),
)
_NAMED = {
    "hz": "topic_hz",
    "type": "topic_type",
    "info": "topic_info",
    "lifecycle": "lifecycle",
    "echo": "topic_echo",
}


class Block(Struct, frozen=True):
    """The output of one command: its kind, what it was about, and whether it was not filtered."""

    kind: str
    target: str
    text: str
    whole: bool = True


def split_blocks(text: str, name: str, ros: RosSpec) -> list[Block]:
    """Split a saved text at the command lines it holds.

    A text without command lines is one block, told by the name of its file (`name`, without
    folder), and by what it looks like; an empty list when nothing tells.
    """
    plain = _COLOUR.sub("", text).replace("\r\n", "\n")
    typed = list(_typed_blocks(_CONTINUED.sub(" ", plain), ros.kinds))
    return typed or list(_named_block(plain, name, ros))


def _typed_blocks(text: str, kinds: Mapping[str, EvidenceKind]) -> Iterator[Block]:
    current: Block | None = None
    seen: list[str] = []
    for line in [*text.splitlines(), None]:
        typed = _TYPED.match(line) if line is not None else None
        if typed is None and line is not None and not _PROMPT.match(line):
            seen.append(line)
            continue
        if current is not None:
            yield Block(current.kind, current.target, "\n".join(seen), current.whole)
        current, seen = (recognise(typed["line"], kinds) if typed else None), []


def recognise(line: str, kinds: Mapping[str, EvidenceKind]) -> Block | None:
    """Tell kind and target of a typed command; None when it is none of the lab's kinds."""
    cut = _END_OF_COMMAND.search(line)
    words = _words(line[: cut.start()] if cut else line)
    for kind in kinds.values():
        pattern = _words(kind.run)
        fixed = [word for word in pattern if not word.startswith("{")]
        if words[: len(fixed)] != fixed:
            continue
        target = _target(words[len(fixed) :], len(pattern) - len(fixed))
        if target is not None:
            return Block(kind.name, target, "", whole=cut is None or "|" not in cut[0])
    return None


def _words(line: str) -> list[str]:
    """The words of a command line that are no options."""
    return [word for word in line.partition("--ros-args")[0].split() if not word.startswith("-")]


def _target(words: Sequence[str], count: int) -> str | None:
    """Pick a topic or node (with its slash), or two frames (without); None when there is none."""
    names = [word.strip("'\"") for word in words if not re.fullmatch(r"[\d.]+", word)]
    if count == 0:
        return ""
    if len(names) < count:
        return None
    if count > 1:
        return " ".join(name.strip("/") for name in names[:count])
    absolute = [name for name in names if name.startswith("/")]
    return absolute[0] if absolute else f"/{names[0]}"


def _named_block(text: str, name: str, ros: RosSpec) -> Iterator[Block]:
    for command in ros.commands:
        if command.file == name:
            yield Block(command.kind.name, command.target, text)
            return
    kind = next((kind for kind, looks in _LOOKS if looks.search(text)), _kind_in(name))
    if kind == "names":
        known = {*ros.topics, *ros.system.topics}
        kind = "topic_list" if known & set(text.split()) else "node_list"
    if kind in {"topic_list", "node_list", "view_frames"}:
        yield Block(kind, "", text)
    elif kind is not None:
        target = _target_in(name, [c for c in ros.commands if c.kind.name == kind])
        if target:
            yield Block(kind, target, text)


def _kind_in(name: str) -> str | None:
    """Tell the kind of an output that says nothing of itself by a word in the file's name."""
    words = file_word(name).lower().split("_")
    return next((kind for word, kind in _NAMED.items() if word in words), None)


def _target_in(name: str, commands: Sequence[Command]) -> str:
    """Return the longest target that the name of a file spells; empty when it spells none."""
    spelled = f"_{file_word(name.rpartition('.')[0] or name)}_"
    found = [
        command.target
        for command in commands
        if all(f"_{file_word(part)}_" in spelled for part in command.target.split())
    ]
    return max(found, key=len, default="")
