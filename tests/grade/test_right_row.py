"""No row of an export ever holds the points of somebody else's submission.

Classes are drawn with names, ids and groups that collide, and named and exported as the platforms
do: this is their side, written from their source and independent of how names are read.
"""

from __future__ import annotations

import csv
import io
import tempfile
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import NamedTuple

import pytest
from class_pages import book_of, laid_out
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from lab3_usd.grade.filled_export import fill_export
from lab3_usd.grade.intake.submissions import StudentSubmission

FIRST = ("Jo", "Lee", "Lee Jo", "Zoë", "D'Arcy", "Anna_1", "Kim 2", "李")
LAST = ("Lee", "Jo", "Fox", "van der Berg", "OBrien", "O'Brien", "5050", "LATE")
GROUPS = ("Team A", "team_5", "Jo Lee", "Participant", "7", "Team-A")
FILES = ("Lab3.zip", "5_a.zip", "a-1.zip", "a-2.zip", "1_2_3.zip", "LATE_4_a.zip")
NUMBERS = st.integers(1, 9)
MIXED = 99.0  # points of a submission that files of two people were taken for: in no row


class Student(NamedTuple):
    """Somebody, and the number of the submission that is theirs (None: of nobody)."""

    first: str
    last: str
    number: int  # the platform's own
    other: int  # the institution's
    submission: int | None


class Handed(NamedTuple):
    """A submission: who handed it in, whether as a group, and the names in the download."""

    owners: tuple[Student, ...]
    entries: tuple[str, ...]


@st.composite
def students(draw: st.DrawFn, most: int = 5) -> tuple[Student, ...]:
    """People of whom some share names; numbers of one kind never repeat, others may be equal."""
    count = draw(st.integers(1, most))
    numbers = draw(st.lists(NUMBERS, min_size=count, max_size=count, unique=True))
    others = draw(st.lists(NUMBERS, min_size=count, max_size=count, unique=True))
    return tuple(
        Student(
            draw(st.sampled_from(FIRST)),
            draw(st.sampled_from(LAST)),
            number,
            other,
            draw(st.sampled_from([None, place, place])),
        )
        for place, (number, other) in enumerate(zip(numbers, others, strict=True))
    )


@st.composite
def in_groups(draw: st.DrawFn) -> tuple[tuple[str, int, tuple[Student, ...]], ...]:
    """Groups of people: name, number and members, whose one submission has one number."""
    people = draw(students(6))
    names = draw(st.permutations(GROUPS))
    split = draw(st.lists(st.integers(0, 2), min_size=len(people), max_size=len(people)))
    numbers = draw(st.permutations(range(1, 10)))
    handed = [draw(st.booleans()) for _ in range(3)]
    return tuple(
        (
            names[group],
            numbers[group],
            tuple(
                one._replace(submission=group if handed[group] else None)
                for one, own in zip(people, split, strict=True)
                if own == group
            ),
        )
        for group in range(3)
    )


def exported(head: Iterable[str], rows: Iterable[Iterable[object]]) -> str:
    text = io.StringIO(newline="")
    csv.writer(text).writerows([list(head), *([*row] for row in rows)])
    return text.getvalue()


