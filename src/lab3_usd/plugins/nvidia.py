"""NVIDIA's validator: one rule of the category Lab3 that reports what the linter finds.

Imported by that validator through its entry points, never by the program itself.
"""

from __future__ import annotations

import importlib
from typing import Any

CATEGORY = "Lab3"
# The same package under its names of 2026, of before, and inside Isaac Sim.
_MODULES = ("usd_validation_nvidia", "omni.asset_validator", "omni.asset_validator.core")
_DECORATORS = ("register_rule", "registerRule")
_ADD = {"error": "_AddFailedCheck", "warning": "_AddWarning", "note": "_AddInfo"}


def validator() -> Any:  # noqa: ANN401 - a module without types
    """Return the module of the validator that is installed.

    Raises:
        ImportError: none is.
    """
    for name in _MODULES:
        try:
            module = importlib.import_module(name)
        except ImportError:
            continue
        if any(hasattr(module, each) for each in _DECORATORS):
            return module
    message = "no validator of NVIDIA is installed"
    raise ImportError(message)


def rule_class(module: Any) -> Any:  # noqa: ANN401 - see above
    """Return the rule for a validator: a class that derives from the validator's own."""

    class IsaacGraphChecker(module.BaseRuleChecker):  # type: ignore[misc]
        """Action Graphs, topics, frames, robots and sensors of Isaac Sim work as they are wired."""

        def CheckStage(self, stage: Any) -> None:  # noqa: ANN401, N802 - the validator's name
            """Report what the linter finds in a stage."""
            from lab3_usd.plugins.findings import findings_of, text_of  # noqa: PLC0415

            for finding in findings_of(stage):
                prim = stage.GetPrimAtPath(finding.prim)
                add = getattr(self, _ADD[finding.severity])
                add(text_of(finding), at=prim or stage)

    return IsaacGraphChecker


class Plugin:
    """What the validator starts and stops."""

    def on_startup(self) -> None:
        """Register the rule."""
        module = validator()
        register = next(getattr(module, each) for each in _DECORATORS if hasattr(module, each))
        register(CATEGORY)(rule_class(module))

    def on_shutdown(self) -> None:
        """Leave nothing behind: the validator lets go of its rules itself."""


plugin = Plugin()
