"""Dask clusters on this computer: a scheduler, its machines, and machines with faults.

Machines are forked from a process that has imported the program.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, NamedTuple
from unittest.mock import patch

import forking
import pytest
from fork_server import FORKED_WORKERS
from mini_lab import MINI, files_below, starter

from lab3_usd.data import LAB_VARIABLE
from lab3_usd.grade.class_run import ClassSettings, grade_class
from lab3_usd.grade.workers.cluster import cluster_runner
from lab3_usd.grade.workers.scheduler import PATIENCE, Patience


class Cluster(NamedTuple):
    """A scheduler in this process, and the machines that began with it."""

    scheduler_address: str
    machines: tuple[Process, ...]


@contextmanager
def cluster_of(machines: int, temporary: Path) -> Iterator[Cluster]:
    """A scheduler and so many machines, whose temporary files lie in a place of their own."""
    with ExitStack() as stack:
        address = stack.enter_context(local_cluster(temporary)).scheduler_address
        running = [machine(address, temporary) for _ in range(machines)]
        yield Cluster(address, tuple(map(stack.enter_context, running)))


@contextmanager
def local_cluster(temporary: Path, **options: Any) -> Iterator[Any]:
    """A scheduler in this process; when it is closed, the machines that joined it end."""
    distributed = pytest.importorskip("distributed", reason="Dask is not installed")
    dask = pytest.importorskip("dask")
    temporary.mkdir()
    quick = {
        "distributed.admin.log-format": "",
        "logging.distributed": "critical",
    }
    with (
        patch.dict(os.environ, {"TMPDIR": str(temporary)}),  # which goes before what Dask is told
        dask.config.set(quick),
        distributed.LocalCluster(
            n_workers=0,
            threads_per_worker=1,
            processes=True,
            dashboard_address=None,
            **options,
        ) as running,
    ):
        yield running


def graded_on(
    cluster: Any,
    place: Path | str,
    out: Path,
    notify: Any = print,
    patience: Patience = PATIENCE,
    **changes: Any,
) -> dict[str, bytes]:
    runner = cluster_runner(cluster.scheduler_address, notify, patience=patience)
    grade_class(ClassSettings(place, starter(), out, runner=runner), **changes)
    return files_below(out)


_MACHINE = """
import asyncio, sys
exec(sys.argv[2])
from distributed import Worker

async def main():
    async with Worker(sys.argv[1], nthreads=1, host="127.0.0.1", dashboard_address=None) as worker:
        print(worker.address, flush=True)
        await worker.finished()

asyncio.run(main())
"""
_SCHEDULER = """
import asyncio, sys
exec(sys.argv[2])
from distributed import Scheduler

async def main():
    async with Scheduler(host="127.0.0.1", port=int(sys.argv[1]), dashboard=False) as scheduler:
        print(scheduler.address, flush=True)
        await scheduler.finished()

asyncio.run(main())
"""
# How a machine without this package answers each import of it.
WITHOUT_LAB3 = """
import sys
for name in [name for name in sys.modules if name.partition(".")[0] == "lab3_usd"]:
    del sys.modules[name]
class Nowhere:
    def find_spec(self, name, *_):
        if name.partition(".")[0] == "lab3_usd":
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
sys.meta_path.insert(0, Nowhere())
"""


class Process(NamedTuple):
    """A scheduler or a machine of a cluster, in a process of its own."""

    address: str
    process: subprocess.Popen[str]


@contextmanager
def machine(scheduler: str, temporary: Path, code: str = "", **variables: str) -> Iterator[Process]:
    """A machine of a cluster that runs this code first, with these variables of its environment."""
    with _running([_MACHINE, scheduler, code], temporary, **variables) as found:
        yield found


@contextmanager
def scheduler(temporary: Path, code: str = "", port: int = 0) -> Iterator[Process]:
    """A scheduler that runs this code first."""
    with _running([_SCHEDULER, str(port), code], temporary) as found:
        yield found


@contextmanager
def _running(arguments: list[str], temporary: Path, **variables: str) -> Iterator[Process]:
    temporary.mkdir(parents=True, exist_ok=True)
    environment = {
        **os.environ,
        "TMPDIR": str(temporary),
        LAB_VARIABLE: str(MINI),
        "DASK_LOGGING__DISTRIBUTED": "critical",
        **FORKED_WORKERS,
        **variables,
    }
    forking.preload("distributed")
    with forking.Popen(
        [sys.executable, "-c", *arguments],
        stdout=subprocess.PIPE,
        env=environment,
        cwd=temporary,
        text=True,
    ) as process:
        assert process.stdout is not None
        try:
            yield Process(process.stdout.readline().strip(), process)
        finally:
            process.kill()
