"""What OpenUSD's own validators find, one rule for each of them (`--native`)."""

from __future__ import annotations

from collections.abc import Iterator

from lab3_usd.check.registry import rule
from lab3_usd.model.finding import Problem, Severity
from lab3_usd.model.native import NativeErrors

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


def rule_of(validator: str) -> str:
    """Return the rule that a validator is: `OTHER` for one of a newer usd-core."""
    return next((rule for rule, name in VALIDATORS.items() if name == validator), OTHER)


def _problems(subject: NativeErrors, rule_id: str) -> Iterator[Problem]:
    """Yield what the validator of a rule says; for `OTHER`, what all unknown ones say."""
    for error in subject.errors:
        if rule_of(error.validator) == rule_id:
            severity: Severity = "note" if error.may_be_defined_elsewhere else error.severity
            message = error.message if rule_id != OTHER else f"{error.validator}: {error.message}"
            yield Problem(error.prim, message, property=error.property, severity=severity)


@rule("UV01", "composition-error", scope="native")
def composition_error(subject: NativeErrors) -> Iterator[Problem]:
    """OpenUSD reports errors when it composes the stage.

    Why: the content of an arc is missing, and the application shows the rest without a message. A
    missing asset is a note: the application may have it. OpenUSD's validator:
    `usdValidation:CompositionErrorTest`.

    Fix: follow the paths in the message; correct the reference, payload or sublayer in the layer it
    names.

    Example: a prim refers to a prim below itself.
    """
    yield from _problems(subject, "UV01")


@rule("UV02", "attribute-of-another-type", scope="native")
def attribute_of_another_type(subject: NativeErrors) -> Iterator[Problem]:
    """An attribute has another type than its schema.

    Why: readers that expect the type of the schema use the default. Only schemas of usd-core are
    compared; those of Isaac Sim, PhysX and OmniGraph are unknown to it. OpenUSD's validator:
    `usdValidation:AttributeTypeMismatch`.

    Fix: declare the attribute with the type that the message names.

    Example: `token physics:gravityDirection` on a physics scene, where a `vector3f` belongs.
    """
    yield from _problems(subject, "UV02")


@rule("UV03", "no-default-prim", scope="native")
def no_default_prim(subject: NativeErrors) -> Iterator[Problem]:
    """The stage has no valid default prim.

    Why: a reference to the file without a prim path brings nothing. OpenUSD's validator:
    `usdValidation:StageMetadataChecker`.

    Fix: make the top prim of the stage the default prim, in the Stage panel or as `defaultPrim` in
    the first lines of the file.

    Example: `defaultPrim` is missing.
    """
    yield from _problems(subject, "UV03")


@rule("UV99", "other-validator", scope="native")
def other_validator(subject: NativeErrors) -> Iterator[Problem]:
    """A validator of a newer usd-core reported a fault.

    Why: this usd-core has validators that this program does not know. The message begins with the
    name.

    Fix: see OpenUSD's documentation of the validator that the message names.

    Example: the installed usd-core has one validator more than the table of `lab3 rules`.
    """
    yield from _problems(subject, "UV99")


@rule("UV10", "no-units", scope="native")
def no_units(subject: NativeErrors) -> Iterator[Problem]:
    """The stage has no units or no up axis.

    Why: readers assume centimetres and Y up, so a robot in metres is a hundredth of its size.
    OpenUSD's validator: `usdGeomValidators:StageMetadataChecker`.

    Fix: write `metersPerUnit` and `upAxis` in the first lines of the file, with the values that the
    stage was made with.

    Example: `upAxis` is missing.
    """
    yield from _problems(subject, "UV10")


@rule("UV11", "nested-shapes", scope="native")
def nested_shapes(subject: NativeErrors) -> Iterator[Problem]:
    """A shape is below another shape.

    Why: renderers and physics may skip the inner one: a gprim must be a leaf. OpenUSD's validator:
    `usdGeomValidators:EncapsulationChecker`.

    Fix: put an Xform above both.

    Example: a Sphere below a Cube.
    """
    yield from _problems(subject, "UV11")


