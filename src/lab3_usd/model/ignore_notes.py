"""Notes in a stage that say which findings are ignored there on purpose."""

from __future__ import annotations

from msgspec import Struct

from lab3_usd.model.finding import Finding, is_among
from lab3_usd.model.paths import is_at_or_below


class IgnoreNote(Struct, frozen=True):
    """A rule or family that is ignored at one place; '' where the note names none.

    A note in the custom data of a prim is about that prim and all below it, one of a property
    about that alone. A comment has no prim: it is about one `line` of a `layer`, and stands at
    the line `written`.
    """

    rule: str
    prim: str = ""
    property: str | None = None
    layer: str = ""
    line: int | None = None
    written: int | None = None

    def covers(self, finding: Finding) -> bool:
        """Whether the note is about a finding."""
        if not is_among(finding.rule, (self.rule,)):
            return False
        if not self.prim:
            return finding.layer == self.layer and finding.line == self.line
        if self.property is not None:
            return (finding.prim, finding.property) == (self.prim, self.property)
        return is_at_or_below(finding.prim, self.prim)
