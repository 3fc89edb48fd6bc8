"""Lint, repair, simulate and write the graphs of Isaac Sim stages, from the USD file alone.

The library in short:

    from lab3_usd import build_checkpoint, check_stage
    build_checkpoint(None, "05", "Lab3_05_odometry_tf.usda")
    result = check_stage("Lab3_05_odometry_tf.usda")
    for finding in result.findings: print(finding.rule, finding.prim, finding.message)
"""

from __future__ import annotations

import sys

# `python -m lab3_usd` puts the working directory first, whose modules are anybody's. The option of
# Python 3.11 against that would have to be given by whoever calls.
_AS_PROGRAM = {"lab3_usd", "-mlab3_usd"}
_IS_SAFE = sys.flags.isolated or getattr(sys.flags, "safe_path", False)
if sys.argv[:1] == ["-m"] and not _AS_PROGRAM.isdisjoint(sys.orig_argv) and not _IS_SAFE:
    del sys.path[:1]

import importlib  # noqa: E402 - from where the path leads now
from typing import TYPE_CHECKING, Any  # noqa: E402

if TYPE_CHECKING:
    from lab3_usd.author.api import Stage
    from lab3_usd.errors import (
        AmbiguousError,
        GraphError,
        Lab3Error,
        NewFindingsError,
        SpecError,
        StageError,
        UsageError,
    )
    from lab3_usd.facts.frames import published_edges
    from lab3_usd.model.finding import Finding, Report, Requirement, Score, StageResult
    from lab3_usd.pipeline.stage import check_stage
    from lab3_usd.spec.load.loader import load_lab, load_platform
    from lab3_usd.stage.read.server_assets import assets_at
    from lab3_usd.stage.read.stage_reader import read_stage
    from lab3_usd.stage.write.builder import build_checkpoint
    from lab3_usd.stage.write.starter import build_starter

# Where each public name lives; imported when it is first asked for, so that pxr is not loaded
# by those who only want the rules or the errors.
_HOMES = {
    "AmbiguousError": "lab3_usd.errors",
    "Finding": "lab3_usd.model.finding",
    "GraphError": "lab3_usd.errors",
    "Lab3Error": "lab3_usd.errors",
    "NewFindingsError": "lab3_usd.errors",
    "Report": "lab3_usd.model.finding",
    "Requirement": "lab3_usd.model.finding",
    "Score": "lab3_usd.model.finding",
    "SpecError": "lab3_usd.errors",
    "Stage": "lab3_usd.author.api",
    "StageError": "lab3_usd.errors",
    "StageResult": "lab3_usd.model.finding",
    "UsageError": "lab3_usd.errors",
    "assets_at": "lab3_usd.stage.read.server_assets",
    "build_checkpoint": "lab3_usd.stage.write.builder",
    "build_starter": "lab3_usd.stage.write.starter",
    "check_stage": "lab3_usd.pipeline.stage",
    "load_lab": "lab3_usd.spec.load.loader",
    "load_platform": "lab3_usd.spec.load.loader",
    "published_edges": "lab3_usd.facts.frames",
    "read_stage": "lab3_usd.stage.read.stage_reader",
}

__all__ = [
    "AmbiguousError",
    "Finding",
    "GraphError",
    "Lab3Error",
    "NewFindingsError",
    "Report",
    "Requirement",
    "Score",
    "SpecError",
    "Stage",
    "StageError",
    "StageResult",
    "UsageError",
    "assets_at",
    "build_checkpoint",
    "build_starter",
    "check_stage",
    "load_lab",
    "load_platform",
    "published_edges",
    "read_stage",
]


def __getattr__(name: str) -> Any:
    """Import a public name from its home."""
    if name not in _HOMES:
        raise AttributeError(f"module 'lab3_usd' has no attribute '{name}'")
    return getattr(importlib.import_module(_HOMES[name]), name)
