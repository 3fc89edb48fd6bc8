"""The HTML page as text: what stands in it, how its parts lead to each other, what it keeps out."""

from __future__ import annotations

import re
import sys
from base64 import b64encode
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Any

import pytest
from html_pages import (
    CLOCK,
    LAB,
    Element,
    break_ten_times,
    judged,
    page,
    read,
    set_value,
    since,
    stages,
)
from in_process import invoke
from linting import broken_robot
from msgspec.structs import replace
from other_labs import copied
from places import REPOSITORY
from pxr import Usd
from report_examples import (
    BROKEN,
    CRASHED,
    EMPTY,
    FAILED,
    HOSTILE,
    LAYER,
    MISSING_WIRE,
    OLD_NAME,
    PASSED,
    REPORT,
    RULES,
    SUBMISSION,
    hostile,
    requirement,
    write_stage,
)

from lab3_usd.data import LAB_VARIABLE
from lab3_usd.isaac.platform import Platform
from lab3_usd.isaac.releases import BASE
from lab3_usd.model.finding import Report, StageResult
from lab3_usd.model.stage import StageModel
from lab3_usd.pipeline.stage import lint_stage
from lab3_usd.report.entries import plural, summarize
from lab3_usd.report.formats.registry import render
from lab3_usd.report.html.model import read_content
from lab3_usd.report.html.pictures import _view
from lab3_usd.report.options import Options
from lab3_usd.report.picture.model import HEADER, Box, LegendEntry, Picture
from lab3_usd.spec.load.loader import load_lab
from lab3_usd.stage.read import stage_reader
from lab3_usd.stage.read.stage_reader import read_stage

MARKUP = (
    *HOSTILE,
    '"><img src=x onerror=alert(1)>',
    "'><svg onload=alert(1)>",
    "</style></script><script>alert(1)</script>",
    "{{ 7 * 7 }}{% raw %}",
    "javascript:alert(1)",
    "--><b>x</b>",
    "`<b>x</b>`",
    "a/<b>b</b>.c:<i>",
)


@pytest.fixture(scope="module")
def faulty(tmp_path_factory: pytest.TempPathFactory) -> Report:
    """Every checkpoint, the same ten faults in each."""
    return judged(stages(tmp_path_factory.mktemp("work"), break_ten_times))


@pytest.fixture(scope="module")
def faulty_text(faulty: Report) -> str:
    return page(faulty)


@pytest.fixture(scope="module")
def faulty_page(faulty_text: str) -> Element:
    return read(faulty_text)


def shown(report: Report, rules: Any = RULES) -> Element:
    return read(render("html", report, rules))


def cards(tree: Element) -> list[Element]:
    return list(tree.all("article", "card"))


def card_of(tree: Element, message: str) -> Element:
    return next(card for card in cards(tree) if message in card.one("h6").text)


def test_every_checkpoint_has_its_verdict_and_score() -> None:
    rows = list(shown(REPORT).all("li", "stage"))
    found = [(row.one(kind="number").text, row.one("b").text) for row in rows]
    assert found == [("00", "pass"), ("05", "fail"), ("06", "unreadable")]
    assert [row.one("div", "score").text.strip() for row in rows] == ["2/2", "3/4", "0/0"]


def test_one_stage_stands_at_the_top_by_itself() -> None:
    tree = shown(Report((FAILED,)))
    assert not list(tree.all("li", "stage"))
    assert tree.one("h1").text == "Lab3_05_ODOM_TF.usda"
    assert "3 of 4 requirements met" in tree.one("header", "hero").text


def test_the_share_of_requirements_is_never_rounded_up() -> None:
    almost = replace(
        FAILED,
        requirements=tuple(requirement("ROS_Drive", str(n), met=n > 0) for n in range(1000)),
    )
    assert shown(Report((almost,))).one("svg", "ring").text == "99%"


