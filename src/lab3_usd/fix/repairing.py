"""Repairs a stage: judges it, makes the edits, and judges it again until nothing is left to do."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd import hooks
from lab3_usd.check.checker import judge
from lab3_usd.check.lint import lint
from lab3_usd.check.registry import Parameters
from lab3_usd.check.repairs import TYPE
from lab3_usd.check.rule_runs import RuleResults
from lab3_usd.errors import StageError
from lab3_usd.files import FileState, copy_beside, read_state
from lab3_usd.fix.text_editor import new_bytes
from lab3_usd.isaac.platform import Platform
from lab3_usd.model.changes import (
    AddGraph,
    AddNode,
    Edit,
    MovePrim,
    RemovePrim,
    Repair,
    Restore,
    SetValue,
    touched,
)
from lab3_usd.model.finding import Finding, Site, StageResult, ordered, site_of
from lab3_usd.model.prims import is_at_or_below, upwards
from lab3_usd.pipeline.any_stage import AUTO, lint_platform, lint_subject
from lab3_usd.pipeline.results import without_noted
from lab3_usd.pipeline.stage import checkpoint_of
from lab3_usd.pipeline.starter_comparison import open_against_starter, open_starter
from lab3_usd.spec.lab import Lab
from lab3_usd.spec.load.loader import lab_of_team, load_lab
from lab3_usd.stage.edit.repairs import apply_edit
from lab3_usd.stage.edit.session import EditSession, Reference, open_for_edits
from lab3_usd.stage.read.opening import check_file, open_stage, quiet
from lab3_usd.stage.read.properties import release_start_values
from lab3_usd.stage.read.stage_reader import read_model

WORSE = "would make the stage worse"
SILENCES = "would end what the dry run shows: {}"
USELESS = "does not help"
_ROUNDS = 8  # a missing graph needs three: the graph, its connections, what those bring to light


class Attempt(Struct, frozen=True):
    """The result of some repairs: the remaining findings, and the new bytes of each file.

    `repairs` are those that were made, each with a finding that it repairs. `states` are the files
    as they were read. `error` says why the result cannot be used; '' where it can.
    """

    after: tuple[Finding, ...]
    repairs: Mapping[Repair, Finding] = {}
    files: dict[Path, bytes] = {}
    states: dict[Path, FileState] = {}
    error: str = ""


class FixOptions(Struct, frozen=True):
    """Which repairs are made, and where: `wanted` keeps the findings that are to be repaired.

    With `heeds_ignores`, what notes in the stage ignore is left as it is. `parameters` are those of
    rules of lint.
    """

    unsafe: bool = False
    root_only: bool = False
    starter: str | None = None
    wanted: Callable[[Iterable[Finding]], tuple[Finding, ...]] = tuple
    heeds_ignores: bool = False
    parameters: Parameters = ()


class Fixed(Struct, frozen=True):
    """The result of a repair: the findings before and after, and the new bytes of each file.

    `repairs` are those that were made, each with a finding that it repairs. `states` are the files
    as they were read, `left_out` says why a repair was not made, and `judge_again` judges the stage
    in another file as this one was judged.
    """

    root: Path
    before: tuple[Finding, ...]
    after: tuple[Finding, ...]
    repairs: Mapping[Repair, Finding]
    files: dict[Path, bytes]
    states: dict[Path, FileState]
    left_out: dict[Site, str]
    judge_again: Callable[[Path], tuple[Finding, ...]]

    @property
    def left(self) -> tuple[Finding, ...]:
        """The errors and warnings that remain."""
        return tuple(finding for finding in self.after if finding.severity != "note")

    @property
    def repaired(self) -> tuple[Finding, ...]:
        """The errors and warnings that are gone, with those that came to light after repairs.

        What a rule without a repair reports at another place now (the stage has no clock, say) has
        only moved there.
        """
        kept = {site_of(finding) for finding in self.after}
        sites = {site_of(finding) for finding in self.before}
        moved = Counter(each.rule for each in self.left if site_of(each) not in sites)
        gone = []
        for finding in self.before:
            if finding.severity == "note" or site_of(finding) in kept:
                continue
            if finding.fix is None and moved[finding.rule]:
                moved[finding.rule] -= 1
            else:
                gone.append(finding)
        added = {
            edit.prim  # what connects it belongs to the same repair
            for repair in self.repairs
            for edit in repair.edits
            if isinstance(edit, AddNode | AddGraph)
            or (isinstance(edit, Restore) and edit.property is None)
        }
        later = (
            finding
            for finding in self.repairs.values()
            if site_of(finding) not in sites | kept
            and not any(is_at_or_below(finding.prim, prim) for prim in added)
        )
        return (*gone, *later)


@quiet()
def fix_stage(path: Path, checkpoint: str, lab: Lab, options: FixOptions) -> Fixed:
    """Repair in memory what the check finds in a stage; no file is written.

    Raises:
        StageError: the stage cannot be opened, or a rule failed.
    """
    spec = lab.checkpoints[checkpoint]
    starter = None if options.starter is None else open_starter(Path(options.starter), lab)

    def judge_stage(file: Path, stage: Any) -> Iterable[Finding]:
        findings = _findings_of(file, judge(lab, spec, read_model(stage, lab.platform, str(file))))
        if starter is None:
            return findings
        result = StageResult(str(file), spec.id, tuple(findings))
        return open_against_starter(result, stage, starter, lab).findings

    right = Reference(lab.at(spec.id), spec, options.starter)
    return _fixed(path, judge_stage, lab.platform, right, options)


@quiet()
def fix_linted(path: Path, release: str, options: FixOptions, moved_from: str = "") -> Fixed:
    """Repair in memory what the linter finds in a stage; no file is written.

    `moved_from` is the release that it comes from, as in `JudgeSettings`.

    Raises:
        StageError: the stage cannot be opened, or a rule failed.
        UsageError: the release is not known.
    """
    platform = lint_platform(release)
    # Told once: a repair takes away what tells it.
    origin = moved_from
    if moved_from == AUTO:
        check_file(path)
        origin_platform = lint_subject(
            read_model(open_stage(path), platform, str(path)), AUTO
        ).moved_from
        origin = platform.release if origin_platform is None else origin_platform.release

    def lint_stage(file: Path, stage: Any) -> Iterable[Finding]:
        subject = lint_subject(read_model(stage, platform, str(file)), origin, options.parameters)
        return _findings_of(file, lint(subject))

    return _fixed(path, lint_stage, platform, None, options)


def _findings_of(file: Path, judged: RuleResults) -> tuple[Finding, ...]:
    if judged.crashes:
        raise StageError(f"{file}: rule {judged.crashes[0].rule} failed: {judged.crashes[0].error}")
    return tuple(ordered(judged.findings))


def _fixed(
    path: Path,
    judge_stage: Callable[[Path, Any], Iterable[Finding]],
    platform: Platform,
    right: Reference | None,
    options: FixOptions,
) -> Fixed:
    """Judge a stage, repair it, and judge it again; restore what the reference has."""
    stage, root = open_for_edits(path, "and repair its stage")

    def findings_in(file: Path, stage: Any) -> tuple[Finding, ...]:
        try:
            findings = tuple(judge_stage(file, stage))
            heed = options.heeds_ignores
            return options.wanted(without_noted(findings, stage, file) if heed else findings)
        finally:
            release_start_values(stage)  # which edits are about to change

    def effects() -> frozenset[str]:
        try:
            return hooks.effects_of(stage, platform)
        finally:
            release_start_values(stage)

    before = findings_in(path, stage)
    sites = dict.fromkeys(site_of(finding) for finding in before if _repair_of(finding, options))
    first = EditSession(stage, platform, right, options.root_only)
    shown = effects() if sites and not options.unsafe else frozenset()

    def attempt(kept: frozenset[Site]) -> Attempt:
        session, left_out = replace(first, edited={}), frozenset(sites) - kept
        now = lambda: findings_in(path, stage)  # noqa: E731 - one of two questions to the stage
        lost = lambda: shown and shown - effects()  # noqa: E731
        return _attempt(session, options, left_out, before, root, now, lost)

    best, left_out = most_helpful(tuple(sites), attempt)
    return Fixed(
        root=path,
        before=before,
        after=best.after,
        repairs=best.repairs,
        files=best.files,
        states=best.states,
        left_out=left_out,
        judge_again=lambda copy: findings_in(copy, open_stage(copy)),
    )


def _repair_of(finding: Finding, options: FixOptions) -> Repair | None:
    fix = finding.fix if finding.severity != "note" else None
    return fix if fix and (options.unsafe or fix.safe) else None


def _attempt(
    session: EditSession,
    options: FixOptions,
    left_out: frozenset[Site],
    before: tuple[Finding, ...],
    root: FileState,
    findings_now: Callable[[], tuple[Finding, ...]],
    lost_now: Callable[[], frozenset[str]],
) -> Attempt:
    """Repair until nothing but `left_out` remains; the layers then hold what they held before.

    What would end something that the stage does is an error.
    """
    after, made = before, dict[Repair, Finding]()
    try:
        for _ in range(_ROUNDS):
            findings: dict[Repair, Finding] = {}
            for finding in after:
                repair = _repair_of(finding, options)
                if repair and site_of(finding) not in left_out:
                    findings.setdefault(repair, finding)
            errors = errors_by_prim(after, findings)
            repairs = compatible(
                repair
                for repair in findings
                if not deletes_what_waits(repair, errors, session)
                and not _restores_what_moves(repair, findings)
            )
            make_edits(session, repairs)
            made.update((repair, findings[repair]) for repair in repairs if repair not in made)
            before_edits, after = after, findings_now() if repairs else after
            if after == before_edits:
                break
        lost = lost_now() if made else frozenset()
        if lost:
            return Attempt(before, error=SILENCES.format(min(lost)))
        edited = {Path(layer.layer.realPath): layer for layer in session.edited.values()}
        root_path = Path(session.stage.GetRootLayer().realPath)
        states = {path: root if path == root_path else read_state(path) for path in edited}
        files = {path: new_bytes(layer, states[path].content) for path, layer in edited.items()}
        changed = {path: data for path, data in files.items() if states[path].content != data}
        return Attempt(after, made, changed, states)
    except StageError as error:
        return Attempt(before, error=str(error))
    finally:
        session.close()


def compatible(repairs: Iterable[Repair]) -> list[Repair]:
    """Leave out each repair that edits in another way what one before it edits.

    What that finding says then is judged anew.
    """
    claimed: dict[tuple[str, str], Edit] = {}
    kept = []
    for repair in repairs:
        places = {place: edit for edit in repair.edits for place in touched(edit)}
        if all(claimed.get(place, edit) == edit for place, edit in places.items()):
            claimed.update(places)
            kept.append(repair)
    return kept


def errors_by_prim(
    findings: Iterable[Finding], repairs: Iterable[Repair]
) -> Mapping[str, Sequence[tuple[Repair | None, bool]]]:
    """Map each prim with errors to their repairs, and whether these are made."""
    made = set(repairs)
    errors: dict[str, list[tuple[Repair | None, bool]]] = {}
    for finding in findings:
        if finding.severity == "error" and finding.prim != "/":
            errors.setdefault(finding.prim, []).append((finding.fix, finding.fix in made))
    return errors


def deletes_what_waits(
    repair: Repair,
    errors: Mapping[str, Sequence[tuple[Repair | None, bool]]],
    session: EditSession,
) -> bool:
    """Whether a repair deletes a node while its parent has an error, or one above is repaired.

    Once that is repaired the node may be right where it is. An error further above that stays
    says nothing of the node.
    """
    node_type = session.platform.graph.node_type
    parents = [
        edit.prim.rpartition("/")[0]
        for edit in repair.edits
        if isinstance(edit, RemovePrim)
        and session.stage.GetPrimAtPath(edit.prim).GetTypeName() == node_type
    ]
    return any(
        fix != repair and (prim == parent or is_made)
        for parent in parents
        for prim in upwards(parent)
        for fix, is_made in errors.get(prim, ())
    )


def _restores_what_moves(repair: Repair, repairs: Iterable[Repair]) -> bool:
    """Whether a repair restores a prim that another one moves: only there does the lab know it."""
    restored = [edit.prim for edit in repair.edits if isinstance(edit, Restore)]
    others = (other for other in repairs if other != repair) if restored else ()
    moved = [e.prim for other in others for e in other.edits if isinstance(e, MovePrim)]
    return any(is_at_or_below(path, prim) for path in restored for prim in moved)


def make_edits(session: EditSession, repairs: Iterable[Repair]) -> None:
    """Make each edit of some repairs once.

    Prims are moved last: the other edits name them where they were found.
    """
    edits = dict.fromkeys(edit for repair in repairs for edit in repair.edits)
    for edit in sorted(edits, key=lambda edit: isinstance(edit, MovePrim)):
        apply_edit(session, edit)


def most_helpful(
    sites: Sequence[Site], attempt: Callable[[frozenset[Site]], Attempt]
) -> tuple[Attempt, dict[Site, str]]:
    """Repair as many of these findings as cause no new ones, and say why others were left out.

    All are tried at once. If that causes a new finding, leaves one of them, or cannot be written,
    each half is tried by itself, down to single repairs.
    """
    kept: frozenset[Site] = frozenset()
    best = attempt(kept)
    left_out: dict[Site, str] = {}
    waiting = [tuple(sites)] if sites else []
    while waiting:
        group = waiting.pop(0)
        tried = attempt(kept.union(group))
        before, after = _messages(best), _messages(tried)
        is_useless = any(before.get(site) == after.get(site) is not None for site in group)
        is_right = _helps(tried, best) or (len(group) == 1 and _is_harmless(tried, best, group[0]))
        if is_right and not is_useless:
            kept, best = kept.union(group), tried
        elif len(group) == 1:
            left_out[group[0]] = tried.error or (USELESS if is_right else WORSE)
        else:
            half = len(group) // 2
            waiting[:0] = [group[:half], group[half:]]
    return best, left_out


def _messages(attempt: Attempt) -> dict[Site, list[str]]:
    """Return the messages of the repairable findings, by site."""
    messages: dict[Site, list[str]] = {}
    for finding in attempt.after:
        if finding.fix:
            messages.setdefault(site_of(finding), []).append(finding.message)
    return messages


def _helps(tried: Attempt, best: Attempt) -> bool:
    """Whether a finding is repaired and no new one appears."""
    sites = {site_of(finding) for finding in best.after}
    is_new = any(
        site_of(finding) not in sites for finding in tried.after if finding.severity != "note"
    )
    return not (tried.error or is_new) and weight(tried.after) < weight(best.after)


def _is_harmless(tried: Attempt, best: Attempt, site: Site) -> bool:
    """Whether no findings are added, and no error elsewhere.

    An error there may have been hidden behind the repaired one; elsewhere the repair brought it.
    Of a node of an unknown type hardly anything is judged: what is found of it once it has its
    right type was as wrong before.
    """
    repairs = [found.fix for found in best.after if found.fix and site_of(found) == site]
    edits = [edit for repair in repairs for edit in repair.edits]
    known = {site_of(finding) for finding in best.after}
    retyped = {e.prim for e in edits if isinstance(e, SetValue) and e.property == TYPE}
    counted = [f for f in tried.after if f.prim not in retyped or site_of(f) in known]
    if tried.error or weight(counted) > weight(best.after):
        return False
    sites = {site_of(finding) for finding in best.after if finding.severity == "error"}
    # The prims that findings are about, and those which are edited.
    repaired = {finding.prim for finding in best.after if site_of(finding) == site}
    repaired.update(edit.to if isinstance(edit, MovePrim) else edit.prim for edit in edits)
    for finding in tried.after:
        if finding.severity == "error" and site_of(finding) not in sites:
            paths = (finding.prim, *(related.partition(".")[0] for related in finding.related))
            if not all(any(is_at_or_below(path, prim) for prim in repaired) for path in paths):
                return False
    return True


def weight(findings: Iterable[Finding]) -> tuple[int, int]:
    """Count errors and warnings."""
    severities = [finding.severity for finding in findings]
    return severities.count("error"), severities.count("warning")


@quiet()
def check_result(fixed: Fixed, data: bytes, target: Path) -> None:
    """Open and judge the bytes of a repaired file where they are going to stand.

    A file beside the root layer is not the repaired stage: it holds what was judged in memory.

    Raises:
        StageError: no stage can be opened from them, or there is more to find than was announced.
        UsageError: nothing can be written there.
    """
    is_whole = {path.resolve() for path in fixed.files} <= {fixed.root.resolve()}
    with copy_beside(target, data) as copy:
        if is_whole:
            after = fixed.judge_again(copy)
        else:
            open_stage(copy)
            after = fixed.after
    if weight(after) > max(weight(fixed.before), weight(fixed.after)):
        raise StageError(
            f"{target}: the repaired stage would be worse than before; nothing was written"
        )


def repair_open_stage(repair: Repair, stage: Any) -> None:
    """Make the edits of a repair in the layers of a stage; no file is written."""
    name = Path(stage.GetRootLayer().realPath).name
    lab = load_lab()
    checkpoint = checkpoint_of(name, lab)
    lab = lab_of_team(lab, [(name, checkpoint)] if checkpoint else [])
    checkpoint = checkpoint or lab.first
    right = Reference(lab.at(checkpoint), lab.checkpoints[checkpoint])
    make_edits(EditSession(stage, lab.platform, right), [repair])
