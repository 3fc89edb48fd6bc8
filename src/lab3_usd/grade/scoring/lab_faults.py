"""What rubric and checklists of a lab name that its checkpoints do not ask for, and leave out."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from fnmatch import fnmatchcase

from lab3_usd.check.registry import all_rules
from lab3_usd.errors import SpecError
from lab3_usd.grade.scoring.load_rubric import everything_asked, load_rubric
from lab3_usd.grade.scoring.rubric import Rubric
from lab3_usd.model.finding import Requirement
from lab3_usd.spec.files import CHECKPOINTS, RUBRIC, SUBMISSION
from lab3_usd.spec.lab import Lab
from lab3_usd.spec.lint.fault import LabFault
from lab3_usd.spec.lint.sections import RULES
from lab3_usd.spec.submission import ChecklistSpec

_Asked = Mapping[str, tuple[Requirement, ...]]


def scoring_faults(lab: Lab) -> Iterator[LabFault]:
    """Yield what is wrong with the points and checklists of a lab, and what they leave out."""
    for rule in lab.handout.rules:
        if rule not in all_rules():
            yield LabFault(
                CHECKPOINTS, f"{RULES}: {rule}", "there is no such rule", "see lab3 rules"
            )
    asked = everything_asked(lab)
    yield from _checklist_faults(lab, asked[lab.last])
    if not (lab.folder / RUBRIC).is_file():
        message = "is missing, so that lab3 grade needs --rubric"
        yield LabFault(RUBRIC, "items", message, severity="warning")
        return
    try:
        rubric = load_rubric(lab.folder / RUBRIC, lab)
    except SpecError as error:
        key, _, message = str(error).removeprefix(f"{RUBRIC}: ").rpartition(": ")
        yield LabFault(RUBRIC, key or "items", message)
        return
    yield from _sections_without_points(lab, rubric, asked)


def _checklist_faults(lab: Lab, asked: tuple[Requirement, ...]) -> Iterator[LabFault]:
    for line in lab.submission.checklist:
        key = f"checklist: {line.section}: '{line.text}'"
        for pattern in line.requirements:
            if not any(fnmatchcase(each.id, pattern) for each in asked):
                message = f"'{pattern}' fits no requirement of checkpoint {lab.last}"
                groups = ", ".join(dict.fromkeys(each.group for each in asked))
                yield LabFault(SUBMISSION, f"{key}: requirements", message, f"groups: {groups}")
        for rule in line.rules:
            if rule not in all_rules():
                message = f"there is no rule {rule}"
                yield LabFault(SUBMISSION, f"{key}: rules", message, "see lab3 rules")


def _sections_without_points(lab: Lab, rubric: Rubric, asked: _Asked) -> Iterator[LabFault]:
    """Yield the sections of which no item counts any requirement."""
    lines = {line.text: line for line in lab.submission.checklist}
    paid = {each.handout for counted in rubric.asked.values() for each in counted}
    for item in rubric.items:
        line = lines.get(item.checklist)
        paid |= _sections_of(line, asked[lab.last]) if line is not None else set()
    first: dict[str | None, tuple[str, Requirement]] = {}
    for checkpoint, requirements in asked.items():
        for each in requirements:
            first.setdefault(each.handout, (checkpoint, each))
    for section, (checkpoint, requirement) in first.items():
        if section not in paid:
            message = f"no item counts section {section} of the handout"
            other = f"checkpoint {checkpoint} asks for {requirement.id}"
            yield LabFault(RUBRIC, "items", message, other, "warning")


def _sections_of(line: ChecklistSpec, asked: tuple[Requirement, ...]) -> set[str | None]:
    return {
        each.handout
        for each in asked
        if any(fnmatchcase(each.id, pattern) for pattern in line.requirements)
    }
