"""Finds the submission of each student of a class, in folders, archives and at addresses."""

from __future__ import annotations

import contextlib
import hashlib
import os
import re
import stat
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.errors import NoRoomError, UsageError, is_no_room
from lab3_usd.grade.intake.addresses import address_below, name_at, public_place
from lab3_usd.grade.intake.archives import ArchiveError, is_archive, unpack
from lab3_usd.grade.intake.download_names import ARCHIVE_END, is_receipt
from lab3_usd.grade.intake.people import Person
from lab3_usd.grade.intake.platforms import (
    METADATA,
    Entry,
    StudentNames,
    SubmissionPart,
    entries_in,
    is_leftover,
    is_submission_part,
    names_in,
    parts_of,
    read_in,
)
from lab3_usd.grade.intake.remote import archive_at, entries_at, read_at
from lab3_usd.grade.intake.scratch import scratch_folder
from lab3_usd.grade.intake.staging import Source
from lab3_usd.grade.intake.submission_copy import (
    LEADS_OUT,
    Limits,
    RefusedFile,
    SubmissionCopy,
    TooLargeError,
    UnreachedError,
    path_parts,
)
from lab3_usd.pipeline.folder import are_submission, is_submission

# A class in one archive holds many submissions.
_CLASS = Limits(files=200_000, total_size=16 << 30, file_size=1 << 30)
_PASSED_OVER = "its name begins with a dot"
_LeftOut = list[tuple[tuple[str, ...], RefusedFile]]  # parts of a path, and its reason
_SLUG = re.compile(r"[^A-Za-z0-9._-]+")
_LONGEST_SLUG = 80
_MOST_NAMED = 5
_RECEIPT = 10_000  # bytes of it that are read
Notify = Callable[[str], None]


class StudentSubmission(Struct, frozen=True):
    """What one student handed in.

    `student` is the number or name that the platform gives, made unique where two claim the same
    `number`; `folder` the name of the report folder, which no other student has. `platform` named
    the `entries`, the files and folders of the class that it consists of, and `people`, whose it
    is. Where the names can be read in several ways, `may_be` are all whom every file may be of.
    """

    student: str
    name: str
    folder: str
    sources: tuple[Source, ...]
    late: bool = False
    number: str = ""
    platform: str = ""
    entries: tuple[str, ...] = ()
    people: tuple[Person, ...] = ()
    may_be: tuple[Person, ...] = ()


class ClassLocation(Struct, frozen=True):
    """Where submissions lie: a folder, or the address of one.

    `given` is how the user calls it, and `name` whose it is when it is a single submission.
    `left_out` is what is not there because it was not unpacked, by the entry that it belongs to,
    and `empty_folder` replaces entries that were not unpacked.
    """

    where: Path | str
    given: str
    name: str = ""
    left_out: tuple[tuple[Entry, RefusedFile], ...] = ()
    empty_folder: Path = Path()


@contextmanager
def submissions_in(place: Path | str) -> Iterator[ClassLocation]:
    """Yield where the submissions lie; an archive of a whole class is unpacked first.

    Raises:
        UsageError: there is no such place, or the archive is damaged or too large.
    """
    if isinstance(place, Path) and _is_folder(place):
        yield ClassLocation(place, str(place))
        return
    with scratch_folder("lab3-class-") as scratch:
        path = place if isinstance(place, Path) else archive_at(place, scratch, _CLASS)
        given = public_place(place)
        yield ClassLocation(place, given) if path is None else _unpacked(path, given, scratch)


def _is_folder(place: Path) -> bool:
    try:
        return stat.S_ISDIR(place.stat().st_mode)
    except (FileNotFoundError, NotADirectoryError) as error:
        raise UsageError(f"{place}: there is no such folder or archive of submissions") from error
    except OSError as error:
        raise UsageError(f"{place}: cannot be read ({error.strerror})") from error