def check(
    platform: str,
    entries: dict[str, int],
    text: str,
    owners: list[int | None],
    column: int,
    receipts: dict[str, str] | None = None,
) -> list[int | None]:
    """Fill in the points, and return whose each row got: the number of the submission.

    `entries` are the names in the download, with the number of their submission, and `owners` is
    whose points each row of the export may hold.
    """
    with tempfile.TemporaryDirectory() as folder:
        place = laid_out(Path(folder) / "class", entries)
        for name, receipt in (receipts or {}).items():
            (place / name).write_text(receipt, encoding="utf-8")

        def earned(submission: StudentSubmission) -> float:
            whose = {entries[entry] for entry in submission.entries if entry in entries} | {
                entries[f"{entry}/"] for entry in submission.entries if f"{entry}/" in entries
            }
            return whose.pop() + 1.0 if len(whose) == 1 else MIXED

        book = book_of(place, earned)
        path = Path(folder) / "export.csv"
        path.write_text(text, encoding="utf-8", newline="")
        data = fill_export(platform, path, book).data.decode()
    rows = list(csv.reader(io.StringIO(data, newline="")))[1:]
    rows = [row for row in rows if row[0].strip() != "Points Possible"]
    found = [int(float(row[column])) - 1 if row[column] else None for row in rows]
    for owner, got in zip(owners, found, strict=True):
        assert got in {None, owner}, f"a row of {owner} holds the points of {got}:\n{data}"
    return found


def word(text: str) -> str:
    """What Canvas leaves of a name: letters, digits and underscores of every script."""
    return "".join(letter for letter in text.lower() if letter.isalnum() or letter == "_")


def canvas(
    people: Iterable[Student], files: list[str], name_of: Callable[[Student], str]
) -> dict[str, int]:
    """The names of content_zipper.rb; attachments are numbered through the class."""
    entries, number = {}, 1
    for one in people:
        for file in files if one.submission is not None else ():
            assert one.submission is not None
            late = ["LATE"] if one.number % 3 == 0 else []
            name = "_".join([word(name_of(one)), *late, str(one.number)])
            entries[f"{name}_{number}_{file}"] = one.submission
            number += 1
    return entries


SOME_FILES = st.lists(st.sampled_from(FILES), min_size=1, max_size=2, unique=True)
SETTINGS = settings(
    max_examples=30, deadline=None, suppress_health_check=[HealthCheck.too_slow]
)  # fmt: skip


@SETTINGS
@given(students(), SOME_FILES, st.data())
def test_canvas(people: tuple[Student, ...], files: list[str], data: st.DataObject) -> None:
    entries = canvas(people, files, lambda one: f"{one.last}, {one.first}")
    if not entries:
        return
    # A section exports a part of the class.
    listed = [one for one in people if data.draw(st.booleans())]
    head = ("Student", "ID", "SIS User ID", "SIS Login ID", "Section", "Lab 3 (1)")
    rows = [
        (f"{one.last}, {one.first}", one.number, one.other, f"u{one.other}", "A", "")
        for one in listed
    ]
    text = exported(head, [("    Points Possible", "", "", "", "", 100), *rows])
    check("canvas", entries, text, [one.submission for one in listed], 5)


@SETTINGS
@given(in_groups(), SOME_FILES)
def test_groups_of_canvas(
    groups: tuple[tuple[str, int, tuple[Student, ...]], ...], files: list[str]
) -> None:
    names = {members[0]: name for name, _, members in groups if members}
    entries = canvas(names, files, lambda one: names[one])
    if not entries:
        return
    people = [one for _, _, members in groups for one in members]
    head = ("Student", "ID", "Section", "Lab 3 (1)")
    rows = [(f"{one.last}, {one.first}", one.number, "A", "") for one in people]
    text = exported(head, [("    Points Possible", "", "", 100), *rows])
    check("canvas", entries, text, [one.submission for one in people], 3)


def full(one: Student) -> str:
    return f"{one.first} {one.last}"


def moodle_name(text: str) -> str:
    """What downloader.php leaves of a name: no underscores, no apostrophes."""
    return text.replace("_", " ").replace("'", "")


