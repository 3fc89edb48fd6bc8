"""The HTML page in a browser: it loads by itself, its filter and links work, it can be read."""

from __future__ import annotations

import functools
import itertools
import threading
from collections.abc import Callable
from dataclasses import dataclass
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import pytest
from browser import CONTRASTS, DESKTOP, PHONE, Browser
from grade_files import grade
from html_pages import CLOCK, DRIVE, LAB, TF, break_ten_times, judged, page, stages
from in_process import invoke
from linting import broken_robot
from machine import eventually
from pxr import Sdf, Usd
from report_examples import SUBMISSION, hostile

from lab3_usd.grade.gradebook import HTML, write_reports
from lab3_usd.grade.rubric import load_rubric
from lab3_usd.model.finding import Report
from lab3_usd.pipeline.stage import lint_stage
from lab3_usd.report.formats.registry import render

ATTACKS = (
    "<script>window.attacked=1</script>",
    "\"'><img src=x onerror=window.attacked=1>",
    "</style></script><script>window.attacked=1</script>",
    "</title></svg><svg onload=window.attacked=1>",
)


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Pages of a clean stage, of one with faults, and of a faulty submission with its grade."""
    folder = tmp_path_factory.mktemp("pages")
    whole = stages(folder / "submission" / "work", break_ten_times, "00 01 02 03")
    about = SUBMISSION
    foreign = [folder / f"{name}.usda" for name in ("a_warehouse_" * 15, "yard")]
    rover = broken_robot("rover", [{"deactivate": "/World/Clock"}])
    lost = rover.DefinePrim("/World/Lost").GetReferences()
    lost.AddReference("../shelves_of_the_warehouse/" * 8 + "shelf.usda")
    for path in foreign:
        rover.GetRootLayer().Export(str(path))
    reports = {
        "clean": judged(stages(folder / "clean", None, "02")),
        "faulty": judged(whole[2:3]),
        "submission": judged(
            whole, type(about)(str(folder / "submission"), about.findings, about.checklist)
        ),
        "hostile": judged(stages(folder / "hostile", attack, "05")),
        "linted": Report(tuple(map(lint_stage, foreign))),
    }
    texts = {name: page(report) for name, report in reports.items()}
    rubric = load_rubric(None, LAB)
    points = grade(rubric, reports["submission"].results[:3], about.checklist, late=True)
    graded = write_reports(reports["submission"], rubric, points, "Jane " + "Doe" * 60)
    for name, text in {**texts, "graded": graded[HTML]}.items():
        (folder / f"{name}.html").write_text(text, encoding="utf-8")
    return {name: folder / f"{name}.html" for name in (*texts, "graded")}


def attack(stage: Usd.Stage) -> None:
    """Put markup into every string that a stage can bring onto the page."""
    for graph in LAB.graphs.values():
        if graph.path not in {CLOCK, DRIVE, TF} and stage.GetPrimAtPath(graph.path):
            stage.RemovePrim(graph.path)
    for path in (CLOCK, DRIVE, TF):
        for prim in stage.GetPrimAtPath(path).GetChildren():
            prim.SetDisplayName(ATTACKS[0])
            for attribute in prim.GetAttributes():
                if isinstance(attribute.Get(), str) and attribute.GetName().startswith("inputs:"):
                    attribute.Set(ATTACKS[len(attribute.GetName()) % len(ATTACKS)])
    context = stage.GetPrimAtPath(f"{CLOCK}/ros2_context")
    context.GetAttribute("node:type").Set(ATTACKS[1])
    context.CreateAttribute("isaac:nameOverride", Sdf.ValueTypeNames.String).Set(ATTACKS[2])
    stage.GetPrimAtPath(f"{TF}/isaac_compute_transform_tree").GetAttribute("node:type").Set(
        ATTACKS[3]
    )
    for name in ("base_link", "base_scan"):
        prim = stage.GetPrimAtPath(f"/turtlebot3_burger/{name}")
        prim.CreateAttribute("isaac:nameOverride", Sdf.ValueTypeNames.String).Set(ATTACKS[0])


def select(chromium: Browser, label: str) -> None:
    option = next(each for each in chromium.all("select option") if each.text.startswith(label))
    option.click()


def visible_messages(chromium: Browser) -> list[str]:
    return chromium.texts(".card h6")


@dataclass(frozen=True)
class Seen:
    """What a browser says of a page that is only looked at."""

    complaints: list[str]
    widths: list[int]
    headings: list[int]
    regions: list[str]
    contrasts: dict[str, list[tuple[float, str]]]
    grounds: dict[str, str]
    stages: list[list[float]]
    pictures: list[tuple[float, bool, bool]]
    scripts: list[int]
    text: str


HEADINGS = """return [...document.querySelectorAll("h1, h2, h3, h4, h5, h6")]
  .map((heading) => Number(heading.localName[1]))"""
REGIONS = """return [...document.querySelectorAll("[role=region]")]
  .map((region) => region.getAttribute("aria-label"))"""
WIDTH = "return document.documentElement.scrollWidth"
GROUND = "return getComputedStyle(document.body).backgroundColor"
# Where the name of each stage ends and its verdict begins.
STAGES = """return [...document.querySelectorAll(".stage")]
  .map((stage) => [stage.querySelector(".name a"), stage.querySelector(".verdict")])
  .filter(([name, verdict]) => name && verdict)
  .map(([name, verdict]) =>
    [name.getBoundingClientRect().right, verdict.getBoundingClientRect().left])"""
# How much of each picture fits at full size, whether it does now, and whether there is a hint.
PICTURES = """return [...document.querySelectorAll("figure:has(.picture)")].map((figure) => {
  const picture = figure.querySelector(".picture");
  const hint = figure.querySelector("figcaption small");
  return [picture.clientWidth / picture.querySelector("svg").width.baseVal.value,
    picture.scrollWidth <= picture.clientWidth, Boolean(hint && !hint.hidden)]; })"""
# Scripts, images, and whether anything slipped in was run.
SCRIPTS = """return [document.querySelectorAll("script").length,
  document.querySelectorAll("img").length, Number(window.attacked !== undefined)]"""


@pytest.fixture(scope="module")
def look(chromium: Browser, pages: dict[str, Path]) -> Callable[[str], Seen]:
    """What is seen of a page of this kind, which is opened once."""
    return functools.cache(lambda name: _seen(chromium, pages[name]))


def _seen(chromium: Browser, page: Path) -> Seen:
    chromium.open(page)
    complaints = chromium.logs()
    headings, regions = chromium.run(HEADINGS), chromium.run(REGIONS)
    widths, stages = [chromium.run(WIDTH)], chromium.run(STAGES)
    pictures = [tuple(each) for each in chromium.run(PICTURES)]
    chromium.run("for (const each of document.querySelectorAll('details')) each.open = true")
    contrasts, grounds = {}, {}
    for scheme in ("light", "dark"):
        chromium.scheme(scheme)
        contrasts[scheme], grounds[scheme] = chromium.run(CONTRASTS), chromium.run(GROUND)
    chromium.resize((320, 568))
    widths.append(chromium.run(WIDTH))
    scripts, text = chromium.run(SCRIPTS), chromium.run("return document.body.textContent")
    return Seen(
        complaints, widths, headings, regions, contrasts, grounds, stages, pictures, scripts, text
    )


@pytest.fixture(params=["clean", "submission", "graded", "linted", "hostile"])
def seen(request: pytest.FixtureRequest, look: Callable[[str], Seen]) -> Seen:
    """A page of each kind."""
    return look(request.param)


def test_the_page_loads_without_an_error(seen: Seen) -> None:
    assert seen.complaints == []


def test_nothing_runs_out_of_the_window(seen: Seen) -> None:
    assert seen.widths == [1280, 320]


def test_no_level_of_headings_is_left_out(seen: Seen) -> None:
    assert seen.headings[0] == 1
    assert all(low - high <= 1 for high, low in itertools.pairwise(seen.headings))


def test_every_region_has_a_name_of_its_own(seen: Seen) -> None:
    assert len(seen.regions) == len(set(seen.regions)) >= 1


def test_every_text_has_enough_contrast(seen: Seen) -> None:
    for scheme, found in seen.contrasts.items():
        assert len(found) > 50
        assert [(scheme, kind) for ratio, kind in found if ratio < 4.5] == []


def test_light_and_dark_differ(seen: Seen) -> None:
    assert seen.grounds["light"] != seen.grounds["dark"]


class _Quiet(SimpleHTTPRequestHandler):
    def __init__(self, *values: Any, asked: list[str], **named: Any) -> None:
        self.asked = asked
        super().__init__(*values, **named)

    def do_GET(self) -> None:
        self.asked.append(self.path)
        super().do_GET()

    def log_message(self, *_: Any) -> None:
        """Say nothing on standard error."""


def test_the_page_asks_for_nothing_but_itself(chromium: Browser, pages: dict[str, Path]) -> None:
    asked: list[str] = []
    path = pages["submission"]
    handler = functools.partial(_Quiet, asked=asked, directory=str(path.parent))
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, args=(0.05,), daemon=True).start()
        chromium.requests()
        chromium.visit(f"http://127.0.0.1:{server.server_address[1]}/{path.name}")
        chromium.one("a.crop").click()
        server.shutdown()
    assert asked == [f"/{path.name}"]
    sent = [
        request for request in chromium.requests() if not request.startswith(("data:", "about:"))
    ]
    assert len(sent) == 1


def test_the_policy_stops_what_is_slipped_in(chromium: Browser, pages: dict[str, Path]) -> None:
    chromium.open(pages["clean"])
    chromium.run(
        """
        const put = (name, key, value) => {
          const element = document.createElement(name);
          element[key] = value;
          document.body.append(element);
        };
        put("script", "textContent", "window.attacked = 1");
        put("img", "src", "http://127.0.0.1:9/x.png");
        put("div", "innerHTML", "<b onclick='window.attacked = 1' id='slipped'>x</b>");
        document.getElementById("slipped").click();
        """
    )
    refused = [message for message in chromium.logs() if "Content Security Policy" in message]
    assert len(refused) == 3
    assert chromium.run("return window.attacked") is None


def test_only_a_page_that_was_not_graded_opens_files(
    pages: dict[str, Path], tmp_path: Path
) -> None:
    (stage,) = stages(tmp_path, break_ten_times, "02")
    checked = tmp_path / "report.html"
    invoke("check", stage, "--format", "html", "-o", checked)
    assert "vscode://file/" in checked.read_text(encoding="utf-8")
    assert "vscode:" not in pages["graded"].read_text(encoding="utf-8")


def test_every_severity_can_be_switched_off(chromium: Browser, pages: dict[str, Path]) -> None:
    chromium.open(pages["submission"])
    assert len(chromium.shown(".card.error")) >= 6
    chromium.one(".toggle.error").click()
    assert chromium.shown(".card.error") == []
    assert len(chromium.shown(".card.note")) == 1
    assert chromium.texts(".chapter h4") == ["Section 8"]
    total = len(chromium.all(".card"))
    assert chromium.one("output").text == f"1 of {total} findings"
    chromium.one(".tools button").click()
    wait_for(lambda: len(chromium.shown(".card")) == total)


def test_a_checkpoint_can_be_chosen(chromium: Browser, pages: dict[str, Path]) -> None:
    chromium.open(pages["submission"])
    select(chromium, "01")
    assert chromium.shown(".card")
    assert {card.get_attribute("data-in").split()[0] for card in chromium.shown(".card")} == {"1"}
    drawn = {each.get_attribute("data-in") for each in chromium.shown("figure")}
    assert drawn == {"1 2 3"}
    assert chromium.texts("tr[data-in] th") == ["/klock"]


def test_a_checkpoint_in_the_list_chooses_itself(chromium: Browser, pages: dict[str, Path]) -> None:
    chromium.open(pages["submission"])
    chromium.one("a[data-stage='2']").click()
    assert chromium.one("select").get_property("value") == "2"
    assert all("2" in card.get_attribute("data-in") for card in chromium.shown(".card"))


def test_all_words_of_a_search_must_be_in_the_card(
    chromium: Browser, pages: dict[str, Path]
) -> None:
    chromium.open(pages["faulty"])
    chromium.one("input[type=search]").send_keys("LR diff")
    assert len(visible_messages(chromium)) == 1
    chromium.one("input[type=search]").send_keys(" kl")
    assert visible_messages(chromium) == []
    assert chromium.one(".nothing").is_displayed()


def test_a_search_leaves_only_what_it_hits(chromium: Browser, pages: dict[str, Path]) -> None:
    chromium.open(pages["submission"])
    before = chromium.run("return document.documentElement.scrollHeight")
    chromium.one("input[type=search]").send_keys("klock")
    kept = "figure, .rules article, tbody tr, .checks > li, .card"
    assert chromium.shown(kept)
    words = chromium.run(
        "return [...document.querySelectorAll(arguments[0])]"
        ".filter((each) => each.checkVisibility()).map((each) => each.textContent)",
        kept,
    )
    assert [text for text in words if "klock" not in text.lower()] == []
    assert chromium.shown(".rules h2") == []
    assert chromium.run("return document.documentElement.scrollHeight") < before / 4


def test_the_filter_is_in_the_address(chromium: Browser, pages: dict[str, Path]) -> None:
    chromium.open(pages["submission"])
    chromium.one(".toggle.note").click()
    select(chromium, "02")
    chromium.one("input[type=search]").send_keys("l radi")
    address = chromium.run("return location.hash.slice(1)")
    assert address == "without=note&stage=2&words=l+radi"
    kept = visible_messages(chromium)
    chromium.open(pages["submission"], at=address)
    assert visible_messages(chromium) == kept != []
    assert chromium.one("input[type=search]").get_property("value") == "l radi"
    chromium.one("button[type=reset]").click()
    wait_for(lambda: len(chromium.shown(".card")) == len(chromium.all(".card")))
    wait_for(lambda: chromium.run("return location.hash") == "")


def test_the_command_of_a_repair_can_be_copied(chromium: Browser, pages: dict[str, Path]) -> None:
    chromium.open(pages["faulty"])
    chromium.run(
        "Object.defineProperty(navigator.clipboard, 'writeText',"
        " {value: async (text) => { window.copied = text; }})"
    )
    card = chromium.with_text(".card", "wheelRadius")
    command = card.find_element("css selector", ".command code").text
    card.find_element("css selector", ".command .copy").click()
    assert chromium.run("return window.copied") == command
    path = card.find_element("css selector", ".site .copy")
    path.click()
    assert (
        chromium.run("return window.copied")
        == f"{DRIVE}/differential_controller.inputs:wheelRadius"
    )
    wait_for(lambda: path.text == "Copied")


@pytest.mark.parametrize("name", ["faulty", "submission"])
def test_the_graphs_open_at_the_first_with_a_finding(
    chromium: Browser, pages: dict[str, Path], name: str
) -> None:
    chromium.open(pages[name])
    chromium.one("nav").find_element("link text", "Graphs").click()
    first = chromium.one("figure:has(.count)")
    wait_for(
        lambda: 0 <= chromium.run("return arguments[0].getBoundingClientRect().y", first) < 200
    )


def is_in_view(chromium: Browser, element: Any) -> bool:
    place = chromium.run(
        "const r = arguments[0].getBoundingClientRect();"
        "return [r.left, r.top, r.right, r.bottom, innerWidth, innerHeight]",
        element,
    )
    return bool(place[0] >= 0 and place[1] >= 0 and place[2] <= place[4] and place[3] <= place[5])


@pytest.mark.parametrize("size", [DESKTOP, PHONE], ids=["desktop", "phone"])
def test_a_finding_lights_its_port(
    chromium: Browser, pages: dict[str, Path], size: tuple[int, int]
) -> None:
    chromium.open(pages["faulty"], size)
    link = chromium.with_text(".card h6 a", "wheelRadius")
    before = chromium.run(
        "return getComputedStyle(document.getElementById(arguments[0]).querySelector('.hit')).fill",
        link.get_attribute("href").partition("#")[2],
    )
    link.click()
    lit = chromium.one(":target")
    assert "wheelRadius" in lit.get_attribute("id")
    assert "lit" in lit.get_attribute("class")
    after = chromium.run("return getComputedStyle(document.querySelector(':target .hit')).fill")
    assert after != before
    assert is_in_view(chromium, lit)


def test_a_port_shows_its_finding_even_where_the_filter_hides_it(
    chromium: Browser, pages: dict[str, Path]
) -> None:
    chromium.open(pages["submission"])
    chromium.one(".toggle.error").click()
    assert chromium.shown(".card.error") == []
    port = chromium.with_text(".picture a", "topicName")
    chromium.run("arguments[0].scrollIntoView({block: 'center', inline: 'center'})", port)
    port.click()
    card = chromium.one(".card:target")
    wait_for(card.is_displayed)
    assert "topicName" in card.find_element("css selector", "h6").text
    wait_for(lambda: chromium.driver.switch_to.active_element == card)
    assert is_in_view(chromium, card)


def wait_for(condition: Any) -> None:
    from selenium.webdriver.support.ui import WebDriverWait

    WebDriverWait(None, 30, poll_frequency=0.02).until(lambda _: condition())


def test_the_address_of_a_finding_can_be_sent_to_somebody(
    chromium: Browser, pages: dict[str, Path]
) -> None:
    chromium.open(pages["faulty"], at="b0-f3")
    assert is_in_view(chromium, chromium.one("#b0-f3"))


@pytest.fixture(scope="module")
def stops(chromium: Browser, pages: dict[str, Path]) -> list[tuple[str, str, bool]]:
    """Where the tabulator key stops: the element, its class or name, and whether it is visible."""
    from selenium.webdriver.common.keys import Keys

    chromium.open(pages["submission"])
    chromium.run(
        "window.seen = []; addEventListener('focusin', ({target: e}) => window.seen.push("
        "[e.localName, e.className.baseVal ?? (e.className || e.name || ''), e.checkVisibility()]))"
    )
    chromium.one("body").send_keys(Keys.TAB * 200)
    return [(tag, name, visible) for tag, name, visible in chromium.run("return window.seen")]


def test_the_keyboard_comes_to_everything(stops: list[tuple[str, str, bool]]) -> None:
    assert stops[0][1] == "skip"
    expected = {"severity", "words", "rule", "crop", "show", "frame", "scroll"}
    assert expected <= {name.partition(" ")[0] for _, name, _ in stops}


def test_the_keyboard_stops_at_nothing_that_cannot_be_seen(
    stops: list[tuple[str, str, bool]],
) -> None:
    tags = [tag for tag, _, _ in stops]
    assert tags.count("a") > 20
    assert set(tags) <= {"a", "button", "div", "input", "pre", "select", "summary"}
    assert all(visible for _, _, visible in stops)


def test_a_port_is_followed_with_the_keyboard(chromium: Browser, pages: dict[str, Path]) -> None:
    from selenium.webdriver.common.keys import Keys

    chromium.open(pages["faulty"])
    link = chromium.one(".picture a")
    chromium.run("arguments[0].focus()", link)
    assert chromium.driver.switch_to.active_element == link
    link.send_keys(Keys.ENTER)
    wait_for(lambda: chromium.all(".card:target"))


def test_a_long_name_of_a_stage_ends_before_its_verdict(look: Callable[[str], Seen]) -> None:
    stages = look("linted").stages
    assert len(stages) == 2
    assert all(name <= verdict for name, verdict in stages)


def test_the_page_is_read_without_scripts(chromium: Browser, pages: dict[str, Path]) -> None:
    chromium.scripts(on=False)
    try:
        chromium.open(pages["submission"])
        assert len(chromium.shown(".card")) == len(chromium.all(".card")) >= 8
        assert len(chromium.shown("figure")) == len(chromium.all("figure"))
        assert not chromium.one(".tools").is_displayed()
        chromium.one(".card a.show").click()
        assert chromium.one(":target").is_displayed()
    finally:
        chromium.scripts(on=True)


WIDE = "return [arguments[0].scrollWidth, arguments[0].clientWidth]"


def wide_picture(chromium: Browser) -> tuple[Any, dict[str, Any]]:
    """A picture that is wider than the page, and its buttons by what they say."""
    (figure, *_) = (
        figure
        for figure in chromium.all("figure")
        if "Fit to width" in figure.find_element("css selector", "figcaption").text
    )
    buttons = figure.find_elements("css selector", ".zoom button")
    picture = figure.find_element("css selector", ".picture")
    return picture, {button.text: button for button in buttons}


def test_a_wide_picture_can_be_fitted(chromium: Browser, pages: dict[str, Path]) -> None:
    chromium.open(pages["clean"])
    picture, buttons = wide_picture(chromium)
    whole, shown = chromium.run(WIDE, picture)
    assert whole > shown
    buttons["Fit to width"].click()
    whole, shown = chromium.run(WIDE, picture)
    assert whole <= shown
    assert buttons["Fit to width"].text == "Full size"


def test_a_picture_is_zoomed_with_buttons_and_keys(
    chromium: Browser, pages: dict[str, Path]
) -> None:
    from selenium.webdriver.common.keys import Keys

    chromium.open(pages["clean"])
    picture, buttons = wide_picture(chromium)

    def width() -> float:
        return float(
            chromium.run(
                "return arguments[0].querySelector('svg').getBoundingClientRect().width", picture
            )
        )

    full = width()
    buttons["+"].click()
    assert width() == pytest.approx(1.25 * full, rel=0.01)
    buttons["\N{MINUS SIGN}"].click()
    assert width() == pytest.approx(full, rel=0.01)
    chromium.run("arguments[0].focus()", picture)
    picture.send_keys("+")
    assert width() == pytest.approx(1.25 * full, rel=0.01)
    before = chromium.run("return arguments[0].scrollLeft", picture)
    picture.send_keys(Keys.ARROW_RIGHT)
    wait_for(lambda: chromium.run("return arguments[0].scrollLeft", picture) > before)
    picture.send_keys("0")
    assert width() <= DESKTOP[0]


def test_a_picture_is_dragged_and_no_link_in_it_followed(
    chromium: Browser, pages: dict[str, Path]
) -> None:
    from selenium.webdriver import ActionChains

    chromium.open(pages["faulty"])
    picture, _ = wide_picture(chromium)
    links = picture.find_elements("css selector", "a")
    link = next(link for link in links if "wheelRadius" in link.text)
    chromium.run("arguments[0].scrollIntoView({block: 'center', inline: 'center'})", link)
    before = chromium.run("return arguments[0].scrollLeft", picture)
    drag = ActionChains(chromium.driver).click_and_hold(link)
    drag.move_by_offset(60, 0).release().perform()
    assert chromium.run("return arguments[0].scrollLeft", picture) == before - 60
    assert chromium.run("return location.hash") == ""
    wait_for(lambda: "dragged" not in picture.get_attribute("class"))
    link.click()
    assert chromium.run("return location.hash") != ""


def test_a_wide_picture_starts_at_its_first_fault(
    chromium: Browser, pages: dict[str, Path]
) -> None:
    chromium.open(pages["faulty"])
    picture, _ = wide_picture(chromium)
    place = chromium.run(
        "const [fault, frame] = [arguments[0].querySelector('a'), arguments[0]]"
        ".map((each) => each.getBoundingClientRect());"
        "return [fault.left >= frame.left, fault.right <= frame.right]",
        picture,
    )
    assert place == [True, True]


def test_a_picture_that_was_zoomed_is_whole_on_paper(
    chromium: Browser, pages: dict[str, Path]
) -> None:
    chromium.open(pages["clean"])
    picture, buttons = wide_picture(chromium)
    buttons["+"].click()
    chromium.scheme("light", "print")
    width = chromium.run("return arguments[0].querySelector('svg').clientWidth", picture)
    assert width <= DESKTOP[0]
    assert not buttons["+"].is_displayed()
    chromium.scheme("light")


def test_a_picture_that_can_still_be_read_is_fitted_at_once(look: Callable[[str], Seen]) -> None:
    found = look("clean").pictures
    assert {share >= 0.75 for share, _, _ in found} == {True, False}
    assert [fits for _, fits, _ in found] == [share >= 0.75 for share, _, _ in found]
    assert [hint for _, _, hint in found] == [not fits for _, fits, _ in found]


def test_a_turned_phone_fits_its_pictures_again(chromium: Browser, pages: dict[str, Path]) -> None:
    chromium.open(pages["clean"], PHONE)
    assert chromium.shown("figcaption small")
    chromium.resize((2600, 900))
    assert eventually(lambda: not chromium.shown("figcaption small"))


@pytest.fixture(scope="module")
def paper(chromium: Browser, pages: dict[str, Path]) -> dict[str, Any]:
    """What is printed of a page."""
    chromium.open(pages["faulty"], (794, 1123))
    chromium.scheme("light", "print")
    return {
        "tools": chromium.shown(".tools"),
        "hidden": len(chromium.all(".card")) - len(chromium.shown(".card")),
        **chromium.run(PRINTED),
    }


PRINTED = """
const widths = [], turned = [];
for (const figure of document.querySelectorAll("figure")) {
  const drawn = figure.querySelector(".picture svg");
  const { width, height } = drawn.viewBox.baseVal;
  const { page } = getComputedStyle(figure);
  widths.push(drawn.getBoundingClientRect().width);
  turned.push([width > 1300 && width > 1.3 * height, page === "landscape"]);
}
const scrolling = [...document.querySelectorAll(".frame, .scroll, figure pre")]
  .filter((box) => getComputedStyle(box).overflowX !== "visible").length;
