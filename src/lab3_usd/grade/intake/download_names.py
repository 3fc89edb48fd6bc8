"""Finds whose each file and folder of a download is by its name, as learning platforms write it.

Canvas: `lib/content_zipper.rb` of instructure/canvas-lms. Moodle: `classes/downloader.php` of
`mod/assign` in moodle/moodle. Blackboard and Brightspace publish no source; their names are those
of public exports.
"""

from __future__ import annotations

import os
import re
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping
from datetime import datetime

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.grade.intake.people import (
    BLACKBOARD_USER,
    CANVAS_USER,
    MOODLE_NUMBER,
    STUDENT_ID,
    Person,
)
from lab3_usd.spec.load.loader import load_lab
from lab3_usd.spec.submission import named_checkpoint

ARCHIVE_END = re.compile(r"(\.tar)?\.[A-Za-z0-9]+$")


class FileOwner(Struct, frozen=True):
    """Whose a file or folder is, as its name says.

    `student` tells the owner from others of the download, `person` is how the platform names them,
    and `others` are people that it may be of instead. `file` is the student's own name for it, ''
    for none. Files of one attempt have one number, and the highest is that of the last; 0 belongs
    to every attempt. `when` tells it to people.
    """

    student: str
    platform: str
    person: Person
    file: str = ""
    late: bool = False
    upload: int = 0
    when: str = ""
    others: tuple[Person, ...] = ()

    @property
    def name(self) -> str:
        """The name to show."""
        return self.person.name or self.student


# Canvas: [name, LATE?, id] or [LATE?, anon_ID], then the number of the file and its name.
_CANVAS_ANONYMOUS = re.compile(
    r"^(?P<late>LATE_)?(?P<id>anon_[A-Za-z0-9]+)_(?:(?P<number>\d+)_(?P<file>.+)|(?P<page>text|link)\.html)$"
)
_CANVAS_PAGES = ("text.html", "link.html")
_LATE = "LATE"
_AGAIN = re.compile(r"-\d+(?=\.[A-Za-z0-9.]+$)")  # Canvas renames a file of a name that it has
# Moodle: [name, id?] assignsubmission, plugin, file; only the default group has no id.
_MOODLE = re.compile(
    r"^(?P<name>[^_]+)(?:_(?P<id>\d+))?_assignsubmission_[a-z]+(?:_(?P<file>.*))?$"
)
# Brightspace: numbers of person and folder - name - date - file; older ones have no numbers.
_BRIGHTSPACE = re.compile(
    r"^(?:(?P<first>\d+)-(?P<second>\d+) ?- )?(?P<name>.+?) ?- "
    r"(?P<date>[A-Z][a-z]{2,8} \d{1,2}, \d{4} \d{3,4}(?: [AP]M)?)(?: ?- (?P<file>.+))?$"
)
# An OrgDefinedId in a name: with a number sign or in brackets, else of four characters or more.
_ID_INSIDE = re.compile(r"#(?=\w*\d)\w+|[(\[]#?(?=\w*\d)\w+[)\]]|(?<!\S)(?=\w*\d)\w{4,}(?!\S)")
# Blackboard: assignment, user, attempt, date, file; a receipt without a file for each attempt.
_BLACKBOARD = re.compile(
    r"^(?P<head>.+?)_attempt_(?P<date>\d{4}(?:-\d\d){5})(?:_(?P<file>.+)|(?P<receipt>\.txt))$"
)
_LONGEST_NUMBER = 18  # digits
_LONGEST_NAME = 255  # of what a file system takes


def is_platform_name(name: str) -> bool:
    """Whether a learning platform put a student's name before that of the file."""
    return bool(file_owners([name]))


def is_receipt(name: str) -> bool:
    """Whether Blackboard wrote this file about an attempt; it names who handed it in."""
    match = _BLACKBOARD.match(name) if len(name) <= _LONGEST_NAME else None
    return match is not None and match["receipt"] is not None


def file_owners(
    names: Iterable[str], receipts: Callable[[str], str] = lambda _name: ""
) -> dict[str, FileOwner]:
    """Return whose each file or folder is; names that no platform wrote are left out.

    The names of a class are read together, because one alone may be ambiguous. `receipts` returns
    the text of a receipt of Blackboard.
    """
    readable = [name for name in names if len(name) <= _LONGEST_NAME]
    owners: dict[str, FileOwner] = {}
    owners |= _brightspace(readable)
    owners |= _blackboard([name for name in readable if name not in owners], receipts)
    for reader in (_moodle, _canvas):
        owners |= reader([name for name in readable if name not in owners])
    return owners


def _number(digits: str) -> int:
    return int(digits[:_LONGEST_NUMBER])


def _labels(people: Mapping[str, tuple[str, str]]) -> dict[str, str]:
    """Return what tells people apart, whose number and name are given for each file.

    It is the number, unless two names share it.
    """
    shared = Counter(number for number, _ in set(people.values()))
    return {
        file: f"{number} {name}" if shared[number] > 1 else number
        for file, (number, name) in people.items()
    }


