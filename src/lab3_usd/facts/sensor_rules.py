"""Whether the values of a sensor keep a rule about its model."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from itertools import pairwise
from operator import ge, gt, le, lt
from typing import Any

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.facts.sensor_values import SensorValues, entry_count, listed_entries
from lab3_usd.isaac.sensor_models import INSTANCE, LongList, SchemaRules, ValueRule
from lab3_usd.model.finding import display
from lab3_usd.model.physics import number

_NS = 1_000_000_000  # in a second
_LIMITS: Mapping[str, tuple[str, str, Callable[[Any, Any], bool]]] = {
    "above": ("above", "below", gt),
    "least": ("at least", "at most", ge),
    "below": ("below", "above", lt),
    "most": ("at most", "at least", le),
}


class Breach(Struct, frozen=True):
    """What breaks a rule: the attributes that it is about, first the one to repair.

    `is_list` tells whether it is about the lists of an instance.
    """

    names: tuple[str, ...]
    message: str
    expected: str
    is_list: bool = False


class _Demand(Struct, frozen=True):
    """What a value must be, by which other attributes, and whether one is.

    The words of a limit come before what is `asked` for. `otherwise` are those for what the other
    attribute must be.
    """

    expected: str
    by: tuple[str, ...]
    is_met: Callable[[Any], bool]
    otherwise: str = ""
    asked: Any = None


class _Place(Struct, frozen=True):
    """A rule at one instance ('' for a rule about none), and all values."""

    rule: ValueRule
    part: SchemaRules
    values: SensorValues
    instance: str = ""

    def whole(self, name: str) -> str:
        return self.part.whole(name, self.instance)

    def value(self, asked: Any) -> Any:
        """Return what a rule asks for: a number, or the value of the attribute that it names."""
        return self.values.get(self.whole(asked)) if isinstance(asked, str) else asked

    def named(self, asked: Any) -> tuple[str, ...]:
        return (self.whole(asked),) if isinstance(asked, str) else ()

    def shown(self, asked: Any) -> str:
        """Return a limit in words: the attribute that has it, and its value."""
        if not isinstance(asked, str):
            return display(asked)
        name, value = self.whole(asked), _shown(self.value(asked))
        return f"{_short(name)} ({value if name in self.values.written else f'{value} by schema'})"


def breaches(
    rule: ValueRule, part: SchemaRules, values: SensorValues, wrong: set[str]
) -> Iterator[Breach]:
    """Yield where written values break a rule; those that are `wrong` decide nothing, and grow."""
    if rule.unless and values.get(part.whole(rule.unless)):
        return
    places = [_Place(rule, part, values, instance) for instance in _instances(rule, part, values)]
    breaches: Iterator[Breach]
    for place in places if not rule.distinct else places[:1]:
        if not _counts(place):
            continue
        if rule.distinct:
            breaches = _too_many(place, [each.whole(name) for each in places for name in rule.of])
        elif rule.holds:
            breaches = _unfulfilled(place, wrong)
        elif rule.entries is not None:
            breaches = _of_another_size(place, wrong)
        else:
            breaches = _single(place, wrong)
        conditions = [*map(place.whole, (*rule.when, *rule.when_above))]
        for breach in breaches:
            names = (*breach.names, *conditions)
            if values.written.keys() & {*names} and not wrong & {*names}:
                yield replace(breach, names=tuple(dict.fromkeys(names)))
                wrong.update({*breach.names} & {*map(place.whole, rule.of)})


def _instances(rule: ValueRule, part: SchemaRules, values: SensorValues) -> list[str]:
    """Return the instances that a rule is about, '' for a rule about none."""
    name = next((name for name in (*rule.of, *rule.when) if INSTANCE in name), None)
    if name is None:
        return [""]
    start = part.whole(name).partition(INSTANCE)[0]
    inside = [full[len(start) :] for full in values.attributes if full.startswith(start)]
    return [*dict.fromkeys([rest.partition(":")[0] for rest in inside])]


def _counts(place: _Place) -> bool:
    """Whether the conditions of a rule hold."""
    rule = place.rule
    return all(place.value(name) == value for name, value in rule.when.items()) and all(
        (number(place.value(name)) or 0.0) > value for name, value in rule.when_above.items()
    )


def _single(place: _Place, wrong: set[str]) -> Iterator[Breach]:
    """Yield each value that is not as it must be."""
    demands = list(_demands(place))
    for name in map(place.whole, place.rule.of):
        value = place.values.get(name)
        for demand in demands:
            is_known = value is not None and not wrong & {name, *demand.by}
            if is_known and not demand.is_met(value):
                first, expected = name, demand.expected
                if demand.asked is not None:
                    expected = f"{expected} {place.shown(demand.asked)}"
                if (
                    demand.otherwise
                    and demand.by
                    and _oddness(demand.by[0], place) > _oddness(name, place)
                ):
                    first, expected = demand.by[0], f"{demand.otherwise} {place.shown(name)}"
                message = f"{first} is {_shown(place.values.get(first))}, expected {expected}"
                names = (first, name, *demand.by)
                yield Breach(names, message, expected, bool(place.instance))
                break


def _oddness(name: str, place: _Place) -> float:
    """Return how far a number is from its default, as a factor; 0 for what is no number above 0."""
    value, usual = place.values.number(name), number(place.values.default(name))
    return abs(math.log(value / usual)) if value and usual and value / usual > 0 else 0.0


def _demands(place: _Place) -> Iterator[_Demand]:
    rule = place.rule
    for key, (words, otherwise, holds) in _LIMITS.items():
        asked = getattr(rule, key)
        limit = None if asked is None else place.value(asked)
        if limit is not None and not isinstance(limit, LongList):
            limit = max(1, limit) if rule.from_one else limit
            limit = limit + rule.spare if key == "most" and rule.spare else limit
            is_met = partial(_each, holds, limit)
            yield _Demand(words, place.named(asked), is_met, otherwise, asked)
    if rule.period_of:
        rate = number(place.value(rule.period_of)) or 0.0
        most = int(_NS / rate) if rate > 0 else 0
        expected = f"at most {most}, the time between two firings"
        yield _Demand(expected, place.named(rule.period_of), partial(_each, le, most))
    if rule.ordered:
        yield _Demand(
            "no time before the one ahead of it",
            (),
            lambda value: isinstance(value, LongList) or all(a <= b for a, b in pairwise(value)),
        )
    if rule.some:
        yield _Demand("true for one emitter at least", (), lambda value: any(listed_entries(value)))
    if rule.among:
        expected = " or ".join(display(one) for one in rule.among)
        yield _Demand(expected, (), partial(_is_among, rule.among))


def _each(holds: Callable[[Any, Any], bool], limit: Any, value: Any) -> bool:
    """Whether each entry keeps a limit, or its own of a list of limits."""
    items = listed_entries(value)
    limits = limit if isinstance(limit, tuple) else (limit,) * len(items)
    return all(
        isinstance(item, (int, float)) and holds(item, most)
        for item, most in zip(items, limits, strict=False)
    )


def _is_among(allowed: tuple[Any, ...], value: Any) -> bool:
    """Whether a value is one of those allowed; of texts the case does not count."""
    text = value.upper() if isinstance(value, str) else value
    return text in [one.upper() if isinstance(one, str) else one for one in allowed]


def _of_another_size(place: _Place, wrong: set[str]) -> Iterator[Breach]:
    """Yield lists of another size than they must have, those of one size at once."""
    rule, values = place.rule, place.values
    wanted = number(place.value(rule.entries))
    if wanted is None or wrong & {*place.named(rule.entries)}:
        return
    odd: dict[int, list[str]] = {}
    for name in map(place.whole, rule.of):
        entries, right = entry_count(values.get(name)), int(wanted)
        if rule.from_one:
            entries, right = max(1, entries), max(1, right)
        is_known = values.get(name) is not None and name not in wrong
        if entries != right and is_known and not (rule.or_empty and not entries):
            odd.setdefault(entry_count(values.get(name)), []).append(name)
    for size, names in odd.items():
        unset = [name for name in names if name not in values.written]
        short = ", ".join(_short(name) for name in names[1:])
        message = (
            f"{names[0]}{f' ({short} as well)' if short else ''} has {_entries(size)}"
            f"{' by schema' if unset == names else ''}, "
            f"expected {place.shown(rule.entries)}"
        )
        by = place.named(rule.entries)
        yield Breach((*names, *by), message, _entries(int(wanted)), bool(place.instance))


def _entries(count: int) -> str:
    return f"{count} {'entry' if count == 1 else 'entries'}"


def _too_many(place: _Place, names: list[str]) -> Iterator[Breach]:
    """Yield lists that together have more different values than they may."""
    values, most = place.values, number(place.value(place.rule.distinct))
    lists = [values.get(name) for name in names]
    items = {item for value in lists for item in (value if isinstance(value, tuple) else ())}
    count = max([len(items), *(value.length for value in lists if isinstance(value, LongList))])
    if most is not None and count > most:
        limit = place.shown(place.rule.distinct)
        message = f"{names[0]} has {count} different values, expected at most {limit}"
        named = (*names, *place.named(place.rule.distinct))
        yield Breach(named, message, f"at most {most:g} different values", is_list=True)


def _unfulfilled(place: _Place, wrong: set[str]) -> Iterator[Breach]:
    """Yield that a formula is not true, at the value that is the farthest from its default."""
    values = {_short(name): place.values.get(name) for name in map(place.whole, place.rule.of)}
    is_known = None not in values.values() and not any(
        isinstance(value, LongList) for value in values.values()
    )
    names = sorted(map(place.whole, place.rule.of), key=lambda name: -_oddness(name, place))
    if not is_known or wrong & {*names}:
        return
    from lab3_usd.facts.formulas import result

    if result(place.rule.holds, values) is False:
        name = next((each for each in names if each in place.values.written), names[0])
        message = f"{name} is {_shown(place.values.get(name))}, expected {place.rule.holds}"
        values_of_others = [
            f"{_short(each)} {_shown(place.values.get(each))}" for each in names if each != name
        ]
        message += f" ({', '.join(values_of_others)})" if values_of_others else ""
        yield Breach((name, *names), message, place.rule.holds, bool(place.instance))


def _shown(value: Any) -> str:
    return (
        f"{display(value.low)} to {display(value.high)}"
        if isinstance(value, LongList)
        else display(value)
    )


def _short(name: str) -> str:
    return name.rpartition(":")[2]
