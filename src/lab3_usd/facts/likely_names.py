"""Which known name a written one was likely meant to be, and which types a release surely lacks."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping

from lab3_usd.isaac.platform import Platform
from lab3_usd.isaac.releases import order

_ALIKE = 0.8
_NEAR_TYPE = 0.92
_ALIKE_WORD = 0.6  # `max` and `min` are another word, `tik` and `tick` are one
_NUMBER = r"\d+"
_WORD = r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])|\d+"


def likely_name(written: str, names: Collection[str]) -> str | None:
    """Return the known name that a name was likely meant to be, None where none is near."""
    same = [name for name in names if name.lower() == written.lower()]
    return same[0] if same else near_name(written, names, _ALIKE)


def likely_port(written: str, ports: Collection[str]) -> str | None:
    """Return the port of a type that a name was likely meant to be, None where none is near.

    What all inputs begin with makes no two of them alike, and one with another word in its name is
    no misspelling: it is another quantity.
    """
    side, _, short = written.partition(":")
    names = {name.partition(":")[2]: name for name in ports if name.partition(":")[0] == side}
    near = likely_name(short, names)
    return None if near is None or _has_other_word(short, near) else names[near]


def _has_other_word(written: str, near: str) -> bool:
    """Whether two names of as many words differ in a word by more than a few letters."""
    words, meant = (re.findall(_WORD, name) for name in (written, near))
    if len(words) != len(meant):
        return False
    pairs = zip(map(str.lower, words), map(str.lower, meant), strict=True)
    return any(
        near_name(word, [other], _ALIKE_WORD) is None for word, other in pairs if word != other
    )


def likely_type(written: str, types: Collection[str]) -> str | None:
    """Return the node type that was probably meant: one with the same or a similar last name.

    A type of an unknown extension with a known last name is a type of its own, as is a name that
    differs only in a number.
    """
    *before, last = written.split(".")
    same = _only_one_called(last, types)
    if same and _is_known_publisher(before, same, types):
        return same
    if near_name(written, types, _NEAR_TYPE) is None:
        return None
    letters = re.sub(_NUMBER, "", written)
    others = [name for name in types if re.sub(_NUMBER, "", name) != letters]
    return near_name(written, others, _NEAR_TYPE)


def _only_one_called(last: str, types: Collection[str]) -> str:
    """Return the only type with this last part of its name, '' where none or several have it."""
    last = last.removeprefix("Ogn")
    same = [name for name in types if name.rpartition(".")[2].removeprefix("Ogn") == last]
    return same[0] if len(same) == 1 and last else ""


def _is_known_publisher(before: list[str], meant: str, types: Collection[str]) -> bool:
    """Whether a name has the extension of the type that is meant, or another one that is known.

    Of an extension whose types are only documented there may be more.
    """
    right = meant.split(".")[:-1]
    if not before or before[: len(right)][:2] == right[:2]:
        return True
    if before[0] != right[0]:
        return before[0] in right
    start = ".".join(before[:2]) + "."
    same = [name for name in types if name.startswith(start)]
    kinds = types if isinstance(types, Mapping) else {}
    return bool(same) and not any(kinds[name].is_documented for name in same if name in kinds)


def meant_type(written: str, platform: Platform) -> str | None:
    """Return the type of a release that a name was likely meant to be.

    A name of an extension of before is meant by its last part: the list of new names is not whole.
    In a release of before it may be right.
    """
    is_early = order(platform.release) < order(platform.names.before)
    if is_early and platform.names.is_former_extension(written):
        return None
    if written in platform.lookalikes:
        return platform.lookalikes[written]
    if platform.names.is_former_extension(written):
        same = _only_one_called(written.rpartition(".")[2], platform.types)
        if same:
            return same
    return likely_type(written, platform.types)


def is_unregistered(name: str, platform: Platform) -> bool:
    """Whether a type is surely none of a release: of another one, or a name for one of its own.

    No name is none, too. Of any other unknown type nothing is known: somebody else may have it.
    """
    names = {*platform.types, *platform.events, *platform.once, *platform.deprecated}
    releases = platform.releases_of(name)
    if name in names or platform.scripts.runs(name) or platform.release in releases:
        return False
    return not name or bool(releases) or meant_type(name, platform) is not None


def near_name(written: str, names: Collection[str], least: float) -> str | None:
    """Return the name that is the most like another one, None where none is as like as `least`."""
    from difflib import get_close_matches

    return next(iter(get_close_matches(written, names, 1, least)), None)


def did_you_mean(name: str | None) -> str:
    """Return the end of a sentence that offers a name, nothing without one."""
    return f"; did you mean {name}?" if name else ""
