"""Turns what the stages of a submission fail into points: the same faults, the same grade.

An item is judged in the stage of its checkpoint. What that stage fails takes shares of the item;
points never leave the total, and fewer faults never earn less.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Literal, NamedTuple

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.grade.adjustments import WHOLE, Adjustment
from lab3_usd.grade.rubric import Cap, Item, Rubric, fits_name
from lab3_usd.model.finding import ChecklistItem, Finding, Requirement, StageResult, is_among
from lab3_usd.model.grade import ADJUSTED, REMARK
from lab3_usd.report.entries import plural
from lab3_usd.spec.submission import named_checkpoint

State = Literal["full", "part", "none", "missing", "unreadable", "blocked", "open"]
DRY_RUN = "dry run"
_OF_NODES = ("node", "setting", "wire", "target")
_NOTHING: Mapping[str, Adjustment] = {}


class Fault(Struct, frozen=True):
    """An error as points see it.

    It takes from the requirements that it fails (`unmet`), else from the `parts` it is about.
    `place` is a line of a file, else the prim or file.
    """

    rule: str
    message: str
    place: str
    unmet: tuple[str, ...] = ()
    parts: tuple[str, ...] = ()


class StageFacts(Struct, frozen=True):
    """What a grade needs to know of a stage, under any rubric.

    `unmet` are the ids of the requirements that it fails, `slight` of those that it nearly meets,
    so that the robot does the same. `shown` is what a dry run shows to be wrong, by topic, check
    and kind of fault; a stage that is neither faulty nor warned about is not played.
    """

    checkpoint: str
    path: str
    readable: bool
    unmet: tuple[str, ...] = ()
    faults: tuple[Fault, ...] = ()
    shown: Mapping[str, str] = {}
    slight: tuple[str, ...] = ()
    is_warned_about: bool = False


class SubmissionFacts(Struct, frozen=True):
    """What a grade needs to know of a submission: its stages, its files, its checklists.

    `crashes` are the stages, by path, over which this program failed, and how: they earn nothing.
    """

    stages: tuple[StageFacts, ...] = ()
    faults: tuple[Fault, ...] = ()
    checklist: Mapping[str, str] = {}
    crashes: Mapping[str, str] = {}


class ItemGrade(Struct, frozen=True):
    """What one item earned, of how many points.

    `open` items are for a person to judge: nothing earned, nothing possible yet. `blocked` is of
    results of earlier releases, in which points could leave the total.
    """

    id: str
    state: State
    earned: float
    possible: float
    blocked: float = 0.0
    because: str = ""


class Deduction(Struct, frozen=True):
    """Points that an item lost, and why: those of an item add up to what it did not earn.

    `requirement` is the id of what is not met, `PART/error/RULE` for an error that fails none,
    and empty where the faults are named elsewhere. `found` is what the fault behind it says,
    `again` the earlier item that was judged again. Points that a grader adds by hand are negative.
    """

    item: str
    requirement: str
    title: str
    points: float = 0.0
    rule: str = ""
    place: str = ""
    found: str = ""
    again: str = ""


class Grade(Struct, frozen=True):
    """The points of one submission; `percent` is None where nothing could be judged.

    `days_late` are what the grader says, None where nothing is said.
    """

    items: tuple[ItemGrade, ...]
    lost: tuple[Deduction, ...]
    earned: float
    possible: float
    percent: float | None
    because: tuple[str, ...] = ()
    days_late: int | None = None


def facts_of(
    results: Iterable[StageResult],
    required: Mapping[str, Sequence[Requirement]],
    findings: Iterable[Finding] = (),
    checklist: Iterable[ChecklistItem] = (),
) -> SubmissionFacts:
    """Reduce the results of a submission, in whatever order they come, to what a grade needs.

    `findings` are those of the folder as a whole. One about the file of a stage is that stage's.
    """
    of_files = [_fault(finding) for finding in findings if finding.severity == "error"]
    by_checkpoint = _by_checkpoint(results)
    stages = []
    for number, result in sorted(by_checkpoint.items()):
        met = {requirement.id for requirement in result.requirements if requirement.met}
        own = [_fault(finding) for finding in result.findings if finding.severity == "error"]
        own += [fault for fault in of_files if fault.place == result.path]
        stage = StageFacts(
            checkpoint=number,
            path=result.path,
            readable=result.verdict != "unreadable",
            unmet=tuple(each.id for each in required.get(number, ()) if each.id not in met),
            faults=tuple(own),
            slight=tuple(item.id for item in result.requirements if item.slight),
            is_warned_about=any(finding.severity == "warning" for finding in result.findings),
        )
        stages.append(stage)
    paths = {stage.path for stage in stages}
    crashed = [result for result in by_checkpoint.values() if result.crashes]
    return SubmissionFacts(
        stages=tuple(stages),
        faults=tuple(fault for fault in of_files if fault.place not in paths),
        checklist={line.text: line.state for line in checklist},
        crashes={result.path: result.crashes[0].error for result in crashed},
    )


def _by_checkpoint(results: Iterable[StageResult]) -> dict[str, StageResult]:
    """Keep one result of each checkpoint: of several files the one that meets the least."""

    def order(result: StageResult) -> tuple[bool, float, str]:
        score = result.score
        share = (score.earned + score.not_judged) / score.possible if score.possible else 0.0
        is_judged = result.verdict != "unreadable" and not result.crashes
        return (is_judged, share, result.path)

    kept: dict[str, StageResult] = {}
    for result in sorted(results, key=order):
        kept.setdefault(result.checkpoint or "", result)
    return kept


def _fault(finding: Finding) -> Fault:
    place = finding.prim if finding.layer in {None, finding.prim} else str(finding.layer)
    if finding.line is not None:
        place = f"{place}:{finding.line}"
    return Fault(finding.rule, finding.message, place, finding.unmet, finding.costs)


def grade_facts(
    rubric: Rubric,
    facts: SubmissionFacts,
    by_hand: Mapping[str, Adjustment] = _NOTHING,
    *,
    late: bool = False,
) -> Grade:
    """Return the points for what is known of a submission.

    What a grader decides `by_hand` about an item changes no other item; being late limits the sum,
    and what is decided about the whole submission comes last.
    """
    stages = {stage.checkpoint: stage for stage in facts.stages}
    grades: dict[str, ItemGrade] = {}
    adjusted: dict[str, ItemGrade] = {}
    lost: list[Deduction] = []
    for item in rubric.items:
        if item.checklist:
            graded, losses = _by_checklist(item, facts.checklist.get(item.checklist, "not shown"))
        else:
            graded, losses = _by_stage(rubric, item, stages.get(item.checkpoint), facts, grades)
            graded, losses = _capped(rubric.caps, item, graded, losses, facts)
        grades[item.id] = graded
        if item.id in by_hand:
            adjusted[item.id], remark = _adjusted(item, graded, by_hand[item.id])
            lost.append(remark)
        lost += _in_cents(item, graded, losses)
    whole = by_hand.get(WHOLE)
    days = None if whole is None else whole.days
    late = late if days is None else days > 0
    total = _total(rubric, {**grades, **adjusted}, tuple(lost), late=late)
    if late and days is None and rubric.late.per_day:
        total = replace(total, because=(*total.because, "late, by how many days is not given"))
    return total if whole is None else _decided(rubric, total, whole)


def _decided(rubric: Rubric, total: Grade, by_hand: Adjustment) -> Grade:
    """Return the points of a submission with what a grader decided about it as a whole."""
    points, because = total.earned, list(total.because)
    if by_hand.days:
        points = max(0.0, points - by_hand.days * rubric.late.per_day * total.possible)
        because.append(f"late by {plural(by_hand.days, 'day')}, each {rubric.late.per_day:.0%}")
    if by_hand.points is not None:
        change = by_hand.points - (0.0 if by_hand.is_change else points)
        because.append(f"{ADJUSTED}{by_hand.text} ({change:+g} points)")
        points += change
    elif by_hand.text:
        because.append(f"{REMARK}{by_hand.text}")
    earned = total.earned if points == total.earned else _cents(max(0.0, points), total.possible)
    percent = _cents(100 * earned / total.possible, 100.0) if total.possible else None
    return replace(
        total, earned=earned, percent=percent, because=tuple(because), days_late=by_hand.days
    )


def _adjusted(item: Item, graded: ItemGrade, by_hand: Adjustment) -> tuple[ItemGrade, Deduction]:
    """Return the item with the points that a grader gives, and the line that says so."""
    if by_hand.points is None:
        return graded, Deduction(item.id, "", f"{REMARK}{by_hand.text}")
    points = by_hand.points + (graded.earned if by_hand.is_change else 0.0)
    earned = min(max(round(points, 2), 0.0), item.points)
    state: State = "full" if earned == item.points else "part" if earned else "none"
    because = f"{ADJUSTED}{by_hand.text}"
    lost = round(item.points - earned - (graded.possible - graded.earned), 2)
    return (
        ItemGrade(item.id, state, earned, item.points, because=because),
        Deduction(item.id, "", because, lost),
    )


class _Loss(NamedTuple):
    """A share of an item, and what took it."""

    share: float
    title: str
    requirement: str = ""
    rule: str = ""
    place: str = ""
    found: str = ""
    again: str = ""


def _by_checklist(item: Item, state: str) -> tuple[ItemGrade, list[_Loss]]:
    if state == "met":
        return ItemGrade(item.id, "full", item.points, item.points), []
    if state == "not met":
        loss = _Loss(1.0, f"not met: {item.checklist}")
        return ItemGrade(item.id, "none", 0.0, item.points), [loss]
    return ItemGrade(item.id, "open", 0.0, 0.0, because="for a person to judge"), []


def _by_stage(
    rubric: Rubric,
    item: Item,
    stage: StageFacts | None,
    facts: SubmissionFacts,
    grades: Mapping[str, ItemGrade],
) -> tuple[ItemGrade, list[_Loss]]:
    """Weigh what the stage of the item's checkpoint fails."""
    name = f"checkpoint {item.checkpoint}"
    if stage is not None and stage.path in facts.crashes:
        loss = _Loss(1.0, f"{name} is not judged: this program failed", name, place=stage.path)
        return ItemGrade(item.id, "unreadable", 0.0, item.points), [loss]
    if stage is None or not stage.readable:
        state: State = "missing" if stage is None else "unreadable"
        named = [
            fault
            for fault in facts.faults  # of files that are called as the stage
            if named_checkpoint(fault.place.rpartition("/")[2], rubric.files) == item.checkpoint
        ]
        causes = named[-1:] if stage is None else stage.faults[:1]  # what is said last says why
        rule, place = (causes[0].rule, causes[0].place) if causes else ("", "")
        loss = _Loss(1.0, f"{name} is {state}", name, rule, place)
        return ItemGrade(item.id, state, 0.0, item.points), [loss]
    losses = [*_blocking(rubric, item, stage, grades), *_own_losses(rubric, item, stage)]
    losses += _of_files(rubric, item, facts.faults)
    losses.sort(key=lambda loss: loss.share < 1)  # what takes the whole item comes first
    if item.partial or not rubric.asked[item.id]:
        losses += _earlier_losses(rubric, item, stage, _kept(item, losses))
    earned = _cents(item.points * _kept(item, losses), item.points)
    state = "full" if not losses else "part" if earned else "none"
    return ItemGrade(item.id, state, earned, item.points), losses


