"""The exceptions of the package, each one line with the repair, and the exit codes of commands."""

import errno
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from types import FrameType
from typing import Any

EXIT_FOUND = 1  # faults, differences, or what a command refuses to go on with
EXIT_USAGE = 2
EXIT_CRASH = 3
EXIT_INTERRUPTED = 130  # what a shell says of a command that Ctrl-C ended
_BY_SIGNAL = 128  # and the number of the signal: what it says of others, as of SIGTERM (143)


def guess(name: str, candidates: Iterable[str], otherwise: str = "") -> str:
    """Return which known name may be meant; where none is near, `otherwise` or all of them."""
    from difflib import get_close_matches

    names = list(candidates)
    if near := " or ".join(f"'{match}'" for match in get_close_matches(name, names)):
        return f"did you mean {near}?"
    return otherwise or f"known are {', '.join(names)}"


class Lab3Error(Exception):
    """Base of every error that the package raises on purpose."""


class SpecError(Lab3Error):
    """A file in `graphs/` is wrong; the line names file, graph, role and port."""


class GraphError(Lab3Error):
    """A node, value or wire of a graph is one that Isaac Sim does not have."""


class StageError(Lab3Error):
    """A stage file cannot be opened, read or written; damaged text has a line and a column.

    Where the text says how to `repair` it, nothing else needs to.
    """

    def __init__(
        self, text: str, line: int | None = None, column: int | None = None, repair: str = ""
    ) -> None:
        """Say what is wrong, where in the file, and how to repair it."""
        super().__init__(f"{text}; {repair}" if repair else text)
        self.line = line
        self.column = column
        self.repair = repair


class RuleError(Lab3Error, ValueError):
    """A rule cannot be registered: its id or name is taken, or of another form."""


class UsageError(Lab3Error):
    """The command or call was given something it cannot work with."""


class UnknownTeamError(UsageError):
    """A lab has values by team, and nothing says which team it is, or there are none for it."""


class AmbiguousError(UsageError):
    """Several things can be meant; `candidates` names them, and `option` chooses one."""

    def __init__(self, what: str, candidates: Sequence[str], option: str) -> None:
        """Ask which one is meant."""
        super().__init__(f"which {what}? {', '.join(candidates)}: name one with {option}")
        self.candidates = tuple(candidates)
        self.option = option


class NewFindingsError(UsageError):
    """The linter finds something new in what was added; `findings` has it."""

    def __init__(self, path: Path, findings: Sequence[Any]) -> None:
        """Say what is new."""
        lines = (f"{finding.rule} {finding.prim}: {finding.message}" for finding in findings)
        super().__init__(
            f"{path}: new findings: {'; '.join(lines)}; check=False saves all the same"
        )
        self.findings = tuple(findings)


class NoRoomError(Lab3Error):
    """The disk is full, which is a fault of neither the call nor the input."""


class RecordingError(Lab3Error):
    """A recording cannot be read: none, damaged, or too large."""


_NO_ROOM = {errno.ENOSPC, getattr(errno, "EDQUOT", errno.ENOSPC)}


def is_no_room(error: BaseException) -> bool:
    """Whether the disk is full, or what a user may have of it."""
    return isinstance(error, OSError) and error.errno in _NO_ROOM


def unwritten(place: object, error: OSError, kind: type[Lab3Error] = UsageError) -> Lab3Error:
    """Return the error that says that a file or folder cannot be written, and why."""
    raised = NoRoomError if is_no_room(error) else kind
    return raised(f"{place} cannot be written ({error.strerror})")


def signal_name(number: int) -> str:
    """Return the name of a signal; real-time signals have none, and are called by their number."""
    import signal

    try:
        return signal.Signals(number).name
    except ValueError:
        return f"signal {number}"


def exit_text(status: int) -> str:
    """Say how a process ended, from its status as Python has it: the signal, or the exit status."""
    return signal_name(-status) if status < 0 else f"exit status {status}"


class EndedBySignalError(KeyboardInterrupt):
    """A signal asked the program to end, which first cleans up behind itself."""

    def __init__(self, signal: int) -> None:
        """Keep the number of the signal, and the exit code that shells show for it."""
        super().__init__(signal)
        self.signal = signal
        self.status = _BY_SIGNAL + signal


_SECONDS_UNTIL_AGAIN = 0.05


def interrupt(number: int, frame: FrameType | None) -> None:
    """Handle SIGINT as Python does, but not while modules of usd-core are imported.

    They import each other from C++, which prints an exception and goes on without the module. The
    signal comes again a moment later.

    Raises:
        KeyboardInterrupt: no module of usd-core is being imported.
    """
    inner = frame
    while inner is not None:
        if str(inner.f_globals.get("__name__")).partition(".")[0] == "pxr":
            import signal
            from threading import Timer, get_ident

            if sys.platform == "win32":
                again = Timer(_SECONDS_UNTIL_AGAIN, signal.raise_signal, (number,))
            else:  # which wakes the thread that waits
                again = Timer(_SECONDS_UNTIL_AGAIN, signal.pthread_kill, (get_ident(), number))
            again.daemon = True
            again.start()
            return
        inner = inner.f_back
    raise KeyboardInterrupt


def failure_text(error: Exception) -> str:
    """Name an exception that nobody raised on purpose, and the line that raised it."""
    import traceback

    frames = traceback.extract_tb(error.__traceback__)
    place = f" at {Path(frames[-1].filename).name}:{frames[-1].lineno}" if frames else ""
    try:
        text = str(error)
    except UnicodeError:  # what usd-core says of bytes that are no text
        text = "its message is not text"
    return f"{type(error).__name__}: {text}{place}"
