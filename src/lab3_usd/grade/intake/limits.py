"""How much of what a submission may hold or use before it is refused."""

from __future__ import annotations

from msgspec import Struct

from lab3_usd.errors import Lab3Error

MEGABYTE = 1024 * 1024
_TIMES_AS_LONG = 10  # a submission has more than one file


class TooLargeError(Lab3Error):
    """A submission holds more than the limits allow; none of it is judged."""


class Limits(Struct, frozen=True):
    """Limits of one submission.

    `seconds` without progress end the judging of a file, `all_seconds` that of the submission;
    `memory` is in bytes beyond what a worker needs to begin with, `answer_size` what a worker may
    answer, reports included. Files beyond `file_size` bytes are not opened; `ratio` is how many
    times larger a packed file may become, `nesting` how deep prims and values may lie in one
    another.
    """

    seconds: float = 20.0
    memory: int = 2048 * MEGABYTE
    files: int = 4000
    file_size: int = 64 * MEGABYTE
    total_size: int = 512 * MEGABYTE
    ratio: int = 200
    folders: int = 24
    nesting: int = 200
    prims: int = 100_000
    answer_size: int = 64 * MEGABYTE

    @property
    def all_seconds(self) -> float:
        """How long one submission may take, whatever progress it makes; so may fetching it."""
        return _TIMES_AS_LONG * self.seconds

    def check_count(self, files: int) -> None:
        """Raise TooLargeError where a submission holds more files than it may."""
        if files > self.files:
            message = f"holds more than {self.files} files"
            raise TooLargeError(message)

    def check_size(self, total: int) -> None:
        """Raise TooLargeError where the files of a submission hold more bytes than they may."""
        if total > self.total_size:
            message = f"holds more than {self.total_size >> 20} MB"
            raise TooLargeError(message)
