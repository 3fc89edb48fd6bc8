"""OpenUSD's validators of materials and shaders."""

from __future__ import annotations

from collections.abc import Iterator

from lab3_usd.check.registry import rule
from lab3_usd.model.finding import Problem
from lab3_usd.model.native import NativeErrors


@rule("UV30", "material-contents", scope="native")
def material_contents(subject: NativeErrors) -> Iterator[Problem]:
    """A material holds prims that are no shaders.

    Why: shapes below a material are not drawn. OpenUSD's validator:
    `usdShadeValidators:EncapsulationMaterialValidator`.

    Fix: move them out of the material.

    Example: a Cube below a Material.
    """
    yield from subject.problems("UV30")


@rule("UV31", "shader-place", scope="native")
def shader_place(subject: NativeErrors) -> Iterator[Problem]:
    """A shader or node graph stands where it cannot be connected.

    Why: connections across such a border are not valid, and renderers leave them out. OpenUSD's
    validator: `usdShadeValidators:EncapsulationRulesValidator`.

    Fix: put it below the material or node graph.

    Example: a Shader below a Shader.
    """
    yield from subject.problems("UV31")


@rule("UV32", "binding-not-applied", scope="native")
def binding_not_applied(subject: NativeErrors) -> Iterator[Problem]:
    """A prim binds a material without MaterialBindingAPI.

    Why: usd-core ignores such a binding: the prim has no material. OpenUSD's validator:
    `usdShadeValidators:MaterialBindingApiAppliedValidator`.

    Fix: apply MaterialBindingAPI to the prim.

    Example: `material:binding` on a Cube without the schema.
    """
    yield from subject.problems("UV32")


@rule("UV33", "binding-collection", scope="native")
def binding_collection(subject: NativeErrors) -> Iterator[Problem]:
    """A material is bound to a collection that is not one.

    Why: the members of the collection have no material. OpenUSD's validator:
    `usdShadeValidators:MaterialBindingCollectionValidator`.

    Fix: let the relationship name one collection and one material.

    Example: `material:binding:collection:all` names a collection that is not there.
    """
    yield from subject.problems("UV33")


@rule("UV34", "binding-no-relationship", scope="native")
def binding_no_relationship(subject: NativeErrors) -> Iterator[Problem]:
    """A property with the name of a material binding is no relationship.

    Why: it binds nothing. OpenUSD's validator:
    `usdShadeValidators:MaterialBindingRelationships`.

    Fix: delete the attribute, and bind the material again.

    Example: `token material:binding`.
    """
    yield from subject.problems("UV34")


@rule("UV35", "normal-map", scope="native")
def normal_map(subject: NativeErrors) -> Iterator[Problem]:
    """The picture of a normal map is read as a colour.

    Why: the normals are bent, and the surface is lit wrongly. A picture that cannot be found
    from here is a note. OpenUSD's validator: `usdShadeValidators:NormalMapTextureValidator`.

    Fix: set scale (2, 2, 2, 1), bias (-1, -1, -1, 0) and sourceColorSpace `raw` on the texture.

    Example: a UsdUVTexture feeds `inputs:normal` without scale and bias.
    """
    yield from subject.problems("UV35")


@rule("UV36", "shader-inputs", scope="native")
def shader_inputs(subject: NativeErrors) -> Iterator[Problem]:
    """The input of a shader has another type than the shader asks for.

    Why: renderers use the default instead. usd-core has no MDL: that it does not know such a
    shader is a note. OpenUSD's validator: `usdShadeValidators:ShaderSdrCompliance`.

    Fix: declare the input with the type that the message names.

    Example: `float inputs:diffuseColor` on a UsdPreviewSurface.
    """
    yield from subject.problems("UV36")


@rule("UV37", "bound-subset", scope="native")
def bound_subset(subject: NativeErrors) -> Iterator[Problem]:
    """A subset binds a material and is not of the family `materialBind`.

    Why: renderers ask only subsets of that family for materials. OpenUSD's validator:
    `usdShadeValidators:SubsetMaterialBindFamilyName`.

    Fix: set `familyName` of the subset to `materialBind`.

    Example: a GeomSubset with `material:binding` and no family name.
    """
    yield from subject.problems("UV37")


@rule("UV38", "bound-subset-family", scope="native")
def bound_subset_family(subject: NativeErrors) -> Iterator[Problem]:
    """Subsets that bind materials may overlap.

    Why: a face in two subsets has two materials, and nobody says which counts. OpenUSD's
    validator: `usdShadeValidators:SubsetsMaterialBindFamily`.

    Fix: set the type of the family `materialBind` to `nonOverlapping` or `partition`.

    Example: `subsetFamily:materialBind:familyType = "unrestricted"`.
    """
    yield from subject.problems("UV38")