# ---- Canvas


def _canvas_readings(name: str) -> Iterator[FileOwner]:
    """Yield every way to read a name of Canvas, the shortest student's name first.

    Names of students and groups may hold underscores, and end in a number after one; Canvas takes
    the underscores from numbers in the middle of a name.
    """
    anonymous = _CANVAS_ANONYMOUS.match(name)
    if anonymous:
        file = anonymous["file"] or f"{anonymous['page']}.html"
        is_late, number = anonymous["late"] is not None, _number(anonymous["number"] or "0")
        yield FileOwner(anonymous["id"], "canvas", Person(), file, is_late, number)
        return
    parts = name.split("_")
    for index in range(1, len(parts) - 1):
        if not _is_number(parts[index]):
            continue
        rest = parts[index + 1 :]
        is_late = index > 1 and parts[index - 1] == _LATE
        called = "_".join(parts[: index - is_late]).strip("_")
        person = Person(called, {CANVAS_USER: parts[index]})
        owner = FileOwner(parts[index], "canvas", person, "_".join(rest), is_late)
        if owner.file in _CANVAS_PAGES:
            yield owner
        elif len(rest) > 1 and _is_number(rest[0]) and any(rest[1:]):
            yield replace(owner, file="_".join(rest[1:]), upload=_number(rest[0]))
        if any(_is_number(part) for part in parts[1:index]):
            return


def _is_number(part: str) -> bool:
    return part.isascii() and part.isdecimal()


def _canvas(names: Iterable[str]) -> dict[str, FileOwner]:
    """Read the names of Canvas; numbers of files never repeat in a class."""
    readings: dict[str, list[FileOwner]] = {}
    for name in names:
        possible = list(_canvas_readings(name))
        if possible:
            readings[name] = [owner for owner in possible if owner.late] or possible
    certain = {
        (owners[0].student, owners[0].person.name)
        for owners in readings.values()
        if len(owners) == 1
    }
    used = [
        Counter(_numbered(owners[min(rank, len(owners) - 1)]) for owners in readings.values())
        for rank in range(2)
    ]
    owners = {name: _likeliest(possible, certain, used) for name, possible in readings.items()}
    owners = _told_apart(owners)
    own_names = dict(_with_own_names(owners))
    return {name: own_names[name] for name in owners}


def _numbered(owner: FileOwner) -> tuple[str, int]:
    """Return what no two files of Canvas have: whose one is, and its number."""
    return owner.person.name, owner.upload


def _likeliest(
    readings: list[FileOwner],
    certain: set[tuple[str, str]],
    used: list[Counter[tuple[str, int]]],
) -> FileOwner:
    """Choose between two readings of a name by what the rest of the class shows."""
    if len(readings) == 1:
        return readings[0]
    certain_readings = [
        reading for reading in readings if (reading.student, reading.person.name) in certain
    ]
    possible = [
        reading
        for rank, reading in enumerate(readings)
        if not reading.upload or used[rank][_numbered(reading)] == 1
    ]
    for candidates in (certain_readings, possible):
        if len(candidates) == 1:
            return candidates[0]
    longest = max(readings, key=lambda reading: (len(str(reading.upload)), len(reading.student)))
    return replace(
        longest, others=tuple(reading.person for reading in readings if reading is not longest)
    )


def _told_apart(owners: Mapping[str, FileOwner]) -> dict[str, FileOwner]:
    """Return the owners, where one of whom it is not certain who it is, is never somebody else."""
    names: defaultdict[str, set[str]] = defaultdict(set)
    for owner in owners.values():
        names[owner.student].add(owner.person.name)
    return {
        name: replace(owner, student=f"{owner.student} {owner.name}")
        if owner.others and len(names[owner.student]) > 1
        else owner
        for name, owner in owners.items()
    }


def _with_own_names(owners: Mapping[str, FileOwner]) -> Iterator[tuple[str, FileOwner]]:
    """Yield files of Canvas under the names that their student gave them.

    A download holds the current attempt alone: all files of a user are one attempt. Canvas adds
    `-1` to the name of a file that it has already, which is undone unless two files of the user
    would then have one name: those names are the student's own. Of files of one name, and of two
    stages of a checkpoint, the last keeps the name and the others get their number.
    """
    files = load_lab().files
    of_student: defaultdict[str, list[tuple[str, FileOwner]]] = defaultdict(list)
    for name, owner in owners.items():
        of_student[owner.student].append((name, owner))
    for own in of_student.values():
        plain = Counter(_AGAIN.sub("", file) for file in {owner.file for _, owner in own})
        taken: set[str] = set()
        for name, owner in sorted(own, key=lambda item: (-item[1].upload, item[0])):
            short = _AGAIN.sub("", owner.file)
            is_shared = plain[short] > 1 and named_checkpoint(short, files) is None
            file = owner.file if is_shared else short
            if file in taken:
                end = ARCHIVE_END.search(file)
                stem = file[: end.start()] if end else file
                file = f"{stem}-{owner.upload}{file[len(stem) :]}"
            taken.add(file)
            yield name, replace(owner, file=file, upload=0)


