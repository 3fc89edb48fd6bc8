"""NVIDIA's validator: a rule that reports what the linter finds, and one for the lab's stages.

Imported by that validator through its entry points, never by the program itself.
"""

from __future__ import annotations

import importlib
from collections.abc import Iterable
from typing import Any

from lab3_usd.model.changes import Repair
from lab3_usd.model.finding import Finding

CATEGORY = "Lab3"
CHECK_CATEGORY = "Lab3Check"
# The same package under its names of 2026, of before, and inside Isaac Sim.
_MODULES = ("usd_validation_nvidia", "omni.asset_validator", "omni.asset_validator.core")
_DECORATORS = ("register_rule", "registerRule")
_ADD = {"error": "_AddFailedCheck", "warning": "_AddWarning", "note": "_AddInfo"}


def validator() -> Any:
    """Return the module of the validator that is installed.

    Raises:
        ImportError: none is.
    """
    for name in _MODULES:
        try:
            module = importlib.import_module(name)
        except ImportError:
            continue
        if any(hasattr(module, decorator) for decorator in _DECORATORS):
            return module
    raise ImportError("no validator of NVIDIA is installed")


def rule_class(module: Any) -> Any:
    """Return the rule that lints, a class that derives from the one of a validator."""

    class IsaacGraphChecker(module.BaseRuleChecker):  # type: ignore[misc]
        """Action Graphs, topics, frames, robots and sensors of Isaac Sim work as they are wired."""

        def CheckStage(self, stage: Any) -> None:  # noqa: N802 - the validator's name
            """Report what the linter finds in a stage."""
            from lab3_usd.plugins.findings import findings_of

            _report(module, self, stage, findings_of(stage))

    return IsaacGraphChecker


def checkpoint_rule_class(module: Any) -> Any:
    """Return the rule that checks the stages of the lab, with repairs as suggestions."""

    class LabCheckpointChecker(module.BaseRuleChecker):  # type: ignore[misc]
        """A stage of the lab, named after its checkpoint, is as the lab asks for it."""

        def CheckStage(self, stage: Any) -> None:  # noqa: N802 - the validator's name
            """Report what the check finds in a stage."""
            from lab3_usd.plugins.findings import checked_findings_of

            _report(module, self, stage, checked_findings_of(stage))

    return LabCheckpointChecker


def _report(module: Any, rule: Any, stage: Any, findings: Iterable[Finding]) -> None:
    """Give a rule of the validator its issues, each with the repair that may be made unasked."""
    from lab3_usd.plugins.findings import text_of

    for finding in findings:
        add = getattr(rule, _ADD[finding.severity])
        suggested = _suggestion(module, finding.fix) if finding.fix is not None else {}
        add(text_of(finding), at=stage.GetPrimAtPath(finding.prim) or stage, **suggested)


def _suggestion(module: Any, repair: Repair) -> dict[str, Any]:
    """Return a repair as the validator takes it; nothing where it adds, removes or moves prims.

    `--fix` makes every suggestion without asking.
    """
    if not repair.safe or not hasattr(module, "Suggestion"):
        return {}

    def repaired(stage: Any, _at: Any) -> None:
        from lab3_usd.fix.repairing import repair_open_stage

        repair_open_stage(repair, stage)

    return {"suggestion": module.Suggestion(callable=repaired, message=repair.title)}


class Plugin:
    """The plugin that the validator starts and stops."""

    def on_startup(self) -> None:
        """Register the rules."""
        module = validator()
        register = next(
            getattr(module, decorator) for decorator in _DECORATORS if hasattr(module, decorator)
        )
        register(CATEGORY)(rule_class(module))
        register(CHECK_CATEGORY)(checkpoint_rule_class(module))

    def on_shutdown(self) -> None:
        """Do nothing: the validator removes its rules itself."""


plugin = Plugin()
