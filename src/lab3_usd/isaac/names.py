"""The names that other releases of Isaac Sim have for node types and ports."""

from __future__ import annotations

from collections.abc import Mapping

from msgspec import Struct

from lab3_usd.isaac.releases import BASE, order


class OtherName(Struct, frozen=True):
    """A name, and the release that has the other one for it: '' where that is not known.

    A release after the described one has the other name from then on, an earlier one until then.
    """

    name: str
    release: str = ""


class Names(Struct, frozen=True):
    """Which names mean which types and ports: other names first, those of this catalog behind them.

    `prefixes` and `renamed` are names of types from before the release `before`. `types` are those
    that single releases have, and `ports` by type the names of its ports, in full.
    """

    before: str
    prefixes: Mapping[str, str]
    renamed: Mapping[str, str]
    types: Mapping[str, OtherName]
    ports: Mapping[str, Mapping[str, OtherName]]

    def modern(self, name: str) -> str:
        """Return the name that another name of a type means; the others come back unchanged."""
        if name in self.types:
            return self.types[name].name
        if name in self.renamed:
            return self.renamed[name]
        prefix, _, rest = name.rpartition(".")
        return f"{self.prefixes[prefix]}.{rest}" if prefix in self.prefixes else name

    def is_old(self, name: str) -> bool:
        """Whether a name of a type is one from before the release `before`."""
        return name not in self.types and self.modern(name) != name

    def is_former_extension(self, name: str) -> bool:
        """Whether the name of a type begins with an extension from before the release `before`."""
        prefix = name.rpartition(".")[0]
        return prefix in self.prefixes or any(old.startswith(f"{prefix}.") for old in self.renamed)

    def former(self, name: str) -> str | None:
        """Return the name that a type had before the release `before`, None where it is the same.

        Of several names the last one counts, which is that of the release just before.
        """
        whole = [old for old, new in self.renamed.items() if new == name]
        if whole:
            return whole[-1]
        prefix, _, last = name.rpartition(".")
        parts = [old for old, new in self.prefixes.items() if new == prefix]
        return f"{parts[-1]}.{last}" if parts else None

    @property
    def releases(self) -> set[str]:
        """The releases that have other names."""
        ports = (other for names_of in self.ports.values() for other in names_of.values())
        return {other.release for other in (*self.types.values(), *ports) if other.release}

    def origin(self, name: str) -> str:
        """Say which releases have another name of a type, as the end of a sentence about it."""
        if name in self.types:
            return origin(self.types[name].release)
        return f"from before Isaac Sim {self.before}"


def origin(release: str) -> str:
    """Say which releases have another name, as the end of a sentence about it."""
    if not release:
        return "that the lab declares"
    if order(release) > order(BASE):
        return f"of Isaac Sim from {release} on"
    return f"of Isaac Sim up to {release}"
