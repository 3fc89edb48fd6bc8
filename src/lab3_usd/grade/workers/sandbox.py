"""Takes away from a worker process what judging does not need, as far as the platform allows."""

from __future__ import annotations

import contextlib
import ctypes
import os
import signal
import struct
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from lab3_usd.grade.intake.submission_copy import Limits

# What a worker gives up, and what it means where the system does not let it.
WALLS = {
    "files": "Landlock, Linux 5.13 and later, is not there or refused",
    "limits": "memory and files of a process cannot be limited",
    "network": "namespaces of the network are refused",
    "privileges": "they cannot be given up",
}
_OPEN_FILES = 256
_PR_SET_PDEATHSIG = 1
_PR_SET_NO_NEW_PRIVS = 38
_CAPABILITIES_VERSION_3 = 0x20080522
_CAP_DAC_READ_SEARCH = 1 << 2
_CLONE_NEWUSER = 0x10000000
_CLONE_NEWNET = 0x40000000

# Landlock: the numbers of the system calls are the same on every architecture of Linux.
_CREATE_RULESET, _ADD_RULE, _RESTRICT_SELF = 444, 445, 446
_VERSION_FLAG = 1
_BENEATH = 1
_EXECUTE, _WRITE, _READ, _READ_FOLDER = 1, 2, 4, 8
_MAKE_DEVICES = (1 << 6) | (1 << 9) | (1 << 10) | (1 << 11) | (1 << 12)
_FILES_OF_ABI_1 = (1 << 13) - 1
_TRUNCATE = 1 << 14
_ON_FILES = _EXECUTE | _WRITE | _READ | _TRUNCATE
_ABI_WITH_TRUNCATE = 3
_ABI_WITH_NETWORK = 4
_TCP = 3  # bind and connect


def limit_resources(limits: Limits) -> bool:
    """Limit the memory and files of this process from now on; say whether that worked.

    What it has already, the modules that judge, does not count. `limit_time` is made ready.
    """
    if hasattr(signal, "SIGPROF"):  # whoever started this may ignore it, which is inherited
        signal.signal(signal.SIGPROF, signal.SIG_DFL)
    try:
        import resource
    except ImportError:
        return False
    held = True
    wanted = {
        resource.RLIMIT_AS: _address_space() + limits.memory,
        resource.RLIMIT_FSIZE: 2 * limits.total_size,
        resource.RLIMIT_CORE: 0,
        resource.RLIMIT_NOFILE: _OPEN_FILES,
    }
    for name, most in wanted.items():
        _, hard = resource.getrlimit(name)
        allowed = most if hard == resource.RLIM_INFINITY else min(most, hard)
        try:
            resource.setrlimit(name, (allowed, allowed))
        except (ValueError, OSError):
            held = False
    return held


def limit_time(seconds: float) -> None:
    """Have this process ended by SIGPROF after so much more processor time; 0 lifts the limit.

    The system counts, also while usd-core computes, and neither pauses nor other processes.
    Windows cannot; there a worker has its limit by the clock alone.
    """
    if hasattr(signal, "setitimer"):
        signal.setitimer(signal.ITIMER_PROF, seconds)


def _address_space() -> int:
    """Return how many bytes of address space this process has; 0 where that is not known."""
    try:
        pages = Path("/proc/self/statm").read_text(encoding="ascii").split()[0]
    except OSError:
        return 0
    return int(pages) * os.sysconf("SC_PAGE_SIZE")


# The C library, None where it is not that of Linux, which alone gives up what is asked here.
LIBC = ctypes.CDLL(None, use_errno=True) if sys.platform == "linux" else None


def give_up_privileges(libc: Any = LIBC) -> dict[str, bool]:
    """Give up the network, and what privileges there are or could be; say which of it worked."""
    if libc is None:
        return {"privileges": False, "network": False}
    # A network of one's own, in which there is nothing; as root or as a user.
    kinds = (_CLONE_NEWNET, _CLONE_NEWUSER | _CLONE_NEWNET)
    network = any(libc.unshare(kind) == 0 for kind in kinds)
    dies_with_parent = libc.prctl(_PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0) == 0
    given_up = dies_with_parent and _no_new_privileges(libc) and _no_capabilities(libc)
    return {"privileges": given_up, "network": network}


def _no_new_privileges(libc: Any) -> bool:
    return bool(libc.prctl(_PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) == 0)


def _no_capabilities(libc: Any) -> bool:
    """Give up every capability, where root runs this, but to read what students own."""
    kept = _CAP_DAC_READ_SEARCH if os.geteuid() == 0 else 0
    header = struct.pack("<Ii", _CAPABILITIES_VERSION_3, 0)
    sets = struct.pack("<6I", kept, kept, 0, 0, 0, 0)
    return bool(libc.capset(header, sets) == 0)


def fence_files(readable: Iterable[Path], writable: Iterable[Path], libc: Any = LIBC) -> bool:
    """Let this thread read below `readable` and write below `writable` only, by Landlock.

    So do the threads and processes that it starts from then on; they can be confined closer.
    Returns whether the kernel can do that and does.
    """
    if libc is None:
        return False
    version = libc.syscall(_CREATE_RULESET, None, ctypes.c_size_t(0), _VERSION_FLAG)
    if version < 1:
        return False
    handled = _FILES_OF_ABI_1 | (_TRUNCATE if version >= _ABI_WITH_TRUNCATE else 0)
    network = _TCP if version >= _ABI_WITH_NETWORK else 0
    size = 16 if version >= _ABI_WITH_NETWORK else 8
    attributes = struct.pack("<QQ", handled, network)[:size]
    ruleset = libc.syscall(_CREATE_RULESET, attributes, ctypes.c_size_t(size), 0)
    if ruleset < 0:
        return False
    try:
        for path in readable:
            _allow(libc, ruleset, path, (_READ | _READ_FOLDER | _EXECUTE) & handled)
        for path in writable:
            _allow(libc, ruleset, path, handled & ~_MAKE_DEVICES)
        return _no_new_privileges(libc) and libc.syscall(_RESTRICT_SELF, ruleset, 0) == 0
    finally:
        os.close(ruleset)


def _allow(libc: Any, ruleset: int, path: Path, rights: int) -> None:
    with contextlib.suppress(OSError):
        handle = os.open(path, getattr(os, "O_PATH", os.O_RDONLY))
        try:
            allowed = rights if path.is_dir() else rights & _ON_FILES
            rule = struct.pack("<Qi", allowed, handle)
            libc.syscall(_ADD_RULE, ruleset, _BENEATH, rule, 0)
        finally:
            os.close(handle)
