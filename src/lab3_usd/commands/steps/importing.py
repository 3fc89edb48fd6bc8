"""Imports in another thread what a command needs once its stage is open.

The first stage of a process takes usd-core 10 to 20 ms, which it spends outside of Python's lock
(GIL): as long as it takes to import the rules.
"""

from __future__ import annotations

import importlib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import Thread
from typing import Any


@contextmanager
def imported_while_opening(*modules: str) -> Iterator[None]:
    """Import modules while the first stage of the body opens.

    They may import no more of usd-core than opening does, which imports some of it itself. One that
    cannot be imported fails where it is needed. What they write to standard error is lost, as
    usd-core's own warnings are.
    """
    from lab3_usd.stage.read.opening import opener  # noqa: PLC0415 - pxr, only when it is needed

    importing = Thread(target=_import, args=modules)
    open_only = opener.get()

    def open_and_import(path: Path) -> Any:  # noqa: ANN401 - pxr has no types
        if importing.ident is not None:
            return open_only(path)
        importing.start()
        try:
            return open_only(path)
        finally:
            importing.join()

    before = opener.set(open_and_import)
    try:
        yield
    finally:
        opener.reset(before)


def _import(*modules: str) -> None:
    for module in modules:
        with suppress(Exception):
            importlib.import_module(module)
