"""A contradiction in the description of a lab: its file, its key, and the other place."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches
from typing import Literal

from msgspec import Struct


class LabFault(Struct, frozen=True):
    """One thing that is wrong in the description of a lab.

    `key` leads to the value in `file`, `other` is the place that it contradicts. With an error the
    lab is refused; a warning says what is left out.
    """

    file: str
    key: str
    message: str
    other: str = ""
    severity: Literal["error", "warning"] = "error"

    def __str__(self) -> str:
        """Write the fault in one line."""
        other = f" ({self.other})" if self.other else ""
        return f"{self.file}: {self.key}: {self.message}{other}"


def nearest(name: str, known: Iterable[str]) -> str | None:
    """Return the known name that was likely meant, None where none is like it."""
    return next(iter(get_close_matches(name, tuple(known), 1)), None)
