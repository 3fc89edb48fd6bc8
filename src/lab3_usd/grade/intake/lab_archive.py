"""Unpacks the zip of a lab, with the caution that any stranger's archive gets."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from lab3_usd.errors import UsageError
from lab3_usd.grade.intake.archives import unpack
from lab3_usd.grade.intake.submission_copy import MEGABYTE, Limits, SubmissionCopy
from lab3_usd.spec.lab import CHECKPOINTS
from lab3_usd.yaml_file import read_foreign_yaml

# What a lab is made of: text, and a map.
_LIMITS = Limits(files=500, file_size=16 * MEGABYTE, total_size=64 * MEGABYTE, folders=6)
_CODE = (".py", ".pyc", ".pyd", ".so", ".dll", ".exe", ".sh", ".bat", ".ps1")


@contextmanager
def unpacked_lab(archive: Path) -> Iterator[Path]:
    """Unpack the zip of a lab, and return its folder, which is there until the context is left.

    Raises:
        UsageError: it holds a program, a file that is not taken in, YAML that unfolds, or no lab.
        ArchiveError: it cannot be read, or is damaged.
        TooLargeError: it holds too many files or too much in them.
    """
    with tempfile.TemporaryDirectory(prefix="lab3-lab-") as temporary:
        target = Path(temporary, "lab")
        target.mkdir()
        copy = SubmissionCopy(target, _LIMITS)
        unpack(archive, "", copy)
        for refused in copy.refused:
            raise UsageError(f"{archive.name}: {refused.path}: {refused.reason}")
        paths = sorted(path for path in target.rglob("*") if path.is_file())
        for path in paths:
            name = path.relative_to(target).as_posix()
            if path.suffix.lower() in _CODE:
                raise UsageError(f"{archive.name}: {name} is a program; a lab contains data only")
            if path.suffix.lower() == ".yaml":
                read_foreign_yaml(path)
        if not (target / CHECKPOINTS).is_file():
            raise UsageError(f"{archive.name}: holds no {CHECKPOINTS}; pack the folder of a lab")
        yield target
