"""Whom a submission is of: a name, and ids of a kind, which is compared with its own kind only."""

from __future__ import annotations

import unicodedata
from collections.abc import Mapping

from msgspec import Struct

# The kinds of ids. Two numbers of different kinds may be equal and of two people.
CANVAS_USER = "Canvas user"
MOODLE_NUMBER = "Moodle number"  # the participant's, or that of a group
BLACKBOARD_USER = "Blackboard user"
STUDENT_ID = "student id"  # the institution's
ADDRESS = "address"
LOGIN = "login"


class Person(Struct, frozen=True):
    """Somebody as a platform names them; the name is '' where it is unknown."""

    name: str = ""
    ids: Mapping[str, str] = {}


def id_key(cell: str) -> str:
    """Return an id as it is compared: without case, and without the `#` of Brightspace."""
    return cell.strip().removeprefix("#").casefold()


def name_key(name: str) -> str:
    """Return the letters and digits of a name without case, which is what platforms leave of it.

    Canvas drops everything else, Moodle apostrophes; a file system may decompose accents.
    """
    plain = unicodedata.normalize("NFKC", name.casefold())
    return "".join(
        letter for letter in plain if unicodedata.category(letter)[0] in "LM" or letter.isdecimal()
    )


def name_keys(name: str) -> frozenset[str]:
    """Return the keys of a name in both orders: `Lee, Jo` is `leejo` and `jolee`."""
    first, _, second = name.partition(",")
    return frozenset({name_key(name), name_key(f"{second} {first}")} - {""})