def _kept(item: Item, losses: Sequence[_Loss]) -> float:
    """Return the share that losses leave of an item."""
    if losses and not item.partial:
        return 0.0
    return max(0.0, 1.0 - sum(loss.share for loss in losses))


def _cents(points: float, whole: float) -> float:
    """Round points to cents; what is less than the whole never shows as the whole."""
    rounded = round(points, 2)
    return rounded if rounded < whole or points >= whole else max(0.0, round(whole - 0.01, 6))


def _blocking(
    rubric: Rubric, item: Item, stage: StageFacts, grades: Mapping[str, ItemGrade]
) -> Iterator[_Loss]:
    """Yield what takes the whole item: an item it needs, or nothing of the checkpoint's own."""
    for name in item.needs:
        if not grades[name].earned:
            yield _Loss(1.0, f"depends on {name}, which earned nothing")
    added = rubric.added[item.checkpoint]
    if added and added.issubset(stage.unmet):
        yield _Loss(1.0, f"nothing that checkpoint {item.checkpoint} adds is there")
    elif not rubric.asked[item.id]:
        earlier = rubric.earlier[item.id]
        latest = [previous for previous in earlier if previous.checkpoint == earlier[-1].checkpoint]
        losses = {previous.title: [*_own_losses(rubric, previous, stage)] for previous in latest}
        if latest and not any(_kept(previous, losses[previous.title]) for previous in latest):
            first = losses[latest[0].title][0]
            added_last = f"what checkpoint {earlier[-1].checkpoint} adds does not work"
            title = f"{added_last}: {', '.join(losses)}: {first.title}"
            yield first._replace(share=1.0, title=title, requirement="")


