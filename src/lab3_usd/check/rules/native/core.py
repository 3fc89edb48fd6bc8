"""OpenUSD's validators of the stage itself."""

from __future__ import annotations

from collections.abc import Iterator

from lab3_usd.check.registry import rule
from lab3_usd.model.finding import Problem
from lab3_usd.model.native import NativeErrors


@rule("UV01", "composition-error", scope="native")
def composition_error(subject: NativeErrors) -> Iterator[Problem]:
    """OpenUSD meets errors when it composes the stage.

    Why: what an arc should bring is not there, and the application shows the rest without a
    word. An asset that cannot be found from here is a note: the application may have it.
    OpenUSD's validator: `usdValidation:CompositionErrorTest`.

    Fix: follow the paths in the message; correct the reference, payload or sublayer in the
    layer it names.

    Example: a prim refers to a prim below itself.
    """
    yield from subject.problems("UV01")


@rule("UV02", "attribute-of-another-type", scope="native")
def attribute_of_another_type(subject: NativeErrors) -> Iterator[Problem]:
    """A layer declares an attribute with a type that its schema does not give it.

    Why: readers that ask for the type of the schema get nothing and use the default. Only
    schemas that usd-core brings are compared: those of Isaac Sim, PhysX and OmniGraph are not
    known here. OpenUSD's validator: `usdValidation:AttributeTypeMismatch`.

    Fix: declare the attribute with the type that the message names.

    Example: `token physics:gravityDirection` on a physics scene, where a `vector3f` belongs.
    """
    yield from subject.problems("UV02")


@rule("UV03", "no-default-prim", scope="native")
def no_default_prim(subject: NativeErrors) -> Iterator[Problem]:
    """The stage has no valid default prim.

    Why: who refers to the file without naming a prim gets nothing. OpenUSD's validator:
    `usdValidation:StageMetadataChecker`.

    Fix: make the top prim of the stage the default prim, in the Stage panel or as `defaultPrim`
    in the first lines of the file.

    Example: `defaultPrim` is missing.
    """
    yield from subject.problems("UV03")


@rule("UV99", "other-validator", scope="native")
def other_validator(subject: NativeErrors) -> Iterator[Problem]:
    """A validator of a newer usd-core has found something.

    Why: usd-core brings validators that this program does not know by name. The message begins
    with the name.

    Fix: see OpenUSD's documentation of the validator that the message names.

    Example: the installed usd-core has one validator more than the table of `lab3 rules`.
    """
    yield from subject.problems("UV99")
