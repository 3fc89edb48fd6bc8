"""A process that has imported what commands and workers import, and forks for each that is started.

`forking` starts it. A message says what to run, and comes with three standard files. What a process
asks for over the pair of sockets becomes a child of that process, as its own parent ends. What a
shell script asks for, over the named socket, is waited for, and answered with its exit status.
"""

from __future__ import annotations

import atexit
import contextlib
import gc
import importlib
import marshal
import os
import runpy
import select
import signal
import socket
import sys
import tempfile
import threading
import time
import traceback
from pathlib import Path
from types import ModuleType
from typing import NamedTuple, NoReturn

MODULES = (
    "lab3_usd.cli",
    "lab3_usd.check.lint",
    "lab3_usd.grade.workers.worker_main",
    "lab3_usd.pipeline.entries",
    "lab3_usd.stage.sandboxed_open",
)
MINI = Path(__file__).parents[1] / "labs" / "mini"
LARGEST = 1 << 17  # bytes of a message
FORKED_WORKERS = {"LAB3_TESTS": "forked workers"}  # in an environment: its workers are forked too
PATH = "PYTHONPATH"


class Program(NamedTuple):
    """What is to run: a module or code, as with `-m` or `-c`, and what a process is given."""

    module: str
    code: str
    arguments: list[str]
    folder: str
    environment: dict[str, str]
    isolated: bool = False  # as with `-I -B`
    in_session: bool = False  # of its own