def _own_losses(rubric: Rubric, item: Item, stage: StageFacts) -> Iterator[_Loss]:
    """Yield what a stage, of the item's checkpoint or a later one, fails of the item itself."""
    unmet = set(stage.unmet)
    causes = {name: fault for fault in reversed(stage.faults) for name in fault.unmet}
    asked = {requirement.id: requirement for requirement in rubric.asked[item.id]}
    total = sum(rubric.weights[requirement.kind] for requirement in asked.values())
    titles = rubric.titles[stage.checkpoint]
    blemished: set[str] = set()
    for name in stage.unmet:
        breaks = fits_name(name, item.breaks) and name not in stage.slight
        if name in asked or breaks:
            share = 1.0 if breaks else rubric.weights[asked[name].kind] / total
            if not breaks and _place_of(name) not in blemished:
                blemished.add(_place_of(name))
                share += rubric.blemish
            fault = causes.get(name)
            told = ("", stage.path, "")
            if fault is not None:
                told = (fault.rule, fault.place, fault.message)
            yield _Loss(min(share, 1.0), titles[name], name, *told)
    for fault in stage.faults:
        names = [f"{part}/error/{fault.rule}" for part in _parts(fault)]
        is_own = _is_home(rubric, item, stage, fault)
        concerns = is_own or any(fits_name(part, item.groups) for part in _parts(fault))
        breaks = any(fits_name(name, item.breaks) for name in names)
        breaks = breaks or (concerns and is_among(fault.rule, item.breaks))
        fails_nothing = unmet.isdisjoint(rubric.counted.intersection(fault.unmet))
        if breaks or (is_own and fails_nothing and not rubric.is_priced(fault.rule)):
            share = 1.0 if breaks else rubric.blemish
            name = next(iter(names), f"checkpoint {stage.checkpoint}/error/{fault.rule}")
            yield _Loss(share, fault.message, name, fault.rule, fault.place, fault.message)
    for name in item.dry_run:
        if name in stage.shown:
            title = f"{DRY_RUN}: {stage.shown[name]}"
            yield _Loss(1.0, title, f"{DRY_RUN}/{name}", place=stage.path)


