"""What the values of a script are, as far as they are known before it runs.

Numbers, booleans and None stand for themselves. What only a run tells is `Unknown`; within a text
it leaves a stand-in in braces, as `{args.topic}`.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator, Mapping
from typing import Any, TypeAlias

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.model.stage import Unknown

Value: TypeAlias = Any
At = tuple[int, int, int, int]  # line, column, last line and its column, as ast counts them

MOST_ITEMS = 20_000  # of a list
MOST_LETTERS = 200_000  # of a text
_LONGEST = 40  # letters of what a stand-in says
_STAND_IN = re.compile(r"\{[^{}]*\}")


def place(node: ast.AST) -> At:
    """Return where a part of the script stands."""
    line = getattr(node, "lineno", 1)
    column = getattr(node, "col_offset", 0)
    last = getattr(node, "end_lineno", None) or line
    end = getattr(node, "end_col_offset", None)
    return line, column, last, column if end is None else end


def words(node: ast.AST, depth: int = 6) -> str:
    """Return what a script calls a value, in short."""
    if depth == 0:
        return "..."
    match node:
        case ast.Name():
            text = node.id
        case ast.Attribute():
            text = f"{words(node.value, depth - 1)}.{node.attr}"
        case ast.Call():
            text = f"{words(node.func, depth - 1)}()"
        case ast.Subscript():
            text = f"{words(node.value, depth - 1)}[{words(node.slice, depth - 1)}]"
        case ast.Constant() if (
            isinstance(node.value, (str, int)) and len(str(node.value)) < _LONGEST
        ):
            text = repr(node.value)
        case ast.Await():
            text = words(node.value, depth - 1)
        case _:
            text = "..."
    return text if len(text) <= _LONGEST else f"{text[:_LONGEST]}..."


def unknown(node: ast.AST) -> Unknown:
    """Return the value of an expression that only a run tells."""
    return Unknown(words(node), getattr(node, "lineno", 1))


def last_name(call: ast.Call) -> str:
    """Return the last name of what is called, '' where it has none."""
    if isinstance(call.func, ast.Attribute):
        return call.func.attr
    return call.func.id if isinstance(call.func, ast.Name) else ""


def reason(value: Value, line: int) -> Unknown:
    """Return what is unknown of a value that is not of the kind that is needed."""
    return value if isinstance(value, Unknown) else Unknown("...", line)


class Text(Struct, frozen=True):
    """A text, with stand-ins for what is unknown of it.

    `unknown` is the first unknown part. One that `is_path` was made a path of USD.
    """

    text: str
    at: At
    unknown: Unknown | None = None
    is_path: bool = False


class Items(Struct, eq=False):
    """A list, tuple or set; `rest` is what is not known of it, None where all of it is."""

    items: list[Value]
    at: At
    kind: str = "list"
    rest: Unknown | None = None

    def extend(self, items: list[Value], rest: Unknown | None = None) -> None:
        """Take more items; of those that are too many, it is only known that there are some."""
        if len(self.items) + len(items) > MOST_ITEMS:
            rest = rest or Unknown("a long list", self.at[0])
        else:
            self.items += items
        self.rest = self.rest or rest


class Table(Struct, eq=False):
    """A dictionary: its keys and values in order, and what is not known of it.

    `lost` are the keys that a literal has twice, each with the value that does not count.
    """

    at: At
    rest: Unknown | None = None
    keys: dict[object, Value] = {}
    values: dict[object, Value] = {}
    lost: list[tuple[Value, Value]] = []

    def set(self, key: Value, value: Value) -> None:
        """Give a key a value; one that is not known makes the table so."""
        name = key_of(key)
        if name is None:
            self.rest = self.rest or reason(key, 0)
            return
        self.keys[name] = key
        self.values[name] = value

    def update(self, other: Table) -> None:
        """Take the keys and values of another table, and what is not known of it."""
        self.keys |= other.keys
        self.values |= other.values
        self.rest = self.rest or other.rest

    def copy(self) -> Table:
        """Return a table with the same keys."""
        return Table(self.at, self.rest, dict(self.keys), dict(self.values))


class External(Struct, frozen=True):
    """Something of a module that is not read, by its dotted name."""

    name: str

    @property
    def last(self) -> str:
        """The last part of the name."""
        return self.name.rpartition(".")[2]


class Scope(Struct, eq=False):
    """The names of a module, a class or a function, and the scope around it.

    `public` are those that are declared global or nonlocal.
    """

    kind: str
    outer: Scope | None = None
    owner: Class | None = None
    names: dict[str, Value] = {}
    public: dict[str, Scope] = {}
    stars: list[str] = []
    returns: list[Value] = []
    yields: list[Value] | None = None

    def holder(self, name: str) -> Scope | None:
        """Return the scope that gives a name its value, here or further out, None without one."""
        if name in self.public:
            return self.public[name]
        if name in self.names:
            return self
        scope = self.outer
        while scope is not None and (scope.kind == "class" or name not in scope.names):
            scope = scope.outer
        return scope

    def set(self, name: str, value: Value) -> None:
        """Give a name a value."""
        self.public.get(name, self).names[name] = value

    def top(self) -> Scope:
        """Return the scope of the module."""
        scope = self
        while scope.outer is not None:
            scope = scope.outer
        return scope

    def function(self) -> Scope:
        """Return the scope of the function, or of the module, that it is in."""
        scope = self
        while scope.kind not in ("function", "module") and scope.outer is not None:
            scope = scope.outer
        return scope


class Function(Struct, frozen=True, eq=False):
    """A function of the script; `own` is the object or class that a method belongs to."""

    node: ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda
    scope: Scope
    own: Value | None = None
    owner: Class | None = None
    defaults: Mapping[str, Value] = {}

    def of(self, own: Value, owner: Class) -> Function:
        """Return the function as a method of an object or a class."""
        return replace(self, own=own, owner=owner)


class Class(Struct, eq=False):
    """A class of the script with its attributes, and those of its bases that are known."""

    node: ast.ClassDef
    scope: Scope
    bases: list[Value]

    def lines(self) -> Iterator[Class]:
        """Yield the class and its bases, nearest first."""
        seen: list[Class] = [self]
        for kind in seen:
            yield kind
            seen += [base for base in kind.bases if isinstance(base, Class) and base not in seen]

    def find(self, name: str) -> tuple[Value, Class] | None:
        """Return an attribute and the class that has it."""
        for kind in self.lines():
            if name in kind.scope.names:
                return kind.scope.names[name], kind
        return None

    def method(self, name: str, own: Value) -> Function | None:
        """Return a function of the class as a method of one of its objects, None without one."""
        member, owner = self.find(name) or (None, self)
        return member.of(own, owner) if isinstance(member, Function) else None


class Instance(Struct, eq=False):
    """An object of a class of the script."""

    type: Class
    attributes: dict[str, Value] = {}


class Super(Struct, frozen=True, eq=False):
    """What `super()` gives in a method."""

    own: Value
    owner: Class


class Method(Struct, frozen=True, eq=False):
    """A function of a value that is no object of the script: of a text, a list, a node."""

    own: Value
    name: str


class Controller(Struct, eq=False):
    """An object of the controller class, which remembers short names of nodes between its calls."""

    names: dict[str, Any] = {}


class GraphHandle(Struct, frozen=True):
    """A graph as an object."""

    path: str


class NodeHandle(Struct, frozen=True):
    """A node as an object."""

    path: str


class AttributeHandle(Struct, frozen=True):
    """An attribute or relationship as an object, of OmniGraph or of USD."""

    path: str
    name: str


class PrimHandle(Struct, frozen=True):
    """A prim as an object."""

    path: str


Handles = (GraphHandle, NodeHandle, AttributeHandle, PrimHandle)


def key_of(key: Value) -> object | None:
    """Return what tells a key of a dictionary from others, None where that is unknown."""
    if isinstance(key, Text):
        return None if key.unknown else key.text
    if key is None or isinstance(key, (bool, int, float)):
        return ("", key) if key is None else key
    if isinstance(key, External):
        return ("external", key.name)
    if isinstance(key, Items) and key.kind == "tuple" and key.rest is None:
        parts = tuple(key_of(item) for item in key.items)
        return None if None in parts else parts
    return None


def truth(value: Value) -> bool | None:
    """Return whether a value counts as true, None where that is unknown."""
    if isinstance(value, (Unknown, External, Method)):
        return None
    if isinstance(value, Text):
        if value.unknown is None:
            return bool(value.text)
        return True if _STAND_IN.sub("", value.text) else None
    if isinstance(value, Items):
        return True if value.items else None if value.rest else False
    if isinstance(value, Table):
        return True if value.values else None if value.rest else False
    return bool(value) if value is None or isinstance(value, (bool, int, float)) else True


def same(one: Value, other: Value, depth: int = 4) -> bool | None:
    """Return whether two values are equal, None where that is unknown."""
    if one is other and not isinstance(one, (Unknown, External)):
        return True
    if isinstance(one, Text) and isinstance(other, Text):
        return None if one.unknown or other.unknown else one.text == other.text
    unsure = (Unknown, External, Method)
    if isinstance(one, unsure) or isinstance(other, unsure) or depth == 0:
        return True if one == other and isinstance(one, External) else None
    if isinstance(one, Items) and isinstance(other, Items):
        if one.rest or other.rest:
            return None
        if len(one.items) != len(other.items):
            return False
        pairs = [same(*pair, depth - 1) for pair in zip(one.items, other.items, strict=True)]
        return False if False in pairs else None if None in pairs else True
    plain = (bool, int, float, type(None))
    if isinstance(one, plain) and isinstance(other, plain):
        return bool(one == other)
    if isinstance(one, Handles) or isinstance(other, Handles):
        return bool(one == other) if type(one) is type(other) else False
    return False


def joined(one: Value, other: Value, what: Unknown) -> Value:
    """Return the value after one of two ways of which it is unknown which was taken."""
    if one is other or same(one, other):
        return one
    return one if isinstance(one, Unknown) and one == other else what


class UnknownValueError(Exception):
    """A value is needed that only a run of the script tells."""


def plain(value: Value, depth: int = 12) -> Any:
    """Return a value as Python has it.

    Raises:
        UnknownValueError: it is not known, or no plain value.
    """
    if depth == 0:
        raise UnknownValueError
    if isinstance(value, Text):
        if value.unknown is not None:
            raise UnknownValueError
        return value.text
    if value is None or isinstance(value, (bool, int, float)):
        return value
    if isinstance(value, Items) and value.rest is None:
        items = [plain(item, depth - 1) for item in value.items]
        return tuple(items) if value.kind == "tuple" else items
    if isinstance(value, Table) and value.rest is None:
        return {
            plain(value.keys[name], depth - 1): plain(entry, depth - 1)
            for name, entry in value.values.items()
        }
    raise UnknownValueError


def lifted(value: Any, at: At) -> Value:
    """Return a plain value of Python as a value of the script."""
    if isinstance(value, str):
        if len(value) > MOST_LETTERS:
            return Unknown("a long text", at[0])
        return Text(value, at)
    if isinstance(value, (list, tuple, set, frozenset, range)):
        if len(value) > MOST_ITEMS:
            return Unknown("a long list", at[0])
        kind = "tuple" if isinstance(value, tuple) else "list"
        return Items([lifted(item, at) for item in value], at, kind)
    if value is None or isinstance(value, (bool, int, float)):
        return value
    return Unknown("...", at[0])


def as_text(value: Value, at: At) -> Text:
    """Return a value as a part of a text: what is unknown as a stand-in."""
    if isinstance(value, Text):
        return value
    if isinstance(value, Unknown):
        return Text(f"{{{value.why}}}", at, value)
    if isinstance(value, External):
        return Text(f"{{{value.name}}}", at, Unknown(value.name, at[0]))
    if isinstance(value, (GraphHandle, NodeHandle, PrimHandle)):
        return Text(value.path, at)
    if value is None or isinstance(value, (bool, int, float)):
        return Text(str(value), at)
    return Text("{...}", at, Unknown("...", at[0]))


def concatenated(parts: list[Text], at: At) -> Value:
    """Return texts one after the other."""
    if sum(len(part.text) for part in parts) > MOST_LETTERS:
        return Unknown("a long text", at[0])
    return Text(
        "".join(part.text for part in parts),
        at,
        next((part.unknown for part in parts if part.unknown), None),
    )
