"""Copies one submission to where it is judged."""

from __future__ import annotations

import contextlib
import hashlib
import os
import shutil
import stat
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cache, partial
from itertools import accumulate
from pathlib import Path

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.grade.intake.archives import (
    OTHER_ENDINGS,
    ArchiveError,
    is_archive,
    unpack,
    unpack_beside,
)
from lab3_usd.grade.intake.submission_copy import (
    LEADS_OUT,
    LEADS_TO_NO_FILE,
    Limits,
    RefusedFile,
    SubmissionCopy,
    TooLargeError,
    check_reached,
    is_hidden,
    made_folder,
    stage_seeker,
)
from lab3_usd.grade.intake.submission_folder import (
    UPLOAD_LEFT_ASIDE,
    FolderRemark,
    choose_folder,
    counted,
    stage_folder,
)
from lab3_usd.spec.load.loader import load_lab
from lab3_usd.spec.submission import named_checkpoint

_UNREAD = "it cannot be read"
_NO_FILE = "it is a pipe, socket or device; not opened"


class Source(Struct, frozen=True):
    """A file, folder or archive that a submission consists of, and its name there ('' for all).

    `address` is set if it must be fetched from elsewhere, `left_out` names what was refused on the
    way here, and `fault` is the reason why it cannot be fetched.
    Sources of one upload have one number, the last upload the highest, and 0 belongs to every
    upload; `when` tells the upload to people.
    """

    path: Path
    name: str = ""
    address: str = ""
    left_out: tuple[RefusedFile, ...] = ()
    fault: str = ""
    upload: int = 0
    when: str = ""


class StagedSubmission(Struct, frozen=True):
    """The copy of a submission: its folder, its digest, what was left out, and its files' digests.

    The digests are by the names of the files in the folder, '' for those whose contents are not
    judged. `remarks` say which of several folders and uploads this is.
    """

    folder: Path
    digest: str
    refused: tuple[RefusedFile, ...]
    digests: Mapping[str, str]
    remarks: tuple[FolderRemark, ...] = ()


def stage_submission(
    sources: Iterable[Source], target: Path, limits: Limits, *, merge: bool = False
) -> StagedSubmission:
    """Copy and unpack a submission below `target`, which holds plain files only afterwards.

    Of several uploads the last alone is the submission; with `merge`, what it does not hold comes
    from the ones before.

    Raises:
        TooLargeError: it holds too many files or too much in them.
        ArchiveError: the one archive that it consists of cannot be unpacked, or nothing in it read.
        UnreachedError: this computer cannot read a file, or has no room for it.
    """
    taken = list(sources)
    numbers = sorted({source.upload for source in taken if source.upload}, reverse=True)
    if len(numbers) < 2:  # noqa: PLR2004 - one upload
        return _stage_upload(taken, target, limits)[0]
    uploads = [[source for source in taken if source.upload in {0, number}] for number in numbers]
    when, *whens = (next(source.when for source in own if source.upload) for own in uploads)
    folders = [target / str(rank) for rank in range(len(uploads))]
    for folder in folders:
        folder.mkdir()
    try:
        last, copy = _stage_upload(uploads[0], folders[0], limits)
    except ArchiveError as error:
        earlier = ", ".join(whens)
        raise ArchiveError(f"{error}; this is the last {when}, before it came {earlier}") from error
    digest, remarks = hashlib.sha256(last.digest.encode()), list(last.remarks)

    def remark(text: str) -> None:
        remarks.append(FolderRemark(".", text, UPLOAD_LEFT_ASIDE))

    held = stage_folder(copy, last.folder.relative_to(folders[0]).as_posix()).checkpoints
    for own, folder, earlier in zip(uploads[1:], folders[1:], whens, strict=True):
        try:
            before, copy = _stage_upload(own, folder, limits)
        except (ArchiveError, TooLargeError) as error:
            remark(f"the earlier {earlier} cannot be read: {error}")
            continue
        digest.update(before.digest.encode())
        had = stage_folder(copy, before.folder.relative_to(folder).as_posix()).checkpoints
        if merge:
            last, added = _merged(last, before)
            if added:
                remark(f"from the {earlier}: {', '.join(added)}")
        elif len(had) > len(held):
            remark(
                f"the last {when} is judged ({counted(held)}); the earlier {earlier} has more "
                f"({counted(had)})"
            )
    if merge and remarks != list(last.remarks):
        remark(f"all else is from the last {when}")
    for folder_remark in remarks:
        digest.update(folder_remark.text.encode("utf-8", "backslashreplace"))
    return replace(last, digest=digest.hexdigest(), remarks=tuple(remarks))


