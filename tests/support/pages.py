"""Pages of the documentation: their blocks, and the commands in them with what they print."""

from __future__ import annotations

import functools
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from markdown_it import MarkdownIt
from markdown_it.token import Token

BEFORE = re.compile(r"<!-- before:\s+(.+?)\s*-->", re.DOTALL)


@functools.cache
def tokens(page: Path) -> list[Token]:
    return MarkdownIt("commonmark").enable("table").parse(page.read_text(encoding="utf-8"))


def inline(page: Path, kind: str) -> Iterator[Token]:
    for token in tokens(page):
        yield from (child for child in token.children or () if child.type == kind)


@dataclass(frozen=True)
class Block:
    """A fenced block: its language, what else its first line says, and its text."""

    language: str
    extra: str
    text: str


def blocks(page: Path) -> Iterator[Block]:
    for token in tokens(page):
        if token.type == "fence":
            language, _, extra = token.info.partition(" ")
            yield Block(language, extra.strip(), token.content)
        elif token.type == "html_block":
            yield from (Block("before", "", hidden) for hidden in BEFORE.findall(token.content))


def sessions(text: str) -> Iterator[tuple[str, list[str]]]:
    """Yield each command of a console block with the lines that it prints."""
    command, printed = "", list[str]()
    for line in text.splitlines():
        if line.startswith("$ "):
            if command:
                yield command, printed
            command, printed = line[2:], []
        elif command.endswith("\\") and not printed:
            command = command[:-1] + line.removeprefix("> ").strip()
        else:
            printed.append(line)
    if command:
        yield command, printed


def matches(shown: list[str], printed: str) -> bool:
    """Say whether a page shows what was printed.

    A line `...` stands for any lines, `...` within a line for any text.
    """
    pattern = "".join(
        r"(?:.*\n)*?"
        if line.strip() == "..."
        else ".*".join(map(re.escape, line.rstrip().split("..."))) + r"\n"
        for line in shown
    )
    lines = "".join(f"{line.rstrip()}\n" for line in printed.splitlines())
    return re.fullmatch(pattern, lines) is not None
