"""What the core asks of the features, each of which is imported when it is first used.

The core builds, checks, lints and repairs stages (see docs/architecture.md). It imports no feature,
not even inside a function: it calls `features.NAME`, and `_HOMES` says which module has that.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from lab3_usd.commands.diff import changes_to
    from lab3_usd.commands.sim import with_dry_run
    from lab3_usd.grade.gradebook import grade_of
    from lab3_usd.grade.intake.lab_archive import unpacked_lab
    from lab3_usd.grade.untrusted import find_untrusted, judge_untrusted
    from lab3_usd.report.html.live_page import (
        end_live_page,
        refuse_foreign_script,
        write_live_page,
    )
    from lab3_usd.sim.bag.submitted import read_recordings
    from lab3_usd.sim.effects import effects_of

_HOMES = {
    "changes_to": "lab3_usd.commands.diff",  # fix --diff of a binary stage
    "effects_of": "lab3_usd.sim.effects",  # fix: whether a repair ends something
    "end_live_page": "lab3_usd.report.html.live_page",  # --watch --format html
    "find_untrusted": "lab3_usd.grade.untrusted",  # check --untrusted
    "grade_of": "lab3_usd.grade.gradebook",  # --format gradescope
    "judge_untrusted": "lab3_usd.grade.untrusted",  # check --untrusted
    "read_recordings": "lab3_usd.sim.bag.submitted",  # recordings in a submission
    "refuse_foreign_script": "lab3_usd.report.html.live_page",  # --watch --format html
    "unpacked_lab": "lab3_usd.grade.intake.lab_archive",  # --lab ZIP
    "with_dry_run": "lab3_usd.commands.sim",  # check --sim
    "write_live_page": "lab3_usd.report.html.live_page",  # --watch --format html
}

__all__ = [
    "changes_to",
    "effects_of",
    "end_live_page",
    "find_untrusted",
    "grade_of",
    "judge_untrusted",
    "read_recordings",
    "refuse_foreign_script",
    "unpacked_lab",
    "with_dry_run",
    "write_live_page",
]

if not TYPE_CHECKING:  # mypy follows the imports above

    def __getattr__(name: str) -> Any:
        """Import a function of a feature."""
        if name not in _HOMES:
            raise AttributeError(f"module 'lab3_usd.features' has no attribute '{name}'")
        return getattr(importlib.import_module(_HOMES[name]), name)
