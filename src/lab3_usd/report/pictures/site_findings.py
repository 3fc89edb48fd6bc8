"""Findings by site: the node, or the port of a node, that a picture marks."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from msgspec import Struct, field

from lab3_usd.model.changes import Site
from lab3_usd.model.finding import SEVERITIES, Finding
from lab3_usd.report.picture import State, is_port


class SiteFindings(Struct, frozen=True):
    """The findings at each site, the gravest first."""

    at: Mapping[Site, tuple[Finding, ...]] = field(default_factory=dict)

    def state(self, prim: str, prop: str | None = None) -> State:
        """Return how the site is drawn: wrong for an error, extra for a warning, else ok.

        Properties that are no ports (a node's type) count for the node.
        """
        found = self._found(prim, prop)
        severities = {finding.severity for finding in found}
        if "error" in severities:
            return "wrong"
        return "extra" if "warning" in severities else "ok"

    def note(self, prim: str, prop: str | None = None) -> str:
        """Return the messages at the site, one per line."""
        return "\n".join(finding.message for finding in self._found(prim, prop))

    def _found(self, prim: str, prop: str | None) -> list[Finding]:
        sites = [prop] if prop is not None else [None, *self._others(prim)]
        return [finding for site in sites for finding in self.at.get((prim, site), ())]

    def _others(self, prim: str) -> list[str]:
        return sorted(self._named(prim) - self.ports(prim))

    def _named(self, prim: str) -> frozenset[str]:
        return frozenset(prop for path, prop in self.at if path == prim and prop is not None)

    def expected(self, prim: str, prop: str) -> str | None:
        """Return what the site should hold, where an error or warning says it."""
        for finding in self.at.get((prim, prop), ()):
            if finding.severity != "note" and finding.expected is not None:
                return finding.expected
        return None

    def ports(self, prim: str) -> frozenset[str]:
        """Return the ports of a prim that a finding names."""
        return frozenset(prop for prop in self._named(prim) if is_port(prop))


def findings_by_site(findings: Iterable[Finding]) -> SiteFindings:
    """Sort findings by site."""
    at: dict[Site, list[Finding]] = {}
    for finding in findings:
        at.setdefault((finding.prim, finding.property), []).append(finding)
    return SiteFindings(
        {
            site: tuple(sorted(found, key=lambda one: SEVERITIES.index(one.severity)))
            for site, found in at.items()
        }
    )
