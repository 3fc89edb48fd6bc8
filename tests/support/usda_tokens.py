"""Cuts the text of a layer into tokens, character by character, each with its line and column."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NoReturn

PUNCTUATION = "()[]{}=,;:.&"
NUMBER_CHARACTERS = frozenset("0123456789.+-eE")


@dataclass(frozen=True, slots=True)
class Token:
    """`kind` is name, string, asset, path, number, newline, end or a punctuation mark itself."""

    kind: str
    text: str
    line: int
    column: int


class Reader:
    """The characters of a text, one after the other, and where the next one stands."""

    def __init__(self, text: str) -> None:
        self.text = text
        self.at = 0
        self.line = 1
        self.column = 1

    def sees(self, sign: str) -> bool:
        return self.text.startswith(sign, self.at)

    def take(self, count: int = 1) -> str:
        taken = self.text[self.at : self.at + count]
        if len(taken) < count:
            self.refuse("text that ends too early")
        for character in taken:
            self.at += 1
            self.column += 1
            if character == "\n":
                self.line += 1
                self.column = 1
        return taken

    def take_until(self, sign: str, escapes: tuple[str, ...] = ()) -> str:
        """Take everything up to `sign` and `sign` itself; return what came before it."""
        taken = ""
        while not self.sees(sign):
            escape = next((each for each in escapes if self.sees(each)), None)
            taken += self.take(len(escape) if escape else 1)
        self.take(len(sign))
        return taken

    def take_line(self) -> None:
        while self.at < len(self.text) and self.text[self.at] not in "\r\n":
            self.take()

    def refuse(self, what: str) -> NoReturn:
        raise SyntaxError(f"{what} at {self.line}:{self.column}")


def tokens(text: str) -> Iterator[Token]:
    reader = Reader(text)
    while reader.at < len(text):
        line, column = reader.line, reader.column
        for kind, content in _next(reader):
            yield Token(kind, content, line, column)
    yield Token("end", "", reader.line, reader.column)


def _next(reader: Reader) -> Iterator[tuple[str, str]]:
    """Take one token or one piece of blank, for which nothing is yielded."""
    character = reader.text[reader.at]
    if character in " \t":
        reader.take()
    elif character in "\r\n":
        yield "newline", reader.take()
    elif character in "#/":
        _comment(reader)
    elif character in "\"'":
        yield "string", _string(reader, character)
    elif character == "@":
        yield "asset", _asset(reader)
    elif character == "<":
        reader.take()
        yield "path", reader.take_until(">")
    else:
        yield _bare(reader, character)


def _bare(reader: Reader, character: str) -> tuple[str, str]:
    after = reader.text[reader.at + 1 : reader.at + 2]
    if character.isdigit() or character == "-" or (character == "." and after.isdigit()):
        return "number", _number(reader)
    if character in PUNCTUATION:
        return reader.take(), character
    return "name", _name(reader)


def _comment(reader: Reader) -> None:
    if reader.sees("/*"):
        reader.take(2)
        reader.take_until("*/")
    elif reader.sees("#") or reader.sees("//"):
        reader.take_line()
    else:
        reader.refuse("a lone slash")


def _string(reader: Reader, quote: str) -> str:
    escapes = ("\\\\", f"\\{quote}")
    if reader.sees(quote * 3):
        reader.take(3)
        return reader.take_until(quote * 3, escapes)
    reader.take()
    content = reader.take_until(quote, escapes)
    if "\n" in content or "\r" in content:
        reader.refuse("a string over more than one line")
    return content


def _asset(reader: Reader) -> str:
    if not reader.sees("@@@"):
        reader.take()
        return reader.take_until("@")
    reader.take(3)
    content = reader.take_until("@@@", ("\\@@@",))
    while reader.sees("@") and len(content) - len(content.rstrip("@")) < 2:
        content += reader.take()
    return content


def _number(reader: Reader) -> str:
    if reader.sees("-inf"):
        return reader.take(4)
    taken = reader.take()
    while reader.at < len(reader.text) and reader.text[reader.at] in NUMBER_CHARACTERS:
        taken += reader.take()
    return taken


def _name(reader: Reader) -> str:
    """Take a name with the namespaces before it (`inputs:x`, `Package::Type`)."""
    taken = ""
    while reader.at < len(reader.text):
        character = reader.text[reader.at]
        if not f"_{character}".isidentifier() and not _joins(reader):
            break
        taken += reader.take(2 if reader.sees("::") else 1)
    if not taken:
        reader.refuse(f"the character {reader.text[reader.at]!r}")
    return taken


def _joins(reader: Reader) -> bool:
    """Whether the colon here has a name on its other side as well, with nothing between."""
    rest = reader.text[reader.at : reader.at + 3]
    after = rest.removeprefix("::") if rest.startswith("::") else rest.removeprefix(":")
    return after != rest and f"_{after[:1]}".isidentifier() and after != ""