return { widths, turned, scrolling };
"""


def test_on_paper_every_finding_is_there_and_no_tool(paper: dict[str, Any]) -> None:
    assert paper["tools"] == []
    assert paper["hidden"] == 0


def test_on_paper_nothing_is_cut(paper: dict[str, Any]) -> None:
    assert max(paper["widths"]) <= 794


def test_on_paper_a_wide_graph_has_a_landscape_page(paper: dict[str, Any]) -> None:
    assert {wide for wide, _ in paper["turned"]} == {True, False}
    assert all(wide == on_its_side for wide, on_its_side in paper["turned"])


def test_on_paper_nothing_scrolls(paper: dict[str, Any]) -> None:
    assert paper["scrolling"] == 0


def test_markup_in_a_stage_stays_text(look: Callable[[str], Seen]) -> None:
    hostile = look("hostile")
    assert hostile.scripts == [1, 0, 0]
    assert all(each in hostile.text for each in ATTACKS[:2])


@pytest.mark.parametrize("text", ATTACKS)
def test_markup_in_a_report_stays_text(chromium: Browser, tmp_path: Path, text: str) -> None:
    path = tmp_path / "hostile.html"
    path.write_text(render("html", hostile(text)), encoding="utf-8")
    chromium.open(path)
    assert chromium.logs() == []
    assert chromium.run("return window.attacked") is None
    assert f"found {text}" in visible_messages(chromium)
