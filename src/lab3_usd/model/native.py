"""The errors of OpenUSD's own validators."""

from __future__ import annotations

from msgspec import Struct

from lab3_usd.model.finding import Severity

FAMILY = "UV"


class NativeError(Struct, frozen=True):
    """One error of a validator, under OpenUSD's names, at a prim or property of the stage.

    `may_be_defined_elsewhere`: it rests on what only the application has, an asset or a kind of
    shader, so that nothing is decided here.
    """

    validator: str
    name: str
    severity: Severity
    prim: str
    property: str | None
    message: str
    may_be_defined_elsewhere: bool = False


class NativeErrors(Struct, frozen=True):
    """All errors of one stage from the validators of the installed usd-core."""

    errors: tuple[NativeError, ...]
