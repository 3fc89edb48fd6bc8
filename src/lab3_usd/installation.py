"""How this program was installed, and with which command an extra is added to just that."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any

NAME = "lab3-usd"
_EXTRA = r"extra == ['\"]([\w-]+)['\"]"
_OWN = rf"{NAME}\[([\w,-]+)\]"
_PLAIN = r"[\w@%+=:,./\\-]+"  # what no shell of Windows takes for anything else


def install_command(extra: str) -> str:
    """Return the command that adds the packages of an extra where this program runs.

    pipx leaves `pipx_metadata.json` in the environment of a program, `uv tool` a receipt. The next
    upgrade of `uv tool` removes packages that the receipt does not name. Environments of uv have no
    pip.
    """
    receipt = Path(sys.prefix) / "uv-receipt.toml"
    if receipt.is_file():
        return command_line("uv", "tool", "install", _named_in(receipt, extra))
    packages = tuple(dict.fromkeys(_packages(extra)))
    environment = Path(sys.prefix)
    if (environment / "pipx_metadata.json").is_file():
        return command_line("pipx", "inject", environment.name, *packages)
    if find_spec("pip") is None:
        return command_line("uv", "pip", "install", "--python", sys.executable, *packages)
    return command_line(sys.executable, "-m", "pip", "install", *packages)


def _named_in(receipt: Path, extra: str) -> str:
    """Return what `uv tool install` takes for this program, the extras that it has, and one more.

    Those of a source that is neither path nor repository come from a registry.
    """
    if sys.version_info >= (3, 11):
        import tomllib
    else:
        import tomli as tomllib

    asked = tomllib.loads(receipt.read_text(encoding="utf-8"))["tool"]["requirements"]
    mine: dict[str, Any] = next((entry for entry in asked if entry["name"] == NAME), {})
    extras = ",".join(dict.fromkeys([*mine.get("extras", ()), extra]))
    place = next((mine[key] for key in ("directory", "path", "url", "editable") if key in mine), "")
    if "git" in mine:
        address, _, revision = mine["git"].partition("?rev=")
        place = f"git+{address}{'@' if revision else ''}{revision}"
    return f"{NAME}[{extras}] @ {place}" if place else f"{NAME}[{extras}]"


def _packages(extra: str) -> Iterator[str]:
    """Yield the packages of an extra, and of the extras that it has in turn, with their bounds."""
    from importlib import metadata

    try:
        requirements = metadata.requires(NAME) or []
    except metadata.PackageNotFoundError:  # it runs from its files
        requirements = []
    lines = (line.partition(";") for line in requirements)
    mine = [package.strip() for package, _, marker in lines if extra in re.findall(_EXTRA, marker)]
    for package in mine or [f"{NAME}[{extra}]"]:
        own = re.match(_OWN, package) if mine else None
        if own is None:
            yield package
        else:
            for inner in own[1].split(","):
                yield from _packages(inner)


def command_line(*words: str) -> str:
    """Return words as a shell of this system takes them; PowerShell and cmd share double quotes."""
    if sys.platform == "win32":
        return " ".join(word if re.fullmatch(_PLAIN, word) else f'"{word}"' for word in words)
    import shlex

    return shlex.join(words)
