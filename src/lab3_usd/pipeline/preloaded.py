"""Imports what each process of `lab3 check --jobs` needs, before the processes are forked."""

from __future__ import annotations

import gc

from lab3_usd.check.registry import all_rules
from lab3_usd.spec.load.loader import load_lab

all_rules()
load_lab()
gc.freeze()
