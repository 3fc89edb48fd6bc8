"""Recognises a typed command in a line of saved text, behind whatever prompt and wrapper."""

from __future__ import annotations

import re

from msgspec import Struct

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
    at = next((i for i, word in enumerate(words) if _is_program(word)), None)
    if at is None:
        return None
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


def _is_program(word: str) -> bool:
    return word.lstrip("'\"").rpartition("/")[2] == _PROGRAM


def _may_precede(words: list[str]) -> bool:
    """Whether words may stand before a command: a prompt or a short label, then wrappers."""
    names = [word.lstrip("'\"") for word in words]
    start = next(
        (i for i, name in enumerate(names) if name in _WRAPPERS or _ASSIGNED.match(name)),
        len(names),
    )
    prompt, wrapper = names[:start], names[start:]
    if prompt and not _is_prompt_or_label(prompt):
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


def _is_prompt_or_label(words: list[str]) -> bool:
    if words[-1].endswith(_ENDS) or words[0].startswith(_BEGINS):
        return len(words) <= _LONGEST_PROMPT
    return words[-1].endswith(":") and len(words) <= _LONGEST_LABEL


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