def test_sections_come_in_the_order_of_the_handout() -> None:
    names = ["8.11", None, "C10", "C9", "4.4", "J5, F11", "6.1", "A2"]
    findings = tuple(replace(OLD_NAME, handout=name, prim=f"/{name}") for name in names)
    tree = shown(Report((replace(FAILED, findings=findings),)))
    assert [heading.text for heading in tree.all("h5")] == [
        "4.4", "A2", "C9", "C10", "J5, F11", "6.1", "8.11", "no section",
    ]  # fmt: skip
    assert [part.one("h4").text for part in tree.all("section", "chapter")] == [
        "Section 4", "Part A: Starter scene", "Part C: Drive", "Part J", "Section 6", "Section 8",
        "Beside the handout",
    ]  # fmt: skip


def test_a_chapter_is_named_after_the_parts_of_the_lab(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    checkpoints = copied(tmp_path / "lab") / "checkpoints.yaml"
    text = checkpoints.read_text()
    for old, new in (("A", "Ex 3"), ("B", "Ex 31"), ("C", "Ex 31")):
        text = text.replace(f"part: {old},", f"part: {new},")
    checkpoints.write_text(text)
    monkeypatch.setenv(LAB_VARIABLE, str(checkpoints.parent))
    names = (None, "Ex 31.1", "Ex 4", "Ex 3.1", "Ex 3.2")
    findings = tuple(replace(OLD_NAME, handout=name, prim=f"/{name}") for name in names)
    tree = shown(Report((replace(FAILED, checkpoint="00", findings=findings),)))
    assert [part.one("h4").text for part in tree.all("section", "chapter")] == [
        "Ex 3: Starter scene", "Ex 4", "Ex 31", "Beside the handout",
    ]  # fmt: skip


def test_a_note_of_an_early_part_stands_below_an_error_of_a_late_one() -> None:
    asked = (("note", "A2"), ("warning", "B6"), ("error", "F9"))
    findings = tuple(replace(MISSING_WIRE, severity=word, handout=name) for word, name in asked)
    tree = shown(Report((replace(FAILED, findings=findings),)))
    assert [card.attributes["data-severity"] for card in cards(tree)] == [
        "error", "warning", "note",
    ]  # fmt: skip
    assert [(rank.one("h3").text, rank.one("h5").text) for rank in tree.all("section", "rank")] == [
        ("Errors", "F9"), ("Warnings", "B6"), ("Notes", "A2"),
    ]  # fmt: skip


def test_a_fault_that_is_carried_along_is_one_card(faulty_page: Element) -> None:
    card = card_of(faulty_page, "wheelRadius")
    numbers = [number for number in LAB.checkpoints if number >= "02"]
    assert card.attributes["data-in"] == since("02")
    assert card.one(kind="in").text == f"02 to {numbers[-1]}"
    places = [place.text for place in card.one("details", "spots").all("li")]
    assert [re.sub(r"\.usda:\d+:\d+$", "", place) for place in places] == [
        LAB.checkpoints[number].file for number in numbers
    ]


def test_the_same_rule_at_two_places_is_two_cards() -> None:
    findings = (MISSING_WIRE, replace(MISSING_WIRE, prim="/elsewhere"))
    assert len(cards(shown(Report((replace(FAILED, findings=findings),))))) == 2


def test_a_card_shows_the_lines_of_the_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_stage(tmp_path)
    monkeypatch.chdir(tmp_path)
    frame = shown(Report((FAILED,))).one("pre", "frame")
    assert ">  9 |" in frame.one("span", "hit").text
    assert "custom token inputs:input0" in frame.one("span", "hit").text


def test_a_card_says_what_was_expected_only_where_the_message_does_not() -> None:
    said = replace(OLD_NAME, message="is 1, expected 2", expected="2", actual="1", prim="/said")
    unsaid = replace(OLD_NAME, message="is wrong", expected="2", actual="1", prim="/unsaid")
    tree = shown(Report((replace(FAILED, findings=(said, unsaid)),)))
    assert [bool(list(card.all("dl"))) for card in cards(tree)] == [False, True]


def test_a_rule_is_explained_once() -> None:
    tree = shown(Report((FAILED, replace(FAILED, checkpoint="06"))))
    assert [part.attributes["id"] for part in tree.one("section", "rules").all("article")] == [
        "rule-W01"
    ]
    text = tree.one("section", "rules").text
    assert "the wheels stand still" in text
    assert card_of(tree, "has no wire").one("a", "rule").attributes["href"] == "#rule-W01"


def test_without_the_rules_nothing_leads_to_them() -> None:
    tree = shown(REPORT, None)
    assert not list(tree.all("section", "rules"))
    assert not list(tree.all("a", "rule"))


def test_a_wrong_port_and_its_card_lead_to_each_other(faulty_page: Element) -> None:
    card = card_of(faulty_page, "wheelRadius")
    target = card.one("h6").one("a").attributes["href"].removeprefix("#")
    link = next(
        link
        for link in faulty_page.all("a")
        if any(part.attributes.get("id") == target for part in link.inside)
    )
    assert link.attributes["href"] == f"#{card.attributes['id']}"
    assert target.endswith("differential_controller-p-inputs-c-wheelRadius")


def test_a_missing_node_and_its_card_lead_to_each_other(faulty_page: Element) -> None:
    card = card_of(faulty_page, "is missing")
    target = card.one("h6").one("a").attributes["href"]
    assert target.endswith("ROS_Drive--scale_linear_velocity")
    assert card.one("a", "crop").attributes["href"] == target
    assert f"#{card.attributes['id']}" in {
        link.attributes["href"] for link in faulty_page.one("svg", "lab3").all("a")
    } | {
        link.attributes["href"]
        for picture in faulty_page.all("svg", "lab3")
        for link in picture.all("a")
    }


def test_every_link_leads_somewhere_and_no_id_comes_twice(faulty_page: Element) -> None:
    ids = [each.attributes["id"] for each in faulty_page.all() if "id" in each.attributes]
    assert len(set(ids)) == len(ids)
    links = {each.attributes["href"] for each in faulty_page.all() if "href" in each.attributes}
    inner = {link.removeprefix("#") for link in links if link.startswith("#")}
    assert inner <= set(ids)
    assert {link[:5] for link in links if not link.startswith("#")} == {"data:"}


def test_a_graph_that_stays_the_same_is_drawn_once(faulty_page: Element) -> None:
    figures = [
        (each.one("b").text, each.attributes["data-in"]) for each in faulty_page.all("figure")
    ]
    graphs = [
        (graph, since(number))
        for number, checkpoint in LAB.checkpoints.items()
        for graph in checkpoint.new
    ]
    assert figures == [*graphs, ("TF", "5 6"), ("TF", since("07"))]


def test_a_graph_that_changes_is_drawn_for_each_of_its_looks(tmp_path: Path) -> None:
    paths = stages(tmp_path, None, "01 02")
    stage = Usd.Stage.Open(str(paths[1]))
    set_value(stage, f"{CLOCK}/ros2_publish_clock.inputs:topicName", "/klock")
    stage.GetRootLayer().Save()
    tree = read(page(judged(paths)))
    figures = [(each.one("b").text, each.attributes["data-in"]) for each in tree.all("figure")]
    assert figures == [("ROS_Clock", "0"), ("ROS_Clock", "1"), ("ROS_Drive", "1")]


def test_the_part_beside_a_fault_lies_within_its_picture(faulty_page: Element) -> None:
    sizes = {
        picture.attributes["id"]: [float(part) for part in picture.attributes["viewbox"].split()]
        for picture in faulty_page.all("svg", "lab3")
    }
    views = [crop.one("svg") for crop in faulty_page.all("a", "crop")]
    assert len(views) >= 9
    for view in views:
        left, top, width, height = map(float, view.attributes["viewbox"].split())
        picture = sizes[view.one("use").attributes["href"].removeprefix("#")]
        assert left >= 0
        assert top >= 0
        assert width == 2 * height
        assert left + width <= picture[2] + 1
        assert top + height <= picture[3] + 1


@pytest.mark.parametrize(("down", "top"), [(HEADER, 186), (400.0, 505)])
def test_the_part_beside_a_fault_begins_at_the_title_or_has_the_row_in_its_middle(
    down: float, top: int
) -> None:
    box = Box("/node", "node", "", "data", x=100.0, y=200.0, w=300.0, h=900.0)
    legend = (LegendEntry("ok", "", 0.0, 1900.0),)
    picture = Picture("", "", (box,), (), legend=legend, width=2000.0, height=2000.0)
    assert _view(box, down, picture) == f"60 {top} 380 190"


def test_topics_are_listed_once_with_their_checkpoints(faulty_page: Element) -> None:
    rows = {row.one("th").text: row for row in faulty_page.all("tr") if "data-in" in row.attributes}
    assert rows["/klock"].attributes["data-in"] == since("01")
    assert rows["/cmd_vel"].attributes["data-in"] == since("02")
    assert [cell.text for cell in rows["/klock"].all("td")][:2] == [
        "rosgraph_msgs/msg/Clock", "publishes",
    ]  # fmt: skip


def test_the_tree_is_there_as_text_too(faulty_page: Element) -> None:
    trees = [each for each in faulty_page.all("figure") if each.one("b").text == "TF"]
    assert "base_footprint" in trees[0].one("pre").text


def test_a_stage_that_is_gone_has_no_pictures() -> None:
    tree = shown(Report((FAILED,)))
    assert not list(tree.all("figure"))
    assert len(cards(tree)) == 3


def test_an_unreadable_stage_is_on_the_page() -> None:
    tree = shown(Report((BROKEN,)))
    assert "unreadable" in tree.one("header", "hero").text
    assert "NUL bytes" in cards(tree)[0].text


def test_a_clean_stage_says_so() -> None:
    tree = shown(Report((PASSED,)))
    assert "Nothing found" in tree.one("p", "clear").text
    assert not cards(tree)


def test_a_crash_is_no_pass() -> None:
    text = shown(Report((CRASHED,))).one("section", "crashes").text
    assert "T03" in text
    assert "KeyError: 'odom'" in text


def test_a_submission_shows_its_findings_and_its_checklist() -> None:
    tree = shown(REPORT)
    assert tree.one("h1").text == "work"
    assert card_of(tree, "no stage for checkpoint 08").one(kind="in").text == "submission"
    lists = [[item.one().text for item in part.all("li")] for part in tree.all("ul", "checks")]
    assert lists == [["met", "not met"], ["for a person to judge"]]


def test_submissions_stand_apart_on_one_page(tmp_path: Path) -> None:
    paths = stages(tmp_path / "a" / "work", break_ten_times, "01 02")
    paths += stages(tmp_path / "b" / "work", break_ten_times, "01 02")
    about = [replace(SUBMISSION, path=str(tmp_path / name)) for name in "ab"]
    tree = read(page(judged(paths, *about)))
    ids = [each.attributes["id"] for each in tree.all() if "id" in each.attributes]
    assert len(set(ids)) == len(ids)
    names = [block.one("header", "hero").one("h2").text for block in tree.all("section", "block")]
    assert names == ["a", "b"]
    assert [card.attributes["data-in"] for card in cards(tree) if "wheelRadius" in card.text] == [
        "1", "3",
    ]  # fmt: skip


def test_stages_of_one_checkpoint_are_told_apart_by_their_files() -> None:
    tree = shown(Report((replace(FAILED, path="a/x.usda"), replace(FAILED, path="a/y.usda"))))
    assert cards(tree)[0].one(kind="in").text == "x.usda, y.usda"


def test_files_without_a_common_folder_keep_their_paths() -> None:
    tree = shown(Report((FAILED, replace(PASSED, path="/x/Lab3_00.usda"))))
    assert [each.text for each in tree.all("span", "file")] == [LAYER, "/x/Lab3_00.usda"]


def test_a_report_without_results_is_a_page() -> None:
    assert shown(EMPTY).one("h1").text == "Lab 3"


def different(index: int, number: str) -> Any:
    def change(stage: Usd.Stage) -> None:
        for prim in stage.Traverse():
            for attribute in prim.GetAttributes():
                if attribute.GetName() in {"inputs:topicName", "inputs:frameId", "inputs:width"}:
                    old = attribute.Get()
                    attribute.Set(f"{old}_{number}" if isinstance(old, str) else index)

    return change


def test_a_whole_submission_fits_in_400_kilobytes_with_the_pictures_that_have_room(
    faulty_text: str, tmp_path: Path
) -> None:
    carried = len(faulty_text.encode())
    paths = [
        path
        for index, number in enumerate(load_lab().checkpoints)
        for path in stages(tmp_path, different(index, number), number)
    ]
    every_stage_different = page(judged(paths))
    assert carried < 200_000
    assert len(every_stage_different.encode()) < 400_000
    clocks = [
        bool(list(each.all(kind="left-out")))
        for each in read(every_stage_different).all("figure")
        if each.one("b").text == "ROS_Clock"
    ]
    assert set(clocks) == {True, False}
    assert clocks == sorted(clocks, reverse=True)  # those of early checkpoints go first


def skeleton(element: Element) -> list[tuple[str, tuple[str, ...]]]:
    return [
        (each.tag, tuple(sorted(each.attributes)))
        for each in element.all()
        if each.tag != "wbr" and each.attributes.get("class") != "long"
    ]


@cache
def page_with(text: str) -> str:
    return render("html", hostile(text), RULES)


@cache
def harmless() -> list[tuple[str, tuple[str, ...]]]:
    return skeleton(read(page_with("harmless")))


@pytest.mark.parametrize("text", MARKUP)
def test_no_string_of_a_report_becomes_markup(text: str) -> None:
    kept = [part for part in skeleton(read(page_with(text))) if part != ("code", ())]
    assert kept == [part for part in harmless() if part != ("code", ())]


@pytest.mark.parametrize("text", MARKUP)
def test_no_control_character_comes_through(text: str) -> None:
    rendered = page_with(text)
    assert {letter for letter in {*rendered} if not letter.isprintable()} == {"\n"}
    rendered.encode("utf-8")


def test_hostile_text_can_be_read() -> None:
    tree = shown(hostile("<script>alert(1)</script>"))
    assert "found <script>alert(1)</script>" in cards(tree)[0].one("h6").text
    assert len(list(tree.all("script"))) == 1


def test_the_policy_lets_in_only_the_page_itself() -> None:
    text = render("html", REPORT, RULES)
    tree = read(text)
    policy = next(
        each.attributes["content"]
        for each in tree.all("meta")
        if each.attributes.get("http-equiv") == "Content-Security-Policy"
    )
    assert policy.startswith("default-src 'none'; ")
    assert "unsafe" not in policy
    assert "http" not in policy
    for tag in ("style", "script"):
        content = re.search(rf"<{tag}>(.*?)</{tag}>", text, re.DOTALL)
        assert content
        digest = b64encode(sha256(content[1].encode()).digest()).decode()
        assert f"{tag}-src 'sha256-{digest}'" in policy
    assert not [each for each in tree.all() if "style" in each.attributes]


def test_no_address_leads_out_of_the_page(faulty_text: str) -> None:
    addresses = set(re.findall(r"\w+://[^\s'\"<>)]*", faulty_text))
    assert addresses == {"http://www.w3.org/2000/svg"}


def test_the_title_tells_the_verdict() -> None:
    open_ = replace(PASSED, gaps=("the robot is missing",))
    titles = [shown(Report((each,))).one("title").text for each in (PASSED, FAILED, open_)]
    assert titles == [
        "Lab3_00_INITIAL.usda: pass",
        "Lab3_05_ODOM_TF.usda: not passed yet",
        "Lab3_00_INITIAL.usda: not judged",
    ]


def test_what_can_be_repaired_has_its_command(faulty: Report) -> None:
    def commands(report: Report) -> set[str]:
        card = card_of(read(page(report)), "wheelRadius")
        return {each.text.strip() for each in card.all("p", "command")}

    stage = next(result for result in faulty.results if result.checkpoint == "02")
    odd = replace(stage, path="my work/Lab3_02.usda")
    assert commands(Report((odd,))) == {"lab3 fix 'my work/Lab3_02.usda' --select P01 --in-place"}
    whole = replace(SUBMISSION, path=str(Path(stage.path).parent))
    assert commands(replace(faulty, submissions=(whole,))) == {
        f"lab3 fix {whole.path} --select P01 --in-place"
    }


def test_a_command_is_quoted_as_the_shells_of_windows_take_it(
    faulty: Report, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "platform", "win32")
    stage = next(result for result in faulty.results if result.checkpoint == "02")
    odd = replace(stage, path=r"C:\my work\Lab3_02.usda")
    card = card_of(read(page(Report((odd,)))), "wheelRadius")
    (command,) = card.all("p", "command")
    quoted = r'lab3 fix "C:\my work\Lab3_02.usda" --select P01 --in-place'
    assert command.text.strip() == quoted


def editor_links(report: Report) -> list[str]:
    tree = read(render("html", report, RULES, Options(editor=True)))
    return [link.attributes["href"] for link in tree.all("a", "editor")]


def test_a_place_in_a_file_opens_in_the_editor(tmp_path: Path) -> None:
    (layer,) = stages(tmp_path / "my work", break_ten_times, "02")
    report = judged([layer])
    links = editor_links(report)
    path = layer.as_posix().replace(" ", "%20")
    (radius,) = (
        finding for finding in report.results[0].findings if "wheelRadius" in finding.message
    )
    assert f"vscode://file{path}:{radius.line}:{radius.column}" in links
    assert len(links) == len(set(links)) >= 5


def test_a_file_that_is_gone_does_not_open(tmp_path: Path) -> None:
    (layer,) = stages(tmp_path, break_ten_times, "02")
    report = judged([layer])
    layer.unlink()
    assert editor_links(report) == []


def test_no_link_into_the_editor_unless_it_is_asked_for(faulty_page: Element) -> None:
    assert not list(faulty_page.all("a", "editor"))


def test_what_cannot_be_repaired_has_no_command() -> None:
    assert not list(shown(Report((replace(FAILED, findings=(MISSING_WIRE,)),))).all("p", "command"))


def test_the_head_counts_findings_as_the_terminal_does(
    faulty: Report, faulty_page: Element
) -> None:
    totals = summarize(faulty)
    counted = [each.text for each in faulty_page.one("header", "hero").all("span", "count")]
    assert counted == [plural(totals.errors, "error"), plural(totals.notes, "note")]
    different = len(cards(faulty_page))
    assert different < totals.errors
    assert "counted in each checkpoint" in faulty_page.one("header", "hero").text
    assert f"{different} findings listed" in faulty_page.text


@pytest.mark.parametrize("count", [1, 2])
def test_a_page_of_the_linter_speaks_of_no_lab(count: int, tmp_path: Path) -> None:
    paths = [tmp_path / f"robot_{number}.usda" for number in range(count)]
    broken = broken_robot("rover", [{"deactivate": "/World/Clock"}])
    for path in paths:
        broken.GetRootLayer().Export(str(path))
    text = page(Report(tuple(lint_stage(path) for path in paths)))
    title = ["robot_0.usda", "Lint of 2 stages"][count - 1]
    assert read(text).one("title").text == f"{title}: pass"
    shown = re.sub(r"<(style|script).*?</\1>|<[^>]*>", " ", text, flags=re.DOTALL).lower()
    assert "k02" in shown
    assert [word for word in ("checkpoint", "handout", "lab 3", "0/0") if word in shown] == []


def test_the_pictures_of_a_stage_of_no_lab_are_those_of_the_linter(tmp_path: Path) -> None:
    page = tmp_path / "lint.html"
    invoke("lint", REPOSITORY / "docs/examples/carter.usda", "--format", "html", "-o", page)
    shown = page.read_text(encoding="utf-8")
    assert "3 transforms, 1 in another tree" in shown
    assert "10 nodes, 11 wires, 1 with an error" in shown
    assert "not asked for" not in shown


@pytest.mark.parametrize(("judged_by", "read_by"), [("5.1", "5.1"), ("", BASE)])
def test_a_page_reads_a_stage_by_the_release_that_judged_it(
    judged_by: str, read_by: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    releases = []

    def noted(path: Path, platform: Platform) -> StageModel:
        releases.append(platform.release)
        return read_stage(path, platform)

    monkeypatch.setattr(stage_reader, "read_stage", noted)
    path = str(REPOSITORY / "docs/examples/carter.usda")
    assert read_content(StageResult(path, None, release=judged_by), load_lab()) is not None
    assert releases == [read_by]
