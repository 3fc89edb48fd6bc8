"""Ctrl-C is nobody's failure: one line, and the exit status that shells expect."""

from __future__ import annotations

import signal
import sys
import threading

import forking
import pytest

from lab3_usd import cli
from lab3_usd.errors import EndedBySignalError, interrupt


@pytest.mark.parametrize(
    ("interrupt", "status"),
    [
        (KeyboardInterrupt(), 130),
        (EndedBySignalError(signal.SIGINT), 130),
        (EndedBySignalError(signal.SIGTERM), 143),
    ],
)
def test_a_run_that_is_interrupted_does_not_claim_that_the_tool_failed(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    interrupt: KeyboardInterrupt,
    status: int,
) -> None:
    def interrupted(_context: object) -> None:
        raise interrupt

    monkeypatch.setattr(cli.lab3, "invoke", interrupted)
    monkeypatch.setattr("sys.argv", ["lab3", "rules"])
    with pytest.raises(SystemExit) as stopped:
        cli.main()
    assert stopped.value.code == status
    assert capsys.readouterr().err.strip() == "lab3: interrupted"


# Sends itself a signal when the command line is imported, or when the work is over.
SIGNALLED = """
import os, signal, sys
name, when = sys.argv[1:]
signal.signal(signal.SIGTERM, signal.SIG_DFL)
sys.argv = ["lab3", "rules"]
class Finder:
    def find_spec(self, module, path, target=None):
        if module == "lab3_usd.cli":
            os.kill(os.getpid(), getattr(signal, name))
if when == "imports":
    for module in [each for each in sys.modules if each.startswith("lab3_usd")]:
        del sys.modules[module]
    sys.meta_path.insert(0, Finder())
from lab3_usd.__main__ import start
if when == "end":
    from lab3_usd import cli
    cli.main = lambda: os.kill(os.getpid(), getattr(signal, name))
start()
"""


@pytest.mark.parametrize(("name", "status"), [("SIGINT", 130), ("SIGTERM", 143)])
@pytest.mark.parametrize("when", ["imports", "end"])
def test_a_signal_at_any_time_gives_the_status_that_shells_show(
    name: str, status: int, when: str
) -> None:
    command = [sys.executable, "-c", SIGNALLED, name, when]
    done = forking.run(command, capture_output=True, text=True, check=False, timeout=60)
    code = done.returncode
    assert (code if code >= 0 else 128 - code) == status
    assert done.stderr.strip() == ("lab3: interrupted" if name == "SIGINT" else "")


def test_ctrl_c_waits_while_modules_of_usd_core_are_imported() -> None:
    """These are loaded from C++, which prints an exception, and goes on without the module."""
    reached = []

    def raise_and_go_on() -> None:
        signal.raise_signal(signal.SIGINT)
        reached.append(True)

    inherited = signal.signal(signal.SIGINT, interrupt)
    try:
        exec("run()", {"__name__": "pxr.UsdGeom", "run": raise_and_go_on})  # noqa: S102
        assert reached == [True]
        with pytest.raises(KeyboardInterrupt):
            threading.Event().wait(timeout=60)
    finally:
        signal.signal(signal.SIGINT, inherited)
