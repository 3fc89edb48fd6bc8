"""What was read of the stages before: a prim that is written as it was is not read again."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TypeVar

from msgspec import Struct, field
from pxr import Usd

from lab3_usd.stage.opening import remembered
from lab3_usd.stage.own_text import texts_of

_T = TypeVar("_T")


class Entry(Struct, frozen=True, eq=False):
    """A prim that was read: its own text, the entry of its parent then, and what was read.

    What is read of a prim depends on the prim and on its ancestors, and on nothing else. So the
    same text below the same entry gives the same again.
    """

    text: str
    parent: Entry | None
    read: Any


class Before(Struct, frozen=True):
    """The entries of earlier stages, and those that hold for the stage that is being read."""

    texts: Mapping[str, str]
    entries: dict[str, Entry]
    here: dict[str, Entry] = field(default_factory=dict)

    def read(self, path: str) -> Any:  # noqa: ANN401 - whatever was kept
        """Return what was read of the prim at `path`, None where it has to be read."""
        entry = self.entries.get(path)
        if entry is None or entry.text != self.texts.get(path):
            return None
        parent = path.rpartition("/")[0]
        if parent and (entry.parent is None or self.here.get(parent) is not entry.parent):
            return None
        self.here[path] = entry
        return entry.read

    def keep(self, path: str, read: _T) -> _T:
        """Keep what was read of the prim at `path` for the stages to come, and return it."""
        parent = path.rpartition("/")[0]
        text, above = self.texts.get(path), self.here.get(parent)
        if text is not None and (above is not None or not parent):
            self.here[path] = self.entries[path] = Entry(text, above, read)
        return read


def before(stage: Usd.Stage) -> Before:
    """Return what was read before `stage`; nothing where no stage stays open."""
    return Before(texts_of(stage), remembered("prims", dict))
