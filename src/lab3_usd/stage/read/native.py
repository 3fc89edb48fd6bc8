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
_OPEN: dict[tuple[str, str], re.Pattern[str]] = {
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
    """Return what the validators of usd-core say of a stage; `given` names its root layer.

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
    found = {
        NativeError(
            validator=str(error.GetValidator().GetMetadata().name),
            name=str(error.GetName()),
            severity=severities.get(error.GetType(), "note"),
            prim=place[0],
            property=place[1],
            message=_one_line(error.GetMessage()).replace(folder, prefix),
            is_open=_is_open(error),
        )
        for error in context.Validate(stage)
        for place in (_place(stage, error),)
    }
    return tuple(sorted(found, key=str))


def _one_line(text: str) -> str:
    return " ".join(_SESSION.sub("", text).split()).removesuffix(".")


def _is_open(error: Any) -> bool:
    validator = str(error.GetValidator().GetMetadata().name).rpartition(":")[2]
    message = _OPEN.get((validator, str(error.GetName())))
    return message is not None and message.search(error.GetMessage()) is not None


def _place(stage: Usd.Stage, error: Any) -> tuple[str, str | None]:
    """Return where an error is: a prim, and a property of it or None."""
    for site in error.GetSites():
        if site.IsValid() and site.IsProperty():
            return _split(site.GetProperty().GetPath())
        if site.IsValid() and site.IsPrim():
            return _split(site.GetPrim().GetPath())
        if site.IsValidSpecInLayer():
            return _split((site.GetPropertySpec() or site.GetPrimSpec()).path)
    # Of a layer that is referred to OpenUSD gives a path of the stage, in the message alone.
    named = (Sdf.Path(path) for path in _NAMED.findall(error.GetMessage()))
    return _split(next((path for path in named if stage.GetObjectAtPath(path)), _ROOT))


def _split(path: Sdf.Path) -> tuple[str, str | None]:
    return str(path.GetPrimPath()), str(path.name) if path.IsPropertyPath() else None
