"""Opens the stages that are to be judged, and has what judges them imported at the same time."""

from __future__ import annotations

import importlib
import sys
from contextlib import suppress
from pathlib import Path
from threading import Thread
from typing import Any


def open_while_importing(module: str, path: Path) -> Any:  # noqa: ANN401 - pxr has no types
    """Open a stage, and import a module meanwhile if it is not imported yet.

    The first stage of a process takes usd-core 10 to 20 ms, which it spends outside of Python's
    lock (GIL): as long as it takes to import the rules. The module must not import usd-core.

    Raises:
        StageError: the file cannot be opened.
    """
    from lab3_usd.stage.read.opening import open_stage  # noqa: PLC0415 - pxr, only when it is needed

    if module in sys.modules:
        return open_stage(path)
    importing = Thread(target=_import, args=(module,))
    importing.start()
    try:
        return open_stage(path)
    finally:
        importing.join()


def _import(module: str) -> None:
    with suppress(Exception):  # which the one who needs the module will meet as well
        importlib.import_module(module)