@rule("UV12", "subset-family", scope="native")
def subset_family(subject: NativeErrors) -> Iterator[Problem]:
    """Subsets of a mesh contradict the type of their family.

    Why: in a partition each face belongs to one subset. Faces in none or in two have no clear
    material. OpenUSD's validator: `usdGeomValidators:SubsetFamilies`.

    Fix: correct the indices, or the type of the family.

    Example: a family of type `partition` leaves out a face.
    """
    yield from _problems(subject, "UV12")


@rule("UV13", "subset-without-mesh", scope="native")
def subset_without_mesh(subject: NativeErrors) -> Iterator[Problem]:
    """A geometry subset is not directly below a shape.

    Why: it is a subset of nothing and has no effect. OpenUSD's validator:
    `usdGeomValidators:SubsetParentIsImageable`.

    Fix: move it below its mesh.

    Example: a GeomSubset below a prim without a type.
    """
    yield from _problems(subject, "UV13")


@rule("UV20", "body-that-cannot-move", scope="native")
def body_that_cannot_move(subject: NativeErrors) -> Iterator[Problem]:
    """Physics cannot move the prim of a rigid body.

    Why: the body stays where it is, or falls out of the simulation. OpenUSD's validator:
    `usdPhysicsValidators:RigidBodyChecker`.

    Fix: apply the schema to an Xform or a shape that is neither below an instance nor scaled with a
    rotation of its own.

    Example: PhysicsRigidBodyAPI on a Scope.
    """
    yield from _problems(subject, "UV20")


@rule("UV21", "collider-shape", scope="native")
def collider_shape(subject: NativeErrors) -> Iterator[Problem]:
    """Physics does not support the shape or scale of a collider.

    Why: the engine uses another shape, or none. OpenUSD's validator:
    `usdPhysicsValidators:ColliderChecker`.

    Fix: scale spheres, capsules and cones equally in all directions, or use a mesh.

    Example: a Sphere scaled by (1, 2, 3) with PhysicsCollisionAPI.
    """
    yield from _problems(subject, "UV21")


@rule("UV22", "articulation-in-another", scope="native")
def articulation_in_another(subject: NativeErrors) -> Iterator[Problem]:
    """An articulation root is below another, or does not move.

    Why: the engine keeps one articulation, and a controller of the other finds nothing. OpenUSD's
    validator: `usdPhysicsValidators:ArticulationChecker`.

    Fix: leave PhysicsArticulationRootAPI on one prim of the robot.

    Example: robot and gripper both have an articulation root.
    """
    yield from _problems(subject, "UV22")


@rule("UV23", "joint-without-bodies", scope="native")
def joint_without_bodies(subject: NativeErrors) -> Iterator[Problem]:
    """A joint does not connect bodies.

    Why: the engine ignores it. OpenUSD's validator: `usdPhysicsValidators:PhysicsJointChecker`.

    Fix: choose the bodies of the joint again; at least one must be an enabled rigid body.

    Example: `physics:body0` names an Xform without PhysicsRigidBodyAPI.
    """
    yield from _problems(subject, "UV23")


@rule("UV30", "material-contents", scope="native")
def material_contents(subject: NativeErrors) -> Iterator[Problem]:
    """A material contains other prims than shaders.

    Why: shapes below a material are not drawn. OpenUSD's validator:
    `usdShadeValidators:EncapsulationMaterialValidator`.

    Fix: move them out of the material.

    Example: a Cube below a Material.
    """
    yield from _problems(subject, "UV30")


@rule("UV31", "shader-place", scope="native")
def shader_place(subject: NativeErrors) -> Iterator[Problem]:
    """A shader or node graph is where it cannot be connected.

    Why: connections across such a border are invalid, and renderers ignore them. OpenUSD's
    validator: `usdShadeValidators:EncapsulationRulesValidator`.

    Fix: put it below the material or node graph.

    Example: a Shader below a Shader.
    """
    yield from _problems(subject, "UV31")


@rule("UV32", "binding-not-applied", scope="native")
def binding_not_applied(subject: NativeErrors) -> Iterator[Problem]:
    """A binding lacks MaterialBindingAPI.

    Why: usd-core ignores such a binding: the prim has no material. OpenUSD's validator:
    `usdShadeValidators:MaterialBindingApiAppliedValidator`.

    Fix: apply MaterialBindingAPI to the prim.

    Example: `material:binding` on a Cube without the schema.
    """
    yield from _problems(subject, "UV32")


