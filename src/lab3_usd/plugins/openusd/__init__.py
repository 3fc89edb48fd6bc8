"""OpenUSD's validation framework: one validator of stages that reports what the linter finds.

usd-core reads `plugInfo.json` in this folder, which PXR_PLUGINPATH_NAME must name, and imports this
module when the validator first runs.
"""

from __future__ import annotations

from typing import Any

from pxr import Usd, UsdValidation

from lab3_usd.plugins.findings import findings_of, text_of

NAME = f"{__name__}:IsaacGraphValidator"
_KINDS = {
    "error": UsdValidation.ValidationErrorType.Error,
    "warning": UsdValidation.ValidationErrorType.Warn,
    "note": UsdValidation.ValidationErrorType.Info,
}


def found_errors(stage: Usd.Stage, _time: Any) -> list[UsdValidation.ValidationError]:
    """Return what the linter finds, each with its prim or property."""
    errors = []
    for finding in findings_of(stage):
        path = f"{finding.prim}.{finding.property}"
        if not (finding.property and stage.GetPropertyAtPath(path)):
            path = finding.prim  # no file declares the property
        if stage.GetPrimAtPath(finding.prim):
            site = UsdValidation.ValidationErrorSite(stage, path)
        else:
            site = UsdValidation.ValidationErrorSite(stage.GetRootLayer(), "/")
        kind = _KINDS[finding.severity]
        errors.append(UsdValidation.ValidationError(finding.rule, kind, [site], text_of(finding)))
    return errors


def register() -> None:
    """Give the framework the function of the validator that `plugInfo.json` names."""
    registry = UsdValidation.ValidationRegistry()
    registry.RegisterPluginStageValidator(NAME, found_errors)


register()