def _merged(last: StagedSubmission, before: StagedSubmission) -> tuple[StagedSubmission, list[str]]:
    """Add the files of an earlier upload that a later one does not hold, and name them.

    Where the later one has the stage of a checkpoint, an earlier one is not added.
    """
    lab = load_lab()

    def checkpoint_in(name: str) -> str | None:
        return named_checkpoint(Path(name).name, lab.files)

    checkpoints = {checkpoint_in(name) for name in last.digests} - {None}
    digests, added = dict(last.digests), []
    for name, digest in sorted(before.digests.items()):
        goal = last.folder / name
        if checkpoint_in(name) in checkpoints or os.path.lexists(goal):
            continue
        try:
            goal.parent.mkdir(parents=True, exist_ok=True)
            shutil.move(before.folder / name, goal)
        except (FileExistsError, NotADirectoryError):  # a file is called as a folder
            continue
        digests[name] = digest
        added.append(name)
    return replace(last, digests=digests), added


def _stage_upload(
    sources: Sequence[Source], target: Path, limits: Limits
) -> tuple[StagedSubmission, SubmissionCopy]:
    """Copy and unpack one upload below `target`, and choose the folder that is the submission."""
    copy = SubmissionCopy(target, limits)
    for source in sources:
        for file in source.left_out:
            copy.refuse(file.path, file.reason, file.rule)
        if os.path.isdir(source.path) and not source.path.is_symlink():  # noqa: PTH112 - never raises
            root = source.path.resolve()
            for path, name in _files_below(root, copy):
                _take_file(path, source.name + name, copy, root=root)
        else:
            name = source.name or source.path.name
            _take_file(source.path, name, copy, alone=len(sources) == 1)
    copy.say_passed_over()
    unread = [file for file in copy.refused if file.reason.startswith(_UNREAD)]
    if unread and not copy.digests:
        raise ArchiveError(f"{unread[0].path}: {unread[0].reason.removeprefix('it ')}")
    _put_in_place(copy)
    choice = choose_folder(copy)
    folder = target / choice.path
    start = f"{folder}{os.sep}"
    digests = {
        path.removeprefix(start): digest
        for path, digest in copy.digests.items()
        if path.startswith(start)
    }
    refused = tuple(
        replace(file, path=file.path.removeprefix(f"{choice.path}/"))
        for file in (*copy.refused, *choice.beside)
    )
    texts = "\0".join((choice.path, *(remark.text for remark in choice.remarks)))
    digest = hashlib.sha256(f"{copy.digest()}\0{texts}".encode("utf-8", "backslashreplace"))
    staged = StagedSubmission(folder, digest.hexdigest(), refused, digests, choice.remarks)
    return staged, copy


def _put_in_place(copy: SubmissionCopy) -> None:
    """Move what came in an archive to where the archive lay.

    An archive that holds the stage of a checkpoint that there is elsewhere too is another version
    of the lab: its files stay in the folder that stands for it.
    """
    lab = load_lab()

    @cache
    def checkpoint_of(path: str) -> str | None:
        return named_checkpoint(Path(path).name, lab.files)

    merged: set[str] = set()
    for archive in reversed(copy.unpacked):  # the inner ones first
        start = f"{copy.target / archive}{os.sep}"
        own = sorted(path for path in copy.digests if path.startswith(start))
        numbers = {checkpoint_of(path) for path in own} - {None}
        others = (path for path in copy.digests if not path.startswith(start))
        if numbers and not numbers.isdisjoint(map(checkpoint_of, others)):
            continue
        merged.add(archive)
        parent, slash, _ = archive.rpartition("/")
        for path in own:
            name = Path(path.removeprefix(start)).as_posix()
            copy.move(f"{archive}/{name}", f"{parent}{slash}{name}")
        shutil.rmtree(copy.target / archive, ignore_errors=True)
    copy.unpacked = [_merged_path(name, merged) for name in copy.unpacked if name not in merged]
    copy.refused = [replace(file, path=_merged_path(file.path, merged)) for file in copy.refused]


