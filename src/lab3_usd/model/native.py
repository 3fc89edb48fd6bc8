"""The errors of OpenUSD's own validators, and the rule that stands for each validator."""

from __future__ import annotations

from collections.abc import Iterator

from msgspec import Struct

from lab3_usd.model.finding import Problem, Severity

FAMILY = "UV"
OTHER = "UV99"
VALIDATORS = {
    "UV01": "usdValidation:CompositionErrorTest",
    "UV02": "usdValidation:AttributeTypeMismatch",
    "UV03": "usdValidation:StageMetadataChecker",
    "UV10": "usdGeomValidators:StageMetadataChecker",
    "UV11": "usdGeomValidators:EncapsulationChecker",
    "UV12": "usdGeomValidators:SubsetFamilies",
    "UV13": "usdGeomValidators:SubsetParentIsImageable",
    "UV20": "usdPhysicsValidators:RigidBodyChecker",
    "UV21": "usdPhysicsValidators:ColliderChecker",
    "UV22": "usdPhysicsValidators:ArticulationChecker",
    "UV23": "usdPhysicsValidators:PhysicsJointChecker",
    "UV30": "usdShadeValidators:EncapsulationMaterialValidator",
    "UV31": "usdShadeValidators:EncapsulationRulesValidator",
    "UV32": "usdShadeValidators:MaterialBindingApiAppliedValidator",
    "UV33": "usdShadeValidators:MaterialBindingCollectionValidator",
    "UV34": "usdShadeValidators:MaterialBindingRelationships",
    "UV35": "usdShadeValidators:NormalMapTextureValidator",
    "UV36": "usdShadeValidators:ShaderSdrCompliance",
    "UV37": "usdShadeValidators:SubsetMaterialBindFamilyName",
    "UV38": "usdShadeValidators:SubsetsMaterialBindFamily",
    "UV40": "usdSkelValidators:SkelBindingApiAppliedValidator",
    "UV41": "usdSkelValidators:SkelBindingApiValidator",
    "UV50": "usdLuxValidators:EncapsulationRulesValidator",
    "UV60": "usdMediaValidators:AuthorshipInputsPaired",
    "UV61": "usdMediaValidators:ShadowedOrDuplicateAuthorship",
    "UV70": "usdUtilsValidators:MissingReferenceValidator",
    "UV71": "usdUtilsValidators:FileExtensionValidator",
    "UV72": "usdUtilsValidators:PackageEncapsulationValidator",
    "UV73": "usdUtilsValidators:RootPackageValidator",
    "UV74": "usdUtilsValidators:UsdzPackageValidator",
}


class NativeError(Struct, frozen=True):
    """One error of a validator, under OpenUSD's names, at a prim or property of the stage.

    `may_be_defined_elsewhere`: it rests on what only the application has, an asset or a kind of
    shader, so that nothing is decided here.
    """

    validator: str
    name: str
    severity: Severity
    prim: str
    property: str | None
    message: str
    may_be_defined_elsewhere: bool = False


class NativeErrors(Struct, frozen=True):
    """All errors of one stage from the validators of the installed usd-core."""

    errors: tuple[NativeError, ...]

    def problems(self, rule: str) -> Iterator[Problem]:
        """Yield what the validator of a rule says; for `OTHER`, what all unknown ones say."""
        for error in self.errors:
            if rule_of(error.validator) != rule:
                continue
            severity: Severity = "note" if error.may_be_defined_elsewhere else error.severity
            message = error.message if rule != OTHER else f"{error.validator}: {error.message}"
            yield Problem(error.prim, message, property=error.property, severity=severity)


def rule_of(validator: str) -> str:
    """Return the rule that a validator is: `OTHER` for one of a newer usd-core."""
    return next((rule for rule, name in VALIDATORS.items() if name == validator), OTHER)
