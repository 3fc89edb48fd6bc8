"""Applies a configuration: which findings are left out, how grave the others are."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from fnmatch import fnmatchcase
from pathlib import Path
from typing import TypeVar

from msgspec.structs import replace

from lab3_usd.config.config import Config
from lab3_usd.model.finding import Finding, family_of, is_among

_Value = TypeVar("_Value")


def with_config_applied(
    findings: Iterable[Finding], path: str, config: Config
) -> Iterator[Finding]:
    """Yield the findings of a file that its patterns do not ignore, as grave as is set.

    What is set for a rule counts before what is set for its family.
    """
    if not (config.per_file_ignores or config.severity):
        yield from findings
        return
    ignored = tuple(
        rule for rules in matching(config.per_file_ignores, path, config) for rule in rules
    )
    severities = dict(config.severity)
    for finding in findings:
        if not is_among(finding.rule, ignored):
            of_family = severities.get(family_of(finding.rule), finding.severity)
            yield replace(finding, severity=severities.get(finding.rule, of_family))


def matching(
    by_pattern: Iterable[tuple[str, _Value]], path: str, config: Config
) -> Iterator[_Value]:
    """Yield what is set for the patterns that a path matches, in the order of the file."""
    whole = Path(path).absolute()
    names = [whole.name]
    if config.file is not None and whole.is_relative_to(config.file.parent):
        names.append(whole.relative_to(config.file.parent).as_posix())
    for pattern, value in by_pattern:
        if any(fnmatchcase(name, pattern) for name in names):
            yield value
