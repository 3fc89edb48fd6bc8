"""Finds which submission belongs to which person of an export: each the other's only candidate.

A person's id is compared with the column of its kind. Where names may be typed or numbers be of
somebody else (a group of Moodle), name and number must agree. Names alone decide where the export
has no id of the same kind; a row with another id of that kind is somebody else's.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence

from msgspec import Struct

from lab3_usd.grade.intake.people import (
    ADDRESS,
    BLACKBOARD_USER,
    CANVAS_USER,
    LOGIN,
    MOODLE_NUMBER,
    STUDENT_ID,
    Person,
    id_key,
    name_key,
    name_keys,
)
from lab3_usd.grade.rosters import Roster, RosterRow
from lab3_usd.grade.scoring import Deduction
from lab3_usd.model.grade import ADJUSTED

_WITH_NAME = (MOODLE_NUMBER, STUDENT_ID)  # kinds that count only where the name agrees
_WHAT_FOLDERS_ARE_CALLED = (LOGIN, ADDRESS, BLACKBOARD_USER)
_MOST_NAMED = 5


class GradedSubmission(Struct, frozen=True):
    """What grades.json says of a submission: whose it is, and what it earned."""

    student: str
    name: str
    folder: str
    status: str
    reason: str
    earned: float
    because: tuple[str, ...]
    platform: str
    entries: tuple[str, ...]
    people: tuple[Person, ...]
    may_be: tuple[Person, ...]
    crashes: tuple[str, ...] = ()
    lost: tuple[Deduction, ...] = ()

    @property
    def has_points_by_hand(self) -> bool:
        """Whether a grader gave points to what could not be judged, which has no others."""
        words = (*self.because, *(line.title for line in self.lost))
        is_judged = self.status == "graded" or bool(self.crashes)
        return not is_judged and any(text.startswith(ADJUSTED) for text in words)


class Claim(Struct, frozen=True):
    """A person of a submission, and the rows of the export that may be that person's.

    `doubt` says why none of them is certain, and `remark` what else is to be known.
    """

    student: str
    rows: tuple[RosterRow, ...]
    doubt: str = ""
    remark: str = ""


class Match(Struct, frozen=True):
    """A row and what became of it: the one submission that it is of, else why there is none."""

    row: RosterRow
    student: str = ""
    ambiguous: str = ""
    remark: str = ""


class Matching(Struct, frozen=True):
    """Every row of an export, and the submissions that are in none, with the reason."""

    rows: tuple[Match, ...]
    without_row: tuple[tuple[str, str], ...]


def matched(
    submissions: Iterable[GradedSubmission],
    roster: Roster,
    mapped: Mapping[str, Sequence[RosterRow]] = {},
) -> Matching:
    """Match one to one. `mapped` are the rows that somebody gave for a submission, by student."""
    index = _indexed(roster.rows)
    claims = [
        claim
        for submission in submissions
        for claim in _claims(submission, index, roster.platform, mapped.get(submission.student))
    ]
    of_row: defaultdict[int, list[Claim]] = defaultdict(list)
    for claim in claims:
        for row in claim.rows:
            of_row[row.line].append(claim)
    matches = {row.line: _match(row, of_row[row.line]) for row in roster.rows}
    without = {
        (claim.student, _why_in_no_row(claim, of_row)): None
        for claim in claims
        if not any(matches[row.line].student == claim.student for row in claim.rows)
    }
    return Matching(tuple(matches.values()), tuple(without))


def _match(row: RosterRow, claims: Sequence[Claim]) -> Match:
    if not claims:
        return Match(row)
    if len(claims) == 1 and len(claims[0].rows) == 1 and not claims[0].doubt:
        return Match(row, claims[0].student, remark=claims[0].remark)
    students = list(dict.fromkeys(claim.student for claim in claims))
    doubt = next((claim.doubt for claim in claims if claim.doubt), "")
    if len(students) > 1:
        why = f"may be of {_listed(students)}"
    else:
        labels = dict.fromkeys(other.label for claim in claims for other in claim.rows)
        why = doubt or f"{students[0]} may be of {_listed(list(labels))}"
    return Match(row, ambiguous=why)


def _why_in_no_row(claim: Claim, of_row: Mapping[int, Sequence[Claim]]) -> str:
    if not claim.rows:
        return claim.doubt or "the export names nobody of this name or number"
    rivals = {other.student for row in claim.rows for other in of_row[row.line]} - {claim.student}
    rows = _listed([row.label for row in claim.rows])
    if claim.doubt or not rivals or len(claim.rows) > 1:
        return f"ambiguous: {claim.doubt or f'may be of {rows}'}"
    return f"ambiguous: {rows} may also be of {_listed(sorted(rivals))}"


def _listed(names: Sequence[str]) -> str:
    more = len(names) - _MOST_NAMED
    shown = " or ".join(names[:_MOST_NAMED])
    return f"{shown} or {more} more" if more > 0 else shown


class _Index(Struct, frozen=True):
    """The rows of an export by id, name and group, as they are compared."""

    by_id: Mapping[tuple[str, str], list[RosterRow]]
    by_name: Mapping[str, list[RosterRow]]
    by_group: Mapping[str, list[RosterRow]]


def _indexed(rows: Iterable[RosterRow]) -> _Index:
    index = _Index(defaultdict(list), defaultdict(list), defaultdict(list))
    for row in rows:
        for kind, value in row.ids.items():
            index.by_id[kind, value].append(row)
        for name in row.names:
            index.by_name[name].append(row)
        if name_key(row.group):
            index.by_group[name_key(row.group)].append(row)
    return index


def _claims(
    submission: GradedSubmission, index: _Index, platform: str, given: Sequence[RosterRow] | None
) -> Iterator[Claim]:
    """Yield a claim for each person that a submission may be of, or on each row that is given."""
    student = submission.student
    if given is not None:
        yield from (Claim(student, (row,)) for row in given)
        if not given:
            yield Claim(student, (), "the export has nobody of the id in the map")
    elif submission.may_be:
        yield _uncertain_claim(submission, index)
    elif not submission.platform:
        yield _claim_by_folder(student, index)
    elif not any(person.name or person.ids for person in submission.people):
        yield Claim(student, (), "the platform hides who this is: give --map")
    elif submission.platform == platform == "moodle":
        yield from _claims_at_moodle(student, submission.people[0], index)
    else:
        for person in submission.people:
            rows, remark = _rows_of(person, index)
            yield Claim(student, rows, "" if rows else _near_miss(person, index), remark)


def _rows_of(person: Person, index: _Index) -> tuple[tuple[RosterRow, ...], str]:
    """Return the rows that may be a person's, and a remark about them."""
    keys = {kind: id_key(value) for kind, value in person.ids.items()}
    by_line = {
        row.line: row
        for kind, key in keys.items()
        for row in index.by_id[kind, key]
        if (kind not in _WITH_NAME or _has_name(person, row))
        and all(row.ids.get(each, own) == own for each, own in keys.items())
    }
    if by_line:
        rows = tuple(by_line.values())
        is_group = CANVAS_USER in person.ids and len(rows) == 1 and not _has_name(person, rows[0])
        remark = f"represents '{person.name}'" if is_group and name_key(person.name) else ""
        return rows, remark
    named = {row.line: row for name in name_keys(person.name) for row in index.by_name[name]}
    return tuple(row for row in named.values() if not person.ids.keys() & row.ids.keys()), ""


