"""Judges on more than one machine over Dask: what each needs is packed and sent there."""

from __future__ import annotations

import hashlib
import importlib
import pickle
from collections.abc import Callable, Generator, Iterable
from functools import partial
from typing import Any

from lab3_usd.grade.workers.dispatch import Dispatch
from lab3_usd.grade.workers.pool import Runner
from lab3_usd.grade.workers.scheduler import PATIENCE, Patience, connected
from lab3_usd.grade.workers.shipment import packed
from lab3_usd.grade.workers.worker_messages import Answer, PoolSettings, Task

_RETRIES = 5
_WARNING_SIZE = "distributed.admin.large-graph-warning-threshold"


def cluster_runner(
    address: str,
    notify: Callable[[str], None] = lambda _line: None,
    *,
    insecure: bool = False,
    patience: Patience = PATIENCE,
) -> Runner:
    """Return what runs tasks on the Dask cluster at `address` in place of `pool.run_tasks`.

    `notify` receives a line for each machine that is taken out of the run, and where others may
    reach the cluster. With `insecure`, its scheduler may be public without TLS.
    """
    return partial(run_on_cluster, address, notify, insecure, patience)


def run_on_cluster(
    address: str,
    notify: Callable[[str], None],
    insecure: bool,  # noqa: FBT001 - of a partial
    patience: Patience,
    tasks: Iterable[Task],
    settings: PoolSettings,
) -> Generator[Answer]:
    """Yield each task with its answer; what a machine cannot judge is judged by others.

    Raises:
        UsageError: Dask is not installed, there is no scheduler or no worker at `address`, or
            everybody reaches it.
        WorkerError: all workers have gone, or none of them can judge.
    """
    with connected(address, notify, insecure=insecure, patience=patience) as client:
        data = pickle.dumps(packed(settings))
        digest = hashlib.sha256(data).digest()
        dispatch = Dispatch(
            client, address, lambda: _sent(client, data), digest, notify, patience.to_return
        )
        yield from dispatch.answers(tasks)


def _sent(client: Any, data: bytes) -> Any:
    """Send what every machine needs to the cluster, once.

    As the result of a task it can be made again: the scheduler keeps what that task is given. What
    is scattered instead is lost with the machines that have it.
    """
    dask = importlib.import_module("dask")
    with dask.config.set({_WARNING_SIZE: "1 TB"}):  # the assets of a starter may be large
        return client.submit(bytes, data, pure=False, retries=_RETRIES)
