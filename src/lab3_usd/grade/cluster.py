"""Judges on more than one machine: tasks go over Dask, and each machine keeps its own fences."""

from __future__ import annotations

import atexit
import importlib
import tempfile
import threading
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.errors import UsageError
from lab3_usd.grade.class_run import Runner
from lab3_usd.grade.judge import Json, Task
from lab3_usd.grade.pool import Seat, judge_in
from lab3_usd.grade.worker_process import PoolSettings
from lab3_usd.report.tool import tool_version

_PER_THREAD = 3  # tasks on their way for each thread of the cluster
_RETRIES = 5
_SECONDS_TO_CONNECT = 20
_local = threading.local()


class Shipment(Struct, frozen=True):
    """What a machine of the cluster needs to judge: the files themselves, not where they lie.

    `files` are the starter and its assets by their paths below the starter's folder.
    """

    version: str
    files: tuple[tuple[str, bytes], ...]
    starter: str
    rubric: bytes | None
    settings: PoolSettings


def cluster_runner(address: str) -> Runner:
    """Return what runs tasks on the Dask cluster at `address` in place of `pool.run_tasks`."""

    def run(tasks: Iterable[Task], settings: PoolSettings) -> Iterator[tuple[Task, Json]]:
        return run_on_cluster(address, tasks, settings)

    return run


def run_on_cluster(
    address: str, tasks: Iterable[Task], settings: PoolSettings
) -> Iterator[tuple[Task, Json]]:
    """Yield each task with its answer; a machine that goes away has its tasks done by others.

    Raises:
        UsageError: Dask is not installed, or there is no scheduler at `address`.
    """
    client, as_completed = _connect(address)
    try:
        shipment = client.scatter(_shipment(settings), broadcast=True)
        waiting = iter(tasks)
        flying = as_completed()
        for _ in range(_PER_THREAD * max(1, sum(client.nthreads().values()))):
            _send(client, flying, shipment, waiting)
        for future in flying:
            yield future.result()
            _send(client, flying, shipment, waiting)
    finally:
        client.close()


def _connect(address: str) -> tuple[Any, Any]:
    try:
        distributed = importlib.import_module("distributed")
    except ImportError as error:
        message = "--cluster needs Dask; install lab3-usd[cluster]"
        raise UsageError(message) from error
    try:
        client = distributed.Client(address, timeout=_SECONDS_TO_CONNECT)
    except (OSError, ValueError) as error:
        message = f"{address}: there is no Dask scheduler ({error})"
        raise UsageError(message) from error
    return client, distributed.as_completed


def _send(client: Any, flying: Any, shipment: Any, waiting: Iterator[Task]) -> None:  # noqa: ANN401
    task = next(waiting, None)
    if task is not None:
        flying.add(
            client.submit(judge_here, shipment, _absolute(task), pure=False, retries=_RETRIES)
        )


def _absolute(task: Task) -> Task:
    return replace(
        task,
        sources=tuple(
            source if source.address else replace(source, path=source.path.absolute())
            for source in task.sources
        ),
    )


def _shipment(settings: PoolSettings) -> Shipment:
    from lab3_usd.stage.fence import files_of  # noqa: PLC0415 - pxr

    if settings.starter is None:
        message = "--cluster needs a starter"
        raise UsageError(message)
    starter = settings.starter.resolve()
    paths = sorted(Path(path) for path in files_of(starter))
    inside = [path for path in paths if path.is_relative_to(starter.parent)]
    return Shipment(
        version=tool_version(),
        files=tuple((str(path.relative_to(starter.parent)), path.read_bytes()) for path in inside),
        starter=starter.name,
        rubric=None if settings.rubric is None else settings.rubric.read_bytes(),
        settings=replace(settings, readable=tuple(path.absolute() for path in settings.readable)),
    )


def judge_here(shipment: Shipment, task: Task) -> tuple[Task, Json]:
    """Judge a task on this machine, in a fenced process that this thread keeps.

    Raises:
        UsageError: this machine has another version of the package, or not the submission.
    """
    if tool_version() != shipment.version:
        message = f"a worker of the cluster has version {tool_version()}, not {shipment.version}"
        raise UsageError(message)
    for source in task.sources:
        if not source.address and not source.path.exists():
            message = f"{source.path} is not on every machine of the cluster; give an address"
            raise UsageError(message)
    return judge_in(_seat(shipment), task, lambda: False)


def _seat(shipment: Shipment) -> Seat:
    """Return this thread's worker for a shipment; one for another shipment leaves first."""
    known: tuple[Shipment, Seat] | None = getattr(_local, "seat", None)
    if known is not None and known[0] is shipment:
        return known[1]
    if known is not None:
        known[1].leave()
    seat = Seat(_unpacked(shipment, Path(tempfile.mkdtemp(prefix="lab3-starter-"))))
    atexit.register(seat.leave)
    _local.seat = (shipment, seat)
    return seat


def _unpacked(shipment: Shipment, folder: Path) -> PoolSettings:
    for name, data in shipment.files:
        path = folder / "starter" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)
    rubric = None
    if shipment.rubric is not None:
        rubric = folder / "rubric.yaml"
        rubric.write_bytes(shipment.rubric)
    starter = folder / "starter" / shipment.starter
    return replace(shipment.settings, starter=starter, rubric=rubric)
