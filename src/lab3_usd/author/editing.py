"""A stage that is being edited in memory, in its root layer alone."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from msgspec import Struct

from lab3_usd.check.lint import lint
from lab3_usd.check.match.rule_inputs import LintSubject
from lab3_usd.check.registry import Parameters
from lab3_usd.errors import StageError
from lab3_usd.files import FileState
from lab3_usd.fix.text_editor import new_bytes
from lab3_usd.isaac.platform import Platform
from lab3_usd.model.changes import Edit
from lab3_usd.model.finding import Finding, ordered
from lab3_usd.model.stage import StageModel
from lab3_usd.pipeline.any_stage import lint_platform
from lab3_usd.stage.edit.repairs import apply_edit
from lab3_usd.stage.edit.session import EditSession
from lab3_usd.stage.read.properties import release_start_values
from lab3_usd.stage.read.stage_reader import read_model


class Editing(Struct, eq=False):
    """An open stage to which graphs are added, in its root layer alone."""

    path: Path
    session: EditSession
    platform: Platform
    model: StageModel
    parameters: Parameters = ()

    @classmethod
    def begin(cls, path: Path, stage: Any, release: str, parameters: Parameters = ()) -> Editing:
        """Begin to edit an open stage, which rules with these parameters judge.

        Raises:
            UsageError: the release is not known.
        """
        platform = lint_platform(release)
        session = EditSession(stage, platform, root_only=True)
        model = read_model(stage, platform, str(path))
        return cls(path, session, platform, model, parameters)

    def findings(self) -> tuple[Finding, ...]:
        """Return what the linter finds now.

        Raises:
            StageError: a rule failed.
        """
        results = lint(LintSubject(self.model, parameters=self.parameters))
        if results.crashes:
            crash = results.crashes[0]
            raise StageError(f"{self.path}: rule {crash.rule} failed: {crash.error}")
        return tuple(ordered(results.findings))

    def edit(self, edits: Sequence[Edit]) -> None:
        """Make edits and read the stage again."""
        release_start_values(self.session.stage)
        for edit in edits:
            apply_edit(self.session, edit)
        self.model = read_model(self.session.stage, self.platform, str(self.path))

    def new_root(self, state: FileState) -> bytes | None:
        """Return the new bytes of the root layer, None where they are the old ones."""
        edited = next(iter(self.session.edited.values()), None)
        data = None if edited is None else new_bytes(edited, state.content)
        return None if data == state.content else data
