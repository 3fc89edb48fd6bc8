"""Damaged and made-up stages: each is answered, and the tool itself never fails."""

from __future__ import annotations

import sys
from collections import Counter
from types import ModuleType

import pytest
from benchmark import load_benchmark
from fuzz_inputs import generate, written

pytestmark = pytest.mark.usefixtures("forked_workers")
COUNT = 8  # many: `make fuzz`


@pytest.fixture(scope="module", autouse=True)
def _small_lab() -> None:
    """The script works with the bundled lab."""


@pytest.fixture(scope="module")
def fuzz() -> ModuleType:
    return load_benchmark("fuzz")


def test_every_input_is_answered_and_the_tool_never_fails(
    fuzz: ModuleType, capsys: pytest.CaptureFixture[str]
) -> None:
    counts = fuzz.fuzz(COUNT, seed=11)
    said = capsys.readouterr().out
    assert counts.total() == COUNT
    assert counts["tool failed"] == 0, said
    assert counts["unreadable"] > 0
    assert counts["fail"] > 0


def test_every_input_is_answered_where_workers_misbehave(
    fuzz: ModuleType,
) -> None:
    program = fuzz.odd_program(0.4)
    counts = fuzz.fuzz(
        14, seed=4, seconds=6, program=program
    )  # on a busy machine one takes more than a second
    assert counts.total() == 14
    assert counts["crashed"] + counts["timeout"] + counts["too large"] > 0
    assert counts["unreadable"] + counts["fail"] > 0


def test_the_same_seed_gives_the_same_inputs() -> None:
    stages = written()
    first, again = generate(stages, 3, 5), generate(written(), 3, 5)
    assert first == again
    assert first != generate(stages, 3, 6)


@pytest.mark.parametrize(("kind", "status"), [("fail", 0), ("tool failed", 1)])
def test_the_command_counts_its_inputs(
    fuzz: ModuleType,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    kind: str,
    status: int,
) -> None:
    monkeypatch.setattr(sys, "argv", ["fuzz.py", "--count", "1200"])
    monkeypatch.setattr(fuzz, "fuzz", lambda count, *_settings: Counter({kind: count}))
    assert fuzz.main() == status
    lines = capsys.readouterr().out.splitlines()
    assert [line.partition(",")[0] for line in lines] == [
        "500 inputs", "1000 inputs", "1200 inputs",
    ]  # fmt: skip
    assert lines[-1].endswith(f": 1200 {kind}")
