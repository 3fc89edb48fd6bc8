"""Random text layers in every layout that USD allows, and what a random edit does to their text."""

from __future__ import annotations

import random
import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from fixing import own_texts
from pxr import Sdf

from lab3_usd.fix.text_editor import new_text
from lab3_usd.isaac.values import Value
from lab3_usd.model.changes import (
    Activate,
    ApplySchema,
    ClearValue,
    Connect,
    Edit,
    MovePrim,
    RemovePrim,
    RemoveSchema,
    RenameProperty,
    Retarget,
    SetValue,
)
from lab3_usd.spec.load.loader import load_lab
from lab3_usd.stage.edit.repairs import apply_edit
from lab3_usd.stage.edit.session import EditSession
from lab3_usd.stage.read.opening import open_stage, quiet

TYPES = {
    "int": ("1", "-7"),
    "double": ("0.5", "1e-3", "inf"),
    "float": ("2.25", "-0"),
    "bool": ("1", "true", "false"),
    "token": ('"a"', "'b'", '"with # hash"'),
    "string": ('"x"', '"""two\nlines { def "No" ( """', "'''# not a comment'''", r'"a\"b;"'),
    "float3": ("(1, 2, 3)", "( 0.5,0.5 , 1 )"),
    "int[]": ("[]", "[1, 2]", "[1,\n  2, # inside\n  3]"),
    "asset": ("@./a.usd@", "@@@odd@name@@@", "@http://x/y#z@"),
    "token[]": ('["a", "b"]',),
}
VALUES: dict[str, Value] = {
    "int": 42, "double": 0.025, "float": 1.5, "bool": True, "token": "set",
    "string": "it's \"set\"", "float3": (7.0, 8.0, 9.0), "int[]": (4, 5), "token[]": ("c",),
}  # fmt: skip
SCHEMAS = ("PhysicsMassAPI", "PhysicsRigidBodyAPI", "NodeGraphNodeAPI")


@dataclass
class Layer:
    """A text layer, and what is in it: properties by prim, with their types."""

    text: str = ""
    prims: dict[str, dict[str, str]] = field(default_factory=dict)