@SETTINGS
@given(students(), st.sampled_from(["file", "file_", "file_a.zip"]), st.booleans(), st.data())
def test_moodle(
    people: tuple[Student, ...],
    plugin: str,
    blind: bool,  # noqa: FBT001 - drawn
    data: st.DataObject,
) -> None:
    end = "" if plugin.endswith(".zip") else "/"
    entries = {
        f"{'Participant' if blind else moodle_name(full(one))}_{one.number}"
        f"_assignsubmission_{plugin}{end}": one.submission
        for one in people
        if one.submission is not None
    }
    if not entries:
        return
    listed = [one for one in people if data.draw(st.booleans())]
    german = data.draw(st.booleans()) and not blind and bool(listed)
    head = ("ID", "Name", "Status", "Note", "Max") if german else (
        "Identifier", "Full name", "Status", "Grade", "Maximum grade")  # fmt: skip
    if not listed:
        return
    rows = [(f"Participant {one.number}", full(one), "Sent", "", "100.00") for one in listed]
    if blind:
        head = (head[0], *head[2:])
        rows = [(row[0], *row[2:]) for row in rows]
    owners = [one.submission for one in listed]
    check("moodle", entries, exported(head, rows), owners, len(head) - 2)


@SETTINGS
@given(in_groups())
def test_teams_of_moodle(groups: tuple[tuple[str, int, tuple[Student, ...]], ...]) -> None:
    entries = {
        f"{moodle_name(name)}_{number}_assignsubmission_file/": place
        for place, (name, number, members) in enumerate(groups)
        if any(one.submission is not None for one in members)
    }
    rows = [
        (f"Participant {one.number}", full(one), "Sent", name, "", "100.00")
        for name, _, members in groups
        for one in members
    ]
    if not entries:
        return
    head = ("Identifier", "Full name", "Status", "Group", "Grade", "Maximum grade")
    owners = [one.submission for _, _, members in groups for one in members]
    check("moodle", entries, exported(head, rows), owners, 4)


@SETTINGS
@given(students(), st.sampled_from(["{} - {}", "{1}- ", "{0}-{1} (o{2})"]), st.data())
def test_brightspace(people: tuple[Student, ...], form: str, data: st.DataObject) -> None:
    # Names alone decide: whoever handed something in is in the export.
    entries = {}
    for one in people:
        for day in range(data.draw(st.integers(1, 2))):
            if one.submission is None:
                continue
            date = f"Oct {day + 1}, 2025 1022 AM"
            name = {
                "{} - {}": f"{one.number}-7 - {full(one)} - {date}/",
                "{1}- ": f"7-{one.number} - {full(one)} - {date} - a.zip",
                "{0}-{1} (o{2})": f"{one.number}-7 - {full(one)} (a100{one.other}) - {date}/",
            }[form]
            entries[name] = one.submission
    if not entries:
        return
    head = ("OrgDefinedId", "Username", "Last Name", "First Name",
            "Lab 3 Points Grade <Numeric MaxPoints:100>", "End-of-Line Indicator")  # fmt: skip
    prefix = "a100" if "(o" in form else ""
    rows = [
        (f"#{prefix}{one.other}", f"#u{one.number}", one.last, one.first, "", "#") for one in people
    ]
    check("brightspace", entries, exported(head, rows), [one.submission for one in people], 4)


@SETTINGS
@given(
    st.lists(
        st.sampled_from(["lens", "a_lens", "b_a_lens", "bo", "a_bo", "3_bo", "A_bo2", "x"]),
        min_size=1, unique=True,
    ),
    st.sampled_from(["Lab 3", "Lab_3", "Lab_a", "a_a"]),
    st.data(),
)  # fmt: skip
def test_blackboard(users: list[str], title: str, data: st.DataObject) -> None:
    entries, receipts = {}, {}
    for place, user in enumerate(users):
        if not data.draw(st.booleans()):
            continue
        for day in range(1, data.draw(st.integers(1, 2)) + 1):
            start = f"{title}_{user}_attempt_2026-11-0{day}-10-22-33"
            entries[f"{start}_a.zip"] = place
            if data.draw(st.booleans()):
                receipts[f"{start}.txt"] = f"Name: Some One ({user})\nAssignment: {title}\n"
    if not entries:
        return
    listed = [place for place in range(len(users)) if data.draw(st.booleans())]
    head = ("Last Name", "First Name", "Username", "Lab 3 [Total Pts: 100 Score] |5")
    rows = [("One", "Some", users[place].upper(), "") for place in listed]
    check("blackboard", entries, exported(head, rows), list(listed), 3, receipts)


