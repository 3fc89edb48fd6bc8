"""Writes the table of `sim.md`: the node types that a dry run plays, by extension.

Run `python docs/make_played_nodes.py`.
"""

from __future__ import annotations

from pathlib import Path

from lab3_usd.sim.execution.node_instance import function_of
from lab3_usd.spec.load.loader import load_platform

PAGE = Path(__file__).with_name("sim.md")
MARK = "<!-- table: docs/make_played_nodes.py -->\n"


def page(text: str) -> str:
    """Return the page with a table of this release's types."""
    before, _, _ = text.partition(MARK)
    played: dict[str, list[str]] = {}
    for name, kind in load_platform().types.items():
        extension, _, last = name.rpartition(".")
        if function_of(kind) is not None:
            played.setdefault(extension, []).append(last)
    rows = ["| extension | node types |", "|---|---|"]
    rows += [
        f"| `{extension}` | {', '.join(sorted(names))} |"
        for extension, names in sorted(played.items())
    ]
    return before + MARK + "\n" + "\n".join(rows) + "\n"


if __name__ == "__main__":
    PAGE.write_text(page(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
