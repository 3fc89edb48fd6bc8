"""OpenUSD's validation framework: one validator of stages that reports what the linter finds.

usd-core imports this module when the validator is first asked for; it finds the validator by
`plugInfo.json` beside this file, whose folder PXR_PLUGINPATH_NAME must name.
"""

from __future__ import annotations

from typing import Any

from pxr import Usd, UsdValidation

from lab3_usd.model.finding import Finding
from lab3_usd.plugins.findings import findings_of, text_of

NAME = f"{__name__}:IsaacGraphValidator"
_KINDS = {
    "error": UsdValidation.ValidationErrorType.Error,
    "warning": UsdValidation.ValidationErrorType.Warn,
    "note": UsdValidation.ValidationErrorType.Info,
}


def check(stage: Usd.Stage, _time: Any) -> list[UsdValidation.ValidationError]:
    """Return what the linter finds, each with its prim or property."""
    root = stage.GetRootLayer()
    return [
        UsdValidation.ValidationError(
            finding.rule,
            _KINDS[finding.severity],
            [UsdValidation.ValidationErrorSite(stage, _path(stage, finding))]
            if stage.GetPrimAtPath(finding.prim)
            else [UsdValidation.ValidationErrorSite(root, "/")],
            text_of(finding),
        )
        for finding in findings_of(stage)
    ]


def _path(stage: Usd.Stage, finding: Finding) -> str:
    """Return the path of the property at fault, of its prim where no file declares it."""
    path = f"{finding.prim}.{finding.property}"
    return path if finding.property and stage.GetPropertyAtPath(path) else finding.prim


def register() -> None:
    """Give the framework the function of the validator that `plugInfo.json` names."""
    registry = UsdValidation.ValidationRegistry()
    registry.RegisterPluginStageValidator(NAME, check)


register()
