"""Writes graphs/isaac/messages.json: the messages of ROS 2 Humble as nodes have them.

Usage: .venv/bin/python docs/make_messages.py

The definitions are those of rosbags (extra `sim`); the ports that Isaac Sim makes of fields are in
isaacsim.ros2.core/library/backend/Ros2DynamicMessage.cpp:213-470 (v6.0.1).
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_typestore

FILE = Path(__file__).resolve().parents[1] / "graphs/isaac/messages.json"
STORE = get_typestore(Stores.ROS2_HUMBLE)
OGN = {
    "float32": "float",
    "float64": "double",
    "bool": "bool",
    "byte": "uchar",
    "octet": "uchar",
    "char": "uint",
    "uint8": "uint",
    "uint16": "uint",
    "uint32": "uint",
    "uint64": "uint64",
    "int8": "int",
    "int16": "int",
    "int32": "int",
    "int64": "int64",
    "string": "token",
    "wstring": "token",
}
ABOUT = (
    "The messages of ROS 2 Humble: for each the ports that a generic node makes of its fields. "
    "Written by docs/make_messages.py: change that, not this."
)


def ports(message: str, above: str = "") -> Iterator[tuple[str, str]]:
    """Yield the fields of a message with their types; those of a message in it behind a colon."""
    for name, (kind, what) in STORE.fielddefs[message][1]:
        full = f"{above}:{name}" if above else name
        if kind == Nodetype.NAME:
            yield from ports(what, full)
        elif kind == Nodetype.BASE:
            yield full, OGN[what[0]]
        else:
            yield full, f"{element(what[0])}[]"


def element(item: Any) -> str:
    """Return the type of what an array holds; messages are texts of JSON."""
    kind, what = item
    return OGN[what[0]] if kind == Nodetype.BASE else "token"


def main() -> None:
    """Write the file, a message in a line."""
    lines = ",\n".join(
        f"{json.dumps(message)}: {json.dumps(dict(ports(message)))}"
        for message in sorted(STORE.types)
    )
    FILE.write_text(f'{{\n"about": {json.dumps(ABOUT)},\n"messages": {{\n{lines}\n}}\n}}\n')


if __name__ == "__main__":
    main()
