"""What OpenUSD's own validators find, one rule for each of them (`--native`)."""

from __future__ import annotations

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
    validator: str
    what: str
    why: str
    fix: str
    example: str
    severity: Severity = "error"


_TABLE = (
    _Validator("UV01", "composition-error", "usdValidation:CompositionErrorTest",
        "OpenUSD reports errors when it composes the stage.",
        why="the content of an arc is missing, and the application shows the rest without a "
        "message. A missing asset is a note: the application may have it.",
        fix="follow the paths in the message; correct the reference, payload or sublayer in the "
        "layer it names.",
        example="a prim refers to a prim below itself.",
    ),
    _Validator("UV02", "attribute-of-another-type", "usdValidation:AttributeTypeMismatch",
        "An attribute has another type than its schema.",
        why="readers that expect the type of the schema use the default. Only schemas of usd-core "
        "are compared; those of Isaac Sim, PhysX and OmniGraph are unknown to it.",
        fix="declare the attribute with the type that the message names.",
        example="`token physics:gravityDirection` on a physics scene, where a `vector3f` belongs.",
    ),
    _Validator("UV03", "no-default-prim", "usdValidation:StageMetadataChecker",
        "The stage has no valid default prim.",
        why="a reference to the file without a prim path brings nothing.",
        fix="make the top prim of the stage the default prim, in the Stage panel or as "
        "`defaultPrim` in the first lines of the file.",
        example="`defaultPrim` is missing.",
    ),
    _Validator("UV10", "no-units", "usdGeomValidators:StageMetadataChecker",
        "The stage has no units or no up axis.",
        why="readers assume centimetres and Y up, so a robot in metres is a hundredth of its size.",
        fix="write `metersPerUnit` and `upAxis` in the first lines of the file, with the values "
        "that the stage was made with.",
        example="`upAxis` is missing.",
    ),
    _Validator("UV11", "nested-shapes", "usdGeomValidators:EncapsulationChecker",
        "A shape is below another shape.",
        why="renderers and physics may skip the inner one: a gprim must be a leaf.",
        fix="put an Xform above both.",
        example="a Sphere below a Cube.",
    ),
    _Validator("UV12", "subset-family", "usdGeomValidators:SubsetFamilies",
        "Subsets of a mesh contradict the type of their family.",
        why="in a partition each face belongs to one subset. Faces in none or in two have no "
        "clear material.",
        fix="correct the indices, or the type of the family.",
        example="a family of type `partition` leaves out a face.",
    ),
    _Validator("UV13", "subset-without-mesh", "usdGeomValidators:SubsetParentIsImageable",
        "A geometry subset is not directly below a shape.",
        why="it is a subset of nothing and has no effect.",
        fix="move it below its mesh.",
        example="a GeomSubset below a prim without a type.",
    ),
    _Validator("UV20", "body-that-cannot-move", "usdPhysicsValidators:RigidBodyChecker",
        "Physics cannot move the prim of a rigid body.",
        why="the body stays where it is, or falls out of the simulation.",
        fix="apply the schema to an Xform or a shape that is neither below an instance nor scaled "
        "with a rotation of its own.",
        example="PhysicsRigidBodyAPI on a Scope.",
    ),
    _Validator("UV21", "collider-shape", "usdPhysicsValidators:ColliderChecker",
        "Physics does not support the shape or scale of a collider.",
        why="the engine uses another shape, or none.",
        fix="scale spheres, capsules and cones equally in all directions, or use a mesh.",
        example="a Sphere scaled by (1, 2, 3) with PhysicsCollisionAPI.",
    ),
    _Validator("UV22", "articulation-in-another", "usdPhysicsValidators:ArticulationChecker",
        "An articulation root is below another, or does not move.",
        why="the engine keeps one articulation, and a controller of the other finds nothing.",
        fix="leave PhysicsArticulationRootAPI on one prim of the robot.",
        example="robot and gripper both have an articulation root.",
    ),
    _Validator("UV23", "joint-without-bodies", "usdPhysicsValidators:PhysicsJointChecker",
        "A joint does not connect bodies.",
        why="the engine ignores it.",
        fix="choose the bodies of the joint again; at least one must be an enabled rigid body.",
        example="`physics:body0` names an Xform without PhysicsRigidBodyAPI.",
    ),
    _Validator("UV30", "material-contents", "usdShadeValidators:EncapsulationMaterialValidator",
        "A material contains other prims than shaders.",
        why="shapes below a material are not drawn.",
        fix="move them out of the material.",
        example="a Cube below a Material.",
    ),
    _Validator("UV31", "shader-place", "usdShadeValidators:EncapsulationRulesValidator",
        "A shader or node graph is where it cannot be connected.",
        why="connections across such a border are invalid, and renderers ignore them.",
        fix="put it below the material or node graph.",
        example="a Shader below a Shader.",
    ),
    _Validator("UV32", "binding-not-applied",
        "usdShadeValidators:MaterialBindingApiAppliedValidator",
        "A binding lacks MaterialBindingAPI.",
        why="usd-core ignores such a binding: the prim has no material.",
        fix="apply MaterialBindingAPI to the prim.",
        example="`material:binding` on a Cube without the schema.",
    ),
    _Validator("UV33", "binding-collection",
        "usdShadeValidators:MaterialBindingCollectionValidator",
        "A material binding names an invalid collection.",
        why="the members of the collection have no material.",
        fix="target one collection and one material with the relationship.",
        example="`material:binding:collection:all` names a missing collection.",
    ),
    _Validator("UV34", "binding-no-relationship", "usdShadeValidators:MaterialBindingRelationships",
        "A material binding is not a relationship.",
        why="it binds nothing.",
        fix="delete the attribute, and bind the material again.",
        example="`token material:binding`.",
    ),
    _Validator("UV35", "normal-map", "usdShadeValidators:NormalMapTextureValidator",
        "The texture of a normal map is read as colour.",
        why="the normals are wrong, and so is the lighting of the surface. A missing texture is a "
        "note.",
        fix="set scale (2, 2, 2, 1), bias (-1, -1, -1, 0) and sourceColorSpace `raw` on the "
        "texture.",
        example="a UsdUVTexture feeds `inputs:normal` without scale and bias.",
    ),
    _Validator("UV36", "shader-inputs", "usdShadeValidators:ShaderSdrCompliance",
        "A shader input has another type than defined.",
        why="renderers use the default instead. usd-core does not know MDL shaders: for them it "
        "is a note.",
        fix="declare the input with the type that the message names.",
        example="`float inputs:diffuseColor` on a UsdPreviewSurface.",
    ),
    _Validator("UV37", "bound-subset", "usdShadeValidators:SubsetMaterialBindFamilyName",
        "A bound subset is not in the family `materialBind`.",
        why="renderers read materials only from subsets of that family.",
        fix="set `familyName` of the subset to `materialBind`.",
        example="a GeomSubset with `material:binding` and no family name.",
    ),
    _Validator("UV38", "bound-subset-family", "usdShadeValidators:SubsetsMaterialBindFamily",
        "Subsets that bind materials may overlap.",
        why="a face in two subsets has two materials, and which one applies is undefined.",
        fix="set the type of the family `materialBind` to `nonOverlapping` or `partition`.",
        example='`subsetFamily:materialBind:familyType = "unrestricted"`.',
    ),
    _Validator("UV40", "skeleton-not-applied", "usdSkelValidators:SkelBindingApiAppliedValidator",
        "A prim with a skeleton lacks SkelBindingAPI.",
        why="usd-core ignores the binding: the mesh does not move.",
        fix="apply SkelBindingAPI to the prim.",
        example="`skel:skeleton` on a Mesh without the schema.",
    ),
    _Validator("UV41", "skeleton-root", "usdSkelValidators:SkelBindingApiValidator",
        "A prim with SkelBindingAPI is below no SkelRoot.",
        why="it is never skinned.",
        fix="put the character below a SkelRoot.",
        example="a Mesh with SkelBindingAPI below an Xform.",
    ),
    _Validator("UV50", "light-place", "usdLuxValidators:EncapsulationRulesValidator",
        "A light or light filter is below a prim that cannot contain it.",
        why="its connections are invalid, and renderers may ignore it.",
        fix="move it below an Xform, a light or a light filter.",
        example="a DistantLight below a Shader.",
    ),
    _Validator("UV60", "authorship-pairs", "usdMediaValidators:AuthorshipInputsPaired",
        "Inputs of an authorship record are not pairs.",
        why="readers cannot tell names from values.",
        fix="write a name and a value for each input.",
        example="`authorship:step:inputs` has one element.",
    ),
    _Validator("UV61", "authorship-hidden", "usdMediaValidators:ShadowedOrDuplicateAuthorship",
        "A stronger layer hides an authorship record.",
        why="the composed prim does not show it.",
        fix="prepend the schema in the stronger layer instead of setting the whole list.",
        example='`apiSchemas = ["AuthorshipAPI:last"]` above a reference that has a record of its '
        "own.",
        severity="warning",
    ),
    _Validator("UV70", "missing-reference", "usdUtilsValidators:MissingReferenceValidator",
        "An asset of a layer or variant cannot be found.",
        why="the application may find it through servers, search paths and resolvers that "
        "usd-core does not have. Its content is not judged.",
        fix="open the stage in Isaac Sim, or copy the asset beside the stage; correct the path if "
        "it is wrong.",
        example="a texture on an Omniverse server.",
        severity="note",
    ),
    _Validator("UV71", "file-extension", "usdUtilsValidators:FileExtensionValidator",
        "A package contains a file of a forbidden kind.",
        why="viewers reject the package. Only .usdz files are examined.",
        fix="remove the file, or convert it to USD, PNG, JPEG, EXR or an allowed sound format.",
        example="`notes.txt` in a .usdz.",
    ),
    _Validator("UV72", "package-refers-outside", "usdUtilsValidators:PackageEncapsulationValidator",
        "A package refers to a file outside it.",
        why="the package works on this computer only. Only .usdz files are examined.",
        fix="put the file into the package.",
        example="the root layer of a .usdz refers to `/home/me/robot.usd`.",
        severity="warning",
    ),
    _Validator("UV73", "root-package", "usdUtilsValidators:RootPackageValidator",
        "Files of the package are compressed, encrypted or unaligned.",
        why="readers map packages into memory and cannot read such files. Only .usdz files are "
        "examined.",
        fix="pack it again with a tool for .usdz, not with an ordinary zip program.",
        example="a .usdz made by `zip`.",
    ),
    _Validator("UV74", "package-in-use", "usdUtilsValidators:UsdzPackageValidator",
        "A package in use is compressed, encrypted or unaligned.",
        why="readers map packages into memory and cannot read such files.",
        fix="pack it again with a tool for .usdz, not with an ordinary zip program.",
        example="a stage refers to a .usdz made by `zip`.",
    ),
    _Validator("UV99", "other-validator", "",
        "A validator of a newer usd-core reported a fault.",
        why="this usd-core has validators that this program does not know. The message begins "
        "with the name.",
        fix="see OpenUSD's documentation of the validator that the message names.",
        example="the installed usd-core has one validator more than the table of `lab3 rules`.",
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
                message = error.message if row.validator else f"{error.validator}: {error.message}"
                yield Problem(error.prim, message, error.property, severity=severity)

    check.__name__ = check.__qualname__ = row.name.replace("-", "_")
    named = f" OpenUSD's validator: `{row.validator}`." if row.validator else ""
    paragraphs = (row.what, f"Why: {row.why}{named}", f"Fix: {row.fix}", f"Example: {row.example}")
    check.__doc__ = "\n\n".join(paragraphs)
    return check


for _row in _TABLE:
    rule(_row.id, _row.name, scope="native", severity=_row.severity)(_forwarding(_row))
