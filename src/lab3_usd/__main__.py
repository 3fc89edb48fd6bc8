"""The start of `lab3`, which `python -m lab3_usd` is as well."""

from __future__ import annotations

import gc
import signal
import sys
from typing import NoReturn


def start() -> NoReturn:
    """Run the command line.

    A command lives for a moment: looking for garbage in the meantime only costs time.
    """
    gc.set_threshold(100_000)
    try:
        from lab3_usd.errors import interrupt

        if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
            signal.signal(signal.SIGINT, interrupt)
        from lab3_usd.cli import run

        run()
    except KeyboardInterrupt:  # while the program is loaded, or after its work
        from lab3_usd.data import program
        from lab3_usd.errors import EXIT_INTERRUPTED

        print(f"{program()}: interrupted", file=sys.stderr)  # noqa: T201 - click may not be there
        sys.exit(EXIT_INTERRUPTED)


if __name__ == "__main__":
    start()