@rule("UV33", "binding-collection", scope="native")
def binding_collection(subject: NativeErrors) -> Iterator[Problem]:
    """A material binding names an invalid collection.

    Why: the members of the collection have no material. OpenUSD's validator:
    `usdShadeValidators:MaterialBindingCollectionValidator`.

    Fix: target one collection and one material with the relationship.

    Example: `material:binding:collection:all` names a missing collection.
    """
    yield from _problems(subject, "UV33")


@rule("UV34", "binding-no-relationship", scope="native")
def binding_no_relationship(subject: NativeErrors) -> Iterator[Problem]:
    """A material binding is not a relationship.

    Why: it binds nothing. OpenUSD's validator: `usdShadeValidators:MaterialBindingRelationships`.

    Fix: delete the attribute, and bind the material again.

    Example: `token material:binding`.
    """
    yield from _problems(subject, "UV34")


@rule("UV35", "normal-map", scope="native")
def normal_map(subject: NativeErrors) -> Iterator[Problem]:
    """The texture of a normal map is read as colour.

    Why: the normals are wrong, and so is the lighting of the surface. A missing texture is a note.
    OpenUSD's validator: `usdShadeValidators:NormalMapTextureValidator`.

    Fix: set scale (2, 2, 2, 1), bias (-1, -1, -1, 0) and sourceColorSpace `raw` on the texture.

    Example: a UsdUVTexture feeds `inputs:normal` without scale and bias.
    """
    yield from _problems(subject, "UV35")


@rule("UV36", "shader-inputs", scope="native")
def shader_inputs(subject: NativeErrors) -> Iterator[Problem]:
    """A shader input has another type than defined.

    Why: renderers use the default instead. usd-core does not know MDL shaders: for them it is a
    note. OpenUSD's validator: `usdShadeValidators:ShaderSdrCompliance`.

    Fix: declare the input with the type that the message names.

    Example: `float inputs:diffuseColor` on a UsdPreviewSurface.
    """
    yield from _problems(subject, "UV36")


@rule("UV37", "bound-subset", scope="native")
def bound_subset(subject: NativeErrors) -> Iterator[Problem]:
    """A bound subset is not in the family `materialBind`.

    Why: renderers read materials only from subsets of that family. OpenUSD's validator:
    `usdShadeValidators:SubsetMaterialBindFamilyName`.

    Fix: set `familyName` of the subset to `materialBind`.

    Example: a GeomSubset with `material:binding` and no family name.
    """
    yield from _problems(subject, "UV37")


@rule("UV38", "bound-subset-family", scope="native")
def bound_subset_family(subject: NativeErrors) -> Iterator[Problem]:
    """Subsets that bind materials may overlap.

    Why: a face in two subsets has two materials, and which one applies is undefined. OpenUSD's
    validator: `usdShadeValidators:SubsetsMaterialBindFamily`.

    Fix: set the type of the family `materialBind` to `nonOverlapping` or `partition`.

    Example: `subsetFamily:materialBind:familyType = "unrestricted"`.
    """
    yield from _problems(subject, "UV38")


@rule("UV40", "skeleton-not-applied", scope="native")
def skeleton_not_applied(subject: NativeErrors) -> Iterator[Problem]:
    """A prim with a skeleton lacks SkelBindingAPI.

    Why: usd-core ignores the binding: the mesh does not move. OpenUSD's validator:
    `usdSkelValidators:SkelBindingApiAppliedValidator`.

    Fix: apply SkelBindingAPI to the prim.

    Example: `skel:skeleton` on a Mesh without the schema.
    """
    yield from _problems(subject, "UV40")


@rule("UV41", "skeleton-root", scope="native")
def skeleton_root(subject: NativeErrors) -> Iterator[Problem]:
    """A prim with SkelBindingAPI is below no SkelRoot.

    Why: it is never skinned. OpenUSD's validator: `usdSkelValidators:SkelBindingApiValidator`.

    Fix: put the character below a SkelRoot.

    Example: a Mesh with SkelBindingAPI below an Xform.
    """
    yield from _problems(subject, "UV41")