def _place_of(requirement: str) -> str:
    """Return what a requirement is about: a node with its values and wires, else itself."""
    part, _, name = requirement.partition("/")
    kind, _, role = name.partition("/")
    return f"{part}/{role.partition('.')[0]}" if kind in _OF_NODES else requirement


def _parts(fault: Fault) -> list[str]:
    """Return the parts that an error is about: those of what it fails, else its own."""
    return [*dict.fromkeys(name.partition("/")[0] for name in fault.unmet)] or list(fault.parts)


def _is_home(rubric: Rubric, item: Item, stage: StageFacts, fault: Fault) -> bool:
    """Whether an error takes from this item: the first that counts its part, else the stage's."""
    parts = _parts(fault)
    for candidate in rubric.until(stage.checkpoint):
        if rubric.asked[candidate.id] and any(fits_name(part, candidate.groups) for part in parts):
            return candidate is item
    return item.checkpoint == stage.checkpoint


def _of_files(rubric: Rubric, item: Item, faults: Iterable[Fault]) -> Iterator[_Loss]:
    """Yield the errors in files beside the stages that are this item's."""
    for fault in faults:
        if is_among(fault.rule, item.files):
            share = 1.0 if is_among(fault.rule, item.breaks) else rubric.blemish
            yield _Loss(share, fault.message, f"files/error/{fault.rule}", fault.rule, fault.place)


