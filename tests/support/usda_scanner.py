"""A second way to find where specs stand in a text layer: reads it token by token, by its grammar.

It shares nothing with the scanner of the package, so that each can be held against the other.
It is strict: what the grammar does not allow raises `SyntaxError`.
"""

from __future__ import annotations

from usda_tokens import Token, tokens

Spot = tuple[int, int]
SPECIFIERS = ("def", "over", "class")
LIST_EDITS = ("add", "append", "delete", "prepend", "reorder")
ORDERS = ("nameChildren", "properties", "rootPrims")


def scan(text: str) -> dict[str, Spot]:
    """Return line and column, from 1, of each prim, variant set, variant and property."""
    parser = _Parser(text)
    parser.layer()
    spots: dict[str, Spot] = {}
    for path, spot in [*parser.declarations, *parser.edits]:
        spots.setdefault(path, spot)
    return spots


class _Parser:
    def __init__(self, text: str) -> None:
        self.tokens = list(tokens(text))
        self.next = 0
        self.declarations: list[tuple[str, Spot]] = []
        self.edits: list[tuple[str, Spot]] = []

    @property
    def token(self) -> Token:
        return self.tokens[self.next]

    def take(self, kind: str) -> Token:
        token = self.token
        if token.kind != kind:
            raise SyntaxError(
                f"{token.kind} {token.text!r} at {token.line}:{token.column}, not {kind}"
            )
        self.next += 1
        return token

    def sees(self, *kinds: str) -> bool:
        return self.token.kind in kinds

    def skips(self, *kinds: str) -> bool:
        """Skip all tokens of these kinds; whether there was one."""
        before = self.next
        while self.sees(*kinds):
            self.next += 1
        return self.next > before

    def word(self, *words: str) -> bool:
        """Take the next token if it is one of these words."""
        if not self.sees("name") or self.token.text not in words:
            return False
        self.next += 1
        return True

    def layer(self) -> None:
        self.skips("newline")
        if self.sees("("):
            self.metadata()
        self.skips("newline")
        while not self.sees("end"):
            if self.word("reorder"):
                self.order()
            else:
                self.prim("")
            if not self.skips("newline", ";"):
                self.take("end")
                return

    def prim(self, parent: str) -> None:
        start = self.take("name")
        if start.text not in SPECIFIERS:
            raise SyntaxError(f"{start.text!r} at {start.line}:{start.column} opens no prim")
        if self.sees("name"):
            self.take("name")
            while self.skips("."):
                self.take("name")
        name = self.take("string").text
        path = f"{parent}{name}" if parent.endswith("}") else f"{parent}/{name}"
        self.declarations.append((path, (start.line, start.column)))
        self.body(path)

    def body(self, path: str) -> None:
        self.skips("newline")
        if self.sees("("):
            self.metadata()
        self.skips("newline")
        self.take("{")
        self.skips("newline")
        while not self.sees("}"):
            self.item(path)
            self.skips("newline", ";")
        self.take("}")

    def item(self, path: str) -> None:
        if self.sees("name") and self.token.text in SPECIFIERS:
            self.prim(path)
            self.ends("newline")
        elif self.sees("name") and self.token.text == "variantSet":
            self.variant_set(path)
            self.ends("newline")
        else:
            self.property(path)
            self.ends("newline", ";")

    def ends(self, *kinds: str) -> None:
        if not self.sees(*kinds):
            raise SyntaxError(f"no end of the statement at {self.token.line}:{self.token.column}")

    def variant_set(self, path: str) -> None:
        start = self.take("name")
        name = self.take("string").text
        self.declarations.append((f"{path}{{{name}=}}", (start.line, start.column)))
        self.skips("newline")
        self.take("=")
        self.skips("newline")
        self.take("{")
        self.skips("newline")
        while not self.sees("}"):
            variant = self.take("string")
            selected = f"{path}{{{name}={variant.text}}}"
            self.declarations.append((selected, (variant.line, variant.column)))
            self.body(selected)
            self.skips("newline")
        self.take("}")

    def order(self) -> None:
        if not self.word(*ORDERS):
            self.take("nameChildren")
        self.take("=")
        self.value()

    def property(self, path: str) -> None:
        start = self.token
        edits = self.word(*LIST_EDITS)
        if edits and start.text == "reorder" and self.token.text in ORDERS:
            self.order()
            return
        self.word("custom")
        if self.word("varying"):
            self.word("rel")
        elif not self.word("rel"):
            self.attribute_type()
        name = self.take("name").text
        found = self.edits if edits or self.sees(".") else self.declarations
        found.append((f"{path}.{name}", (start.line, start.column)))
        self.assignment()

    def attribute_type(self) -> None:
        self.word("config", "uniform")
        self.take("name")
        if self.sees("["):
            self.take("[")
            self.take("]")

    def assignment(self) -> None:
        if self.sees("."):
            self.take(".")
            kind = self.take("name").text
            self.take("=")
            (self.group if kind == "spline" else self.value)()
        elif self.sees("["):
            self.take("[")
            self.take("path")
            self.take("]")
        else:
            if self.sees("="):
                self.take("=")
                self.value()
            if self.sees("("):
                self.metadata()

    def metadata(self) -> None:
        """Take a block of metadata, or the settings behind an asset path."""
        self.take("(")
        self.skips("newline")
        while not self.sees(")"):
            if self.sees("string"):
                self.take("string")
            else:
                self.word(*LIST_EDITS)
                self.take("name")
                self.take("=")
                self.value()
            if not self.skips("newline", ";"):
                break
        self.take(")")

    def value(self) -> None:
        if self.sees("[", "("):
            self.items()
        elif self.sees("{"):
            self.mapping()
        elif self.sees("asset", "path"):
            self.reference()
        elif self.sees("name", "number", "string"):
            self.next += 1
        else:
            self.take("value")

    def reference(self) -> None:
        if self.sees("asset"):
            self.take("asset")
        if self.sees("path"):
            self.take("path")
        if self.sees("("):
            self.metadata()

    def items(self) -> None:
        close = {"[": "]", "(": ")"}[self.token.kind]
        self.next += 1
        self.skips("newline")
        while not self.sees(close):
            self.value()
            self.skips("newline")
            if not self.sees(","):
                break
            self.take(",")
            self.skips("newline")
        self.take(close)

    def mapping(self) -> None:
        """Take a dictionary, samples over time, or pairs of names or paths."""
        self.take("{")
        self.skips("newline", ",", ";")
        while not self.sees("}"):
            if self.sees("name"):
                self.attribute_type()
                self.take(self.token.kind if self.sees("name", "string") else "name")
                self.take("=")
            else:
                self.next += 1
                self.take(":")
            self.value()
            if not self.skips("newline", ",", ";"):
                break
        self.take("}")

    def group(self) -> None:
        """Take everything from one brace to the one that closes it."""
        self.take("{")
        while not self.sees("}"):
            if self.sees("{"):
                self.group()
            else:
                self.next += 1
        self.take("}")
