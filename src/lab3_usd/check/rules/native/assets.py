"""OpenUSD's validators of skeletons, lights, authorship and files."""

from __future__ import annotations

from collections.abc import Iterator

from lab3_usd.check.registry import rule
from lab3_usd.model.finding import Problem
from lab3_usd.model.native import NativeErrors


@rule("UV40", "skeleton-not-applied", scope="native")
def skeleton_not_applied(subject: NativeErrors) -> Iterator[Problem]:
    """A prim names a skeleton without SkelBindingAPI.

    Why: usd-core ignores the binding: the mesh does not move. OpenUSD's validator:
    `usdSkelValidators:SkelBindingApiAppliedValidator`.

    Fix: apply SkelBindingAPI to the prim.

    Example: `skel:skeleton` on a Mesh without the schema.
    """
    yield from subject.problems("UV40")


@rule("UV41", "skeleton-root", scope="native")
def skeleton_root(subject: NativeErrors) -> Iterator[Problem]:
    """A prim with SkelBindingAPI is not below a SkelRoot.

    Why: it is never skinned. OpenUSD's validator: `usdSkelValidators:SkelBindingApiValidator`.

    Fix: put the character below a SkelRoot.

    Example: a Mesh with SkelBindingAPI below an Xform.
    """
    yield from subject.problems("UV41")


@rule("UV50", "light-place", scope="native")
def light_place(subject: NativeErrors) -> Iterator[Problem]:
    """A light or light filter stands below a prim that cannot hold it.

    Why: its connections are not valid, and renderers may leave it out. OpenUSD's validator:
    `usdLuxValidators:EncapsulationRulesValidator`.

    Fix: move it below an Xform, a light or a light filter.

    Example: a DistantLight below a Shader.
    """
    yield from subject.problems("UV50")


@rule("UV60", "authorship-pairs", scope="native")
def authorship_pairs(subject: NativeErrors) -> Iterator[Problem]:
    """The inputs of an authorship record are no pairs of name and value.

    Why: readers cannot tell names from values. OpenUSD's validator:
    `usdMediaValidators:AuthorshipInputsPaired`.

    Fix: write a name and a value for each input.

    Example: `authorship:step:inputs` has one element.
    """
    yield from subject.problems("UV60")


@rule("UV61", "authorship-hidden", scope="native", severity="warning")
def authorship_hidden(subject: NativeErrors) -> Iterator[Problem]:
    """An authorship record is hidden by a stronger layer.

    Why: the composed prim does not tell of it. OpenUSD's validator:
    `usdMediaValidators:ShadowedOrDuplicateAuthorship`.

    Fix: prepend the schema in the stronger layer instead of setting the whole list.

    Example: `apiSchemas = ["AuthorshipAPI:last"]` above a reference that has a record of its
    own.
    """
    yield from subject.problems("UV61")


@rule("UV70", "missing-reference", scope="native", severity="note")
def missing_reference(subject: NativeErrors) -> Iterator[Problem]:
    """An asset that some layer or variant names cannot be found from here.

    Why: the application may have it, by its servers, search paths and resolvers, which usd-core
    has not. What it would bring is not judged. OpenUSD's validator:
    `usdUtilsValidators:MissingReferenceValidator`.

    Fix: open the stage in Isaac Sim, or copy the asset beside the stage; correct the path where
    it is wrong.

    Example: a texture on an Omniverse server.
    """
    yield from subject.problems("UV70")


@rule("UV71", "file-extension", scope="native")
def file_extension(subject: NativeErrors) -> Iterator[Problem]:
    """A package holds a file of a kind that packages may not hold.

    Why: viewers of packages refuse it. Asked of .usdz files only. OpenUSD's validator:
    `usdUtilsValidators:FileExtensionValidator`.

    Fix: leave the file out, or convert it to USD, PNG, JPEG, EXR or a sound file that is
    allowed.

    Example: `notes.txt` in a .usdz.
    """
    yield from subject.problems("UV71")


@rule("UV72", "package-refers-outside", scope="native", severity="warning")
def package_refers_outside(subject: NativeErrors) -> Iterator[Problem]:
    """A package refers to a file outside it.

    Why: the package works on this computer only. Asked of .usdz files only. OpenUSD's
    validator: `usdUtilsValidators:PackageEncapsulationValidator`.

    Fix: put the file into the package.

    Example: the root layer of a .usdz refers to `/home/me/robot.usd`.
    """
    yield from subject.problems("UV72")


@rule("UV73", "root-package", scope="native")
def root_package(subject: NativeErrors) -> Iterator[Problem]:
    """Files of the package are compressed, encrypted, or not aligned to 64 bytes.

    Why: readers map packages into memory as they are, and cannot read such files. Asked of
    .usdz files only. OpenUSD's validator: `usdUtilsValidators:RootPackageValidator`.

    Fix: pack it again by a tool for .usdz, and not by a common zip program.

    Example: a .usdz made by `zip`.
    """
    yield from subject.problems("UV73")


@rule("UV74", "package-in-use", scope="native")
def package_in_use(subject: NativeErrors) -> Iterator[Problem]:
    """A package that the stage uses is compressed, encrypted, or not aligned to 64 bytes.

    Why: readers map packages into memory as they are, and cannot read such files. OpenUSD's
    validator: `usdUtilsValidators:UsdzPackageValidator`.

    Fix: pack it again by a tool for .usdz, and not by a common zip program.

    Example: a stage refers to a .usdz made by `zip`.
    """
    yield from subject.problems("UV74")
