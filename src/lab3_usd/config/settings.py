"""The keys of the configuration, their values, and how they change findings."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any, TypeVar

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.check.registry import Parameters, all_rules, check_rule_names, rule_names
from lab3_usd.config.lookup import find_file, located_in_config, read_table
from lab3_usd.errors import UsageError, guess
from lab3_usd.model.finding import SEVERITIES, Finding, Severity, configured_severity, is_among

_Reader = Callable[[Any, str, Path], Any]


class Config(Struct, frozen=True):
    """The configuration; a key that is not set is None or empty.

    `file` holds it. `per_file_ignores` and `checkpoints` are by patterns of file names, or of
    paths below the folder of `file`, as those of `exclude` and `extend_exclude` are; `severity` is
    by rules and families, `assets` by addresses. `rules` are sources of rules of one's own: whole
    paths of files, and names of entry points. `parameters` are those of rules.
    """

    file: Path | None = None
    rules: tuple[str, ...] = ()
    select: tuple[str, ...] = ()
    ignore: tuple[str, ...] = ()
    per_file_ignores: tuple[tuple[str, tuple[str, ...]], ...] = ()
    severity: tuple[tuple[str, Severity], ...] = ()
    parameters: Parameters = ()
    checkpoints: tuple[tuple[str, str], ...] = ()
    starter: Path | None = None
    maps: Path | None = None
    lab: Path | None = None
    assets: tuple[tuple[str, Path], ...] = ()
    exclude: tuple[str, ...] = ()
    extend_exclude: tuple[str, ...] = ()

    def excludes(self, path: Path) -> bool:
        """Whether a file that a folder holds is passed over: it, or a folder above it, is named."""
        whole = path.absolute()
        top = whole.parent if self.file is None else self.file.parent
        named = [(pattern, True) for pattern in (*self.exclude, *self.extend_exclude)]
        above = [folder for folder in whole.parents if named and folder.is_relative_to(top)]
        return any(any(matching(named, str(item), self)) for item in (whole, *above))


def config_for(paths: Iterable[str], option: str = "--config") -> Config:
    """Return the configuration for files that are judged together; `option` names one.

    Raises:
        UsageError: the file that holds it is wrong, or the paths have several.
    """
    files = {find_file(Path(path)): path for path in paths}
    if len(files) > 1:
        named = "; ".join(f"{path}: {file or 'none'}" for file, path in files.items())
        raise UsageError(f"these have several configurations, name one with {option}: {named}")
    file = next(iter(files), None)
    if file is None:
        return Config()
    from lab3_usd.check.own_rules import ENDING

    rules = read_table(file).get("rules")
    listed = rules if isinstance(rules, list) else ()  # another is refused with its place below
    programs = [str(name) for name in listed if str(name).endswith(ENDING)]
    if programs:
        raise UsageError(
            f"{file}: rules names {', '.join(programs)}, which would run as a program; if you "
            f"trust it, name the configuration with {option} {file}"
        )
    return load_config(file)


def reading_for(path: Path) -> Config:
    """Return the lab, the assets and the parameters of rules that the configuration of a stage has.

    They are for those who show what a stage holds, and do not choose among its findings. Custom
    rules are not loaded, and their parameters are left out.

    Raises:
        UsageError: the file that holds it is wrong.
    """
    file = find_file(path)
    if file is None:
        return Config()
    table = read_table(file)
    given = {key: table[key] for key in ("lab", "assets", "parameters") if key in table}
    if "rules" in table and isinstance(given.get("parameters"), dict):
        rule_words = {*all_rules(), *map(str.upper, rule_names())}
        numbers = given["parameters"].items()
        given["parameters"] = {name: each for name, each in numbers if name.upper() in rule_words}
    return _config_of(file, given)


def load_config(file: Path) -> Config:
    """Read a configuration file; the rules of one's own that it names are added.

    Raises:
        UsageError: it cannot be read, or a key or value is wrong; the line says which and where.
    """
    return _config_of(file, read_table(file))


def _config_of(file: Path, given: Mapping[str, Any]) -> Config:
    # Other keys may name its rules.
    ordered = sorted(given.items(), key=lambda item: item[0] != "rules")
    try:
        values = {key.replace("-", "_"): _value(file, key, value) for key, value in ordered}
    except UsageError as error:
        raise located_in_config(error, file) from error
    return Config(file=file, **values)


def _value(file: Path, key: str, written: Any) -> Any:
    if key not in _KEYS:
        raise UsageError(f"{file}: there is no key '{key}'; {guess(key, _KEYS)}")
    return _KEYS[key](written, f"{file}: {key}", file.parent)


def _names(value: Any, where: str, what: str) -> tuple[str, ...]:
    if not isinstance(value, list) or not all(isinstance(item, str) for item in value):
        raise UsageError(f"{where} is {value!r}, expected a list of {what}")
    return tuple(value)


def _rules(value: Any, where: str, _folder: Path) -> tuple[str, ...]:
    return check_rule_names(_names(value, where, "rules and families"), where)


def _own_rules(value: Any, where: str, folder: Path) -> tuple[str, ...]:
    from lab3_usd.check.own_rules import ENDING, add_own_rules

    sources = tuple(
        str(_path(name, where, folder).absolute()) if name.endswith(ENDING) else name
        for name in _names(value, where, "Python files and entry points")
    )
    add_own_rules(sources)
    return sources


def _path(value: Any, where: str, folder: Path) -> Path:
    if not isinstance(value, str) or not value:
        raise UsageError(f"{where} is {value!r}, expected a path")
    if not (folder / value).exists():
        raise UsageError(f"{where}: there is no {folder / value}")
    return folder / value


def _table(value: Any, where: str) -> Mapping[str, Any]:
    if not isinstance(value, dict):
        raise UsageError(f"{where} is {value!r}, expected a table")
    return value


def _by_name(read: _Reader) -> _Reader:
    """Return what reads a table whose values are read so."""
    return lambda value, where, folder: tuple(
        (key, read(each, f"{where}: {key}", folder)) for key, each in _table(value, where).items()
    )


def _severities(value: Any, where: str, _folder: Path) -> tuple[tuple[str, Severity], ...]:
    for name, item in _table(value, where).items():
        if item not in SEVERITIES:
            raise UsageError(
                f"{where}: {name} is {item!r}, expected one of {', '.join(SEVERITIES)}"
            )
    return tuple(zip(check_rule_names(value, where), value.values(), strict=True))


def _parameters(value: Any, where: str, _folder: Path) -> Parameters:
    given: dict[tuple[str, str], float] = {}
    for written, numbers in _table(value, where).items():
        (name,) = check_rule_names([written], where)
        parameters = all_rules()[name].parameters if name in all_rules() else ()
        if not parameters:
            with_parameters = ", ".join(rule.id for rule in all_rules().values() if rule.parameters)
            raise UsageError(f"{where}: {written} has no parameters; {with_parameters} have some")
        names = [parameter.name for parameter in parameters]
        for parameter, number in _table(numbers, f"{where}: {written}").items():
            if parameter not in names:
                hint = guess(parameter, names)
                raise UsageError(f"{where}: {written} has no parameter '{parameter}'; {hint}")
            is_number = isinstance(number, (int, float)) and not isinstance(number, bool)
            if not is_number or not 0 < number < math.inf:
                raise UsageError(
                    f"{where}: {written}.{parameter} is {number!r}, expected a number above 0"
                )
            given[name, parameter] = float(number)
    return tuple(given.items())


def _checkpoint(value: Any, where: str, _folder: Path) -> str:
    if not isinstance(value, str):
        raise UsageError(f"{where} is {value!r}, expected a checkpoint in quotes")
    return value


def _patterns(value: Any, where: str, _folder: Path) -> tuple[str, ...]:
    return _names(value, where, "patterns of file names")


_KEYS: dict[str, _Reader] = {
    "rules": _own_rules,
    "select": _rules,
    "ignore": _rules,
    "per-file-ignores": _by_name(_rules),
    "severity": _severities,
    "parameters": _parameters,
    "checkpoints": _by_name(_checkpoint),
    "starter": _path,
    "maps": _path,
    "lab": _path,
    "assets": _by_name(_path),
    "exclude": _patterns,
    "extend-exclude": _patterns,
}


_Value = TypeVar("_Value")


def chosen(rule: str, select: tuple[str, ...], ignore: tuple[str, ...]) -> bool:
    """Whether the findings of a rule are wanted; a family means all of its rules."""
    return (not select or is_among(rule, select)) and not is_among(rule, ignore)


def selected(findings: Iterable[Finding], path: str, config: Config) -> tuple[Finding, ...]:
    """Return the findings of a file that a configuration asks for, as grave as it says.

    That a file cannot be read is said in any case.
    """
    every = tuple(findings)
    unread = (finding for finding in every if finding.unopened == "stage")
    readable = (finding for finding in every if finding.unopened != "stage")
    kept = _as_configured(readable, path, config)
    return (*unread, *(item for item in kept if chosen(item.rule, config.select, config.ignore)))


def _as_configured(findings: Iterable[Finding], path: str, config: Config) -> Iterator[Finding]:
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
            severity = configured_severity(finding.rule, finding.severity, severities)
            yield replace(finding, severity=severity)


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
