"""Gives tasks to the machines of a cluster, and each that a machine cannot judge to another one."""

from __future__ import annotations

import asyncio
import importlib
import time
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import CancelledError
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

from lab3_usd.grade.workers.machine import ARGUMENTS, CALL
from lab3_usd.grade.workers.pool import interrupted_by_signals
from lab3_usd.grade.workers.scheduler import PATIENCE
from lab3_usd.grade.workers.worker_messages import (
    FAULT,
    FAULT_OF_ALL,
    TOOL_FAILED,
    Answer,
    Json,
    Task,
    encode,
)
from lab3_usd.grade.workers.worker_process import WorkerError
from lab3_usd.report.options import tool_version

_PER_THREAD = 3  # tasks on their way for each thread of a machine that has judged
_MOST_FAULTS = 3  # tasks in a row that others judged, after which a machine gets no more
_MOST_TRIES = 3  # machines that a task is given to
_MOST_LOSSES = 5  # machines that may go away with a task
_POLL_INTERVAL = 0.2  # seconds
_SECONDS_TO_ANSWER = 20.0  # for the scheduler
_RESUME = "continue with --resume, which keeps what is graded"
_OVER = ("finished", "error", "cancelled", "lost")


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


@dataclass(slots=True, eq=False)
class TaskAttempt:
    """A task, the machine that has it, and why others could not judge it."""

    task: Task
    machine: ClusterMachine | None = None
    faults: list[tuple[ClusterMachine, str]] = field(default_factory=list)
    losses: int = 0

    def tried(self, machine: ClusterMachine) -> bool:
        """Whether a machine could not judge it."""
        return any(machine is other for other, _ in self.faults)


