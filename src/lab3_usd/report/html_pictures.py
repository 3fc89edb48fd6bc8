"""The pictures of a block: each drawn once for all stages that look alike, linked to its faults."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from msgspec import Struct, field

from lab3_usd.report.html_links import Place, place_of, related_places
from lab3_usd.report.html_model import Block, Drawn, Fault, Link, Topic
from lab3_usd.report.html_stages import Seen
from lab3_usd.report.picture_model import Picture
from lab3_usd.report.svg import svg

# Characters in one block, so that the page of a whole submission stays below 400 kB.
ROOM = 300_000
LEAST = 40_000
OF_A_FAULT = 1_500
OF_A_TOPIC = 800
MOST_LINKS = 4  # from one fault, where its graph differs from stage to stage


class Gallery(Struct, frozen=True):
    """The pictures of a block, and from the id of each fault the ways into them."""

    pictures: tuple[Drawn, ...] = ()
    links: Mapping[str, tuple[Link, ...]] = field(default_factory=dict)


class _Frame(Struct, frozen=True):
    """A picture with the stages that it shows and its id on the page."""

    id: str
    picture: Picture
    stages: tuple[int, ...]
    lines: tuple[str, ...]


def gallery(block: Block, seen: Mapping[int, Seen], found: Sequence[Fault]) -> Gallery:
    """Draw every picture once; where they do not fit, those without faults give way first.

    Among the others the last checkpoints come first: they hold what those before them added.
    """
    frames = list(_frames(block, seen))
    places = {frame.id: _places(frame, found) for frame in frames}
    drawn: dict[str, str] = {}
    room = _room(seen, found)
    for frame in sorted(frames, key=lambda one: (not places[one.id], -one.stages[-1])):
        text = _svg(frame, places[frame.id], found)
        if len(text) <= room:
            room -= len(text)
            drawn[frame.id] = text
    links: dict[str, list[Link]] = {}
    for frame in frames:
        for name, place in places[frame.id].items():
            if frame.id in drawn:
                links.setdefault(name, []).append(_link(frame, place))
    pictures = tuple(_drawn(frame, places[frame.id], drawn.get(frame.id)) for frame in frames)
    return Gallery(pictures, {name: tuple(ways[:MOST_LINKS]) for name, ways in links.items()})


def _room(seen: Mapping[int, Seen], found: Sequence[Fault]) -> int:
    """Return the characters left for pictures beside the faults and the topics."""
    beside = OF_A_FAULT * len(found) + OF_A_TOPIC * len(topics(seen))
    return max(ROOM - beside, LEAST)


def _frames(block: Block, seen: Mapping[int, Seen]) -> Iterable[_Frame]:
    """Yield each different picture with its stages: graph by graph, in the order of the lab."""
    stages: dict[Picture, list[int]] = {}
    names: dict[tuple[str, str], list[Picture]] = {}
    for index in sorted(seen):
        for picture in seen[index].pictures:
            stages.setdefault(picture, []).append(index)
            same = names.setdefault((picture.kind, picture.title), [])
            same += [] if picture in same else [picture]
    every = [picture for same in names.values() for picture in same]
    for number, picture in enumerate(every):
        shows = tuple(stages[picture])
        lines = seen[shows[0]].tree if picture.kind == "frames" else ()
        yield _Frame(f"{block.id}-g{number}", picture, shows, lines)


def _places(frame: _Frame, found: Sequence[Fault]) -> dict[str, Place]:
    """Return where in the picture each fault is, by the id of the fault."""
    places = {}
    for fault in found:
        place = place_of(fault.finding, frame.picture)
        if place is not None and set(fault.stages) & set(frame.stages):
            places[fault.id] = place
    return places


def _svg(frame: _Frame, places: Mapping[str, Place], found: Sequence[Fault]) -> str:
    links: dict[str, str] = {}
    for name, place in places.items():
        links.setdefault(place.id, f"#{name}")
    for fault in found:
        if fault.id in places:
            for place in related_places(fault.finding, frame.picture):
                links.setdefault(place.id, f"#{fault.id}")
    text = svg(frame.picture, f"{frame.id}-", links)
    # The parts beside the faults are drawn from this element; what has links is no image.
    role = 'role="group"' if links else 'role="img"'
    return text.replace("<svg ", f'<svg id="{frame.id}" ', 1).replace('role="img"', role, 1)


def _link(frame: _Frame, place: Place) -> Link:
    return Link(
        target=f"{frame.id}-{place.id}",
        picture=frame.id,
        title=frame.picture.title,
        stages=frame.stages,
        view=place.view,
    )


def _drawn(frame: _Frame, places: Mapping[str, Place], text: str | None) -> Drawn:
    picture = frame.picture
    return Drawn(
        id=frame.id,
        title=picture.title,
        kind=picture.kind,
        stages=frame.stages,
        size=(picture.width, picture.height),
        faults=len(places),
        svg=text,
        lines=frame.lines,
    )


def topics(seen: Mapping[int, Seen]) -> tuple[Topic, ...]:
    """Return the rows of the topic table, each once, with the stages that have it."""
    stages: dict[tuple[str, ...], list[int]] = {}
    for index in sorted(seen):
        for cells in seen[index].topics:
            stages.setdefault(cells, []).append(index)
    return tuple(Topic(cells, tuple(dict.fromkeys(shows))) for cells, shows in stages.items())
