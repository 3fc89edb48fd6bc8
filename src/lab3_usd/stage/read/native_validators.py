"""Runs the validators that come with usd-core over an open stage."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from pxr import Sdf, Usd

from lab3_usd.errors import UsageError
from lab3_usd.model.finding import Severity
from lab3_usd.model.native import NativeError
from lab3_usd.stage.read.opening import quiet

_NEEDED = (
    "--native needs OpenUSD's validators (pxr.UsdValidation), which usd-core has from 25.5 on; "
    "here is {version}: pip install --upgrade usd-core"
)
# What cannot be decided outside the application: OpenUSD's names of validator and error, and
# what the message has to say besides.
_UNRESOLVED = re.compile(r"Could not (open asset|load sublayer)|nvalid or unresolvable")
_NAMED = re.compile(r"<(/[\w/:.]*)>")
_ROOT = Sdf.Path.absoluteRootPath
_SESSION = re.compile(r",@anon:[^@]*@")  # named by its address in memory
_UNDECIDABLE: dict[tuple[str, str], re.Pattern[str]] = {
    ("CompositionErrorTest", "CompositionError"): _UNRESOLVED,
    ("MissingReferenceValidator", "UnresolvableDependency"): re.compile(""),
    ("NormalMapTextureValidator", "InvalidFile"): re.compile(""),
    ("ShaderSdrCompliance", "MissingSourceTypeInRegistry"): re.compile(""),
    ("ShaderSdrCompliance", "MissingShaderIdInRegistry"): re.compile(""),
}


def native_validation() -> Any:
    """Return OpenUSD's module of validation.

    Raises:
        UsageError: the installed usd-core has none.
    """
    try:
        from pxr import UsdValidation
    except ImportError as error:
        version = ".".join(map(str, Usd.GetVersion()[1:]))
        raise UsageError(_NEEDED.format(version=version)) from error
    return UsdValidation


@quiet()
def native_errors(stage: Usd.Stage, given: str) -> tuple[NativeError, ...]:
    """Return the errors that usd-core's validators find in a stage; `given` names its root layer.

    They see the stage as it is saved. Validators of plugins are left out.

    Raises:
        UsageError: the installed usd-core has none.
    """
    module = native_validation()
    registry = module.ValidationRegistry()
    names = sorted(
        validator.name
        for validator in registry.GetAllValidatorMetadata()
        if not validator.isSuite and not (validator.plugin and validator.plugin.isPythonModule)
    )
    if not stage.GetSessionLayer().empty:
        stage = Usd.Stage.Open(stage.GetRootLayer(), Usd.Stage.LoadAll)
    context = module.ValidationContext(registry.GetOrLoadValidatorsByName(names))
    severities: dict[Any, Severity] = {
        module.ValidationErrorType.Error: "error",
        module.ValidationErrorType.Warn: "warning",
    }
    folder = f"{Path(stage.GetRootLayer().realPath).parent}/"
    prefix = given[: len(given) - len(Path(given).name)]
    errors = set()
    for error in context.Validate(stage):
        validator, name = str(error.GetValidator().GetMetadata().name), str(error.GetName())
        path, text = _path(stage, error), error.GetMessage()
        undecidable = _UNDECIDABLE.get((validator.rpartition(":")[2], name))
        errors.add(
            NativeError(
                validator=validator,
                name=name,
                severity=severities.get(error.GetType(), "note"),
                prim=str(path.GetPrimPath()),
                property=str(path.name) if path.IsPropertyPath() else None,
                message=" ".join(_SESSION.sub("", text).split())
                .removesuffix(".")
                .replace(folder, prefix),
                may_be_defined_elsewhere=undecidable is not None
                and undecidable.search(text) is not None,
            )
        )
    return tuple(sorted(errors, key=str))


def _path(stage: Usd.Stage, error: Any) -> Sdf.Path:
    """Return the path of the prim or property that an error is about."""
    for site in error.GetSites():
        if site.IsValid() and site.IsProperty():
            return site.GetProperty().GetPath()
        if site.IsValid() and site.IsPrim():
            return site.GetPrim().GetPath()
        if site.IsValidSpecInLayer():
            return (site.GetPropertySpec() or site.GetPrimSpec()).path
    # Of a layer that is referred to OpenUSD gives a path of the stage, in the message alone.
    paths = (Sdf.Path(path) for path in _NAMED.findall(error.GetMessage()))
    return next((path for path in paths if stage.GetObjectAtPath(path)), _ROOT)
