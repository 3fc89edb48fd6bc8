"""The file of a picture: its formats, their endings, and writing it."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from lab3_usd.errors import UsageError
from lab3_usd.files import refuse_existing, write_whole
from lab3_usd.installation import install_command

if TYPE_CHECKING:
    from lab3_usd.report.picture.model import Picture
    from lab3_usd.report.picture.svg import Theme

LARGEST = 16000  # pixels on the longer side
ENDINGS = {"svg": "svg", "png": "png", "mermaid": "mmd", "dot": "dot"}


def encoder(form: str, theme: Theme = "auto") -> Callable[[Picture], bytes]:
    """Return what turns a picture into the bytes of its file."""
    from lab3_usd.report.picture.flowcharts import graphviz, mermaid
    from lab3_usd.report.picture.svg import svg_file

    encoders: dict[str, Callable[[Picture], bytes]] = {
        "svg": lambda picture: svg_file(picture, theme).encode(),
        "png": lambda picture: png(picture, theme),
        "mermaid": lambda picture: mermaid(picture).encode(),
        "dot": lambda picture: graphviz(picture).encode(),
    }
    return encoders[form]


def file_names(stem: str, pictures: Iterable[Picture]) -> Iterator[str]:
    """Yield a name for the file of each picture, all different where case does not count."""
    numbers: dict[str, int] = {}  # the last one behind each name
    for picture in pictures:
        name = free = stem + re.sub(r"[^\w-]", "_", picture.title)
        number = numbers.get(name.casefold(), 1)
        while free.casefold() in numbers:
            number += 1
            free = f"{name}-{number}"
        numbers[name.casefold()] = number
        numbers.setdefault(free.casefold(), 1)
        yield free


def png(picture: Picture, theme: Theme = "light") -> bytes:
    """Return the picture as a PNG image; one that would be too large is made smaller.

    The theme `auto` is light, because an image cannot follow a system.

    Raises:
        UsageError: the rasteriser is not installed.
    """
    try:
        import resvg_py
    except ImportError as error:
        raise UsageError(
            f"PNG needs the extra png: {install_command('png')}; or draw as svg"
        ) from error
    from lab3_usd.report.picture.svg import svg_file

    chosen: Theme = "light" if theme == "auto" else theme
    zoom = min(1.0, LARGEST / max(picture.width, picture.height, 1.0))
    return bytes(resvg_py.svg_to_bytes(svg_string=svg_file(picture, chosen), zoom=zoom))


def write_picture(picture: Picture, path: Path, force: bool) -> None:  # noqa: FBT001
    """Write a picture in the format that the ending of its file names.

    Raises:
        UsageError: there is no such format, the picture is empty, or the file exists.
    """
    forms = {f".{ending}": form for form, ending in ENDINGS.items()}
    if path.suffix.lower() not in forms:
        raise UsageError(f"{path}: must end in {', '.join(forms)}")
    if not picture.boxes:
        raise UsageError("there is nothing to draw")
    refuse_existing(path, force=force)
    write_whole(path, encoder(forms[path.suffix.lower()])(picture), force=force)
