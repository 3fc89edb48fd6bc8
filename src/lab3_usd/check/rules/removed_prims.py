"""The rule about what a checkpoint takes out of the stages."""

from __future__ import annotations

from collections.abc import Iterator

from lab3_usd.check.match.rule_inputs import StageSubject
from lab3_usd.check.registry import Demand, rule
from lab3_usd.model.changes import RemovePrim
from lab3_usd.model.finding import Problem
from lab3_usd.spec.lab import Checkpoint, Lab, Removal


def _absences(lab: Lab, checkpoint: Checkpoint) -> Iterator[Demand]:
    for gone in checkpoint.removals:
        name, title = f"Scene/removed{gone.path}", f"{gone.path} is removed"
        yield Demand(name, title, gone.path, _section(gone, lab), part="world")


def _section(gone: Removal, lab: Lab) -> str:
    return gone.handout or lab.handout.behind("S35", lab.scene.stage.handout)


@rule("S35", "not-removed", scope="stage", demands=_absences, needs="removals")
def not_removed(subject: StageSubject) -> Iterator[Problem]:
    """A prim that a checkpoint removes is still there.

    Why: the handout asks to delete it. What stays there goes on to publish, to move or to be seen.

    Fix: delete the prim in the Stage panel.

    Example: `{next_graph}`, which a later part replaces.
    """
    for gone in subject.checkpoint.removals:
        path, prim = gone.path, subject.stage.prim(gone.path)
        if prim is not None:
            yield Problem(
                path,
                f"{path} is there, expected to be removed",
                expected="removed",
                actual=prim.type or "a prim",
                handout=_section(gone, subject.lab),
                fix=(RemovePrim(path),),
                unmet=(f"Scene/removed{path}",),
            )
