"""Scripts that nobody should write end with a clear line, in a moment."""

from __future__ import annotations

from pathlib import Path

import pytest

from lab3_usd.model.finding import StageResult
from lab3_usd.pipeline.stage import lint_stage

HEAD = "import omni.graph.core as og\n"
EDIT = (
    'og.Controller.edit({"graph_path": "/G", "evaluator_name": "execution"},'
    ' {"create_nodes": [("t", "omni.graph.action.OnPlaybackTick")]})\n'
)


def lint(text: str | bytes, folder: Path) -> StageResult:
    path = folder / "script.py"
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return lint_stage(path)


@pytest.mark.parametrize(
    "code",
    [
        "x = " + " + ".join(['"a"'] * 1500),
        "x = " + "[" * 150 + "]" * 150,
        "x = 10 ** 10 ** 10\ny = 'a' * 10 ** 10\nz = [0] * 10 ** 10",
        "x = f'{1:999999999}'\ny = '%999999999d' % 1\nz = '{:>999999999}'.format(1)",
        "x = [1]\nfor i in range(100):\n    x.extend(x)\n    x += x",
        "x = 'a'\nfor i in range(100):\n    x = x + x",
        "x = []\nx.append(x)\nd = {}\nd['a'] = d",
        "def f(x):\n    return f(x) + f(x)\nf(1)",
        "f = lambda x: f(x)\nf(1)",
        "class A:\n    def __init__(self):\n        A()\nA()",
        "while True:\n    pass",
        "".join(f"if a{i}:\n    og.Controller.edit('/A{i}', {{}})\n" for i in range(50)),
    ],
    ids=range(12),
)
def test_what_is_large_or_endless_keeps_nothing_from_being_read(code: str, tmp_path: Path) -> None:
    result = lint(f"{HEAD}{code}\n{EDIT}", tmp_path)
    assert result.verdict == "pass"
    assert result.coverage is not None
    assert result.coverage.nodes == 1


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (f"{HEAD}x = {'-' * 200_000}1\n{EDIT}", "nested too deeply"),
        (f"{HEAD}x = {'(' * 5000}1{')' * 5000}\n{EDIT}", "too many nested parentheses"),
        (f"# -*- coding: nonsense -*-\n{HEAD}{EDIT}", "cannot be decoded"),
        (HEAD.encode() + b"x = '\xff'\n" + EDIT.encode(), "is not UTF-8 text: line 2"),
        (f"# coding: ascii\n{HEAD}# \u00e9\n{EDIT}", "is not ASCII text: line 3"),
        (f"{HEAD}x = '\0'\n{EDIT}", "null bytes"),
        (HEAD + EDIT + "# x\n" * 3_000_000, "it has 12 MB"),
    ],
    ids=range(7),
)
def test_what_cannot_be_read_is_told_in_a_line(
    text: str | bytes, words: str, tmp_path: Path
) -> None:
    result = lint(text, tmp_path)
    assert result.verdict == "unreadable"
    assert words in result.findings[0].message


@pytest.mark.parametrize(
    "text",
    [
        (HEAD + "x = 'é'\n" + EDIT).encode("utf-8-sig"),
        ("# coding: latin-1\n" + HEAD + "x = 'é'\n" + EDIT).encode("latin-1"),
        (HEAD + EDIT).replace("\n", "\r\n").encode(),
    ],
    ids=["byte order mark", "latin-1", "Windows"],
)
def test_encodings_are_those_of_python(text: bytes, tmp_path: Path) -> None:
    assert lint(text, tmp_path).verdict == "pass"


def test_what_takes_too_many_steps_is_not_judged(tmp_path: Path) -> None:
    loops = "for i in range(2000):\n for j in range(2000):\n  og.Controller.connect(a, b)\n"
    result = lint(f"{HEAD}{EDIT}{loops}", tmp_path)
    assert result.verdict == "not judged"
    assert "too many steps" in result.gaps[0]
