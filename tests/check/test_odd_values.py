"""Whatever stands in a map, a parameter file or saved output, no rule crashes over it."""

from __future__ import annotations

import re
from itertools import cycle
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from ros_outputs import good_outputs
from submissions import checked

from lab3_usd.data import data_folder
from lab3_usd.deliverables.maps import MapError, read_pgm
from lab3_usd.deliverables.nav2_templates import PARAMS_FILE, nav2_files
from lab3_usd.deliverables.plain_yaml import load_plain
from lab3_usd.model.finding import Report
from lab3_usd.report.formats.json_report import report_json
from lab3_usd.report.safe_text import json_text
from lab3_usd.spec.load.loader import load_lab

ROS = load_lab().ros
MAP = data_folder("maps") / "turtlebot3_map.yaml"
MAP_TEXT = MAP.read_text()
PARAMS = nav2_files(load_lab(), ROS)[PARAMS_FILE]
OUTPUTS = good_outputs()
GOAL = "goal status: 4\ngoal seconds: 12.5\n"
HUGE = "1" + "0" * 400
ODD = (
    HUGE,
    f"-{HUGE}",
    f"[{HUGE}, {HUGE}, {HUGE}]",
    f"0x{'f' * 400}",
    "9" * 5000,
    ":".join(["59"] * 200),
    f"{':'.join(['59'] * 200)}.5",
    ".inf",
    "-.inf",
    ".nan",
    "[.nan, .inf, -.inf]",
    "1.0e+999",
    "-5",
    "yes",
    "no",
    "~",
    "[1, [2, [3, [4]]]]",
    "[[], {}, ~]",
    "{a: {b: 1}}",
    "{1: 2, ~: 3, .nan: 4, 2020-02-01: 5}",
    "{[1, 2]: 3}",
    "2020-02-01",
    "[2020-02-01, 2020-02-01 10:00:00, 2020-13-45]",
    "!!binary aGk=",
    "!!binary é",
    "!!set {a, b, c}",
    "!!omap [a: 1]",
    "!!bool maybe",
    "!!int ''",
    "!!float x",
    "!!timestamp x",
    "!!python/object:os.system {}",
    '"\\ud800"',
    '"\\U0010ffff \\0 \\x1b"',
    '"\\U00110000"',
    "x" * 5_000,
    f"'{'long ' * 1_000}'",
    "*nowhere",
    "&a [*a]",
    "{<<: 5}",
    "=",
    "",
)
# The default alphabet takes a second to find what UTF-8 can encode.
texts = st.text(st.characters(exclude_categories=["Cs"]), max_size=20)
odd = st.sampled_from(ODD) | texts | st.floats().map(repr) | st.integers().map(str)
_VALUE = re.compile(r"(?m)^(?P<key>[ \t-]*[\w:/*. ]+:[ \t]+)(?P<value>\S.*)$")
_NUMBER = re.compile(r"-?\d+(\.\d+)?(e-?\d+)?")


def hides_others(value: str) -> bool:
    """Whether a file is not read on behind such values: no YAML, repeated, or far too long."""
    if "*" in value or len(value) > len(HUGE) + 1:
        return True
    try:
        load_plain(f"a: {value}")
    except (yaml.YAMLError, ValueError):
        return True
    return False


def with_values(text: str, *values: str) -> str:
    """Put one of several values after the other in the place of every one."""
    given = cycle(values)
    return _VALUE.sub(lambda place: place["key"] + next(given), text)


def with_value(text: str, value: str, at: int) -> str:
    """Put a value in the place of the one with this number."""
    places = list(_VALUE.finditer(text))
    chosen = places[at % len(places)]
    return f"{text[: chosen.start('value')]}{value}{text[chosen.end('value') :]}"


def submitted(folder: Path, map_text: str, params: str, outputs: dict[str, str]) -> Path:
    """Write a submission without a stage."""
    files = {f"maps/{MAP.name}": map_text, PARAMS_FILE: params}
    for command in ROS.commands:
        fitting = [text for words, text in outputs.items() if command.line.startswith(words)]
        files[f"results/{command.file}"] = fitting[-1] if fitting else ""
    files["results/goal.txt"] = outputs.get("goal", "")
    for name, text in files.items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text(text, encoding="utf-8", errors="replace")
    (folder / "maps" / "turtlebot3_map.pgm").write_bytes(MAP.with_suffix(".pgm").read_bytes())
    return folder


def judged(
    map_text: str = MAP_TEXT, params: str = PARAMS, outputs: dict[str, str] = OUTPUTS
) -> dict[str, list[str]]:
    """Judge a submission that holds this, report it, and return the messages of each rule."""
    with TemporaryDirectory() as place:
        folder = submitted(Path(place), map_text, params, outputs)
        found = checked(folder)
    assert found.submission.crashes == ()
    assert [crash for result in found.results for crash in result.crashes] == []
    json_text(report_json(Report(found.results, (found.submission,))), 2).encode()
    said: dict[str, list[str]] = {}
    for finding in found.submission.findings:
        said.setdefault(finding.rule, []).append(finding.message)
    return said


