"""What a lab says of its handout: the sections, and which of them stand behind rules."""

from __future__ import annotations

from collections.abc import Mapping

from msgspec import Struct


class Handout(Struct, frozen=True, forbid_unknown_fields=True):
    """The sections of the handout: how many each part has, and those that ask for nothing here.

    `rules` names the section behind a rule, for findings about what no item of the lab names.
    """

    sections: Mapping[str, int] = {}
    by_hand: tuple[str, ...] = ()
    rules: Mapping[str, str] = {}

    @property
    def names(self) -> tuple[str, ...]:
        """Name every section."""
        return tuple(
            f"{part}{number}"
            for part, count in self.sections.items()
            for number in range(1, count + 1)
        )
