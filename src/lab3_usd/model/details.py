"""What few rules ask of a prim, and only the open stage answers."""

from __future__ import annotations

from lab3_usd.isaac.values import Value
from lab3_usd.model.prims import Matrix


class Details:
    """Answers about the prims of a stage; none where no stage is open."""

    def fallback(self, path: str, name: str) -> Value | None:
        """Return what the schema of a prim gives an attribute that has no value."""
        del path, name
        return None

    def is_file(self, path: str, name: str) -> bool:
        """Whether an attribute names a file."""
        del path, name
        return False

    def variant(self, path: str, variants: str) -> str:
        """Return which one of a prim's set of variants is selected, '' for none."""
        del path, variants
        return ""

    def other_type(self, path: str, name: str, asked: str) -> tuple[str, str] | None:
        """Return the type that a layer gives an attribute, and the one in which it is read.

        They are told where both are of text, and not the same: the second is that of the schema,
        else the one that is `asked` for.
        """
        del path, name, asked
        return None

    def local(self, path: str) -> Matrix | None:
        """Return the transform of a prim in its parent; None where none is authored."""
        del path
        return None

    def origin(self, path: str) -> tuple[float, float, float] | None:
        """Return where the origin of a prim is in the world, in metres; None without a prim."""
        del path
        return None

    def material(self, path: str, binding: str) -> str:
        """Return the material with which USD draws a prim, or lets it slide; '' for none.

        `binding` is the relationship for one purpose, as `material:binding:physics`.
        """
        del path, binding
        return ""
