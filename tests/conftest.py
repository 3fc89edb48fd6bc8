"""What several test modules share.

The program is imported where it is used: the process that hands out tests needs none of it.
"""

from __future__ import annotations

import atexit
import gc
import os
import shutil
import signal
import sys
import tempfile
from collections.abc import Generator, Iterator
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any
from unittest.mock import patch

import pytest
from _pytest.runner import runtestprotocol
from places import REPOSITORY, SHARED

if TYPE_CHECKING:
    from browser import Browser

MEMORY = Path("/dev/shm")  # noqa: S108 - a file system, not a file in it
ROOM = 4_000_000_000  # bytes, many times what the tests leave there at any time


def pytest_configure(config: pytest.Config) -> None:
    """Time no example, and let Ctrl-C end what tests start, which background jobs ignore.

    Temporary files are written into memory where there is room and programs may be run from there:
    to copy a submission takes a tenth of the time.
    """
    if "TMPDIR" not in os.environ and MEMORY.is_dir():
        there = os.statvfs(MEMORY)
        if there.f_bavail * there.f_frsize > ROOM and not there.f_flag & os.ST_NOEXEC:
            os.environ["TMPDIR"] = tempfile.tempdir = tempfile.mkdtemp(prefix="suite-", dir=MEMORY)
            atexit.register(_give_back, tempfile.tempdir)  # after what others clean up in it
    os.environ["HYPOTHESIS_NO_PLUGINS"] = "1"  # that of trio, which selenium brings, loads trio
    import hypothesis

    hypothesis.settings.register_profile("untimed", deadline=None, max_examples=30)
    hypothesis.settings.load_profile("untimed")
    _draw_nothing_out_of_sources()
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    worker = getattr(config, "workerinput", None)
    if worker and not sys.dont_write_bytecode:
        from compiled import compile_share

        compile_share(config, int(worker["workerid"][2:]), worker["workercount"])


def _draw_nothing_out_of_sources() -> None:
    """Let examples not depend on what is imported: Hypothesis takes constants out of our modules.

    To read them all takes each worker a quarter of a second, and two in a fresh clone.
    """
    from hypothesis.internal.conjecture import providers

    providers.is_local_module_file = lambda _path: False  # which earlier releases do not ask


def _give_back(folder: str) -> None:
    """Remove the temporary files of a run; the processes of its tests end without that."""
    shutil.rmtree(folder, ignore_errors=True)


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Keep the temporary files of a run with failures."""
    if session.testsfailed:
        atexit.unregister(_give_back)


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """Look for no garbage while tests are collected, which all stay."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.enable()


def pytest_collection_finish() -> None:
    """Leave out of every search for garbage what is there for good: thousands of tests."""
    gc.freeze()
    gc.set_threshold(100_000)  # as the program does


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """Give the tests of a file to one worker, and those of all files with pages, or clusters.

    So there is one browser, Dask is imported once, and the submission that is broken is built once.
    """
    from xdist.scheduler import LoadFileScheduling

    class ByFile(LoadFileScheduling):
        def _split_scope(self, nodeid: str) -> str:
            file = nodeid.partition("::")[0]
            return _kind_of(file) or file

    return ByFile(config, log) if config.getvalue("dist") == "loadfile" else None


@cache
def _kind_of(file: str) -> str:
    text = (REPOSITORY / file).read_text(encoding="utf-8")
    signs = {
        "pages": "chromium: Browser",
        "clusters": "from clusters import",
        "submissions": "from submissions import",
    }
    return next((kind for kind, sign in signs.items() if sign in text), "")


def pytest_runtest_protocol(item: pytest.Item, nextitem: pytest.Item | None) -> bool | None:
    """Let a worker report of a test only what is shown: how it went, and a fault around it."""
    if not hasattr(item.config, "workerinput"):
        return None
    for report in runtestprotocol(item, log=False, nextitem=nextitem):
        if report.when == "call" or not report.passed:
            if report.passed:
                report.keywords, report.sections = {}, []
            item.ihook.pytest_runtest_logreport(report=report)
    return True


@pytest.fixture(scope="session", autouse=True)
def _made_once() -> Iterator[None]:
    from made_once import (
        platform_assembled_once,
        splines_noted,
        starter_made_once,
        yaml_parsed_once,
    )

    with yaml_parsed_once(), platform_assembled_once(), starter_made_once(), splines_noted():
        yield


@pytest.fixture
def own_rules() -> Iterator[None]:
    """Let a test add rules of its own."""
    from linting import registered_for_a_while

    with registered_for_a_while():
        yield


@pytest.fixture(scope="session")
def repository() -> Path:
    """The checkout that holds these tests."""
    return REPOSITORY


@pytest.fixture(scope="session")
def shared() -> Path:
    """The reference material beside the checkout; tests that want it skip where it is absent."""
    if not SHARED.is_dir():
        pytest.skip("the reference material ../shared is not beside this checkout")
    return SHARED


@pytest.fixture(scope="session")
def chromium() -> Iterator[Browser]:
    """One browser for all tests of pages."""
    from browser import started

    with started() as running:
        yield running


@pytest.fixture(scope="module")
def forked_workers() -> Iterator[None]:
    """Workers of grading that are processes as ever, but need no Python to start."""
    import forking

    from lab3_usd.grade.workers import worker_process

    with patch.object(worker_process, "subprocess", forking):
        yield
