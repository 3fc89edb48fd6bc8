"""A stage that is being edited in memory, in its root layer alone."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

from msgspec import Struct

from lab3_usd.check.lint import lint
from lab3_usd.check.match.rule_inputs import LintSubject
from lab3_usd.check.registry import Parameters
from lab3_usd.errors import StageError
from lab3_usd.files import FileState
from lab3_usd.fix.text_editor import new_bytes
from lab3_usd.isaac.platform import Platform
from lab3_usd.model.changes import Edit
from lab3_usd.model.finding import Finding, ordered, site_of
from lab3_usd.model.stage import StageModel
from lab3_usd.pipeline.any_stage import lint_platform
from lab3_usd.stage.edit.repairs import apply_edit
from lab3_usd.stage.edit.session import EditSession, open_for_edits
from lab3_usd.stage.read.properties import release_start_values
from lab3_usd.stage.read.stage_reader import read_model


class Editing(Struct, eq=False):
    """An open stage to which graphs are added, in its root layer alone.

    `state` is its file as it was read, `parameters` are those of the rules that judge it.
    """

    path: Path
    state: FileState
    session: EditSession
    platform: Platform
    model: StageModel
    parameters: Parameters = ()

    @classmethod
    def begin(cls, path: Path, release: str, parameters: Parameters = ()) -> Editing:
        """Open a stage and begin to edit it.

        Raises:
            StageError: it cannot be opened or edited.
            UsageError: the release is not known.
        """
        stage, state = open_for_edits(path)
        platform = lint_platform(release)
        session = EditSession(stage, platform, root_only=True)
        model = read_model(stage, platform, str(path))
        return cls(path, state, session, platform, model, parameters)

    def close(self) -> None:
        """Leave the layers of the stage as they were."""
        release_start_values(self.session.stage)
        self.session.close()

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

    def new_root(self) -> bytes | None:
        """Return the new bytes of the root layer, None where they are the old ones."""
        edited = next(iter(self.session.edited.values()), None)
        data = None if edited is None else new_bytes(edited, self.state.content)
        return None if data == self.state.content else data


def new_since(before: Iterable[Finding], after: Iterable[Finding]) -> list[Finding]:
    """Return the errors and warnings that were not there before."""
    earlier = {site_of(finding) for finding in before}
    return [each for each in after if each.severity != "note" and site_of(each) not in earlier]
