"""Typed commands in saved text, and the output that belongs to each."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from itertools import takewhile

from msgspec import Struct

from lab3_usd.deliverables.evidence.outputs import NAME
from lab3_usd.spec.ros import Command, EvidenceKind, RosSpec, file_word

_PROGRAM = "ros2"
# How prompts end: bash, zsh, root, fish; oh-my-zsh, starship, powerlevel10k, and what they like.
_ENDS = tuple("$#%>❯➜λ»›⟩▶✗✘✔")  # noqa: RUF001 - they are no slips
_BEGINS = ("➜", "❯", "╰─", "└─", "╭─", "┌─", "λ ", "» ", "$ ")  # noqa: RUF001
_LONGEST_PROMPT = 8  # words
_LONGEST_LABEL = 3  # words, as in `Terminal 2: ros2 node list`
# Programs that run another one, and how many words of their own they take beside options.
_WRAPPERS = {
    "timeout": 1, "sudo": 0, "docker": 2, "podman": 2, "docker-compose": 2, "compose": 0, "env": 0,
    "time": 0, "nohup": 0, "stdbuf": 0, "unbuffer": 0, "command": 0, "exec": 0, "ssh": 1, "wsl": 0,
    "bash": 0, "sh": 0, "zsh": 0, "nice": 0, "distrobox": 1, "enter": 0, "xvfb-run": 0,
}  # fmt: skip
_ASSIGNED = re.compile(r"[A-Za-z_]\w*=")
_LIST_MARK = re.compile(r"(?:#+|[-*+>]|\d+[.)])\s+")
_OPERATORS = re.compile(r"[|;&>]")


class TypedCommand(Struct, frozen=True):
    """The words of a command of ROS 2; `shown` unless its output went elsewhere or was mixed."""

    words: tuple[str, ...]
    shown: bool


def read_command(line: str) -> TypedCommand | None:
    """Read the command that a line holds: typed at a prompt, or the line's only content.

    None where there is none, or where it is part of a sentence. What is redirected, piped into
    another program or joined with another command is not shown.
    """
    if _PROGRAM not in line:
        return None
    words = _without_markup(line).split()
    names = [word.lstrip("'\"").rpartition("/")[2] for word in words]
    if _PROGRAM not in names:
        return None
    at = names.index(_PROGRAM)
    before, command = words[:at], words[at:]
    if any(word in {"&&", "||", "|"} or word.endswith(";") for word in before):
        return TypedCommand((_PROGRAM,), shown=False)
    if not _may_precede(before):
        return None
    return _cut(command)


def is_prompt(line: str) -> bool:
    """Whether a line begins with a prompt: what follows is no longer output of what came before."""
    text = line.strip()
    if text.startswith(_BEGINS) or text == "$":
        return True
    if "@" not in text:
        return False
    words = text.split(maxsplit=_LONGEST_PROMPT)
    who = next((i for i, word in enumerate(words[:4]) if "@" in word.strip("@")), None)
    return who is not None and any(word.endswith(_ENDS) for word in words[who:_LONGEST_PROMPT])


def _without_markup(line: str) -> str:
    """Return what a line of Markdown says where all it says is code; any other line as it is.

    Code in a sentence is a quotation and no command: empty.
    """
    text = line.strip()
    if "`" not in text:
        return text
    mark = _LIST_MARK.match(text)
    rest = text[mark.end() :] if mark else text
    code = rest.strip("*_: ")
    inside = code.strip("`")
    return inside if code.startswith("`") and code.endswith("`") and "`" not in inside else ""


def _may_precede(words: list[str]) -> bool:
    """Whether words may stand before a command: a prompt or a short label, then wrappers."""
    names = [word.lstrip("'\"") for word in words]
    start = next(
        (i for i, name in enumerate(names) if name in _WRAPPERS or _ASSIGNED.match(name)),
        len(names),
    )
    prompt, wrapper = names[:start], names[start:]
    if prompt:
        is_prompt = prompt[-1].endswith(_ENDS) or prompt[0].startswith(_BEGINS)
        longest = _LONGEST_PROMPT if is_prompt else _LONGEST_LABEL
        if len(prompt) > longest or not (is_prompt or prompt[-1].endswith(":")):
            return False
    allowed, own = 0, 0
    for name in wrapper:
        if name in _WRAPPERS:
            allowed += _WRAPPERS[name]
        elif name.startswith("-"):
            allowed += 1  # it may take a value
        elif not _ASSIGNED.match(name):
            own += 1
    return own <= allowed


def _cut(command: list[str]) -> TypedCommand:
    """Cut a command where the shell takes over; errors may go elsewhere, its output may not."""
    quote = command[0][0] if command[0][0] in "'\"" else ""
    command[-1] = command[-1].rstrip(":;" + quote)
    words = [_PROGRAM]
    waiting = iter(command[1:])
    for word in waiting:
        if word.startswith("#"):
            break
        if word.startswith(("2>", "<")):
            if word in {"2>", "2>>", "<"}:
                next(waiting, None)
        elif _OPERATORS.search(word):
            return TypedCommand(tuple(words), shown=False)
        elif word:
            words.append(word)
    return TypedCommand(tuple(words), shown=True)


_COLOUR = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]|\x1b\][^\x07\x1b\n]*\x07?")
_CONTINUED = re.compile(r"\\[ \t]*\n[ \t]*>?")
_FENCE = "```"
_PLACE = re.compile(r"[\w/~]+")
_NUMBER = re.compile(r"[\d.]+")
_MESSAGE_TYPE = re.compile(r"\w+/(?:msg/)?\w+")
# What an output looks like, where neither its name nor a command line above it tells.
_CONTENT_PATTERNS = (
    ("topic_hz", re.compile(r"average rate:")),
    ("topic_info", re.compile(r"Publisher count:")),
    ("view_frames", re.compile(r"digraph |frame_yaml=|^[ \t]+parent: '", re.MULTILINE)),
    ("tf2_echo", re.compile(r"- Translation: \[|Waiting for transform ")),
    ("lifecycles", re.compile(r"^/\S+: \w+ \[\d\]$", re.MULTILINE)),
    ("lifecycle", re.compile(r"^\w+ \[\d\]$", re.MULTILINE)),
    ("topic_type", re.compile(r"\A\w+/msg/\w+\Z")),
    ("topic_echo", re.compile(r"^[a-z]\w*:", re.MULTILINE)),
)
_NAMED = {
    "hz": "topic_hz",
    "type": "topic_type",
    "info": "topic_info",
    "lifecycle": "lifecycle",
    "echo": "topic_echo",
}
# Asked about nothing, it answers for all.
_OF_ALL = {"lifecycle"}


class CommandOutput(Struct, frozen=True):
    """The output of one command: its kind, and what it was about."""

    kind: str
    target: str
    text: str


def split_outputs(text: str, name: str, ros: RosSpec) -> list[CommandOutput]:
    """Split a saved text at the command lines it holds.

    A text without command lines is one block, recognised by the name of its file (`name`, without
    folder), and by what it looks like; an empty list when nothing tells. Commands whose output
    is not shown have no block.
    """
    plain = _COLOUR.sub("", text).replace("\r\n", "\n")
    lines = _CONTINUED.sub(" ", plain).split("\n")
    typed = [read_command(line) for line in lines]
    if any(typed):
        return list(_typed_blocks(lines, typed, ros.kinds))
    return list(_named_block(plain, name, ros))


def _typed_blocks(
    lines: Sequence[str], typed: Sequence[TypedCommand | None], kinds: Mapping[str, EvidenceKind]
) -> Iterator[CommandOutput]:
    """Give each command the lines up to the next prompt, or to the end of the fence around them."""
    current: CommandOutput | None = None
    seen: list[str] = []
    fenced = False
    for line, command in zip(lines, typed, strict=True):
        fence = _FENCE in line and line.lstrip().startswith(_FENCE)
        opens = fence and not fenced
        fenced = fenced != fence
        if current is not None and (
            command is not None or (fence and not opens) or is_prompt(line)
        ):
            yield CommandOutput(current.kind, current.target, "\n".join(seen))
            current = None
        if command is not None:
            current, seen = recognise(command, kinds), []
        elif not fence:
            seen.append(line)
    if current is not None:
        yield CommandOutput(current.kind, current.target, "\n".join(seen))


def recognise(typed: TypedCommand, kinds: Mapping[str, EvidenceKind]) -> CommandOutput | None:
    """Tell kind and target of a typed command; None when the lab asks for none such, or differs."""
    words = _before_node_arguments(typed.words)
    for kind in kinds.values():
        pattern = _before_node_arguments(kind.run.split())
        fixed = [word for word in pattern if not word.startswith(("{", "-"))]
        if not typed.shown or words[: len(fixed)] != fixed:
            continue
        rest = words[len(fixed) :]
        if any(word.partition("=")[0] in kind.narrowed_by for word in rest):
            return None
        count = sum(word.startswith("{") for word in pattern)
        target = _target(rest, count, of_all=kind.name in _OF_ALL)
        if target is not None:
            return CommandOutput(kind.name, target, "")
    return None


def _before_node_arguments(words: Sequence[str]) -> list[str]:
    return list(takewhile(lambda word: word != "--ros-args", words))


def _target(words: Sequence[str], count: int, *, of_all: bool) -> str | None:
    """Pick a topic or node (with its slash), or two frames (without).

    None when there is none, and when more words stand there than the command takes: a sentence.
    """
    given = [
        (word.strip("'\""), before.startswith("-"))
        for before, word in zip(("", *words), words, strict=False)
        if not (word.startswith("-") or _NUMBER.fullmatch(word))
    ]
    # The type of the message may follow its topic.
    places = given[:1] + [word for word in given[1:] if not _MESSAGE_TYPE.fullmatch(word[0])]
    free = [word for word, led in places if not led]
    options = sum(word.startswith("-") for word in words)
    if len(free) > count or len(places) > count + options:
        return None
    names = free if len(free) == count else [word for word, _ in places]
    if count == 0 or (of_all and not names):
        return ""
    if count == 1:
        names.sort(key=lambda name: not name.startswith("/"))
    if len(names) < count or not all(_PLACE.fullmatch(name) for name in names[:count]):
        return None
    targets = [name.strip("/") for name in names[:count]]
    return f"/{targets[0]}" if count == 1 else " ".join(targets)


def _named_block(text: str, name: str, ros: RosSpec) -> Iterator[CommandOutput]:
    for command in ros.commands:
        if command.file == name:
            yield CommandOutput(command.kind.name, command.target, text)
            return
    words = file_word(name).lower().split("_")  # tell of an output that says nothing of itself
    named = (kind for word, kind in _NAMED.items() if word in words)
    kind = _looks_like(text, ros) or next(named, None)
    if kind == "lifecycles":
        yield CommandOutput("lifecycle", "", text)
    elif kind in {"topic_list", "node_list", "view_frames"}:
        yield CommandOutput(kind, "", text)
    elif kind is not None:
        target = _target_in(name, [c for c in ros.commands if c.kind.name == kind])
        if target:
            yield CommandOutput(kind, target, text)


def _looks_like(text: str, ros: RosSpec) -> str | None:
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    if lines and all(NAME.match(line) for line in lines):
        topics = {*ros.topics, *ros.system.topics}
        return "topic_list" if topics & {line.split()[0] for line in lines} else "node_list"
    plain = "\n".join(line.rstrip() for line in text.strip().splitlines())
    return next((kind for kind, pattern in _CONTENT_PATTERNS if pattern.search(plain)), None)


def _target_in(name: str, commands: Sequence[Command]) -> str:
    """Return the longest target that the name of a file spells; empty when it spells none."""
    spelled = f"_{file_word(name.rpartition('.')[0] or name)}_"
    targets = [
        command.target
        for command in commands
        if all(f"_{file_word(part)}_" in spelled for part in command.target.split())
    ]
    return max(targets, key=len, default="")