@rule("UV50", "light-place", scope="native")
def light_place(subject: NativeErrors) -> Iterator[Problem]:
    """A light or light filter is below a prim that cannot contain it.

    Why: its connections are invalid, and renderers may ignore it. OpenUSD's validator:
    `usdLuxValidators:EncapsulationRulesValidator`.

    Fix: move it below an Xform, a light or a light filter.

    Example: a DistantLight below a Shader.
    """
    yield from _problems(subject, "UV50")


@rule("UV60", "authorship-pairs", scope="native")
def authorship_pairs(subject: NativeErrors) -> Iterator[Problem]:
    """Inputs of an authorship record are not pairs.

    Why: readers cannot tell names from values. OpenUSD's validator:
    `usdMediaValidators:AuthorshipInputsPaired`.

    Fix: write a name and a value for each input.

    Example: `authorship:step:inputs` has one element.
    """
    yield from _problems(subject, "UV60")


@rule("UV61", "authorship-hidden", scope="native", severity="warning")
def authorship_hidden(subject: NativeErrors) -> Iterator[Problem]:
    """A stronger layer hides an authorship record.

    Why: the composed prim does not show it. OpenUSD's validator:
    `usdMediaValidators:ShadowedOrDuplicateAuthorship`.

    Fix: prepend the schema in the stronger layer instead of setting the whole list.

    Example: `apiSchemas = ["AuthorshipAPI:last"]` above a reference that has a record of its own.
    """
    yield from _problems(subject, "UV61")


@rule("UV70", "missing-reference", scope="native", severity="note")
def missing_reference(subject: NativeErrors) -> Iterator[Problem]:
    """An asset of a layer or variant cannot be found.

    Why: the application may find it through servers, search paths and resolvers that usd-core does
    not have. Its content is not judged. OpenUSD's validator:
    `usdUtilsValidators:MissingReferenceValidator`.

    Fix: open the stage in Isaac Sim, or copy the asset beside the stage; correct the path if it is
    wrong.

    Example: a texture on an Omniverse server.
    """
    yield from _problems(subject, "UV70")


@rule("UV71", "file-extension", scope="native")
def file_extension(subject: NativeErrors) -> Iterator[Problem]:
    """A package contains a file of a forbidden kind.

    Why: viewers reject the package. Only .usdz files are examined. OpenUSD's validator:
    `usdUtilsValidators:FileExtensionValidator`.

    Fix: remove the file, or convert it to USD, PNG, JPEG, EXR or an allowed sound format.

    Example: `notes.txt` in a .usdz.
    """
    yield from _problems(subject, "UV71")


@rule("UV72", "package-refers-outside", scope="native", severity="warning")
def package_refers_outside(subject: NativeErrors) -> Iterator[Problem]:
    """A package refers to a file outside it.

    Why: the package works on this computer only. Only .usdz files are examined. OpenUSD's
    validator: `usdUtilsValidators:PackageEncapsulationValidator`.

    Fix: put the file into the package.

    Example: the root layer of a .usdz refers to `/home/me/robot.usd`.
    """
    yield from _problems(subject, "UV72")


@rule("UV73", "root-package", scope="native")
def root_package(subject: NativeErrors) -> Iterator[Problem]:
    """Files of the package are compressed, encrypted or unaligned.

    Why: readers map packages into memory and cannot read such files. Only .usdz files are examined.
    OpenUSD's validator: `usdUtilsValidators:RootPackageValidator`.

    Fix: pack it again with a tool for .usdz, not with an ordinary zip program.

    Example: a .usdz made by `zip`.
    """
    yield from _problems(subject, "UV73")


@rule("UV74", "package-in-use", scope="native")
def package_in_use(subject: NativeErrors) -> Iterator[Problem]:
    """A package in use is compressed, encrypted or unaligned.

    Why: readers map packages into memory and cannot read such files. OpenUSD's validator:
    `usdUtilsValidators:UsdzPackageValidator`.

    Fix: pack it again with a tool for .usdz, not with an ordinary zip program.

    Example: a stage refers to a .usdz made by `zip`.
    """
    yield from _problems(subject, "UV74")