class Writer:
    """Writes one layer; every choice comes from the seed."""

    def __init__(self, seed: int) -> None:
        self.rng = random.Random(seed)  # noqa: S311 - the same on every run
        self.layer = Layer()
        self.step = self.rng.choice(("    ", "  ", "\t"))
        self.comments = 0

    def write(self) -> Layer:
        lines = ["#usda 1.0"]
        if self.rng.random() < 0.7:
            lines += ["(", f'{self.step}upAxis = "Z"{self.trailing()}', ")"]
        for number in range(self.rng.randint(1, 4)):
            lines += self.prim("", f"P{number}", 0)
        text = "\n".join(lines) + self.rng.choice(("\n", "\n\n", ""))
        has_strings = '"""' in text or "'''" in text
        self.layer.text = text if has_strings or self.rng.random() < 0.8 else crlf(text)
        return self.layer

    def comment(self) -> str:
        self.comments += 1
        return self.rng.choice(("# note {}", "/* note {} */", "#note {} def {{")).format(
            self.comments
        )

    def trailing(self) -> str:
        return f"  {self.comment()}" if self.rng.random() < 0.2 else ""

    def prim(self, parent: str, name: str, depth: int) -> list[str]:
        path, indent = f"{parent}/{name}", self.step * depth
        self.layer.prims[path] = {}
        specifier = self.rng.choice(("def", "def", "def", "over"))
        kind = self.rng.choice(("", "Xform ", "Scope "))
        head = f'{indent}{specifier} {kind}"{name}"'
        before = [f"{indent}{self.comment()}"] if self.rng.random() < 0.3 else []
        body = self.statements(path, self.step * (depth + 1))
        if (
            depth == 2
            and self.rng.random() < 0.3
            and not any("\n" in each or "#" in each or "/*" in each for each in body)
        ):
            return [*before, head + " { " + "".join(f"{each.strip()} ; " for each in body) + "}"]
        opening = self.metadata(head, indent)
        opening[-1] += self.rng.choice((" {", f"\n{indent}{{", f" {{ {self.comment()}\n"))
        for number in range(self.rng.randint(0, 2) if depth < 2 else 0):
            body += ["", *self.prim(path, f"C{number}", depth + 1)]
        if self.rng.random() < 0.15:
            body += self.variants(indent + self.step)
        return [*before, *opening, *body, f"{indent}}}{self.trailing()}"]

    def metadata(self, head: str, indent: str) -> list[str]:
        entries = []
        if self.rng.random() < 0.3:
            names = ", ".join(
                f'"{each}"' for each in self.rng.sample(SCHEMAS, self.rng.randint(1, 2))
            )
            entries.append(f"{self.rng.choice(('prepend ', '', 'append '))}apiSchemas = [{names}]")
        if self.rng.random() < 0.2:
            entries.append("active = false")
        if self.rng.random() < 0.2:
            entries.append('doc = """about ( this\n } """')
        if self.rng.random() < 0.2:
            entries.append('customData = {\n  string a = "}" # inside\n  dictionary b = {}\n}')
        if not entries:
            return [head]
        if len(entries) == 1 and "\n" not in entries[0] and self.rng.random() < 0.4:
            return [f"{head} ({entries[0]})"]
        lines = [f"{indent}{self.step}{entry}{self.trailing()}" for entry in entries]
        return [f"{head} (", *lines, f"{indent})"]

    def variants(self, indent: str) -> list[str]:
        return [
            f'{indent}variantSet "look" = {{',
            f'{indent}{self.step}"red" {{ int inner = 1; }}',
            f'{indent}{self.step}"blue" {{',
            f"{indent}{self.step * 2}int inner = 2 {self.comment()}",
            f"{indent}{self.step}}}",
            f"{indent}}}",
        ]

    def statements(self, path: str, indent: str) -> list[str]:
        lines: list[str] = []
        for number in range(self.rng.randint(0, 6)):
            name = f"{self.rng.choice(('', 'inputs:', 'a:b:'))}p{number}"
            if self.rng.random() < 0.2:
                lines += self.relationship(path, name)
            else:
                lines += self.attribute(path, name)
            if self.rng.random() < 0.15:
                lines.append(self.comment())
        return [f"{indent}{line}" for line in lines]

    def relationship(self, path: str, name: str) -> list[str]:
        self.layer.prims[path][name] = "rel"
        edit, empty = self.rng.choice((("", ("[]", "None")), ("prepend ", ()), ("custom ", ())))
        paths = self.rng.choice(("</P0>", "[</P0>, </P1/C0>]", *empty))
        return [f"{edit}rel {name} = {paths}{self.trailing()}"]

    def attribute(self, path: str, name: str) -> list[str]:
        kind = self.rng.choice([*TYPES])
        self.layer.prims[path][name] = kind
        words = f"{self.rng.choice(('', 'custom ', 'uniform '))}{kind}"
        gap = self.rng.choice((" ", "  "))
        value = self.rng.choice(
            ("", f" = {self.rng.choice(TYPES[kind])}", f"={self.rng.choice(TYPES[kind])}")
        )
        meta = self.rng.choice(
            (
                "",
                "",
                "",
                " (\n  customData = {\n    bool isExecution = 1 # why\n  }\n)",
                ' (doc = "x")',
            )
        )
        found = [f"{words}{gap}{name}{value}{meta}{self.trailing()}"]
        if words.startswith("uniform "):
            return found
        if self.rng.random() < 0.2:
            edit = self.rng.choice(("", "prepend ", "append "))
            paths = self.rng.choice(("</P0.p0>", "[</P0.p0>, </P0/C0.p1>]"))
            found.append(f"{edit}{kind} {name}.connect = {paths}{self.trailing()}")
        if kind in {"int", "double"} and self.rng.random() < 0.1:
            found.append(f"{kind} {name}.timeSamples = {{\n  0: 1, # at the start\n  2: 5\n}}")
        return found


def crlf(text: str) -> str:
    return text.replace("\n", "\r\n")


def random_layer(seed: int) -> Layer:
    """Return a layer of USD text that is in nobody's layout."""
    return Writer(seed).write()