def _unpacked(archive: Path, given: str, scratch: Path) -> ClassLocation:
    if not archive.is_file() or not is_archive(archive.name):
        raise UsageError(f"{given}: is neither a folder nor an archive of submissions")
    folder, empty_folder = scratch / "class", scratch / "empty_folder"
    for path in (folder, empty_folder):
        path.mkdir()
    copy = SubmissionCopy(folder, _CLASS, archives=True)
    try:
        unpack(archive, "", copy)
    except (ArchiveError, TooLargeError, UnreachedError) as error:
        is_full = error.__cause__ is not None and is_no_room(error.__cause__)
        kind = NoRoomError if is_full else UsageError
        raise kind(f"{given}: {str(error).removeprefix(f'{archive.name}: ')}") from error
    left_out = _left_out(copy)
    for parts, _ in left_out:  # the folders of students of whom nothing was unpacked
        with contextlib.suppress(OSError, ValueError):  # names that no file system takes
            folder.joinpath(*parts[:-1][:2]).mkdir(parents=True, exist_ok=True)
    wrapper = _wrapper(folder, left_out)
    if copy.links:
        _take_links(copy, wrapper)
        left_out = _left_out(copy)
    entries = tuple(_entries(left_out, wrapper))
    name = ARCHIVE_END.sub("", archive.name) or archive.name
    return ClassLocation(folder / wrapper, given, name, entries, empty_folder)


def _take_links(copy: SubmissionCopy, wrapper: str) -> None:
    """Take in the links of a class that stay within what one student handed in."""
    is_one = is_submission(copy.target / wrapper)
    for name, target in copy.links.items():
        students = []
        for path in (name, target):
            student, *below = path_parts(path)[bool(wrapper) :] or [""]
            students.append(student if below else "")
        if is_one or (students[0] and students[0] == students[1]):
            copy.take_link(name, target)
        else:
            copy.refuse(name, LEADS_OUT)


def _left_out(copy: SubmissionCopy) -> _LeftOut:
    """Return what was not unpacked, by what its path would be inside the archive.

    The last part is that of a file, and empty for a folder.
    """
    left_out = []
    copy.say_passed_over()
    for file in [*copy.refused, *(RefusedFile(path, _PASSED_OVER) for path in copy.hidden)]:
        path = file.path
        parts = path.replace("\\", "/").split("/")
        if len(parts[0]) > 1 and parts[0][1] == ":":
            parts = parts[1:]
        own = [part for part in parts if part not in {"", ".", ".."}]
        if path.endswith("/"):
            own.append("")
        if any(own) and not is_leftover(own[0]):
            left_out.append((tuple(own), file))
    return left_out


def _entries(left_out: _LeftOut, wrapper: str) -> Iterator[tuple[Entry, RefusedFile]]:
    """Yield which entry of the class each of them belongs to, and what to say of it."""
    for parts, file in left_out:
        inside = parts[1:] if wrapper and parts[0] == wrapper and len(parts) > 1 else parts
        entry = (inside[0], len(inside) > 1)
        # What is passed over without a word in a student's folder is so in an archive too.
        if inside[0] and (file.reason != _PASSED_OVER or inside[0].startswith(".")):
            name = "/".join(inside[1:]) or inside[0]
            yield entry, replace(file, path=name.encode("utf-8", "backslashreplace").decode())


def _wrapper(place: Path, left_out: _LeftOut) -> str:
    """Return the one folder that an archive wraps its students' folders in, '' for none."""
    tops = {name for name, is_folder in entries_in(place) if is_submission_part((name, is_folder))}
    tops |= {parts[0] for parts, _ in left_out if is_submission_part((parts[0], len(parts) > 1))}
    if len(tops) != 1:
        return ""
    (top,) = tops
    inside = place / top
    if not inside.is_dir() or is_submission(inside):
        return ""
    students = {name for name, is_folder in entries_in(inside) if _is_student(name, is_folder)}
    students |= {
        parts[1]
        for parts, _ in left_out
        if parts[0] == top and len(parts) > 1 and _is_student(parts[1], bool(parts[2:]))
    }
    return top if len(students) > 1 else ""


