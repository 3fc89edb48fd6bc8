"""The rule about what a checkpoint takes out of the stages."""

from __future__ import annotations

from collections.abc import Iterator

from lab3_usd.check.match.rule_inputs import StageSubject
from lab3_usd.check.registry import Demand, rule
from lab3_usd.model.changes import RemovePrim
from lab3_usd.model.finding import Problem
from lab3_usd.spec.lab import Checkpoint, Lab


def _absences(lab: Lab, checkpoint: Checkpoint) -> Iterator[Demand]:
    for path in checkpoint.removed:
        handout = lab.scene.stage.handout
        yield Demand(f"Scene/removed{path}", f"{path} is removed", path, handout, part="world")


@rule("S35", "not-removed", scope="stage", demands=_absences, needs="removals")
def not_removed(subject: StageSubject) -> Iterator[Problem]:
    """A prim is there that a checkpoint takes away.

    Why: the handout asks to delete it. What stays there goes on to publish, to move or to be seen.

    Fix: delete the prim in the Stage panel.

    Example: `{next_graph}`, which a later part replaces.
    """
    for path in subject.checkpoint.removed:
        prim = subject.stage.prim(path)
        if prim is not None:
            yield Problem(
                path,
                f"{path} is there, expected to be removed",
                expected="removed",
                actual=prim.type or "a prim",
                handout=subject.lab.scene.stage.handout,
                fix=(RemovePrim(path),),
                unmet=(f"Scene/removed{path}",),
            )
