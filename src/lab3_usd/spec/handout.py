"""What a lab says of its handout: the sections, and which of them stand behind rules."""

from __future__ import annotations

from collections.abc import Mapping

from msgspec import Struct


class Handout(Struct, frozen=True, forbid_unknown_fields=True):
    """The sections of the handout: how many each part has, and those that ask for nothing here.

    They are called A1 of a part A, 4.1 of a part 4, and Ex 4.1 of a part Ex 4.
    `rules` names the section behind a rule, for findings about what no item of the lab names.
    """

    sections: Mapping[str, int] = {}
    by_hand: tuple[str, ...] = ()
    rules: Mapping[str, str] = {}

    @property
    def names(self) -> tuple[str, ...]:
        """Name every section."""
        return tuple(
            f"{lead}{number}"
            for lead, count in zip(self.leads.values(), self.sections.values(), strict=True)
            for number in range(1, count + 1)
        )

    def behind(self, rule: str, item: str) -> str:
        """Return the section behind a rule, that of its item where the lab names none."""
        return self.rules.get(rule, item)

    @property
    def leads(self) -> dict[str, str]:
        """What the names of the sections of each part begin with."""
        return {part: f"{part}." if part[-1:].isdigit() else part for part in self.sections}
