"""How a process ended, from its own status and figures; one that does not end is killed."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import time

from lab3_usd.grade.workers.messages import CRASHED, OUT_OF_MEMORY

END_SECONDS = 2.0  # for a process that closed its pipe to end, and for a killed one to be gone
CLOSED = "stopped answering"
_POLL_SECONDS = 0.02
# Nothing in a file sends these: somebody outside does, or a system that is short of memory.
_FROM_OUTSIDE = {"SIGKILL", "SIGTERM", "SIGINT", "SIGHUP"}


def how_it_ended(process: subprocess.Popen[bytes], memory: int) -> tuple[str, bool]:
    """Say how a process ended that closed its pipe, and whether that came from outside.

    More than `memory` bytes say that it ran out of it. A process that goes on is killed.
    """
    until = time.monotonic() + END_SECONDS
    while not (ended := _has_ended(process)) and time.monotonic() < until:
        time.sleep(_POLL_SECONDS)
    kill(process)
    if not ended:
        return CLOSED, False
    status, peak = _figures(process)
    if peak > memory:
        return OUT_OF_MEMORY, False
    if status >= 0:
        return f"ended the worker (status {status})", False
    try:
        name = signal.Signals(-status).name
    except ValueError:
        name = f"signal {-status}"
    return (f"ended by {name}", True) if name in _FROM_OUTSIDE else (f"{CRASHED} ({name})", False)


def _has_ended(process: subprocess.Popen[bytes]) -> bool:
    """Whether a process has ended; its figures stay where they are, as long as that is possible."""
    if not hasattr(os, "waitid") or process.returncode is not None:
        return process.poll() is not None
    try:
        flags = os.WEXITED | os.WNOHANG | os.WNOWAIT
        return os.waitid(os.P_PID, process.pid, flags) is not None
    except ChildProcessError:
        return True


def kill(process: subprocess.Popen[bytes]) -> None:
    """Kill a process and everything it started; a process that was waited for has no group."""
    if process.returncode is None:
        with contextlib.suppress(OSError):
            if hasattr(os, "killpg"):
                os.killpg(process.pid, signal.SIGKILL)
            else:
                process.kill()


def _figures(process: subprocess.Popen[bytes]) -> tuple[int, int]:
    """Return the exit status of a process that has ended, and the most memory that it had.

    The memory is in bytes, 0 where it is not known.
    """
    if not hasattr(os, "wait4") or process.returncode is not None:
        return process.wait(), 0
    try:
        _, status, usage = os.wait4(process.pid, 0)
    except ChildProcessError:
        return process.wait(), 0
    process.returncode = os.waitstatus_to_exitcode(status)
    scale = 1 if sys.platform == "darwin" else 1024
    return process.returncode, usage.ru_maxrss * scale
