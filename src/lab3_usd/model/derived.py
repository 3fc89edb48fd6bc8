"""Keeps what several rules compute from one stage, so that it is computed once."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any, ParamSpec, TypeVar

from lab3_usd.model.stage import StageModel

_P = ParamSpec("_P")
_T = TypeVar("_T")


def once_per_stage(function: Callable[_P, _T]) -> Callable[_P, _T]:
    """Let a function of a stage, or of what has a `stage`, keep its results in the stage's model.

    Nothing outlives the model, which may hold an open file.
    """

    @wraps(function)
    def kept(*given: _P.args, **_: _P.kwargs) -> _T:
        about: Any = given[0]
        if isinstance(about, StageModel):
            known, key = about.derived, (function, *given[1:])
        else:
            known, key = about.stage.judged, (function, *given)
        if key not in known:
            known[key] = function(*given)  # type: ignore[call-arg]  # all are positional
        found: _T = known[key]
        return found

    return kept
