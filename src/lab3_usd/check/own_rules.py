"""Rules of one's own: generators of problems in a Python file, or in an installed package.

They run beside the rules of this package, over the same stage and facts, and cost no requirement.
"""

from __future__ import annotations

import importlib.util
import re
import sys
from collections.abc import Callable, Iterable
from functools import cache
from pathlib import Path

from lab3_usd.check.registry import FAMILIES, Check, Rule, added_by, all_rules, rule
from lab3_usd.check.registry import own_rules as registered
from lab3_usd.errors import RuleError, UsageError
from lab3_usd.model.finding import Severity

GROUP = "lab3_usd.rules"  # of entry points
ENDING = ".py"
_ID = r"[A-Z]{2,}\d{2,}"


def own_rule(rule_id: str, name: str, severity: Severity = "error") -> Callable[[Check], Check]:
    """Register a generator of `Problem`s, which takes a `Subject`, as a rule of one's own.

    Its docstring is the manual: what is wrong, then paragraphs that begin with `Why:`, `Fix:` and
    `Example:`. `rule_id` is at least two capital letters, which no rules of this package have, and
    at least two digits.

    Raises:
        RuleError: the id is of another form, or taken, as the name may be; or there is no such
            severity.
    """
    if not re.fullmatch(_ID, rule_id):
        raise RuleError(
            f"{rule_id} is not an id of a rule: at least two capital letters, then at least two "
            "digits, as in ACME01"
        )
    if rule_id.rstrip("0123456789") in FAMILIES:
        raise RuleError(f"{rule_id}: its letters are those of a family of this program")
    all_rules()  # whose names are taken
    return rule(rule_id, name, "own", severity)


def add_own_rules(sources: Iterable[str]) -> None:
    """Let the rules of these sources judge as well: files, and names of entry points.

    Raises:
        UsageError: there is no such source, it cannot be imported, or it holds no rule.
    """
    for source in sources:
        for added in _rules_of(source):
            added_by(added)


@cache
def _rules_of(source: str) -> tuple[Rule, ...]:
    """Return the rules of a source, which is imported once."""
    before = registered()
    try:
        _import_file(Path(source)) if source.endswith(ENDING) else _import_entry_point(source)
    except UsageError:
        raise
    except Exception as error:
        from traceback import extract_tb

        frames = [frame for frame in extract_tb(error.__traceback__) if frame.filename == source]
        line = f":{frames[-1].lineno}" if frames else ""
        raise UsageError(
            f"rules {source}{line}: cannot be imported: {type(error).__name__}: {error}"
        ) from error
    new = tuple(rule for name, rule in registered().items() if rule is not before.get(name))
    if not new:
        raise UsageError(f"rules {source}: holds no rule; @own_rule makes a function one")
    return new


def _import_file(file: Path) -> None:
    name = f"lab3_usd_own_{file.stem}"
    spec = importlib.util.spec_from_file_location(name, file)
    if spec is None or spec.loader is None:
        raise UsageError(f"rules {file}: is no Python file")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)


def _import_entry_point(name: str) -> None:
    from importlib.metadata import entry_points

    points = [point for point in entry_points(group=GROUP) if point.name == name]
    if not points:
        names = ", ".join(sorted(point.name for point in entry_points(group=GROUP))) or "none"
        raise UsageError(
            f"rules {name}: no installed package has the entry point {GROUP}:{name}; "
            f"known are {names}; a file ends in {ENDING}"
        )
    points[0].load()