def random_edits(layer: Layer, seed: int) -> Iterator[Edit]:
    """Yield a few edits of a layer, of what is there and of what is not."""
    rng = random.Random(seed)  # noqa: S311 - the same on every run
    for _ in range(rng.randint(1, 4)):
        prim = rng.choice([*layer.prims])
        name, kind = rng.choice([*layer.prims[prim].items(), ("inputs:new", "double")])
        if kind == "rel":
            yield Retarget(prim, name, rng.choice(((), ("/P0",), ("/P0/C0", "/P1"))))
            continue
        typed = kind if kind in VALUES else "double"
        yield rng.choice(
            (
                SetValue(prim, name, typed, VALUES[typed]),
                SetValue(prim, name, "token", "typed"),
                SetValue(prim, name, typed, VALUES[typed]),
                ClearValue(prim, name),
                RenameProperty(prim, name, "inputs:renamed"),
                Connect(prim, name, typed, rng.choice(((), ("/P0.p0",)))),
                ApplySchema(prim, rng.choice(SCHEMAS)),
                RemoveSchema(prim, rng.choice(SCHEMAS)),
                Activate(prim),
                RemovePrim(prim),
                MovePrim(prim, f"{prim}x"),
                MovePrim(prim, rng.choice(("/P0/moved", "/moved"))),
            )
        )


_NOTE = re.compile(r"note \d+")


@quiet()
def fault_of(seed: int, folder: Path) -> str | None:
    """Edit one random layer; return what went wrong, None where all is well.

    Raises:
        StageError: the layer is none.
    """
    layer = random_layer(seed)
    path = folder / f"layer{seed}.usda"
    path.write_bytes(layer.text.encode())
    session = EditSession(open_stage(path), load_lab().platform)
    edits = []
    try:
        for edit in random_edits(layer, seed):
            if session.stands(edit.prim):
                apply_edit(session, edit)
                edits.append(edit)
        for edited in session.edited.values():
            text = new_text(layer.text, edited)
            wanted = content(edited.layer)
            found = _fault(layer, text, wanted, edits)
            if found:
                return f"{found}: {edits}"
    finally:
        session.close()
        path.unlink()
    return None


def _fault(layer: Layer, text: str, wanted: dict[str, Any], edits: list[Edit]) -> str | None:
    try:
        written = Sdf.Layer.CreateAnonymous(".usda")
        is_read = written.ImportFromString(text)
    except Exception as error:  # noqa: BLE001 - usd-core's own kinds
        return f"is not read: {error}"
    if not is_read:
        return "is not read"
    actual = content(written)
    if actual != wanted:
        paths = sorted(p for p in {*actual, *wanted} if actual.get(p) != wanted.get(p))
        return f"says otherwise at {paths[:3]}"
    return _elsewhere(layer, text, edits) or _lost_comment(layer, text, edits)


def content(layer: Sdf.Layer) -> dict[str, dict[str, str]]:
    """Everything that a layer says, by path, in no order."""
    found: dict[str, dict[str, str]] = {}

    def add(path: Sdf.Path) -> None:
        spec = layer.GetObjectAtPath(path)
        if isinstance(spec, (Sdf.PrimSpec, Sdf.PropertySpec)):
            found[str(path)] = {key: str(spec.GetInfo(key)) for key in spec.ListInfoKeys()}

    layer.Traverse(Sdf.Path.absoluteRootPath, add)
    return found


def _elsewhere(layer: Layer, text: str, edits: list[Edit]) -> str | None:
    """Name a prim whose own text changed though no edit names it."""
    if any(isinstance(edit, MovePrim) for edit in edits):
        return None
    named = {edit.prim for edit in edits}
    before, after = own_texts(layer.text), own_texts(text)
    for path in before.keys() & after.keys():
        if path not in named and before[path] != after[path]:
            return f"changed {path}"
    return None


def _lost_comment(layer: Layer, text: str, edits: list[Edit]) -> str | None:
    """Name a comment that went away with nothing that was removed."""
    if any(isinstance(edit, RemovePrim) for edit in edits):
        return None
    lost = Counter(_NOTE.findall(layer.text)) - Counter(_NOTE.findall(text))
    return f"lost {[*lost]}" if lost else None