def _is_student(name: str, is_folder: bool) -> bool:  # noqa: FBT001 - an entry's two halves
    return is_submission_part((name, is_folder)) and (is_folder or is_archive(name))


def find_submissions(
    place: ClassLocation | Path | str, notify: Notify = lambda _line: None
) -> tuple[StudentSubmission, ...]:
    """Return every student's submission in a folder, in the order of the students.

    A folder in object storage is given by its address, as text. `notify` receives, in a line each,
    what is passed over, and of whom the name is not known.

    Raises:
        UsageError: there is no such folder, it cannot be read, or nothing in it is a submission.
    """
    location = (
        place if isinstance(place, ClassLocation) else ClassLocation(place, public_place(place))
    )
    where = location.where
    if isinstance(where, str):
        entries = entries_at(where)
        is_one, read = are_submission(entries), partial(read_at, where)
    else:
        if not where.is_dir():
            raise UsageError(f"{location.given}: there is no such folder or archive of submissions")
        try:
            entries = entries_in(where)
        except OSError as error:
            raise UsageError(f"{location.given}: cannot be read ({error.strerror})") from error
        is_one, read = is_submission(where), partial(read_in, where)
    parts = [_whole(location)] if is_one else _parts(location, entries, read, notify)
    if not parts:
        raise UsageError(f"{location.given}: holds no submission: no folder, archive or stage")
    return tuple(_joined(parts))


def _whole(location: ClassLocation) -> SubmissionPart:
    """Return the place as the one submission that it is."""
    where = location.where
    if isinstance(where, str):
        name = name_at(where)
        source = Source(Path(name), address=address_below(where, "", is_folder=False))
        return SubmissionPart(name, name, source, name)
    name = location.name or where.resolve().name or "submission"
    missing = tuple(
        replace(refused, path=f"{entry}/{refused.path}") if is_folder else refused
        for (entry, is_folder), refused in location.left_out
    )
    return SubmissionPart(name, name, Source(where.resolve(), left_out=missing), name)


def _parts(
    location: ClassLocation,
    entries: list[Entry],
    read: Callable[[str], bytes | str],
    notify: Notify,
) -> list[SubmissionPart]:
    """Tell by their names whose the entries of a place are, and notify of what is not clear.

    `read` returns the bytes of a file there, or why it cannot be read.
    """

    def receipt(name: str) -> str:
        data = read(name)
        return data[:_RECEIPT].decode("utf-8-sig", "replace") if isinstance(data, bytes) else ""

    names = names_in(read(METADATA)) if (METADATA, False) in entries else StudentNames({}, "")
    present = {name for name, _ in entries}
    missing = dict.fromkeys(entry for entry, _ in location.left_out if entry[0] not in present)
    all_entries = sorted(
        [*{name: (name, is_folder) for name, is_folder in missing}.values(), *entries]
    )
    passed_over = [
        name
        for name, is_folder in all_entries
        if not is_submission_part((name, is_folder)) and not is_leftover(name) and name != METADATA
    ]
    if passed_over:
        listed = _listed(passed_over)
        notify(f"{location.given}: ignored, since they belong to no student: {listed}")
    ours = [entry for entry in all_entries if is_submission_part(entry)]
    left_out: dict[str, list[RefusedFile]] = {}
    for (entry, _), refused in location.left_out:
        left_out.setdefault(entry, []).append(refused)
    parts = []
    for part in parts_of(ours, names.by_folder, receipt):
        if part.others and not is_receipt(part.entry):
            candidates = " or ".join(map(_called, part.others))
            file, owner = _listed([part.entry]), _called(part.people[0])
            notify(f"{file}: taken as of {owner}; may be of {candidates}")
        if isinstance(location.where, str):
            is_folder = (part.entry, True) in ours
            source = _source_at(location.where, part, is_folder=is_folder)
        else:
            path = location.where / part.entry
            source = replace(
                part.source,
                path=path if os.path.lexists(path) else location.empty_folder,
                left_out=tuple(left_out.get(part.entry, ())),
            )
        parts.append(replace(part, source=source))
    if METADATA in present:
        unnamed = [name for name, is_folder in ours if is_folder and name not in names.by_folder]
        who = f"; graded under the names of their folders: {_listed(unnamed)}" if unnamed else ""
        because = f" ({names.fault})" if names.fault else ""
        if who or because:
            notify(f"{METADATA}: does not name everybody{because}{who}")
    return parts


