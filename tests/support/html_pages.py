"""HTML pages for tests: of real stages, right and broken, and what a page is made of."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from html.parser import HTMLParser
from pathlib import Path

from pxr import Sdf, Usd

from lab3_usd.check.registry import all_rules
from lab3_usd.model.finding import Report, Submission
from lab3_usd.pipeline.stage import check_stage
from lab3_usd.report.formats.registry import render
from lab3_usd.spec.load.loader import load_lab
from lab3_usd.stage.write.builder import build_checkpoint

LAB = load_lab()
VOID = {"meta", "link", "input", "br", "wbr", "hr", "img"}
Break = Callable[[Usd.Stage], None]

DRIVE = LAB.graphs["ROS_Drive"].path
CLOCK = LAB.graphs["ROS_Clock"].path
TF = LAB.graphs["ROS_OdomTF"].path
CAMERA = LAB.graphs["ROS_Camera"].path


def since(number: str) -> str:
    """Name the places of a checkpoint and of all that follow it, as `data-in` does."""
    return " ".join(map(str, range(list(LAB.checkpoints).index(number), len(LAB.checkpoints))))


def set_value(stage: Usd.Stage, path: str, value: object) -> None:
    """Set an attribute where the stage has its prim; early checkpoints lack most graphs."""
    prim = stage.GetPrimAtPath(Sdf.Path(path).GetPrimPath())
    if prim:
        prim.GetAttribute(Sdf.Path(path).name).Set(value)


def break_ten_times(stage: Usd.Stage) -> None:
    """Make ten different faults, as far as the stage has what they are made in."""
    set_value(stage, f"{CLOCK}/ros2_publish_clock.inputs:topicName", "/klock")
    set_value(stage, f"{CLOCK}/ros2_context.inputs:useDomainIDEnvVar", True)  # noqa: FBT003
    set_value(stage, f"{DRIVE}/differential_controller.inputs:wheelRadius", 0.033)
    set_value(stage, f"{DRIVE}/constant_right_joint.inputs:value", "wheel_rigth_joint")
    set_value(stage, f"{CAMERA}/ros2_camera_helper.inputs:topicName", "/camera/image")
    set_value(stage, f"{CAMERA}/ros2_camera_helper.inputs:frameId", "camera")
    set_value(stage, f"{TF}/ros2_publish_odometry.inputs:chassisFrameId", "base_link")
    if stage.GetPrimAtPath(DRIVE):
        port = stage.GetPrimAtPath(f"{DRIVE}/make_array").GetAttribute("inputs:input0")
        port.ClearConnections()
        stage.RemovePrim(f"{DRIVE}/scale_linear_velocity")
    tree = stage.GetPrimAtPath(f"{TF}/isaac_compute_transform_tree")
    if tree:
        targets = tree.GetRelationship("inputs:targetPrims")
        targets.SetTargets(targets.GetTargets()[:-1])


def stages(folder: Path, broken: Break | None = None, numbers: str = "") -> list[Path]:
    """Build the checkpoints (`numbers` parted by blanks, else all), and break each of them."""
    paths = []
    for number in numbers.split() or LAB.checkpoints:
        name = LAB.checkpoints[number].file
        path = build_checkpoint(None, number, folder / f"{name}.usda")
        if broken is not None:
            stage = Usd.Stage.Open(str(path))
            broken(stage)
            stage.GetRootLayer().Save()
        paths.append(path)
    return paths


def judged(paths: list[Path], *submissions: Submission) -> Report:
    return Report(tuple(check_stage(path) for path in paths), submissions)


def page(report: Report) -> str:
    return render("html", report, all_rules())


@dataclass
class Element:
    """An element of a page, with its attributes and all the text within."""

    tag: str
    attributes: dict[str, str]
    text: str = ""
    inside: list[Element] = field(default_factory=list)

    def all(self, tag: str = "", kind: str = "") -> Iterator[Element]:
        """Yield the elements within of a tag and a class."""
        for element in self.inside:
            if tag in {"", element.tag} and (not kind or kind in element.kinds):
                yield element
            yield from element.all(tag, kind)

    def one(self, tag: str = "", kind: str = "") -> Element:
        return next(self.all(tag, kind))

    @property
    def kinds(self) -> list[str]:
        return self.attributes.get("class", "").split()


class _Reader(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.open = [Element("", {})]
        self.texts: list[list[str]] = [[]]  # of each that is open

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        element = Element(tag, {name: value or "" for name, value in attrs})
        self.open[-1].inside.append(element)
        if tag not in VOID:
            self.open.append(element)
            self.texts.append([])

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.open[-1].inside.append(Element(tag, {name: value or "" for name, value in attrs}))

    def handle_endtag(self, tag: str) -> None:
        assert self.open[-1].tag == tag, f"</{tag}> ends <{self.open[-1].tag}>"
        text = "".join(self.texts.pop())
        self.open.pop().text = text
        self.texts[-1].append(text)

    def handle_data(self, data: str) -> None:
        self.texts[-1].append(data)


def read(text: str) -> Element:
    """Return the page as a tree; every element that is opened must be closed in its turn."""
    reader = _Reader()
    reader.feed(text)
    reader.close()
    (top,) = reader.open
    top.text = "".join(reader.texts[0])
    return top


def in_lines(shown: str) -> str:
    """Return what a page shows, an element a line, without its style and script."""
    body = shown.partition("<main")[2].partition("<script")[0] or shown
    return re.sub(r"\s*(?=<[a-z])|\s*\n\s*", "\n", body)
