"""Processes of this Python, forked from one that has imported the program: 0.03 s and not 0.4.

`Popen` and `run` are those of `subprocess`, but for programs that are given as `-m MODULE` or
`-c CODE`; a `shim` is the same for a shell. What starts otherwise than the server did (a hash seed,
a path of modules, an encoding) is a new process here too, and so is all but on Linux.
"""

from __future__ import annotations

import atexit
import ctypes
import marshal
import os
import shutil
import socket
import subprocess
import sys
import tempfile
from functools import cache
from pathlib import Path
from subprocess import DEVNULL, PIPE, STDOUT, CompletedProcess, TimeoutExpired
from threading import Lock
from typing import Any
from unittest.mock import patch

import fork_server
from fork_server import Program

__all__ = ["DEVNULL", "PIPE", "STDOUT", "CompletedProcess", "Popen", "TimeoutExpired", "run"]

_PYTHON = sys.executable
_ADOPT = 36  # PR_SET_CHILD_SUBREAPER
_AT_START = ("PYTHON", "PXR_", "LC_", "LANG", "LD_")
_HARMLESS = {"PYTHONUNBUFFERED", "PYTHONDONTWRITEBYTECODE", "PXR_WORK_THREAD_LIMIT"}
_TURN = Lock()
_SHIM = """#!{python} -IS
import _socket, marshal, os, sys
message = ({module!r}, "", sys.argv[1:], os.getcwd(), dict(os.environ))
files = b"".join(number.to_bytes(4, sys.byteorder) for number in range(3))
server = _socket.socket(_socket.AF_UNIX, _socket.SOCK_SEQPACKET)
server.connect({place!r})
server.sendmsg([marshal.dumps(message)], [(_socket.SOL_SOCKET, _socket.SCM_RIGHTS, files)])
os._exit(int(server.recv(64) or 1))
"""


class Popen(subprocess.Popen[Any]):
    """A process that is forked, where it can be."""

    def _execute_child(self, *given: Any) -> None:
        args, _, preexec, _, passed, cwd, env, *_ = given
        (stdin, _, _, stdout, _, stderr), in_session = given[10:16], given[21]
        message = None if preexec or passed else _message(args, cwd, env, in_session)
        if message is None:
            super()._execute_child(*given)  # type: ignore[misc]
            return
        wanted = enumerate((stdin, stdout, stderr))
        self.pid = _forked(message, [own if number < 0 else number for own, number in wanted])
        self._child_created = True
        self._close_pipe_fds(*given[10:16])  # type: ignore[attr-defined]


def run(*args: Any, **options: Any) -> CompletedProcess[Any]:
    """Run a program as `subprocess.run` does."""
    with patch.object(subprocess, "Popen", Popen):
        return subprocess.run(*args, **options)  # noqa: PLW1510 - as is asked


@cache
def preload(module: str) -> None:
    """Have a module imported before further processes are forked; to import some takes a second."""
    if sys.platform == "linux":
        _forked(marshal.dumps(module), [0, 1, 2])


def shim(path: Path, module: str) -> None:
    """Write a program for shells that runs a module of Python; `PYTHONPATH` is one folder."""
    if sys.platform == "linux":
        path.write_text(_SHIM.format(python=sys.executable, module=module, place=_server()[1]))
    else:
        path.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m {module} "$@"\n')
    path.chmod(0o755)


def _message(args: Any, cwd: Any, env: Any, in_session: Any) -> bytes | None:
    """Return what the server is asked for; None where it must be a new process."""
    environment = {**(os.environ if env is None else env)}
    words = [] if isinstance(args, (str, bytes, os.PathLike)) else [*map(os.fspath, args)]
    isolated = words[1:3] == ["-I", "-B"]
    if isolated:
        del words[1:3]
    folder = os.path.realpath(cwd or ".")
    starts_alike = all(
        value == os.environ.get(name) and not (name.startswith("PYTHON") and not isolated)
        for name, value in environment.items()
        if name.startswith(_AT_START) and name not in _HARMLESS
    )
    is_ours = words[:1] == [_PYTHON] and words[1:2] in (["-m"], ["-c"])
    if sys.platform != "linux" or not (is_ours and starts_alike and Path(folder).is_dir()):
        return None
    _, option, what, *arguments = words
    module, code = (what, "") if option == "-m" else ("", what)
    program = Program(module, code, arguments, folder, environment, isolated, bool(in_session))
    message = marshal.dumps(tuple(program))
    return message if len(message) <= fork_server.LARGEST else None


def _forked(message: bytes, files: list[int]) -> int:
    """Let the server fork, and return the process, whose parent is this one."""
    with _TURN:
        server, _ = _server()
        _adopt(1)
        try:
            socket.send_fds(server, [message], files)
            return int(server.recv(64))
        finally:
            _adopt(0)


def _adopt(whether: int) -> None:
    """Become the parent of processes below whose own parent ends, or no longer."""
    ctypes.CDLL(None).prctl(_ADOPT, whether, 0, 0, 0)


@cache
def _server() -> tuple[socket.socket, str]:
    """Start the server; it ends when this process does, which closes its end of the socket."""
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    folder = tempfile.mkdtemp(prefix="forks")
    place = f"{folder}/socket"
    with theirs:
        process = subprocess.Popen(
            [sys.executable, "-I", fork_server.__file__, str(theirs.fileno()), place],
            pass_fds=[theirs.fileno()],
            env={**os.environ, "PXR_WORK_THREAD_LIMIT": "1", "TF_ENV_SETTING_ALERTS_ENABLED": "0"},
        )
    ours.recv(64)
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    atexit.register(process.wait)
    atexit.register(ours.close)
    return ours, place
