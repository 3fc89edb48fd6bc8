"""Copies of layers in memory have splines only where a test has set one.

usd-core lists splines nowhere, so that a layer in memory is looked through for them, which takes a
twentieth of the time of judging a stage; tests judge thousands.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from unittest.mock import patch

from pxr import Sdf, Ts, Usd

from lab3_usd.stage.read import properties

COPY = "copy.usdc"  # how the identifiers of copies end
MAY_HAVE, SET = properties._may_have_splines, Usd.Attribute.SetSpline
_WITH_SPLINES: set[str] = set()  # identifiers; that of a layer that is gone may come again


@contextmanager
def splines_noted() -> Iterator[None]:
    """Note who sets splines, and look through no copy in which nobody did."""
    with (
        patch.object(properties, "_may_have_splines", _may_have),
        patch.object(Usd.Attribute, "SetSpline", _set),
    ):
        yield


def copy_of(layer: Sdf.Layer) -> Sdf.Layer:
    """Copy a layer in memory, which takes a third of the time where it is binary."""
    copy = Sdf.Layer.CreateAnonymous(COPY)
    copy.TransferContent(layer)
    if layer.identifier in _WITH_SPLINES or not layer.anonymous:
        _WITH_SPLINES.add(copy.identifier)
    return copy


def _may_have(layer: Sdf.Layer) -> bool:
    is_copy = layer.anonymous and layer.identifier.endswith(COPY)
    return layer.identifier in _WITH_SPLINES if is_copy else MAY_HAVE(layer)


def _set(attribute: Usd.Attribute, spline: Ts.Spline) -> bool:
    _WITH_SPLINES.add(attribute.GetStage().GetEditTarget().GetLayer().identifier)
    done: bool = SET(attribute, spline)
    return done
