"""What OpenUSD's own validators find, one rule for each of them (`--native`)."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator

from msgspec import Struct

from lab3_usd.check.registry import rule
from lab3_usd.model.finding import Problem, Severity
from lab3_usd.model.native import NativeErrors

OTHER = "UV99"


class _Validator(Struct, frozen=True):
    """A validator of OpenUSD, as the rule that it is; `OTHER` is every one without a rule."""

    id: str
    name: str
    severity: Severity
    validator: str
    manual: str


_TABLE = (
    _Validator("UV01", "composition-error", "error",
        "usdValidation:CompositionErrorTest",
        """OpenUSD reports errors when it composes the stage.

        Why: the content of an arc is missing, and the application shows the rest without a
        message. A missing asset is a note: the application may have it.

        Fix: follow the paths in the message; correct the reference, payload or sublayer in the
        layer it names.

        Example: a prim refers to a prim below itself.
        """,
    ),
    _Validator("UV02", "attribute-of-another-type", "error",
        "usdValidation:AttributeTypeMismatch",
        """An attribute has another type than its schema.

        Why: readers that expect the type of the schema use the default. Only schemas of
        usd-core are compared; those of Isaac Sim, PhysX and OmniGraph are unknown to it.

        Fix: declare the attribute with the type that the message names.

        Example: `token physics:gravityDirection` on a physics scene, where a `vector3f`
        belongs.
        """,
    ),
    _Validator("UV03", "no-default-prim", "error",
        "usdValidation:StageMetadataChecker",
        """The stage has no valid default prim.

        Why: a reference to the file without a prim path brings nothing.

        Fix: make the top prim of the stage the default prim, in the Stage panel or as
        `defaultPrim` in the first lines of the file.

        Example: `defaultPrim` is missing.
        """,
    ),
    _Validator("UV10", "no-units", "error",
        "usdGeomValidators:StageMetadataChecker",
        """The stage has no units or no up axis.

        Why: readers assume centimetres and Y up, so a robot in metres is a hundredth of its
        size.

        Fix: write `metersPerUnit` and `upAxis` in the first lines of the file, with the values
        that the stage was made with.

        Example: `upAxis` is missing.
        """,
    ),
    _Validator("UV11", "nested-shapes", "error",
        "usdGeomValidators:EncapsulationChecker",
        """A shape is below another shape.

        Why: renderers and physics may skip the inner one: a gprim must be a leaf.

        Fix: put an Xform above both.

        Example: a Sphere below a Cube.
        """,
    ),
    _Validator("UV12", "subset-family", "error",
        "usdGeomValidators:SubsetFamilies",
        """Subsets of a mesh contradict the type of their family.

        Why: in a partition each face belongs to one subset. Faces in none or in two have no
        clear material.

        Fix: correct the indices, or the type of the family.

        Example: a family of type `partition` leaves out a face.
        """,
    ),
    _Validator("UV13", "subset-without-mesh", "error",
        "usdGeomValidators:SubsetParentIsImageable",
        """A geometry subset is not directly below a shape.

        Why: it is a subset of nothing and has no effect.

        Fix: move it below its mesh.

        Example: a GeomSubset below a prim without a type.
        """,
    ),
    _Validator("UV20", "body-that-cannot-move", "error",
        "usdPhysicsValidators:RigidBodyChecker",
        """Physics cannot move the prim of a rigid body.

        Why: the body stays where it is, or falls out of the simulation.

        Fix: apply the schema to an Xform or a shape that is neither below an instance nor
        scaled with a rotation of its own.

        Example: PhysicsRigidBodyAPI on a Scope.
        """,
    ),
    _Validator("UV21", "collider-shape", "error",
        "usdPhysicsValidators:ColliderChecker",
        """Physics does not support the shape or scale of a collider.

        Why: the engine uses another shape, or none.

        Fix: scale spheres, capsules and cones equally in all directions, or use a mesh.

        Example: a Sphere scaled by (1, 2, 3) with PhysicsCollisionAPI.
        """,
    ),
    _Validator("UV22", "articulation-in-another", "error",
        "usdPhysicsValidators:ArticulationChecker",
        """An articulation root is below another, or does not move.

        Why: the engine keeps one articulation, and a controller of the other finds nothing.

        Fix: leave PhysicsArticulationRootAPI on one prim of the robot.

        Example: robot and gripper both have an articulation root.
        """,
    ),
    _Validator("UV23", "joint-without-bodies", "error",
        "usdPhysicsValidators:PhysicsJointChecker",
        """A joint does not connect bodies.

        Why: the engine ignores it.

        Fix: choose the bodies of the joint again; at least one must be an enabled rigid body.

        Example: `physics:body0` names an Xform without PhysicsRigidBodyAPI.
        """,
    ),
    _Validator("UV30", "material-contents", "error",
        "usdShadeValidators:EncapsulationMaterialValidator",
        """A material contains other prims than shaders.

        Why: shapes below a material are not drawn.

        Fix: move them out of the material.

        Example: a Cube below a Material.
        """,
    ),
    _Validator("UV31", "shader-place", "error",
        "usdShadeValidators:EncapsulationRulesValidator",
        """A shader or node graph is where it cannot be connected.

        Why: connections across such a border are invalid, and renderers ignore them.

        Fix: put it below the material or node graph.

        Example: a Shader below a Shader.
        """,
    ),
    _Validator("UV32", "binding-not-applied", "error",
        "usdShadeValidators:MaterialBindingApiAppliedValidator",
        """A binding lacks MaterialBindingAPI.

        Why: usd-core ignores such a binding: the prim has no material.

        Fix: apply MaterialBindingAPI to the prim.

        Example: `material:binding` on a Cube without the schema.
        """,
    ),
    _Validator("UV33", "binding-collection", "error",
        "usdShadeValidators:MaterialBindingCollectionValidator",
        """A material binding names an invalid collection.

        Why: the members of the collection have no material.

        Fix: target one collection and one material with the relationship.

        Example: `material:binding:collection:all` names a missing collection.
        """,
    ),
    _Validator("UV34", "binding-no-relationship", "error",
        "usdShadeValidators:MaterialBindingRelationships",
        """A material binding is not a relationship.

        Why: it binds nothing.

        Fix: delete the attribute, and bind the material again.

        Example: `token material:binding`.
        """,
    ),
    _Validator("UV35", "normal-map", "error",
        "usdShadeValidators:NormalMapTextureValidator",
        """The texture of a normal map is read as colour.

        Why: the normals are wrong, and so is the lighting of the surface. A missing texture is
        a note.

        Fix: set scale (2, 2, 2, 1), bias (-1, -1, -1, 0) and sourceColorSpace `raw` on the
        texture.

        Example: a UsdUVTexture feeds `inputs:normal` without scale and bias.
        """,
    ),
    _Validator("UV36", "shader-inputs", "error",
        "usdShadeValidators:ShaderSdrCompliance",
        """A shader input has another type than defined.

        Why: renderers use the default instead. usd-core does not know MDL shaders: for them it
        is a note.

        Fix: declare the input with the type that the message names.

        Example: `float inputs:diffuseColor` on a UsdPreviewSurface.
        """,
    ),
    _Validator("UV37", "bound-subset", "error",
        "usdShadeValidators:SubsetMaterialBindFamilyName",
        """A bound subset is not in the family `materialBind`.

        Why: renderers read materials only from subsets of that family.

        Fix: set `familyName` of the subset to `materialBind`.

        Example: a GeomSubset with `material:binding` and no family name.
        """,
    ),
    _Validator("UV38", "bound-subset-family", "error",
        "usdShadeValidators:SubsetsMaterialBindFamily",
        """Subsets that bind materials may overlap.

        Why: a face in two subsets has two materials, and which one applies is undefined.

        Fix: set the type of the family `materialBind` to `nonOverlapping` or `partition`.

        Example: `subsetFamily:materialBind:familyType = "unrestricted"`.
        """,
    ),
    _Validator("UV40", "skeleton-not-applied", "error",
        "usdSkelValidators:SkelBindingApiAppliedValidator",
        """A prim with a skeleton lacks SkelBindingAPI.

        Why: usd-core ignores the binding: the mesh does not move.

        Fix: apply SkelBindingAPI to the prim.

        Example: `skel:skeleton` on a Mesh without the schema.
        """,
    ),
    _Validator("UV41", "skeleton-root", "error",
        "usdSkelValidators:SkelBindingApiValidator",
        """A prim with SkelBindingAPI is below no SkelRoot.

        Why: it is never skinned.

        Fix: put the character below a SkelRoot.

        Example: a Mesh with SkelBindingAPI below an Xform.
        """,
    ),
    _Validator("UV50", "light-place", "error",
        "usdLuxValidators:EncapsulationRulesValidator",
        """A light or light filter is below a prim that cannot contain it.

        Why: its connections are invalid, and renderers may ignore it.

        Fix: move it below an Xform, a light or a light filter.

        Example: a DistantLight below a Shader.
        """,
    ),
    _Validator("UV60", "authorship-pairs", "error",
        "usdMediaValidators:AuthorshipInputsPaired",
        """Inputs of an authorship record are not pairs.

        Why: readers cannot tell names from values.

        Fix: write a name and a value for each input.

        Example: `authorship:step:inputs` has one element.
        """,
    ),
    _Validator("UV61", "authorship-hidden", "warning",
        "usdMediaValidators:ShadowedOrDuplicateAuthorship",
        """A stronger layer hides an authorship record.

        Why: the composed prim does not show it.

        Fix: prepend the schema in the stronger layer instead of setting the whole list.

        Example: `apiSchemas = ["AuthorshipAPI:last"]` above a reference that has a record of
        its own.
        """,
    ),
    _Validator("UV70", "missing-reference", "note",
        "usdUtilsValidators:MissingReferenceValidator",
        """An asset of a layer or variant cannot be found.

        Why: the application may find it through servers, search paths and resolvers that
        usd-core does not have. Its content is not judged.

        Fix: open the stage in Isaac Sim, or copy the asset beside the stage; correct the path
        if it is wrong.

        Example: a texture on an Omniverse server.
        """,
    ),
    _Validator("UV71", "file-extension", "error",
        "usdUtilsValidators:FileExtensionValidator",
        """A package contains a file of a forbidden kind.

        Why: viewers reject the package. Only .usdz files are examined.

        Fix: remove the file, or convert it to USD, PNG, JPEG, EXR or an allowed sound format.

        Example: `notes.txt` in a .usdz.
        """,
    ),
    _Validator("UV72", "package-refers-outside", "warning",
        "usdUtilsValidators:PackageEncapsulationValidator",
        """A package refers to a file outside it.

        Why: the package works on this computer only. Only .usdz files are examined.

        Fix: put the file into the package.

        Example: the root layer of a .usdz refers to `/home/me/robot.usd`.
        """,
    ),
    _Validator("UV73", "root-package", "error",
        "usdUtilsValidators:RootPackageValidator",
        """Files of the package are compressed, encrypted or unaligned.

        Why: readers map packages into memory and cannot read such files. Only .usdz files are
        examined.

        Fix: pack it again with a tool for .usdz, not with an ordinary zip program.

        Example: a .usdz made by `zip`.
        """,
    ),
    _Validator("UV74", "package-in-use", "error",
        "usdUtilsValidators:UsdzPackageValidator",
        """A package in use is compressed, encrypted or unaligned.

        Why: readers map packages into memory and cannot read such files.

        Fix: pack it again with a tool for .usdz, not with an ordinary zip program.

        Example: a stage refers to a .usdz made by `zip`.
        """,
    ),
    _Validator("UV99", "other-validator", "error",
        "",
        """A validator of a newer usd-core reported a fault.

        Why: this usd-core has validators that this program does not know. The message begins
        with the name.

        Fix: see OpenUSD's documentation of the validator that the message names.

        Example: the installed usd-core has one validator more than the table of `lab3 rules`.
        """,
    ),
)  # fmt: skip
VALIDATORS = {row.id: row.validator for row in _TABLE if row.validator}


def rule_of(validator: str) -> str:
    """Return the rule that a validator is: `OTHER` for one of a newer usd-core."""
    return next((rule for rule, name in VALIDATORS.items() if name == validator), OTHER)


def _forwarding(row: _Validator) -> Callable[[NativeErrors], Iterator[Problem]]:
    """Return the rule that yields what a validator says; that of `OTHER` names the validator."""

    def check(subject: NativeErrors) -> Iterator[Problem]:
        for error in subject.errors:
            if rule_of(error.validator) == row.id:
                severity: Severity = "note" if error.may_be_defined_elsewhere else error.severity
                named = "" if row.validator else f"{error.validator}: "
                yield Problem(
                    error.prim,
                    f"{named}{error.message}",
                    property=error.property,
                    severity=severity,
                )

    check.__name__ = check.__qualname__ = row.name.replace("-", "_")
    named = f" OpenUSD's validator: `{row.validator}`." if row.validator else ""
    check.__doc__ = inspect.cleandoc(row.manual).replace("\n\nFix:", f"{named}\n\nFix:")
    return check


for _row in _TABLE:
    rule(_row.id, _row.name, scope="native", severity=_row.severity)(_forwarding(_row))