def _has_name(person: Person, row: RosterRow) -> bool:
    return bool(name_keys(person.name) & row.names)


def _near_miss(person: Person, index: _Index) -> str:
    """Return why a row that looks like a person's is not taken, '' where there is none."""
    for kind, value in person.ids.items():
        for row in index.by_id[kind, id_key(value)]:
            return f"{row.label} has its {kind} {value}, but not its name or another id"
    for name in sorted(name_keys(person.name)):
        for row in index.by_name[name]:
            return f"{row.label} has its name, but another id"
    return ""


def _claims_at_moodle(student: str, person: Person, index: _Index) -> Iterator[Claim]:
    """Yield the participant whose name and number agree, or the members of the group."""
    called = name_key(person.name)
    own = [
        row
        for row in index.by_id[MOODLE_NUMBER, id_key(person.ids.get(MOODLE_NUMBER, ""))]
        if _has_name(person, row) or (called and name_key(row.word) == called)  # blind marking
    ]
    members = index.by_group[called]
    groups = sorted({row.group for row in members})
    if len(groups) == 1 and not own:
        for row in members:
            yield Claim(student, (row,), remark=f"group {row.group}")
    elif members:
        doubt = f"'{person.name}' may mean {_listed([*(row.label for row in own), *groups])}"
        yield Claim(student, tuple({row.line: row for row in [*own, *members]}.values()), doubt)
    else:
        yield Claim(student, tuple(own), "" if own else _near_miss(person, index))


def _claim_by_folder(called: str, index: _Index) -> Claim:
    """Return the claim of a folder or file that somebody named: by login, address or name."""
    if id_key(called).isdecimal():
        return Claim(called, (), "a number without a kind: give --map")
    named = [row for name in name_keys(called) for row in index.by_name[name]]
    for kind in _WHAT_FOLDERS_ARE_CALLED:
        named += index.by_id[kind, id_key(called)]
    return Claim(called, tuple({row.line: row for row in named}.values()))


def _uncertain_claim(submission: GradedSubmission, index: _Index) -> Claim:
    """Return the claim of a file whose name can be read in several ways.

    It is certain where one reading alone has the id and the name of a row.
    """
    rows: dict[int, RosterRow] = {}
    exact: dict[int, RosterRow] = {}
    for person in submission.may_be:
        for kind, value in person.ids.items():
            for row in index.by_id[kind, id_key(value)]:
                rows[row.line] = row
                if _has_name(person, row):
                    exact[row.line] = row
    if exact:
        return Claim(submission.student, tuple(exact.values()))
    readings = [
        " ".join(filter(None, (person.name, *person.ids.values()))) for person in submission.may_be
    ]
    return Claim(submission.student, tuple(rows.values()), f"its name may mean {_listed(readings)}")
