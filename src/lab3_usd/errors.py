"""The exceptions of the package, each one line with the repair, and the exit codes of commands."""

EXIT_FOUND = 1  # faults, differences, or what a command refuses to go on with
EXIT_USAGE = 2
EXIT_CRASH = 3
EXIT_INTERRUPTED = 130  # what a shell says of a command that Ctrl-C ended


class Lab3Error(Exception):
    """Base of every error that the package raises on purpose."""


class SpecError(Lab3Error):
    """A file in `graphs/` is wrong; the line names file, graph, role and port."""


class StageError(Lab3Error):
    """A stage file cannot be opened, read or written; damaged text has a line and a column."""

    def __init__(self, text: str, line: int | None = None, column: int | None = None) -> None:
        """Say what is wrong, and where in the file."""
        super().__init__(text)
        self.line = line
        self.column = column


class UsageError(Lab3Error):
    """The command or call was given something it cannot work with."""


class RecordingError(Lab3Error):
    """A recording cannot be read: none, damaged, or too large."""
