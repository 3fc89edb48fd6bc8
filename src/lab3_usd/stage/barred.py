"""Names for assets that must not be opened: a path that no computer can open, and back again."""

from __future__ import annotations

from urllib.parse import quote, unquote

# A device has no children, so that nothing below it can be looked up, let alone opened. The asset
# is one name below it, whatever slashes and dots are in it.
_NOWHERE = "/dev/null/barred/"


def barred(asset: str) -> str:
    """Return a path that leads nowhere and still says which asset was asked for."""
    return _NOWHERE + quote(asset, safe="")


def asked_for(path: str) -> str:
    """Return the asset that a barred path stands for, any other path as it is."""
    return unquote(path[len(_NOWHERE) :]) if path.startswith(_NOWHERE) else path