def _earlier_losses(rubric: Rubric, item: Item, stage: StageFacts, kept: float) -> Iterator[_Loss]:
    """Yield what the earlier items, judged again in this stage, take of what is left.

    An item with requirements loses only by what it rests on, one without any by everything.
    """
    earlier = rubric.earlier[item.id]
    share = kept * (rubric.again if rubric.asked[item.id] else 1.0)
    points = sum(previous.points for previous in earlier)
    for previous in earlier if share else ():
        losses = [*_own_losses(rubric, previous, stage)]
        if rubric.asked[item.id]:
            losses = [loss for loss in losses if fits_name(loss.requirement, item.rests)]
        lost = share * previous.points / points * (1.0 - _kept(previous, losses))
        if lost:
            first = max(losses, key=lambda loss: loss.share)
            title = f"carried over: {previous.title}: {first.title}"
            yield first._replace(share=lost, title=title, requirement="", again=previous.title)


def _capped(
    caps: Iterable[Cap],
    item: Item,
    graded: ItemGrade,
    losses: Sequence[_Loss],
    facts: SubmissionFacts,
) -> tuple[ItemGrade, list[_Loss]]:
    """Limit what an item earned, given the rules that found errors in each stage."""
    losses = list(losses)
    for cap in caps:
        limit = _cents(graded.possible * cap.at_most, graded.possible)
        if graded.earned <= limit or (cap.items and item.id not in cap.items):
            continue
        stages = (stage for stage in facts.stages if cap.looks_at(stage.checkpoint, item))
        faults = (fault for stage in stages for fault in stage.faults)
        fault = next((fault for fault in faults if is_among(fault.rule, cap.rules)), None)
        if fault is not None:
            share = (graded.earned - limit) / item.points
            title = f"{cap.because}: {fault.message}"
            losses.append(_Loss(share, title, "", fault.rule, fault.place))
            state: State = "part" if limit else "none"
            graded = replace(graded, earned=limit, state=state, because=cap.because)
    return graded, losses


def _in_cents(item: Item, graded: ItemGrade, losses: Sequence[_Loss]) -> Iterator[Deduction]:
    """Yield the deductions of an item, which add up to what it lost, to the cent."""
    lost = round(100 * (graded.possible - graded.earned))
    share, start = 0.0, 0
    for number, loss in enumerate(losses, start=1):
        share = min(1.0, share + loss.share)
        until = min(lost, round(100 * item.points * share))
        if number == len(losses) or not item.partial:
            until = lost
        points = (until - start) / 100
        start = until
        yield Deduction(item.id, loss.requirement, loss.title, points, *loss[3:])


def _total(
    rubric: Rubric,
    grades: Mapping[str, ItemGrade],
    lost: tuple[Deduction, ...],
    *,
    late: bool,
) -> Grade:
    optional = {item.id for item in rubric.items if item.optional}
    earned = round(sum(graded.earned for graded in grades.values()), 6)
    possible = round(
        sum(graded.possible for name, graded in grades.items() if name not in optional), 6
    )
    because: tuple[str, ...] = ()
    if late and earned > possible * rubric.late.at_most:
        earned = _cents(possible * rubric.late.at_most, possible)
        because = (f"late: at most {rubric.late.at_most:.0%}",)
    percent = _cents(100 * earned / possible, 100.0) if possible else None
    return Grade(tuple(grades.values()), lost, earned, possible, percent, because)
