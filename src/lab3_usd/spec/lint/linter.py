"""Holds the files of a lab against each other, and names those that nothing reads."""

from __future__ import annotations

from collections.abc import Iterator

from lab3_usd.errors import SpecError
from lab3_usd.spec.files import CATALOG, CHECKPOINTS, ROS, RUBRIC, SCENE, STARTER, SUBMISSION
from lab3_usd.spec.lab import Lab
from lab3_usd.spec.lint.checkpoint_ids import checklist_faults, checkpoint_faults
from lab3_usd.spec.lint.fault import LabFault
from lab3_usd.spec.lint.frames import frame_faults
from lab3_usd.spec.lint.graph_names import file_of
from lab3_usd.spec.lint.rubric import rubric_faults
from lab3_usd.spec.lint.sections import section_faults
from lab3_usd.spec.lint.topics import topic_faults

_FIXED = (CATALOG, CHECKPOINTS, ROS, RUBRIC, SCENE, STARTER, SUBMISSION)


def lab_faults(lab: Lab) -> Iterator[LabFault]:
    """Yield what contradicts itself in the description of a lab, and what is left out.

    Raises:
        SpecError: the rubric is no YAML.
    """
    yield from checkpoint_faults(lab)
    yield from checklist_faults(lab)
    yield from frame_faults(lab)
    yield from topic_faults(lab)
    yield from rubric_faults(lab)
    yield from section_faults(lab)
    yield from _unused_files(lab)


def refuse_faulty(lab: Lab) -> None:
    """Refuse a lab that contradicts itself.

    Raises:
        SpecError: it does; the line names file, key and both places of the first contradiction.
    """
    errors = [each for each in lab_faults(lab) if each.severity == "error"]
    if errors:
        more = f"; and {len(errors) - 1} more, see lab3 lab check" if len(errors) > 1 else ""
        message = f"{errors[0]}{more}"
        raise SpecError(message)


def _unused_files(lab: Lab) -> Iterator[LabFault]:
    """Yield the YAML files that no checkpoint asks for."""
    used = {*_FIXED, *(file_of(graph) for graph in lab.graphs.values())}
    for path in sorted(lab.folder.glob("*.yaml")):
        if path.name not in used:
            message = "no checkpoint adds this graph"
            yield LabFault(path.name, "graph", message, f"{CHECKPOINTS}: checkpoints", "warning")
