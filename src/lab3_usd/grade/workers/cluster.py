"""Judges on the machines of a Dask cluster; what one of them cannot judge, another one does."""

from __future__ import annotations

import asyncio
import hashlib
import importlib
import pickle
import threading
import time
from collections.abc import Callable, Generator, Iterable
from concurrent.futures import CancelledError
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

from lab3_usd.grade.workers.machine import ARGUMENTS, CALL
from lab3_usd.grade.workers.pool import Runner
from lab3_usd.grade.workers.scheduler import PATIENCE, Patience, connected
from lab3_usd.grade.workers.shipment import packed
from lab3_usd.grade.workers.worker_messages import (
    FAULT,
    FAULT_OF_ALL,
    TOOL_FAILED,
    Answer,
    Json,
    PoolSettings,
    Task,
    encode,
)
from lab3_usd.grade.workers.worker_process import WorkerError
from lab3_usd.pipeline.processes import Stopped, answers_of
from lab3_usd.report.options import tool_version

_MOST_AT_ONCE = 256  # tasks that are given to machines, or wait for one
_PER_THREAD = 3  # tasks on their way for each thread of a machine that has judged
_MOST_FAULTS = 3  # tasks in a row that others judged, after which a machine gets no more
_MOST_TRIES = 3  # machines that a task is given to
_MOST_LOSSES = 5  # machines that may go away with a task
_POLL_INTERVAL = 0.2  # seconds
_SECONDS_TO_ANSWER = 20.0  # for the scheduler
_RESUME = "continue with --resume, which keeps what is graded"
_RETRIES = 5  # of what is sent to all machines
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
    reach the cluster. With `insecure`, its scheduler may be public without TLS. The runner raises
    UsageError where Dask is not installed, there is no scheduler or no worker at `address`, or
    everybody reaches it, and WorkerError where all workers have gone, or none of them can judge.
    """

    def run(tasks: Iterable[Task], settings: PoolSettings) -> Generator[Answer]:
        with connected(address, notify, insecure=insecure, patience=patience) as client:
            data = pickle.dumps(packed(settings))

            def send() -> Any:
                # As the result of a task it can be made again: the scheduler keeps what that task
                # is given. What is scattered instead is lost with the machines that have it.
                dask = importlib.import_module("dask")
                with dask.config.set({_WARNING_SIZE: "1 TB"}):  # a starter's assets may be large
                    return client.submit(bytes, data, pure=False, retries=_RETRIES)

            digest = hashlib.sha256(data).digest()
            cluster = Cluster(client, address, send, digest, notify, patience.to_return)
            yield from answers_of(tasks, [cluster] * _MOST_AT_ONCE, Cluster.judge, lambda _: None)

    return run


@dataclass(slots=True, eq=False)
class ClusterMachine:
    """A worker of the cluster: how many tasks it judged, and how many in a row it could not.

    `proven` counts those of the latter that another machine judged then. `out` says why it gets no
    more tasks.
    """

    address: str
    threads: int
    busy: int = 0
    judged: int = 0
    faults: int = 0
    proven: int = 0
    out: str = ""

    @property
    def room(self) -> int:
        """How many more tasks it may have: few before it has judged any, one after a fault."""
        most = self.threads * (_PER_THREAD if self.judged else 1)
        return (1 if self.faults else most) - self.busy


_Faults = list[tuple[ClusterMachine, str]]  # of a task: who could not judge it, and why


class Cluster:
    """The machines of a cluster, which come and go, as the threads see them that wait for them."""

    def __init__(
        self,
        client: Any,
        address: str,
        send: Callable[[], Any],
        digest: bytes,
        notify: Callable[[str], None],
        to_return: float = PATIENCE.to_return,
    ) -> None:
        """Begin without tasks; `send` puts what every machine needs into the cluster."""
        self._client = client
        self._address = address
        self._send = send
        self._shipment = send()
        self._digest = digest
        self._notify = notify
        self._to_return = to_return
        self._machines: dict[str, ClusterMachine] = {}
        self._alone_since: float | None = None
        self._looked = -_POLL_INTERVAL
        self._lock = threading.Lock()
        self._distributed = importlib.import_module("distributed")

    def judge(self, task: Task, stopped: Stopped) -> Answer:
        """Return a task with its answer, from a machine that can judge it.

        Raises:
            WorkerError: the scheduler or all machines have gone, or none can judge.
        """
        faults: _Faults = []
        losses = 0
        while not stopped():
            with self._lock:
                self.look()
                able = [machine for machine in self._machines.values() if not machine.out]
                machines = [m for m in able if all(m is not tried for tried, _ in faults)]
                if len(faults) == 1 and not machines:
                    machines = able  # there is no other one; it may have been for a moment
                if losses >= _MOST_LOSSES or (
                    faults and able and (len(faults) >= _MOST_TRIES or not machines)
                ):
                    return task, _unreached(faults, losses)
                judging = [machine for machine in machines if machine.judged and not machine.faults]
                is_busy = any(machine.busy for machine in self._machines.values())
                # What one could not judge goes to one that is known to judge.
                machine = _freest(judging if faults and (judging or is_busy) else machines)
                if machine is not None:
                    machine.busy += 1
            if machine is None:
                time.sleep(_POLL_INTERVAL)
                continue
            answer = self._answer(machine, task, stopped)
            with self._lock:
                machine.busy -= 1
                if answer is None:  # it went away, or was taken out because of other tasks
                    losses += not machine.out
                elif FAULT_OF_ALL in answer:  # which says nothing of the task
                    self._take_out(machine, str(answer[FAULT_OF_ALL]))
                elif FAULT in answer:
                    machine.faults += 1
                    faults.append((machine, str(answer[FAULT])))
                else:
                    self._note_judged(machine, faults)
                    return task, answer
        return task, {}

    def look(self) -> None:
        """See which machines there are.

        Raises:
            WorkerError: the scheduler has gone, or for a while no machine could judge.
        """
        now = time.monotonic()
        if now - self._looked < _POLL_INTERVAL:
            return
        self._looked = now
        if self._client.status != "running":  # with the connection, Dask gives up all tasks
            raise WorkerError(self._gone())
        try:
            threads: dict[str, int] = self._client.sync(
                self._client.scheduler.ncores, callback_timeout=_SECONDS_TO_ANSWER
            )
        except Exception as error:
            raise WorkerError(self._gone()) from error
        if self._shipment.status == "cancelled":  # the connection is another one
            raise WorkerError(self._gone())
        if self._shipment.status == "error":  # it went away with several machines
            self._shipment = self._send()
        for address in self._machines.keys() - threads.keys():
            del self._machines[address]
        for address, count in threads.items():
            self._machines.setdefault(address, ClusterMachine(address, max(1, count)))
        if not all(machine.out for machine in self._machines.values()):
            self._alone_since = None
        elif self._alone_since is None:
            self._alone_since = now
        elif now - self._alone_since > self._to_return:
            raise WorkerError(self._nobody())

    def _gone(self) -> str:
        return (
            f"{self._address}: the scheduler of the cluster has gone; start it and its workers "
            f"again, and {_RESUME}"
        )

    def _nobody(self) -> str:
        """Say that no machine judges any more."""
        if not self._machines:
            what = "the workers of the cluster have gone; start others"
        else:
            machine = next(iter(self._machines.values()))
            what = (
                f"no worker of the cluster can judge ({machine.address}: {machine.out}); start one"
            )
        return f"{self._address}: {what}, and {_RESUME}"

    def _answer(self, machine: ClusterMachine, task: Task, stopped: Stopped) -> Json | None:
        """Return what a machine answers; None where nobody waits for that any more, or it is lost.

        It is lost with its machine, and not waited for of one that is taken out meanwhile.
        """
        arguments = (tool_version(), self._digest, self._shipment, encode(task))
        future = self._client.submit(
            eval,
            CALL,
            {ARGUMENTS: arguments},
            workers=[machine.address],
            allow_other_workers=False,
            pure=False,
        )
        is_done = threading.Event()
        future.add_done_callback(lambda _future: is_done.set())
        try:
            while not is_done.wait(_POLL_INTERVAL) and future.status == "pending":
                with self._lock:
                    self.look()
                    is_there = self._machines.get(machine.address) is machine
                if stopped() or machine.out or not is_there:
                    return None
            return self._result(future)
        finally:
            with suppress(Exception):  # of a scheduler that has gone, as the next look shows
                future.cancel()

    def _result(self, future: Any) -> Json | None:
        try:
            answer: Json = future.result(timeout=_SECONDS_TO_ANSWER)
        except (
            *(TimeoutError, asyncio.TimeoutError, CancelledError, asyncio.CancelledError),
            self._distributed.KilledWorker,
        ):
            return None
        except ImportError as error:
            return {FAULT_OF_ALL: _missing(error)}
        except Exception as error:  # noqa: BLE001 - whatever the machine raised
            lines = str(error).splitlines() or [""]
            return {FAULT: f"{type(error).__name__}: {lines[0]}"}
        return answer

    def _note_judged(self, machine: ClusterMachine, faults: _Faults) -> None:
        """Note that a machine judged a task, and who could not although it could be judged."""
        machine.judged += 1
        machine.faults = machine.proven = 0
        for other, reason in faults:
            if other.faults:
                other.proven += 1
            if other.proven >= _MOST_FAULTS:
                self._take_out(other, reason)

    def _take_out(self, machine: ClusterMachine, reason: str) -> None:
        """Give a machine no more tasks; those that it has go to others."""
        if not machine.out:
            machine.out = reason
            self._notify(f"{machine.address}: judges nothing more in this run: {reason}")


def _freest(machines: Iterable[ClusterMachine]) -> ClusterMachine | None:
    """Return the machine with most room: those without faults first, then those that judged."""
    free = [machine for machine in machines if machine.room > 0]
    return min(
        free,
        key=lambda machine: (
            machine.faults > 0,
            not machine.judged,
            -machine.room / machine.threads,
        ),
        default=None,
    )


def _unreached(faults: _Faults, losses: int) -> Json:
    """Return what to record of a task that no machine could judge."""
    reasons = [f"{reason} ({machine.address})" for machine, reason in faults]
    if losses:
        reasons.append(f"{losses} machines went away with it")
    return {"failed": f"{TOOL_FAILED}: {'; '.join(reasons)}"}


def _missing(error: ImportError) -> str:
    """Say what is not installed on a machine."""
    name = error.name or ""
    if name.startswith("lab3_usd."):
        return f"another release of lab3-usd is installed there, not {tool_version()}"
    package = "lab3-usd" if name == "lab3_usd" else name or str(error)
    return f"{package} is not installed there; install lab3-usd {tool_version()} with extra cluster"