def test_the_files_that_are_changed_here_are_right_as_they_are() -> None:
    assert {"M", "V", "E"} & {rule[0] for rule in judged()} == set()


ALONE = [value for value in ODD if hides_others(value)]
OTHERS = [value for value in ODD if value not in ALONE]
# Of five in one file each stands at every fifth key.
TOGETHER = [
    *([value] for value in ALONE),
    *(OTHERS[at : at + 5] for at in range(0, len(OTHERS), 5)),
]


@pytest.mark.parametrize("values", TOGETHER, ids=lambda values: " ".join(v[:9] for v in values))
def test_an_odd_value_at_every_key_is_no_crash(values: list[str]) -> None:
    given = cycle(values)
    numbers = {words: _NUMBER.sub(lambda _: next(given), text) for words, text in OUTPUTS.items()}
    said = judged(with_values(MAP_TEXT, *values), with_values(PARAMS, *values), numbers)
    assert {rule[0] for rule in said} & {"M", "V", "E"} != set()


@settings(max_examples=4, deadline=None)
@given(st.integers(0, 6), odd)
def test_an_odd_value_in_a_map_is_no_crash(at: int, value: str) -> None:
    judged(map_text=with_value(MAP_TEXT, value, at))


@settings(max_examples=4, deadline=None)
@given(st.integers(0, 300), odd)
def test_an_odd_value_in_a_parameter_file_is_no_crash(at: int, value: str) -> None:
    judged(params=with_value(PARAMS, value, at))


@settings(max_examples=8, deadline=None)
@given(st.sampled_from(sorted({**OUTPUTS, "goal": GOAL})), st.data(), odd)
def test_an_odd_line_in_an_output_is_no_crash(words: str, data: st.DataObject, value: str) -> None:
    text = OUTPUTS.get(words, GOAL)
    lines = text.splitlines()
    line = data.draw(st.integers(0, len(lines) - 1))
    at = data.draw(st.sampled_from([None, 0, 1, 2]))
    changed = {
        "whole": lambda: value,
        "value": lambda: with_values(lines[line], value) if _VALUE.match(lines[line]) else value,
        "numbers": lambda: _NUMBER.sub(lambda _: value, lines[line]),
    }[data.draw(st.sampled_from(["whole", "value", "numbers"]))]()
    kept = [*lines[:line], changed, *([] if at is None else lines[line + at :])]
    judged(outputs={**OUTPUTS, words: "\n".join(kept)})


@pytest.mark.parametrize(
    ("text", "value"),
    [
        (HUGE, HUGE),
        ("9" * 5000, "9" * 5000),
        (".inf", ".inf"),
        ("-.NaN", "-.NaN"),
        ("1.0e+999", "1.0e+999"),
        ("2020-02-01", "2020-02-01"),
        ("!!binary aGk=", "aGk="),
        ("!!bool maybe", "maybe"),
        ("!!int ''", ""),
        ('"\\ud83d\\ude00"', "\U0001f600"),
        ('"\\ud800"', "\ufffd"),
    ],
    ids=lambda value: value[:20],
)
def test_what_is_no_value_to_compute_with_stays_text(text: str, value: str) -> None:
    assert load_plain(text) == value


@pytest.mark.parametrize(
    ("text", "value"), [("0.05", 0.05), ("0x10", 16), ("-3", -3), ("yes", True), ("~", None)]
)
def test_plain_values_are_values(text: str, value: object) -> None:
    assert load_plain(text) == value


def test_a_set_keeps_its_order() -> None:
    assert list(load_plain("!!set {c, a, b}")) == ["c", "a", "b"]


def test_a_number_beyond_all_others_is_a_wrong_value_and_said_in_short() -> None:
    said = judged(
        with_value(MAP_TEXT, HUGE, 2), re.sub(r"(max_vel_x: ).*", rf"\g<1>{HUGE}", PARAMS)
    )
    assert max(len(message) for message in said["M06"] + said["V11"]) < 400


def test_seconds_that_are_no_number_are_no_crash() -> None:
    goal = {**OUTPUTS, "goal": "goal status: 4\ngoal seconds: 1.2.3\n"}
    assert "E16" not in judged(outputs=goal)


def test_a_cell_with_thousands_of_digits_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "map.pgm").write_text(f"P2\n1 1\n255\n{'9' * 5000}\n")
    with pytest.raises(MapError, match="whole numbers"):
        read_pgm(tmp_path / "map.pgm")
