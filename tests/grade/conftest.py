"""Grading is tested on the small lab: what it does depends on no lab."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from other_labs import in_force
from workers_here import judged_once


@pytest.fixture(scope="module", autouse=True)
def _small_lab() -> Iterator[None]:
    with in_force():
        yield


@pytest.fixture(scope="module")
def equal_judged_once() -> Iterator[None]:
    """For modules in which nothing changes how a submission is judged."""
    with judged_once():
        yield