def _merged_path(path: str, merged: set[str]) -> str:
    """Return a path without the folders that stood for archives whose files were put in place."""
    *above, name = path.split("/")
    folders = zip(above, accumulate(above, "{}/{}".format), strict=True)
    return "/".join([*(part for part, folder in folders if folder not in merged), name])


def _files_below(root: Path, copy: SubmissionCopy) -> Iterator[tuple[Path, str]]:
    """Yield what a folder holds, links not followed, in the order of the names."""
    holds_stages = stage_seeker(partial(_files_in, root))
    waiting = [""]
    while waiting:
        below = waiting.pop()
        try:
            with os.scandir(root / below) as scan:
                entries = sorted(scan, key=lambda entry: entry.name)
        except OSError as error:
            check_reached(below.rstrip("/") or root.name, error)
            copy.refuse(below.rstrip("/") or root.name, f"{_UNREAD} ({error.strerror})")
            continue
        for entry in entries:
            name = f"{below}{entry.name}"
            if not entry.is_dir(follow_symlinks=False):
                yield Path(entry.path), name
            elif made_folder(f"{name}/file", holds_stages):
                copy.pass_over(name)
            elif name.count("/") >= copy.limits.folders:
                copy.refuse(name, f"it lies more than {copy.limits.folders} folders deep")
            elif copy.place(name) is not None:
                waiting.append(f"{name}/")


def _files_in(root: Path, folder: str) -> list[str]:
    """Return the names of the files of a folder below `root`."""
    with contextlib.suppress(OSError), os.scandir(root / folder) as scan:
        return [entry.name for entry in scan if not entry.is_dir(follow_symlinks=False)]
    return []


def _take_file(
    path: Path, name: str, copy: SubmissionCopy, root: Path | None = None, *, alone: bool = False
) -> None:
    """Take in one file; an archive at the top of a submission is unpacked."""
    if path.is_symlink():
        inside = _target_inside(path, root)
        if inside is None:
            copy.refuse(name, LEADS_OUT)
            return
        if not inside.is_file():
            copy.refuse(name, LEADS_TO_NO_FILE)
            return
        path = inside
    is_packed = is_archive(name) and "/" not in name
    if not is_packed and name.lower().endswith(OTHER_ENDINGS) and "/" not in name:
        copy.refuse(name, "archives of this kind are not unpacked; hand in a .zip")
        return
    if is_packed and is_hidden([name]) and not alone:
        return
    try:
        if not stat.S_ISREG(path.lstat().st_mode):
            copy.refuse(name, _NO_FILE)  # and never waited for
        elif not is_packed:
            _copy(path, name, copy)
        elif alone:
            unpack(path, "", copy)
        else:
            unpack_beside(path, name, copy)
    except ArchiveError as error:
        if alone:
            raise
        copy.refuse(name, str(error).partition(": ")[2])
    except OSError as error:
        check_reached(name, error)
        copy.refuse(name, f"{_UNREAD} ({error.strerror})")


def _target_inside(link: Path, root: Path | None) -> Path | None:
    """Return what a link leads to when that is in the submission."""
    try:
        target = link.resolve(strict=True)
    except (OSError, RuntimeError):
        return None
    return target if root is not None and target.is_relative_to(root) else None


def _copy(path: Path, name: str, copy: SubmissionCopy) -> None:
    flags = os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)
    handle = os.open(path, flags | getattr(os, "O_BINARY", 0))
    with open(handle, "rb") as file:  # noqa: PTH123 - a handle, not a path
        status = os.fstat(handle)
        if stat.S_ISREG(status.st_mode):
            copy.take(name, status.st_size, file, status.st_mtime)
        else:  # it was replaced since it was looked at
            copy.refuse(name, _NO_FILE)
