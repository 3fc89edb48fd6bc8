"""Which files of a submission are copied: one answer for folders, archives and storages."""

from __future__ import annotations

import re

from msgspec import Struct

from lab3_usd.grade.intake.limits import Limits
from lab3_usd.lab.plain_yaml import bracket_depth

_LONGEST_NAME = 200  # bytes; file systems end at 255
_LONGEST_OF_CLASS = 255
_LONGEST_PATH = 1000
# Files that operating systems, editors and Isaac Sim leave behind.
LEFTOVERS = ("__MACOSX", "__pycache__", "Thumbs.db", "desktop.ini")
YAML = (".yaml", ".yml")
LARGEST_YAML = 8 << 20  # saved messages may be long; maps and parameters are some kilobytes
_ALIAS = re.compile(rb"(?<![^\s\[{,:-])\*\w")
_MOST_ALIASES = 50  # a few lines of aliases of aliases unfold to gigabytes
_MOST_BRACKETS = 60
# Their contents are not judged; their names count as deliverables.
_ONLY_NAMES = (
    ".mp4", ".mov", ".mkv", ".webm", ".avi", ".png", ".jpg", ".jpeg", ".webp", ".gif", ".bmp",
    ".tif", ".tiff", ".heic", ".pdf", ".doc", ".docx", ".odt",
)  # fmt: skip
_MAPS_MAY_BE = (".png", ".bmp")
_SMALL_PICTURE = 4 << 20


class RefusedFile(Struct, frozen=True):
    """A file of a submission that is not copied, by its path there, and why."""

    path: str
    reason: str


def path_parts(name: str) -> list[str]:
    """Return the parts of a path in a submission, whichever system wrote it."""
    return [part for part in name.replace("\\", "/").split("/") if part not in {"", "."}]


def is_hidden(parts: list[str]) -> bool:
    """Whether a file is passed over without a word: hidden files, and what programs leave."""
    return any((part.startswith(".") and part != "..") or part in LEFTOVERS for part in parts)


def name_fault(name: str, limits: Limits, *, of_class: bool = False) -> str:
    """Say why a file of this name is not copied; '' for a name that is fine.

    The files of a class are looked at again as the student's own, without the student's name.
    """
    parts = path_parts(name)
    if ".." in parts or name.startswith(("/", "\\")) or (len(name) > 1 and name[1] == ":"):
        return "its name leads out of the submission; it is not unpacked"
    if "\0" in name or not (of_class or all(part.isprintable() for part in parts)):
        return "its name holds characters that do not print"
    lengths = [len(part.encode(errors="surrogateescape")) for part in parts]
    longest = _LONGEST_OF_CLASS if of_class else _LONGEST_NAME
    if max(lengths) > longest or sum(lengths) + len(lengths) > _LONGEST_PATH:
        return "its name is too long"
    if len(parts) > limits.folders:
        return f"it lies more than {limits.folders} folders deep"
    return ""


def only_name_counts(name: str, size: int) -> bool:
    """Whether the contents of a file are not judged: pictures, videos and documents."""
    lower = name.lower()
    if lower.endswith(_MAPS_MAY_BE) and size <= _SMALL_PICTURE:
        return False
    return lower.endswith(_ONLY_NAMES)


def is_read(name: str, size: int, limits: Limits) -> bool:
    """Whether the contents of a file are read: they are judged, and not too large."""
    return size <= limits.file_size and not only_name_counts(name, size)


def yaml_fault(data: bytes) -> str:
    """Say why YAML is not opened; it may have more aliases or brackets than maps and parameters."""
    if len(data) > LARGEST_YAML:
        return f"it is larger than {LARGEST_YAML >> 20} MB; not opened"
    if len(_ALIAS.findall(data)) > _MOST_ALIASES or bracket_depth(data) > _MOST_BRACKETS:
        return "it unfolds to far more than it says; not opened"
    return ""
