"""The start of `lab3`, which `python -m lab3_usd` is as well."""

from __future__ import annotations

import gc
from typing import NoReturn


def start() -> NoReturn:
    """Run the command line.

    A command lives for a moment: looking for garbage in the meantime only costs time.
    """
    gc.set_threshold(100_000)
    from lab3_usd.cli import run

    run()


if __name__ == "__main__":
    start()