@SETTINGS
@given(in_groups(), st.data())
def test_gradescope(
    groups: tuple[tuple[str, int, tuple[Student, ...]], ...], data: st.DataObject
) -> None:
    lines, entries = [], {}
    for place, (_, _, members) in enumerate(groups):
        if not any(one.submission is not None for one in members):
            continue
        entries[f"submission_{place}/"] = place
        lines.append(f"submission_{place}:\n  :submitters:")
        for one in members:
            sid = data.draw(st.sampled_from(["", str(one.other)]))
            email = data.draw(st.sampled_from(["", f"u{one.number}@x.example"]))
            fields = {":name": full(one), ":sid": sid, ":email": email}
            lines += [
                f'  {" " if place else "-"} {key}: "{value}"'
                for place, (key, value) in enumerate(fields.items())
            ]
    if not entries:
        return
    people = [one for _, _, members in groups for one in members]
    head = ("Student", "ID", "SIS User ID", "SIS Login ID", "Section", "Lab 3 (1)")
    rows = [
        (f"{one.last}, {one.first}", one.number, one.other, f"U{one.number}@X.example", "A", "")
        for one in people
    ]
    text = exported(head, [("    Points Possible", "", "", "", "", 100), *rows])
    metadata = {"submission_metadata.yml": "\n".join(lines)}
    check("canvas", entries, text, [one.submission for one in people], 5, metadata)


# ---- and where nothing collides, every row is filled in


@pytest.mark.parametrize("platform", ["canvas", "moodle", "brightspace", "blackboard"])
def test_a_class_without_collisions_is_filled_in_whole(platform: str) -> None:
    people = [
        Student(first, last, number, number + 50, number)
        for number, (first, last) in enumerate(
            [("Jo", "Lee"), ("Zoë", "van der Berg"), ("李", "小龙"), ("Al", "O'Brien")], start=1
        )
    ]
    owners = [one.submission for one in people]
    title = "Lab 3 (1)"
    if platform == "canvas":
        entries = canvas(people, ["Lab3.zip"], lambda one: f"{one.last}, {one.first}")
        rows = [(f"{one.last}, {one.first}", one.number, "A", "") for one in people]
        rows = [("    Points Possible", "", "", 100), *rows]  # type: ignore[list-item]
        head: tuple[str, ...] = ("Student", "ID", "Section", title)
    elif platform == "moodle":
        entries = {
            f"{moodle_name(full(one))}_{one.number}_assignsubmission_file/": one.number
            for one in people
        }
        rows = [(f"Participant {one.number}", full(one), "", 100) for one in people]  # type: ignore[misc]
        head = ("Identifier", "Full name", "Grade", "Maximum grade")
    elif platform == "brightspace":
        entries = {
            f"{one.number}-7 - {full(one)} - Oct 1, 2025 1022 AM/": one.number for one in people
        }
        rows = [(one.last, f"u{one.number}", one.first, "") for one in people]  # type: ignore[misc]
        head = ("Last Name", "Username", "First Name", "Lab 3 Points Grade <MaxPoints:100>")
    else:
        users = {one: f"{one.first[0].lower()}{one.number}" for one in people}
        date = "attempt_2026-11-01-10-22-33"
        entries = {f"Lab 3_{users[one]}_{date}_a.zip": one.number for one in people}
        rows = [(one.last, one.first, users[one], "") for one in people]  # type: ignore[misc]
        head = ("Last Name", "First Name", "Username", "Lab 3 [Total Pts: 100 Score] |5")
    column = 2 if platform == "moodle" else 3
    assert check(platform, entries, exported(head, rows), owners, column) == owners
