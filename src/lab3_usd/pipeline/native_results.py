"""Adds to the result of a stage what OpenUSD's own validators say of it (`--native`)."""

from __future__ import annotations

from pathlib import Path

from msgspec.structs import replace

from lab3_usd.check.rule_runs import run_family
from lab3_usd.errors import StageError
from lab3_usd.model.finding import StageResult
from lab3_usd.model.native import FAMILY, NativeErrors
from lab3_usd.pipeline.results import located_findings, unreadable_result, with_findings


def require_native() -> None:
    """Refuse to go on where the installed usd-core has no validators.

    Raises:
        UsageError: it has none; the line says from which release on they come.
    """
    from lab3_usd.stage.read.native_validators import native_validation

    native_validation()


def with_native(result: StageResult) -> StageResult:
    """Return the result of a stage together with what OpenUSD's validators say.

    Requirements and score stay as they are: no lab asks for these.

    Raises:
        StageError: the file cannot be opened any more.
        UsageError: the installed usd-core has no validators.
    """
    if result.verdict == "unreadable":
        return result
    from lab3_usd.stage.read.native_validators import native_errors
    from lab3_usd.stage.read.opening import open_stage, stage_errors

    path = Path(result.path)
    stage = open_stage(path)
    try:
        with stage_errors(path):
            errors = native_errors(stage, result.path)
    except StageError as error:  # of a prim that no other rule asks for
        return unreadable_result(result.path, result.checkpoint, error)
    judged = run_family("native", FAMILY, NativeErrors(errors), None)
    native_findings = located_findings(judged.findings, path, stage)
    return with_findings(
        replace(result, crashes=(*result.crashes, *judged.crashes)),
        (*result.findings, *native_findings),
    )
