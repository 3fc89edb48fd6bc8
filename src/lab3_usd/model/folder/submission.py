"""A student's folder as plain data: what the rules about submissions look at."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

from msgspec import Struct, field

from lab3_usd.model.finding import StageResult
from lab3_usd.spec.lab import Lab
from lab3_usd.spec.submission import SubmissionSpec


class Entry(Struct, frozen=True):
    """A file of the folder, by its path in it; `why_not` says why it is never opened."""

    path: str
    why_not: str = ""

    @property
    def name(self) -> str:
        """The name of the file."""
        return self.path.rpartition("/")[2]

    @property
    def folder(self) -> str:
        """The path of the folder that holds it, '' for the submission itself."""
        return self.path.rpartition("/")[0]


class StageFile(Struct, frozen=True):
    """The file that stands for one checkpoint, and how it is named.

    `slip` is a file that ends in what is no ending of USD. `others` are files with the same
    right name and another ending, `more` files elsewhere or of other names that seem to be of the
    same checkpoint.
    """

    checkpoint: str
    path: str
    naming: Literal["right", "misplaced", "misnamed", "slip"] = "right"
    others: tuple[str, ...] = ()
    more: tuple[str, ...] = ()


class StarterFile(Struct, frozen=True):
    """The starter in the submission: why it cannot be opened, or what of the lab it holds."""

    path: str
    fault: str = ""
    holds: tuple[str, ...] = ()


class Listing(Struct, frozen=True):
    """The files of a folder in the order of their paths.

    `stages` are by checkpoint, `found` by deliverable. `stage_folder` is the folder of the stages,
    '' for the submission itself; `complete` is False where there were too many files to look at.
    """

    entries: tuple[Entry, ...]
    stage_folder: str = ""
    stages: Mapping[str, StageFile] = field(default_factory=dict)
    starter: str | None = None
    found: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    complete: bool = True


class SubmissionSubject(Struct, frozen=True):
    """A submission: its files, and the results of its stages by checkpoint.

    `digests` tell files apart, by checkpoint; `starter` is None where there is none.
    """

    lab: Lab
    spec: SubmissionSpec
    listing: Listing
    results: Mapping[str, StageResult]
    digests: Mapping[str, str]
    starter: StarterFile | None = None
