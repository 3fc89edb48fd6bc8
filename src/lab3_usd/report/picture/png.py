"""Pictures as PNG, by the rasteriser of the extra `png`."""

from __future__ import annotations

from lab3_usd.errors import UsageError
from lab3_usd.installation import install_command
from lab3_usd.report.picture.model import Picture
from lab3_usd.report.picture.svg import Theme, svg_file

LARGEST = 16000  # pixels on the longer side


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
    chosen: Theme = "light" if theme == "auto" else theme
    zoom = min(1.0, LARGEST / max(picture.width, picture.height, 1.0))
    return bytes(resvg_py.svg_to_bytes(svg_string=svg_file(picture, chosen), zoom=zoom))
