"""Describes the things of a scene that stages add or change, in the form of `props`."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from typing import Any

from msgspec import Struct

from lab3_usd.model.physics import vector
from lab3_usd.model.prims import upwards
from lab3_usd.model.stage import same_value
from lab3_usd.new_lab.checkpoints import part_letter
from lab3_usd.new_lab.yaml_text import as_typed
from lab3_usd.spec.lab import SCENE
from lab3_usd.stage.things import TURN, Thing

_PLAIN = ("", "Xform", "Scope")
_ABOVE = re.compile(r"^(\.{0,2}/)+")  # of a path, which is not the same for everybody
_NUMBER = re.compile(r"\d+$")
_BODY = "PhysicsRigidBodyAPI"
_BINDING_API = "MaterialBindingAPI"  # which comes with each binding
_DIGITS = 6  # of metres


class Props(Struct, frozen=True):
    """The things by name, what they are at, and what could not be said of them."""

    data: dict[str, dict[str, Any]]
    paths: tuple[str, ...] = ()
    left_out: tuple[str, ...] = ()


def describe_props(
    stages: Mapping[str, Mapping[str, Thing]], optional: Collection[str], *, whole: bool
) -> Props:
    """Describe the things of stages, which are those of each checkpoint in their order.

    Of the first stage they are described where the `whole` scene is a student's, else those that
    change. `optional` are the checkpoints on which no later one builds.
    """
    ids = [*stages]
    left_out: list[str] = []
    described: dict[tuple[str, str], dict[str, Any]] = {}  # by path, and the checkpoint it is from
    for path in dict.fromkeys(path for things in stages.values() for path in things):
        there = [id_ for id_ in ids if path in stages[id_]]
        built_on = [id_ for id_ in there if id_ not in optional] or there[:1]
        states = {id_: _state(stages[id_][path]) for id_ in built_on}
        is_first = built_on[0] == ids[0]
        if built_on[-1] != ids[-1] and not is_first and built_on[0] not in optional:
            left_out.append(f"{SCENE}: props: {path} comes with {built_on[0]}, and goes later")
            continue
        for since, own in _by_start(states).items():
            is_supplied = is_first and since == ids[0]
            data = _described(path, own, left_out, only_changes=is_supplied and not whole)
            if data:
                start = {} if is_supplied else {"from": since}
                described[path, since] = {**data, **start}
    paths = {path for things in stages.values() for path in things}
    described_paths = {path for path, _ in described}
    holders = {above for path in described_paths for above in upwards(path)} & paths
    grouped = _grouped(described, paths, left_out)
    data = _named(grouped, ids)
    return Props(data, tuple(described_paths | holders), tuple(dict.fromkeys(left_out)))


_VALUES = ("set", "targets", "variants", "place")
_LISTED = ("apis", *_VALUES)  # which a later checkpoint may add to a thing


def _state(thing: Thing) -> dict[str, Any]:
    """Return what a thing is, by part and name."""
    is_plain = thing.type in _PLAIN and not thing.assets
    values = {
        name: as_typed(value) if not kind else {"type": kind, "value": as_typed(value)}
        for name, (kind, value) in thing.values.items()
    }
    apis = {api: True for api in thing.apis if api != _BINDING_API}
    has_place = thing.place is not None and _BODY not in apis and not is_plain
    place = [as_typed(round(value, _DIGITS) + 0.0) for value in thing.place or () if has_place]
    turn = vector(thing.values[TURN][1]) if TURN in thing.values else ()
    values.pop(TURN, None)
    if turn and has_place:  # before the scale, as operations of a pose are in order
        values = {TURN: [as_typed(round(angle, _DIGITS) + 0.0) for angle in turn], **values}
    asset = _ABOVE.sub("", next(iter(thing.assets), ""))
    state = {
        "apis": apis,
        "set": values,
        "targets": {name: list(paths) for name, paths in thing.targets.items() if paths},
        "variants": thing.variants,
        "place": dict(zip("xyz", place, strict=False)),
    }
    is_said = not is_plain or any(state.values())
    whole = {
        "type": thing.type,
        **state,
        "asset": asset,
        "resolved": thing.resolved and asset != "",
    }
    return whole if is_said else {}


def _by_start(states: Mapping[str, dict[str, Any]]) -> dict[str, dict[str, dict[str, Any]]]:
    """Return the states of a thing with the parts that it has from a checkpoint on, by that one."""
    ids = [*states]
    final = states[ids[-1]]
    starts: dict[tuple[str, str], str] = {}
    for key in _LISTED:
        for name in final.get(key, {}):
            lacking = [n for n, id_ in enumerate(ids) if name not in states[id_].get(key, {})]
            starts[key, name] = ids[lacking[-1] + 1 if lacking else 0]
    by_start = {}
    for number, start in enumerate(ids):
        if number and start not in starts.values():
            continue
        by_start[start] = {
            id_: {
                **(
                    {key: state.get(key) for key in ("type", "asset", "resolved")}
                    if not number
                    else {}
                ),
                **{
                    key: {
                        n: v for n, v in state.get(key, {}).items() if starts.get((key, n)) == start
                    }
                    for key in _LISTED
                },
            }
            for id_, state in [*states.items()][number:]
        }
    return by_start


def _described(
    path: str, states: Mapping[str, dict[str, Any]], left_out: list[str], *, only_changes: bool
) -> dict[str, Any]:
    """Return a thing as it is in the last of its stages, with what earlier ones have otherwise."""
    *before, last = states
    final = states[last]
    for key in ("type", "asset"):
        if any(states[id_].get(key) != final.get(key) for id_ in before):
            left_out.append(f"{SCENE}: props: {path}: {key} differs between checkpoints")
            final = {**final, key: ""}
    changed = {
        (key, name)
        for key in _VALUES
        for name, value in final[key].items()
        if not all(_same(states[id_][key].get(name), value) for id_ in before)
    }
    until = {}
    for number, id_ in enumerate(before):
        own, after = (
            _changing(states[each], changed) for each in (id_, (*before, last)[number + 1])
        )
        if own != after:
            until[id_] = own
    if only_changes:
        if not changed:
            return {}
        final = {"type": final.get("type"), **_changing(final, changed)}
    elif not any(value for key, value in final.items()):
        return {}
    data = {key: [*value] if key == "apis" else value for key, value in final.items() if value}
    return {**data, **({"until": until} if until else {})}


def _changing(state: Mapping[str, Any], changed: Collection[tuple[str, str]]) -> dict[str, Any]:
    """Return the values of a thing that are not the same at all checkpoints; a place is whole."""
    moved = {key for key, _ in changed} & {"place"}
    changing = {
        key: {n: v for n, v in state[key].items() if (key, n) in changed or key in moved}
        for key in _VALUES
    }
    return {key: value for key, value in changing.items() if value}


def _same(first: Any, second: Any) -> bool:
    if isinstance(first, dict) and isinstance(second, dict):
        return first.keys() == second.keys() and all(_same(first[k], second[k]) for k in first)
    return same_value(*(tuple(x) if isinstance(x, list) else x for x in (first, second)))


def _grouped(
    described: Mapping[tuple[str, str], dict[str, Any]],
    paths: Collection[str],
    left_out: list[str],
) -> dict[tuple[str, str], dict[str, Any]]:
    """Return equal things whose names differ by their numbers as one with a `*` and a count.

    Where one stands is not told of several, nor how they are turned unless all are alike.
    """
    whole: dict[str, dict[str, Any]] = {}  # of each path, by checkpoint
    for (path, since), data in described.items():
        whole.setdefault(path, {})[since] = _of_group(data)
    patterns = {"": ""}  # of each path, what it is written as
    for depth in sorted({path.count("/") for path in paths}):  # parents first
        level = sorted(path for path in paths if path.count("/") == depth)
        twins: dict[tuple[str, str], list[str]] = {}
        for path in level:
            parent, _, name = path.rpartition("/")
            above = patterns.get(parent, parent)
            twins.setdefault((above, _NUMBER.sub("*", name)), []).append(path)
        for (above, stem), members in twins.items():
            states = [whole.get(path) for path in members]
            is_group = len(members) > 1 and all(state == states[0] for state in states)
            for path in members:
                name = stem if is_group else path.rpartition("/")[2]
                patterns[path] = f"{above}/{name}" if is_group or "*" not in above else path
    groups: dict[tuple[str, str], list[str]] = {}
    for path, since in described:
        groups.setdefault((patterns[path], since), []).append(path)
    grouped = {}
    for (pattern, since), members in groups.items():
        data = dict(described[members[0], since])
        if members[1:]:
            counted = {"count": len(members)} if "type" in data else {}
            owns = [_without(described[path, since], _PLACE) for path in members]
            is_alike = all(own == owns[0] for own in owns)
            if any("place" in described[path, since] for path in members):
                what = "places" if is_alike else "places and turns"
                left_out.append(f"{SCENE}: props: {what} of {pattern}")
            data = {**(owns[0] if is_alike else _of_group(data)), **counted}
        grouped[pattern, since] = data
    return grouped


_PLACE = ("place", "")  # key and name of a part


def _of_group(data: Mapping[str, Any]) -> dict[str, Any]:
    return _without(_without(data, _PLACE), ("set", TURN))


def _without(data: Mapping[str, Any], part: tuple[str, str]) -> dict[str, Any]:
    """Return a thing without a part, whole or one of its names, at no checkpoint."""
    key, name = part
    kept = {k: v for k, v in data.items() if k != key}
    own = {n: v for n, v in data.get(key, {}).items() if name and n != name}
    if own:
        kept = {k: own if k == key else v for k, v in data.items()}
    until = {
        id_: values
        for id_, each in kept.pop("until", {}).items()
        if (values := _without(each, part))
    }
    return {**kept, **({"until": until} if until else {})}


def _named(
    things: Mapping[tuple[str, str], dict[str, Any]], ids: Sequence[str]
) -> dict[str, dict[str, Any]]:
    """Return the things by names of their own, with paths and parts of their checkpoints."""
    named: dict[str, dict[str, Any]] = {}
    for (path, since), data in things.items():
        words = []
        for part in path.split("/")[1:]:
            text = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", part.replace("*", "")).lower()
            words.append(" ".join(filter(None, text.split("_"))) or "thing")
        later = "" if "type" in data or since == ids[0] else f" at {since}"
        names = [" ".join(words[start:]) + later for start in reversed(range(len(words)))]
        name = next((name for name in names if name not in named), path + later)
        named[name] = {"path": path, **data, "handout": f"{part_letter(ids.index(since))}1"}
    return named
