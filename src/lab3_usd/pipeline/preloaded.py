"""Imports what each process of `lab3 check --jobs` needs, before the processes are forked."""

from __future__ import annotations

import gc

import lab3_usd.check.demands
import lab3_usd.check.message_suffixes
import lab3_usd.check.own_rules
import lab3_usd.pipeline.entries
import lab3_usd.pipeline.folder
import lab3_usd.pipeline.starter_comparison
import lab3_usd.stage.compare.stages
import lab3_usd.stage.layer_text
import lab3_usd.stage.read.opening
import lab3_usd.stage.read.stage_reader
import lab3_usd.stage.statements  # noqa: F401
from lab3_usd.check.registry import all_rules
from lab3_usd.spec.load.loader import load_lab

all_rules()
load_lab()
gc.freeze()
