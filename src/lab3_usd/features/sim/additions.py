"""What other features add to `lab3 sim`: options, and what is done where they are given."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from msgspec import Struct

from lab3_usd.commands.shared.options import Option, all_of, made_of
from lab3_usd.hooks import added_to

if TYPE_CHECKING:
    from lab3_usd.sim.outcome import DryRun
    from lab3_usd.spec.lab import Lab


class SimOptions(Struct, frozen=True):
    """How a stage is played, and what is made of it.

    `drive` is a file or legs; commands go to the robots that subscribe to `topic`.
    """

    checkpoint: str | None
    drive: str | None
    topic: str | None
    maps: Path | None
    form: str
    release: str | None
    assets: tuple[str, ...]
    page: Path | None


class SimAddition(Struct, frozen=True):
    """The record of the options that one feature adds, and what these do: nothing by themselves."""

    def refuse(self, asked: SimOptions) -> None:
        """Refuse what does not go together, before anything is played.

        Raises:
            UsageError: options do not go together, or an extra is not installed.
        """

    def plays_instead(self, _stage: Path, _lab: Lab, _checkpoint: str, _topic: str) -> bool:
        """Play the stage in place of judging it; whether it does."""
        return False

    def lines_after(self, _run: DryRun, _lab: Lab) -> Iterator[str]:
        """Make something of a run that was judged, and yield lines about it."""
        return iter(())


def additions_to_sim() -> Option:
    """Hand the options that features add to `lab3 sim` over as one record of each."""
    modules = added_to("sim")
    fields = {module.Added: module.Added.__struct_fields__ for module in modules}

    def added(**values: Any) -> tuple[SimAddition, ...]:
        return tuple(
            record(**{name: values[name] for name in names}) for record, names in fields.items()
        )

    names = [name for own in fields.values() for name in own]
    return all_of(*(module.OPTIONS for module in modules), made_of("added", names, added))
