"""JSON is laid out as `json.dumps` does it, also what faster writers refuse."""

from __future__ import annotations

import json
import math

import pytest

from lab3_usd.report.safe_text import json_text

ROW = {"empty": [[], {}], "text": 'é\u2028\x1b\\"</', "numbers": [1e16, -0.0, 10**30, 1e-7, None]}


@pytest.mark.parametrize("more", [True, math.nan, -math.inf, "half \udc80"])
def test_every_document_has_the_layout_of_the_standard_library(more: object) -> None:
    document = {**ROW, "more": [more, {"row": ROW}]}
    assert json_text(document, 1) == json.dumps(document, indent=1) + "\n"
    assert json_text(document, 2) == json.dumps(document, indent=2) + "\n"
