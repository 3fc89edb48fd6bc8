"""Judges on a machine of a cluster what its scheduler passes on, in confined processes."""

from __future__ import annotations

import atexit
import pickle
import threading
from collections import OrderedDict
from pathlib import Path

from lab3_usd.errors import Lab3Error
from lab3_usd.grade.intake.scratch import make_scratch, remove_abandoned, remove_scratch
from lab3_usd.grade.workers.pool import WorkerSlot, judge_with_retries
from lab3_usd.grade.workers.shipment import Shipment, unpacked
from lab3_usd.grade.workers.worker_messages import (
    FAULT,
    FAULT_OF_ALL,
    KILLED,
    Json,
    Task,
    decoded_message,
)
from lab3_usd.grade.workers.worker_process import WorkerError
from lab3_usd.report.options import tool_version

# Dask takes what it runs by this name: neither the scheduler, which reads what it passes on, nor a
# machine without this package fails before it can say so.
CALL = "__import__('lab3_usd.grade.workers.machine', fromlist=['']).judge_here(*arguments)"
ARGUMENTS = "arguments"
_MOST_SLOTS = 3  # of a thread: so many graders use the cluster at the same time unhindered
_local = threading.local()


def judge_here(version: str, *rest: bytes) -> Json:
    """Judge a task on this machine, in a process that this thread keeps, and return its answer.

    The rest is the digest of a shipment, the shipment, and the task. What this machine cannot do
    is in the answer too; `version` comes first, so that other releases can say that they are one.
    """
    own = tool_version()
    if own != version:
        return {FAULT_OF_ALL: f"lab3-usd {own} is installed there, not {version}"}
    digest, shipment, message = rest
    try:
        judged, answer = judge_with_retries(_slot(digest, shipment), decoded_message(message, Task))
    except WorkerError as error:
        return {FAULT_OF_ALL: str(error)}
    except Lab3Error as error:
        return {FAULT: str(error)}
    except OSError as error:  # its disk, its limits
        return {FAULT_OF_ALL: f"{error.strerror}: {error.filename}"}
    for file, how in judged.broken.items():
        if how.startswith(KILLED):  # perhaps by a machine that is short of memory
            return {FAULT: f"{judged.student}: {file}: {how}"}
    return answer


def _slot(digest: bytes, shipment: bytes) -> WorkerSlot:
    """Return this thread's worker for a shipment; each of some graders has its own."""
    slots: OrderedDict[bytes, tuple[WorkerSlot, Path]] | None = getattr(_local, "slots", None)
    if slots is None:
        slots = _local.slots = OrderedDict()
    if digest not in slots:
        while len(slots) >= _MOST_SLOTS:
            _remove(*slots.popitem(last=False)[1])
        packed: Shipment = pickle.loads(shipment)  # noqa: S301 - whoever reaches Dask runs anything
        remove_abandoned(packed.settings.readable)
        folder = make_scratch("lab3-starter-")
        slot = WorkerSlot(unpacked(packed, folder))
        slots[digest] = (slot, folder)
        atexit.register(_remove, slot, folder)
    slots.move_to_end(digest)
    return slots[digest][0]


def _remove(slot: WorkerSlot, folder: Path) -> None:
    slot.stop()
    remove_scratch(folder)