def _source_at(address: str, part: SubmissionPart, *, is_folder: bool) -> Source:
    """Return the source of a part below an address, or the reason why it cannot be fetched."""
    below = address_below(address, part.entry, is_folder=is_folder)
    if "::" in below.removeprefix(address):  # fsspec would read it as an address of its own
        fault = "its name holds '::' which cannot be part of an address"
        return replace(part.source, fault=fault)
    if "\0" in part.entry:
        return replace(part.source, fault="its name holds characters that do not print")
    return replace(part.source, address=below)


def _called(person: Person) -> str:
    """Return a person of one id, as messages name them."""
    (number,) = person.ids.values()
    return f"{person.name} ({number})" if person.name else number


def _listed(names: list[str]) -> str:
    shown = ", ".join(_text(name) if name.isprintable() else repr(name) for name in names[:5])
    more = len(names) - _MOST_NAMED
    return f"{shown} and {more} more" if more > 0 else shown


def _joined(parts: list[SubmissionPart]) -> Iterator[StudentSubmission]:
    """Put together what belongs to one student; two of them never share a name or a folder."""
    groups: dict[tuple[str, str, str], list[SubmissionPart]] = {}
    for part in parts:
        alone = part.entry if part.stands_alone else ""
        groups.setdefault((part.student, part.platform, alone), []).append(part)
    claims = Counter(student for student, _, _ in groups)
    names: set[str] = set()
    folders: set[str] = set()
    for (number, platform, entry), own in sorted(groups.items()):
        student = f"{number} ({entry})" if entry and claims[number] > 1 else number
        while student in names:
            student += " again"
        names.add(student)
        folder = _slug(student, folders)
        folders.add(folder.casefold())
        own.sort(key=lambda part: -part.upload)
        is_uncertain = any(part.others for part in own)
        readings = [(*part.people, *part.others) for part in own] if is_uncertain else [()]
        of_all = (person for person in readings[0] if all(person in each for each in readings))
        yield StudentSubmission(
            _text(student),
            _text(own[0].name),
            folder,
            tuple(replace(part.source, upload=part.upload, when=part.when) for part in own),
            any(part.late for part in own),
            _text(number),
            platform,
            tuple(_text(part.entry) for part in own),
            _unique(own[0].people),
            _unique(of_all),
        )


def _unique(people: Iterable[Person]) -> tuple[Person, ...]:
    """Return people once each, with names and ids that are text."""
    unique: list[Person] = []
    for person in people:
        ids = {kind: _text(value) for kind, value in person.ids.items()}
        as_text = Person(_text(person.name), ids)
        unique += [] if as_text in unique else [as_text]
    return tuple(unique)


def _text(name: str) -> str:
    """Return a name as text, also where the file system holds bytes that are none."""
    return name.encode("utf-8", "backslashreplace").decode()


def _slug(student: str, taken: set[str]) -> str:
    """Return a folder name that every file system and every link takes as it is."""
    plain = _SLUG.sub("_", student).strip("._-")[:_LONGEST_SLUG]
    if plain == student and plain.casefold() not in taken:
        return plain
    digest = student.encode("utf-8", "backslashreplace")
    while True:  # a student may be called as another one's folder
        digest = hashlib.sha256(digest).hexdigest().encode()
        slug = f"{plain or 'student'}-{digest[:8].decode()}"
        if slug.casefold() not in taken:
            return slug
