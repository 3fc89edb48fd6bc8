"""Judges on more than one machine over Dask: what each needs is packed and sent there."""

from __future__ import annotations

import asyncio
import atexit
import importlib
import os
import threading
import time
from collections.abc import Generator, Iterable
from concurrent.futures import CancelledError
from functools import partial
from pathlib import Path
from typing import Any

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.errors import UsageError
from lab3_usd.grade.intake.scratch import (
    make_scratch,
    remove_abandoned,
    remove_scratch,
    scratch_folder,
)
from lab3_usd.grade.workers.messages import Answer, PoolSettings, Task, decode, encode
from lab3_usd.grade.workers.pool import Runner, WorkerSlot, judge_in, run_in
from lab3_usd.grade.workers.worker_process import WorkerError
from lab3_usd.installation import install_command
from lab3_usd.report.options import tool_version


class Shipment(Struct, frozen=True):
    """What a machine of the cluster needs to judge: the files themselves, not where they lie.

    `files` are the starter and its assets, wherever they lie, by their paths below one folder,
    `lab` those that describe the lab, where it is not the bundled one.
    """

    version: str
    files: tuple[tuple[str, bytes], ...]
    starter: str
    rubric: bytes | None
    lab: tuple[tuple[str, bytes], ...]
    settings: PoolSettings


def packed(settings: PoolSettings) -> Shipment:
    """Return what every machine needs to judge by these settings.

    Raises:
        UsageError: there is no starter, or it refers to files where other machines have none.
    """
    from lab3_usd.stage.sandboxed_open import files_of

    if settings.starter is None:
        raise UsageError("--cluster needs a starter")
    starter = settings.starter.resolve()
    lab_files = [] if settings.lab is None else sorted(settings.lab.glob("*.yaml"))
    paths = sorted({Path(path.partition("[")[0]) for path in files_of(starter)})
    root = Path(os.path.commonpath([starter.parent, *(path.parent for path in paths)]))
    shipment = Shipment(
        version=tool_version(),
        files=tuple((path.relative_to(root).as_posix(), path.read_bytes()) for path in paths),
        starter=starter.relative_to(root).as_posix(),
        rubric=None if settings.rubric is None else settings.rubric.read_bytes(),
        lab=tuple((path.name, path.read_bytes()) for path in lab_files),
        settings=replace(settings, readable=tuple(path.absolute() for path in settings.readable)),
    )
    with scratch_folder("lab3-starter-") as folder:
        copy = unpacked(shipment, folder).starter
        copied: frozenset[str] = frozenset() if copy is None else files_of(copy)
        real = folder.resolve()
        if len(copied) < len(files_of(starter)) or not all(
            Path(file).is_relative_to(real) for file in copied
        ):
            raise UsageError(
                f"{settings.starter}: refers to files in a way that other machines cannot follow; "
                "use paths relative to the starter, and no links"
            )
    return shipment


def unpacked(shipment: Shipment, folder: Path) -> PoolSettings:
    """Write the files of a shipment into a folder, and return the settings that name them there."""
    for name, data in shipment.files:
        path = folder / "starter" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)
    lab = folder / "lab" if shipment.lab else None
    for name, data in shipment.lab:
        path = folder / "lab" / name
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(data)
    rubric = None
    if shipment.rubric is not None:
        rubric = folder / "rubric.yaml"
        rubric.write_bytes(shipment.rubric)
    starter = folder / "starter" / shipment.starter
    return replace(shipment.settings, starter=starter, rubric=rubric, lab=lab)


_PER_THREAD = 3  # tasks on their way for each thread of the cluster
_RETRIES = 5
_SECONDS_TO_CONNECT = 20
_SECONDS_TO_RETURN = 20  # for one worker, after all have gone
_WARNING_SIZE = "distributed.admin.large-graph-warning-threshold"
_KILLED = "KilledWorker"  # what Dask raises of a task whose workers died one after the other
_local = threading.local()


def cluster_runner(address: str) -> Runner:
    """Return what runs tasks on the Dask cluster at `address` in place of `pool.run_tasks`."""
    return partial(run_on_cluster, address)


