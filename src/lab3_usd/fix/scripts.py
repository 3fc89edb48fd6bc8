"""Repairs scripts: the name of a port or of a type, in the one string that has it."""

from __future__ import annotations

import re
import tempfile
import tokenize
from collections.abc import Iterable, Iterator
from io import BytesIO
from pathlib import Path

from lab3_usd.errors import StageError
from lab3_usd.files import lines_of, read_state
from lab3_usd.fix.repairing import Fixed, FixOptions
from lab3_usd.isaac.platform import Platform
from lab3_usd.model.changes import TextChange
from lab3_usd.model.finding import Finding, site_of
from lab3_usd.pipeline.any_stage import lint_platform
from lab3_usd.pipeline.script_results import ScriptSettings, lint_script

_NOTEBOOK = ".ipynb"
_UNICODE = ("utf-8", "utf-8-sig")
_TEXT = re.compile(r"""(?P<quote>["'])(?P<text>[\w.:]+)(?P=quote)""")
_NOT_ONE = "is not in one string at its place"


def fix_script(path: Path, release: str, options: FixOptions) -> Fixed:
    """Repair in memory the names that lint finds in a script; no file is written.

    Raises:
        StageError: the script cannot be read, or is a notebook.
        UsageError: the release is not known.
    """
    if path.suffix == _NOTEBOOK:
        raise StageError(f"{path}: is a notebook, which is not repaired; correct it in its editor")
    platform = lint_platform(release)
    settings = ScriptSettings(platform, heeds_ignores=True, parameters=options.parameters)
    state = read_state(path)
    encoding, _ = tokenize.detect_encoding(BytesIO(state.content).readline)
    if encoding not in _UNICODE:
        raise StageError(f"{path}: is no UTF-8 text, and is not repaired")

    def findings_of(file: Path) -> tuple[Finding, ...]:
        return lint_script(file, settings).findings

    before = findings_of(path)
    lines = lines_of(state.content.decode(encoding))
    left_out = {}
    wanted = [finding for finding in options.wanted(before) if finding.fix is not None]
    for finding in wanted:
        ways = list(_names(finding, platform, lines))
        if sum(_repair(lines, finding, *names) for names in ways) == 0:
            left_out[site_of(finding)] = _NOT_ONE
    data = "".join(lines).encode(encoding)
    with tempfile.TemporaryDirectory() as folder:
        repaired = Path(folder, path.name)
        repaired.write_bytes(data)
        after = findings_of(repaired)
    repairs = {f.fix: f for f in wanted if f.fix is not None and site_of(f) not in left_out}
    return Fixed(
        root=path,
        before=before,
        after=after,
        repairs=repairs,
        files={path: data} if data != state.content else {},
        states={path: state},
        left_out=left_out,
        judge_again=findings_of,
    )


def script_changes(finding: Finding, path: Path, release: str) -> tuple[TextChange, ...]:
    """Return the lines of a script that the repair of a finding changes; none where it is unsure.

    Raises:
        StageError: the script cannot be read.
    """
    platform, before = lint_platform(release), lines_of(read_state(path).content.decode())
    after = before.copy()
    for names in _names(finding, platform, before):
        _repair(after, finding, *names)
    return tuple(
        TextChange(str(path), number, number + 1, new)
        for number, (old, new) in enumerate(zip(before, after, strict=True))
        if old != new
    )


def _names(finding: Finding, platform: Platform, lines: Iterable[str]) -> Iterator[tuple[str, str]]:
    """Yield what is written wrongly for a finding, and what is right."""
    if finding.actual is None or finding.expected is None:
        return
    wrong = finding.actual
    if "/" in wrong:  # the path of a source
        wrong = wrong.rpartition(".")[2]
    if platform.type_name(wrong) == wrong or finding.property is not None:
        yield wrong, finding.expected
        return
    # One finding stands for all names of types from before.
    for old in sorted({match["text"] for line in lines for match in _TEXT.finditer(line)}):
        new = platform.type_name(old)
        if new != old and new in platform.types:
            yield old, new


def _repair(lines: list[str], finding: Finding, wrong: str, right: str) -> bool:
    """Replace a name where the part of a finding has it once; a type from before everywhere."""
    span = finding.span
    name = re.compile(rf"(?<![\w:]){re.escape(wrong)}(?![\w:])")
    is_everywhere = finding.property is None or span is None
    first, last = (1, len(lines)) if is_everywhere or span is None else (span[0], span[2])
    places = [n for n in range(first - 1, min(last, len(lines))) if name.search(lines[n])]
    count = sum(len(name.findall(lines[n])) for n in places)
    if not count or (count > 1 and finding.property is not None):
        return False
    for number in places:
        lines[number] = name.sub(right, lines[number])
    return True
