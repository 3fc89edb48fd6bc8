"""A mapping that is unpacked entry by entry: most stages need few of all node types."""

from __future__ import annotations

import pickle
from collections.abc import Iterator, Mapping
from typing import Generic, TypeVar

_Entry = TypeVar("_Entry")


class Packed(Mapping[str, _Entry], Generic[_Entry]):
    """A mapping whose entries are unpacked when they are first asked for."""

    def __init__(self, packed: Mapping[str, bytes]) -> None:
        """Hold entries that `pack` made."""
        self._packed = packed
        self._entries: dict[str, _Entry] = {}

    def __getitem__(self, name: str) -> _Entry:
        """Return an entry, always the same object for a name.

        Raises:
            KeyError: there is none.
        """
        found = self._entries.get(name)
        if found is None:
            found = self._entries[name] = pickle.loads(self._packed[name])  # noqa: S301 - as trusted as its file
        return found

    def get(self, name: str, default: _Entry | None = None) -> _Entry | None:  # type: ignore[override]
        """Return an entry as above, else the default."""
        found = self._entries.get(name)
        return self[name] if found is None and name in self._packed else found or default

    def __contains__(self, name: object) -> bool:
        """Whether there is an entry, which stays packed."""
        return name in self._packed

    def __iter__(self) -> Iterator[str]:
        """Iterate over the names."""
        return iter(self._packed)

    def __len__(self) -> int:
        """Count the entries."""
        return len(self._packed)

    def __reduce__(self) -> tuple[object, ...]:
        """Be pickled packed."""
        return Packed, (self._packed,)


def pack(entries: Mapping[str, _Entry]) -> Packed[_Entry]:
    """Return a mapping that keeps its entries packed."""
    return Packed({name: pickle.dumps(entry, protocol=5) for name, entry in entries.items()})
