"""One requirement of the scene, and whether a stage meets it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from msgspec import Struct

from lab3_usd.check.scene.pose_errors import ORDER
from lab3_usd.model.finding import Finding
from lab3_usd.model.paths import is_at_or_below
from lab3_usd.model.physics import BODY_ENABLED
from lab3_usd.spec.scene import PoseSpec

POSE = {
    "translate": ("position", "xformOp:translate"),
    "rotate": ("rotation", "xformOp:orient"),
    "scale": ("scale", "xformOp:scale"),
}
_ROTATE = "xformOp:rotate"
# What tells as well that a part of a pose is wrong: a prim that does not follow its parent.
_ALSO = {"translate": (ORDER, BODY_ENABLED), "rotate": (_ROTATE,)}
# A prim that one of these rules finds missing meets nothing that is asked of it or below it.
_MISSING = ("S01", "S07", "L01", "L03", "C01", "C03", "D01", "D03")


class SceneItem(Struct, frozen=True):
    """One thing asked of the scene.

    `prim` and `property` are the site at which `rules` report it; `also` are other properties that
    may be named instead. Where the thing stands elsewhere, a finding relates to `prim`; `anywhere`
    says that any finding of the rules counts.
    """

    id: str
    group: str
    title: str
    prim: str
    property: str | None
    handout: str
    rules: tuple[str, ...]
    also: tuple[str, ...] = ()
    anywhere: bool = False


def is_met(item: SceneItem, findings: Iterable[Finding]) -> bool:
    """Whether no error says that the item, or the prim that carries it, is missing or wrong."""
    return not any(_concerns(item, found) for found in findings if found.severity == "error")


def _concerns(item: SceneItem, found: Finding) -> bool:
    prims = (found.prim, *(each.partition(".")[0] for each in found.related))
    if found.rule in item.rules and (item.anywhere or item.prim in prims):
        is_site = item.anywhere or found.property == item.property
        return is_site or _is_other_name(item, found.property)
    # What stands elsewhere relates to the place where it is expected, and is not gone.
    is_elsewhere = found.expected in found.related
    is_gone = found.rule in _MISSING and found.property is None and not is_elsewhere
    return is_gone and is_at_or_below(item.prim, found.prim)


def _is_other_name(item: SceneItem, name: str | None) -> bool:
    return name is not None and name.startswith(item.also) if item.also else False


def pose_items(
    group: str, path: str, pose: PoseSpec, rules: Mapping[str, tuple[str, ...]]
) -> Iterator[SceneItem]:
    """Yield position, rotation and scale of a prim; `rules` says which rules judge each."""
    for kind, (word, where) in POSE.items():
        title = f"{path.rpartition('/')[2]}: {word} {getattr(pose, kind)}"
        also = (where, *_ALSO.get(kind, ()))
        yield SceneItem(
            f"{group}/{word}", group, title, path, where, pose.handout, rules[kind], also
        )
