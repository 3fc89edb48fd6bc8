"""What each process of `lab3 check --jobs` needs, imported before they are forked."""

from __future__ import annotations

import gc

import lab3_usd.check.folder
import lab3_usd.check.unchanged
import lab3_usd.commands.judging
import lab3_usd.stage.compare
import lab3_usd.stage.lines
import lab3_usd.stage.opening
import lab3_usd.stage.reader  # noqa: F401
from lab3_usd.check.registry import all_rules
from lab3_usd.spec.loader import load_lab

all_rules()
load_lab()
gc.freeze()