# ---- Moodle


def _moodle(names: Iterable[str]) -> dict[str, FileOwner]:
    """Read the names of Moodle; a download holds the latest attempt alone."""
    matches = {name: match for name in names if (match := _MOODLE.match(name))}
    people = {
        name: (match["id"] or match["name"], match["name"]) for name, match in matches.items()
    }
    labels = _labels(people)
    return {
        name: FileOwner(
            labels[name],
            "moodle",
            Person(match["name"], {MOODLE_NUMBER: match["id"]} if match["id"] else {}),
            match["file"] or "",
        )
        for name, match in matches.items()
    }


# ---- Brightspace


def _brightspace(names: Iterable[str]) -> dict[str, FileOwner]:
    """Read the names of Brightspace, whose numbers are its own and in no export of grades."""
    matches = {name: match for name in names if (match := _BRIGHTSPACE.match(name))}
    firsts = {match["first"] for match in matches.values()}
    seconds = {match["second"] for match in matches.values()}
    # One of the numbers is that of the assignment's folder, the same for the whole class.
    ours = "second" if len(firsts) == 1 and len(seconds) > 1 else "first"
    people = {
        name: (match[ours] or match["name"], match["name"]) for name, match in matches.items()
    }
    labels = _labels(people)
    return {
        name: FileOwner(
            labels[name],
            "brightspace",
            _with_id_inside(match["name"]),
            match["file"] or "",
            upload=_minutes(match["date"]),
            when=f"upload of {match['date']}",
        )
        for name, match in matches.items()
    }


def _with_id_inside(name: str) -> Person:
    """Return a person whose name may hold the OrgDefinedId: `Jo Lee (1001234)`."""
    inside = _ID_INSIDE.findall(name)
    rest = _ID_INSIDE.sub(" ", name).strip(" -,_")
    if len(inside) != 1 or not rest:
        return Person(name)
    return Person(" ".join(rest.split()), {STUDENT_ID: inside[0].strip("#()[]")})


def _minutes(date: str) -> int:
    """Return a date as a number that grows with time; 0 where it cannot be read."""
    month, day, year, clock, *half = date.replace(",", "").split()
    text = " ".join((month[:3], day, year, clock.zfill(4), *half))
    try:
        when = datetime.strptime(text, f"%b %d %Y {'%I%M %p' if half else '%H%M'}")  # noqa: DTZ007
    except ValueError:
        return 0
    return int(when.strftime("%Y%m%d%H%M"))


# ---- Blackboard


def _blackboard(names: Iterable[str], receipts: Callable[[str], str]) -> dict[str, FileOwner]:
    """Read the names of Blackboard: the user is whom the receipt names."""
    matches = {name: match for name in names if (match := _BLACKBOARD.match(name))}
    people: dict[str, tuple[Person, ...]] = {}
    for name, match in matches.items():
        head = match["head"]
        called, user = _named_in(receipts(name)) if match["receipt"] else ("", "")
        if user and head.endswith(f"_{user}"):
            people[head] = (Person(called, {BLACKBOARD_USER: user}),)
    heads = {match["head"] for match in matches.values()}
    people |= _users_without_receipt(heads - people.keys(), heads, people)
    return {
        name: FileOwner(
            people[match["head"]][0].ids[BLACKBOARD_USER],
            "blackboard",
            people[match["head"]][0],
            match["file"] or name,
            upload=_number(match["date"].replace("-", "")),
            when=f"upload of {match['date']}",
            others=people[match["head"]][1:],
        )
        for name, match in matches.items()
    }


def _named_in(receipt: str) -> tuple[str, str]:
    """Return name and user in the first line of a receipt, `Name: Ann Lens (a_lens)`, else ''."""
    first, _, _ = receipt.strip().partition("\n")
    called, bracket, user = first.partition(":")[2].strip().rpartition("(")
    return (called.strip(), user[:-1]) if bracket and user.endswith(")") else ("", "")


def _users_without_receipt(
    wanted: Iterable[str], heads: Iterable[str], people: Mapping[str, tuple[Person, ...]]
) -> Iterator[tuple[str, tuple[Person, ...]]]:
    """Yield who may be meant in each `assignment_user`, the likeliest first.

    Assignment and user may hold underscores. All begin with the assignment, which another receipt
    shows; else the user follows the longest common start, or begins at an earlier underscore.
    """
    starts = {head.removesuffix(own[0].ids[BLACKBOARD_USER]) for head, own in people.items()}
    common = os.path.commonprefix(list(heads))  # noqa: RUF071 - of texts, not of paths
    for head in wanted:
        if len(starts) == 1 and head.startswith(start := next(iter(starts))) and head != start:
            users = [head.removeprefix(start)]
        else:
            shared = len(common.rpartition("_")[0])
            ends = [place for place, letter in enumerate(head) if letter == "_"]
            users = [head[end + 1 :] for end in reversed(ends) if end <= shared and head[end + 1 :]]
        yield head, tuple(Person("", {BLACKBOARD_USER: user}) for user in users or [head])