class Dispatch:
    """The tasks of a class and the machines of a cluster, which come and go."""

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
        self._flying: dict[Any, TaskAttempt] = {}
        self._again: deque[TaskAttempt] = deque()
        self._alone_since: float | None = None
        self._looked = -_POLL_INTERVAL
        self._distributed = importlib.import_module("distributed")

    def answers(self, tasks: Iterable[Task]) -> Generator[Answer]:
        """Yield each task with its answer, as soon as it is there.

        Raises:
            WorkerError: the scheduler or all machines have gone, or none can judge.
        """
        waiting = iter(tasks)
        with interrupted_by_signals(lambda: None) as interrupt:
            while True:
                with interrupt.put_off():
                    self.look()
                    done = [*self._give(waiting), *self._landed()]
                yield from done
                if self._flying or done:
                    continue
                if not self._again:  # nobody has judged for a while
                    task = next(waiting, None)
                    if task is None:
                        return
                    self._again.append(TaskAttempt(task))
                time.sleep(_POLL_INTERVAL)

    def _able(self) -> list[ClusterMachine]:
        return [machine for machine in self._machines.values() if not machine.out]

    def look(self) -> None:
        """See which machines there are; the tasks of those that have gone are given to others.

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
            self._lose(self._machines.pop(address))
        for address, count in threads.items():
            self._machines.setdefault(address, ClusterMachine(address, max(1, count)))
        if self._able():
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

    def _lose(self, machine: ClusterMachine) -> None:
        """Take back the tasks of a machine that has gone."""
        for future, attempt in list(self._flying.items()):
            if attempt.machine is machine:
                attempt.losses += 1
                self._take_back(future, attempt)

    def _take_back(self, future: Any, attempt: TaskAttempt) -> None:
        del self._flying[future]
        attempt.machine = None
        self._again.append(attempt)
        with suppress(Exception):  # of a scheduler that has gone, which is seen at the next look
            future.cancel()

    def _give(self, waiting: Iterator[Task]) -> Iterator[Answer]:
        """Give tasks to machines with room; yield those that nobody is left to judge."""
        for attempt in [self._again.popleft() for _ in range(len(self._again))]:
            able, tries = self._able(), len(attempt.faults)
            machines = [machine for machine in able if not attempt.tried(machine)]
            if tries == 1 and not machines:
                machines = able  # there is no other one; it may have been for a moment
            if attempt.losses >= _MOST_LOSSES or (
                tries and able and (tries >= _MOST_TRIES or not machines)
            ):
                yield attempt.task, _unreached(attempt)
                continue
            judging = [machine for machine in machines if machine.judged and not machine.faults]
            if tries and (judging or self._flying):  # it goes to one that is known to judge
                machines = judging
            if machine := _freest(machines):
                self._submit(attempt, machine)
            else:
                self._again.append(attempt)
        while machine := _freest(self._able()):
            task = next(waiting, None)
            if task is None:
                return
            self._submit(TaskAttempt(task), machine)

    def _submit(self, attempt: TaskAttempt, machine: ClusterMachine) -> None:
        machine.busy += 1
        attempt.machine = machine
        arguments = (tool_version(), self._digest, self._shipment, encode(attempt.task))
        future = self._client.submit(
            eval,
            CALL,
            {ARGUMENTS: arguments},
            workers=[machine.address],
            allow_other_workers=False,
            pure=False,
        )
        self._flying[future] = attempt

    def _landed(self) -> Iterator[Answer]:
        """Wait a moment, and yield what was judged meanwhile."""
        if not self._flying:
            return
        with suppress(OSError, asyncio.TimeoutError, CancelledError, asyncio.CancelledError):
            self._distributed.wait(
                list(self._flying), timeout=_POLL_INTERVAL, return_when="FIRST_COMPLETED"
            )
        over = [future for future in self._flying if future.status in _OVER]
        for future in over:
            attempt = self._flying.get(future)
            if attempt is None or attempt.machine is None:  # taken back with its machine
                continue
            machine = attempt.machine
            try:
                answer = self._answer(future)
            except (TimeoutError, asyncio.TimeoutError):
                continue  # its machine goes away, as the next look shows
            machine.busy -= 1
            if answer is None:
                attempt.losses += 1
                self._take_back(future, attempt)
                continue
            if FAULT_OF_ALL in answer:  # which says nothing of the task
                self._take_back(future, attempt)
                self._take_out(machine, str(answer[FAULT_OF_ALL]))
            elif FAULT in answer:
                attempt.faults.append((machine, str(answer[FAULT])))
                machine.faults += 1
                self._take_back(future, attempt)
            else:
                del self._flying[future]
                self._note_judged(machine, attempt)
                yield attempt.task, answer

    def _answer(self, future: Any) -> Json | None:
        """Return the answer of a task that is over; None where it was lost with its machine.

        Raises:
            TimeoutError: the machine that has the answer does not send it.
        """
        try:
            answer: Json = future.result(timeout=_SECONDS_TO_ANSWER)
        except (TimeoutError, asyncio.TimeoutError):
            raise
        except (CancelledError, asyncio.CancelledError, self._distributed.KilledWorker):
            return None
        except ImportError as error:
            return {FAULT_OF_ALL: _missing(error)}
        except Exception as error:  # noqa: BLE001 - whatever the machine raised
            lines = str(error).splitlines() or [""]
            return {FAULT: f"{type(error).__name__}: {lines[0]}"}
        return answer

    def _note_judged(self, machine: ClusterMachine, attempt: TaskAttempt) -> None:
        """Note that a machine judged a task, and who could not although it could be judged."""
        machine.judged += 1
        machine.faults = machine.proven = 0
        for other, reason in attempt.faults:
            if other.faults:
                other.proven += 1
            if other.proven >= _MOST_FAULTS and not other.out:
                self._take_out(other, reason)

    def _take_out(self, machine: ClusterMachine, reason: str) -> None:
        """Give a machine no more tasks, and its tasks to others."""
        if machine.out:
            return
        machine.out = reason
        self._notify(f"{machine.address}: judges nothing more in this run: {reason}")
        for future, attempt in list(self._flying.items()):
            if attempt.machine is machine:
                self._take_back(future, attempt)


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


def _unreached(attempt: TaskAttempt) -> Json:
    """Return what to record of a task that no machine could judge."""
    reasons = [f"{reason} ({machine.address})" for machine, reason in attempt.faults]
    if attempt.losses:
        reasons.append(f"{attempt.losses} machines went away with it")
    return {"failed": f"{TOOL_FAILED}: {'; '.join(reasons)}"}


def _missing(error: ImportError) -> str:
    """Say what is not installed on a machine."""
    name = error.name or ""
    if name.startswith("lab3_usd."):
        return f"another release of lab3-usd is installed there, not {tool_version()}"
    package = "lab3-usd" if name == "lab3_usd" else name or str(error)
    return f"{package} is not installed there; install lab3-usd {tool_version()} with extra cluster"
