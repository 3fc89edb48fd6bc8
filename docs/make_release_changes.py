"""Writes the table of `moving.md`: what each release of Isaac Sim changed, out of `graphs/isaac/`.

Run `python docs/make_release_changes.py`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path

from lab3_usd.isaac.platform import Platform
from lab3_usd.model.finding import display
from lab3_usd.spec.load.loader import load_platform

PAGE = Path(__file__).with_name("moving.md")
MARK = "<!-- table: docs/make_release_changes.py -->\n"
MOST = 4  # names in a cell


def table(platform: Platform) -> str:
    """Return the table, the oldest change first."""
    rows = ["| since | what | then |", "|---|---|---|"]
    for before, after in pairwise(platform.known_releases):
        earlier, later = platform.in_release(before), platform.in_release(after)
        rows += [f"| {after} | {what} | {then} |" for what, then in _changes(earlier, later)]
    return "\n".join(rows) + "\n"


def _changes(before: Platform, after: Platform) -> Iterator[tuple[str, str]]:
    """Yield what changed, and what is to be done or happens then."""
    changes = after.changes
    gone: dict[str, list[str]] = {}
    for kind in sorted(before.types.keys() - after.types.keys()):
        found = changes.successor(kind)
        known = found is not None and found[0] in after.types
        named = f"a node of `{_short(found[0])}`, by hand" if found and known else "nothing"
        gone.setdefault("its ROS 2 node, by hand" if "ROS1" in kind else named, []).append(kind)
    for then, kinds in gone.items():
        yield f"no type {_listed(kinds)}", then
    new = sorted(after.types.keys() - before.types.keys())
    if new:
        yield f"new: {_listed(new)}", "unknown in earlier ones"
    for kind in sorted(before.types.keys() & after.types.keys()):
        yield from _of_type(kind, before, after)
    for meaning in changes.meanings:
        if meaning.since == after.release:
            yield _where(meaning.types, meaning.schema, meaning.asset), meaning.up


def _of_type(kind: str, before: Platform, after: Platform) -> Iterator[tuple[str, str]]:
    old, new = before.types[kind], after.types[kind]
    gone: dict[str, list[str]] = {}
    for port in old.ports:
        if port not in new.ports:
            known = after.changes.gone(kind, port)
            then = known.by or (f"`{known.to}`" if known.to else "") if known else ""
            gone.setdefault(then or "its value is lost", []).append(port)
    for then, ports in gone.items():
        yield f"`{_short(kind)}` without {_listed(ports)}", then
    for name, port in new.ports.items():
        was = old.ports.get(name)
        if was is None or not name.startswith("inputs:"):
            continue
        if was.default != port.default and was.default is not None and port.default is not None:
            values = f"{display(was.default)}, now {display(port.default)}"
            is_idle = after.changes.does_nothing(kind, name, after.release)
            then = "does nothing" if is_idle else "the old value is written (K39)"
            yield f"`{name}` of `{_short(kind)}`: {values}", then
        lost = [token for token in was.allowed if token not in port.allowed]
        more = [token for token in port.allowed if token not in was.allowed]
        if lost and port.allowed:
            yield f"`{name}` of `{_short(kind)}` without {_listed(lost)}", "K35"
        if more and was.allowed:
            yield f"`{name}` of `{_short(kind)}` also {_listed(more)}", "unknown in earlier ones"


def _where(types: Sequence[str], schema: str, asset: str) -> str:
    return _listed(types) if types else f"prims with {schema}" if schema else f"assets in {asset}"


def _short(kind: str) -> str:
    return kind.rpartition(".")[2]


def _listed(names: Sequence[str]) -> str:
    shown = [f"`{_short(name)}`" for name in names[:MOST]]
    more = len(names) - MOST
    return ", ".join(shown) + (f" and {more} more" if more > 0 else "")


def page(text: str) -> str:
    """Return the page with the table of today."""
    return text.partition(MARK)[0] + MARK + "\n" + table(load_platform())


if __name__ == "__main__":
    PAGE.write_text(page(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