def run_on_cluster(
    address: str, tasks: Iterable[Task], settings: PoolSettings
) -> Generator[Answer]:
    """Yield each task with its answer; a machine that goes away has its tasks done by others.

    Raises:
        UsageError: Dask is not installed, or there is no scheduler or no worker at `address`.
        WorkerError: all workers have gone.
    """
    client = _connect(address)
    try:
        _await_worker(client, address)
        shipment = _sent(client, packed(settings))
        executor = client.get_executor(pure=False, retries=_RETRIES)
        at_once = _PER_THREAD * max(1, sum(client.nthreads().values()))
        workers = _Workers(client)
        for answer in run_in(
            lambda task: executor.submit(judge_here, shipment, encode(task)),
            tasks,
            at_once,
            look=workers.look,
        ):
            workers.are_there()
            yield answer
    except Exception as error:
        if not isinstance(error, CancelledError) and type(error).__name__ != _KILLED:
            raise
        raise WorkerError(
            f"{address}: the workers of the cluster have gone; start others and go on with "
            "--resume, which keeps what is graded"
        ) from error
    finally:
        client.close()


class _Workers:
    """The workers of a cluster, which may all be away for a while."""

    def __init__(self, client: Any) -> None:
        self._client = client
        self._away_since: float | None = None

    def are_there(self) -> None:
        """Note that one of them has answered."""
        self._away_since = None

    def look(self) -> None:
        """End the waiting when all have been away for long.

        Raises:
            CancelledError: they have.
        """
        now = time.monotonic()
        if self._client.scheduler_info()["workers"]:
            self._away_since = None
        elif self._away_since is None:
            self._away_since = now
        elif now - self._away_since > _SECONDS_TO_RETURN:
            raise CancelledError


def _sent(client: Any, shipment: Shipment) -> Any:
    """Send what every machine needs to the cluster, once.

    As the result of a task it can be made again: the scheduler keeps what that task is given. What
    is scattered instead is lost with the machines that have it.
    """
    dask = importlib.import_module("dask")
    with dask.config.set({_WARNING_SIZE: "1 TB"}):  # the assets of a starter may be large
        return client.submit(_unchanged, shipment, pure=False, retries=_RETRIES)


def _unchanged(shipment: Shipment) -> Shipment:
    return shipment


def _await_worker(client: Any, address: str) -> None:
    try:
        client.wait_for_workers(1, timeout=_SECONDS_TO_CONNECT)
    except (TimeoutError, asyncio.TimeoutError) as error:  # not the same before Python 3.11
        raise UsageError(
            f"{address}: the cluster has no worker; start one with `dask worker {address}`"
        ) from error


def _connect(address: str) -> Any:
    try:
        distributed = importlib.import_module("distributed")
    except ImportError as error:
        raise UsageError(
            f"--cluster needs the extra cluster: {install_command('cluster')}"
        ) from error
    try:
        return distributed.Client(address, timeout=_SECONDS_TO_CONNECT)
    except (OSError, ValueError) as error:
        raise UsageError(f"{address}: there is no Dask scheduler ({error})") from error


def judge_here(shipment: Shipment, message: bytes) -> Answer:
    """Judge the task of a message on this machine, in a fenced process that this thread keeps.

    Raises:
        UsageError: this machine has another version of the package, or not the submission.
    """
    if tool_version() != shipment.version:
        raise UsageError(
            f"a worker of the cluster has version {tool_version()}, not {shipment.version}"
        )
    task = decode(message, Task)
    for source in task.sources:
        if not source.address and not source.path.exists():
            raise UsageError(
                f"{source.path} is not on every machine of the cluster; give an address"
            )
    return judge_in(_slot(shipment), task)


def _slot(shipment: Shipment) -> WorkerSlot:
    """Return this thread's worker for a shipment; one for another shipment is stopped first."""
    known: tuple[Shipment, WorkerSlot, Path] | None = getattr(_local, "slot", None)
    if known is not None and known[0] is shipment:
        return known[1]
    if known is not None:
        _remove(known[1], known[2])
    remove_abandoned(shipment.settings.readable)
    folder = make_scratch("lab3-starter-")
    slot = WorkerSlot(unpacked(shipment, folder))
    _local.slot = (shipment, slot, folder)
    atexit.register(_remove, slot, folder)
    return slot


def _remove(slot: WorkerSlot, folder: Path) -> None:
    slot.stop()
    remove_scratch(folder)