def serve(asked: socket.socket, place: str) -> None:
    """Fork for each message until nobody can ask any more."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    for name in MODULES:
        importlib.import_module(name)
    _warm_up()
    gc.collect()
    gc.freeze()
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as named:
        named.bind(place)
        named.listen(64)
        asked.send(b"ready")
        while True:
            ready, _, _ = select.select([asked, named], [], [])
            if named in ready:
                with named.accept()[0] as shell:
                    _run_for_shell(shell)
            elif not _run_for_process(asked):
                return


def _warm_up() -> None:
    """Grade a submission, so that what is prepared once is there in each process.

    That is what OpenUSD and the rules prepare, the templates of pages, and the labs of most tests.
    """
    from lab3_usd.data import LAB_VARIABLE
    from lab3_usd.grade.intake.staging import Source
    from lab3_usd.grade.intake.submission_copy import Limits
    from lab3_usd.grade.workers.worker_main import answer, load_setup
    from lab3_usd.grade.workers.worker_messages import PoolSettings, Task
    from lab3_usd.stage.write.builder import build_checkpoint

    os.environ.pop(LAB_VARIABLE, None)  # a process has the environment of whoever asks
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        starter = build_checkpoint(None, "00", folder / "starter.usda")
        handed_in = build_checkpoint(None, "05", folder / "work" / "Lab3_05.usda").parent
        for lab in (MINI, None):
            os.environ |= {LAB_VARIABLE: str(lab)} if lab else {}
            setup = load_setup(PoolSettings(starter, None, Limits()))
            answer(setup, Task("", "", (Source(handed_in),)), folder, lambda _name: None)
            os.environ.pop(LAB_VARIABLE, None)


def _run_for_process(asked: socket.socket) -> bool:
    message, files, _, _ = socket.recv_fds(asked, LARGEST, 3)
    if not message:
        return False
    module = marshal.loads(message)  # noqa: S302 - from the tests
    if isinstance(module, str):
        importlib.import_module(module)
        asked.send(b"0")
        for number in files:
            os.close(number)
        return True
    made, known = os.pipe()
    between = os.fork()
    if not between:
        own = os.getpid()
        child = os.fork() or _run(message, files, between=own)
        os.write(known, str(child).encode())
        os._exit(0)
    os.waitpid(between, 0)  # from here on the child is of whoever asked
    asked.send(os.read(made, 64))
    for number in (made, known, *files):
        os.close(number)
    return True


def _run_for_shell(shell: socket.socket) -> None:
    with contextlib.suppress(ChildProcessError):
        while os.waitpid(-1, os.WNOHANG)[0]:  # those that have answered
            pass
    if not os.fork():
        message, files, _, _ = socket.recv_fds(shell, LARGEST, 3)
        child = os.fork() or _run(message, files)
        status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        shell.send(str(status if status >= 0 else 128 - status).encode())
        os._exit(0)


def _run(message: bytes, files: list[int], between: int = 0) -> NoReturn:
    while os.getppid() == between:  # a worker dies with its parent, which is to be whoever asked
        time.sleep(0.0005)
    program = Program(*marshal.loads(message))  # noqa: S302 - from the tests
    for standard, number in enumerate(files):
        os.dup2(number, standard)
    os.closerange(3, os.sysconf("SC_OPEN_MAX"))
    _become(program)
    if program.environment.items() >= FORKED_WORKERS.items():
        _fork_workers()
    status = _status_of(program)
    with contextlib.suppress(BaseException):
        threading._shutdown()  # type: ignore[attr-defined]
        atexit._run_exitfuncs()
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(OSError, ValueError):
            stream.flush()
    os._exit(status)


def _fork_workers() -> None:
    """Fork the workers of grading that this process starts, from a server below it."""
    sys.path.append(str(Path(__file__).parent))
    import forking

    from lab3_usd.grade.workers import worker_process

    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    if not os.fork():
        ours.close()
        while _run_for_process(theirs):
            pass
        os._exit(0)
    theirs.close()
    forking._server = lambda: (ours, "")  # type: ignore[assignment]
    worker_process.subprocess = forking  # type: ignore[attr-defined]


def _become(program: Program) -> None:
    """Take over what a new process gets from the one that started it, and from its options."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
    if program.in_session:
        os.setsid()
    os.chdir(program.folder)
    os.environ.clear()
    os.environ.update(program.environment)
    tempfile.tempdir = None  # which is where the environment says
    if "dask" in sys.modules:
        sys.modules["dask.config"].refresh()  # type: ignore[attr-defined]
    sys.argv = ["-m" if program.module else "-c", *program.arguments]
    sys.dont_write_bytecode = program.isolated
    if not program.isolated:
        path = program.environment.get(PATH)
        sys.path[:0] = [program.folder if program.module else "", *([path] if path else [])]
        others = [] if _has_this_program(path) else [*sys.modules]
        for name in others:
            if name.startswith("lab3_usd"):
                del sys.modules[name]  # that path may have another copy of the program
    sys.stdin = open(0, closefd=False)  # noqa: SIM115 - streams of this process
    sys.stdout = open(1, "w", closefd=False)  # noqa: SIM115
    sys.stderr = open(2, "w", 1, errors="backslashreplace", closefd=False)  # noqa: SIM115
    sys.__stdin__, sys.__stdout__, sys.__stderr__ = sys.stdin, sys.stdout, sys.stderr


def _has_this_program(path: str | None) -> bool:
    """Whether a process with that path of modules would import what this one has imported."""
    package = Path(str(sys.modules["lab3_usd"].__file__)).parent
    return path is None or Path(path).resolve() == package.parent


def _status_of(program: Program) -> int:
    """Run the program, and return the exit status as Python would."""
    try:
        if program.module:
            runpy.run_module(program.module, run_name="__main__", alter_sys=True)
        else:
            sys.modules["__main__"] = main = ModuleType("__main__")
            exec(compile(program.code, "<string>", "exec"), vars(main))  # noqa: S102
    except SystemExit as leaving:
        if leaving.code is None or isinstance(leaving.code, int):
            return (leaving.code or 0) & 255
        sys.stderr.write(f"{leaving.code}\n")
    except KeyboardInterrupt:
        traceback.print_exc()
        sys.stderr.flush()
        signal.signal(signal.SIGINT, signal.SIG_DFL)
        os.kill(os.getpid(), signal.SIGINT)
    except BaseException:  # noqa: BLE001 - as Python ends
        traceback.print_exc()
    else:
        return 0
    return 1


if __name__ == "__main__":
    serve(socket.socket(fileno=int(sys.argv[1])), sys.argv[2])
