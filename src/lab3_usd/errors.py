"""The exceptions of the package: each says in one line what is wrong, where, how to repair it."""


class Lab3Error(Exception):
    """Base of every error that the package raises on purpose."""


class SpecError(Lab3Error):
    """A file in `graphs/` is wrong; the line names file, graph, role and port."""


class StageError(Lab3Error):
    """A stage file cannot be opened, read or written."""


class UsageError(Lab3Error):
    """The command or call was given something it cannot work with."""


class RecordingError(Lab3Error):
    """A recording cannot be read: none, damaged, or too large."""
