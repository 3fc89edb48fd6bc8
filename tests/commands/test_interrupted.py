"""Ctrl-C is nobody's failure: one line, and the exit status that shells expect."""

from __future__ import annotations

import pytest

from lab3_usd import cli


def test_a_run_that_is_interrupted_does_not_claim_that_the_tool_failed(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupt(_context: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(cli.lab3, "invoke", interrupt)
    monkeypatch.setattr("sys.argv", ["lab3", "rules"])
    with pytest.raises(SystemExit) as stopped:
        cli.main()
    assert stopped.value.code == 130
    assert capsys.readouterr().err.strip() == "lab3: interrupted"
