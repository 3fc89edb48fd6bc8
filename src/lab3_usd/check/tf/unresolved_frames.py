"""Target prims whose frames are unknown, because an asset is missing."""

from __future__ import annotations

from collections.abc import Iterator

from msgspec import Struct

from lab3_usd.check.tf.link_tree import FRAME_APIS
from lab3_usd.model.absent_prims import is_unresolved
from lab3_usd.model.paths import is_at_or_below
from lab3_usd.model.physics import BODY_API
from lab3_usd.model.prims import Prim
from lab3_usd.model.stage import StageModel

_SAYS_NOTHING = frozenset({"", "Xform", "Scope"})  # types that a robot may have


class UnresolvedFrames(Struct, frozen=True):
    """Frames that only a missing asset could tell: those of a prim, or of the links at and below.

    `parent` is the frame below which they would hang, `publisher` the node that would send them
    and `cause` the one whose target `prim` is.
    """

    prim: str
    links: bool
    asset: str
    parent: str = ""
    publisher: str = ""
    cause: str = ""
    topic: str = ""

    @property
    def what(self) -> str:
        """What cannot be known, in words."""
        return f"{'links' if self.links else 'frame'} of {self.prim}"

    def may_be(self, frame: str) -> bool:
        """Whether a frame of this name could be among them."""
        return self.links or _name(self.prim) == frame

    def may_give(self, prim: str) -> bool:
        """Whether the frame of this prim could be among them."""
        return is_at_or_below(prim, self.prim) or _name(prim) == _name(self.prim)


def _name(path: str) -> str:
    return path.rpartition("/")[2]


def is_target_unresolved(target: str, stage: StageModel) -> bool:
    """Whether a missing asset holds the target, or what the target stands for.

    What the stage defines itself it also names: a link or a sensor stays what it is.
    """
    if not is_unresolved(stage, target):
        return False
    prim = stage.prim(target)
    return prim is None or (_carries_asset(prim, stage) and not _says_what_it_is(prim))


def _carries_asset(prim: Prim, stage: StageModel) -> bool:
    return any(missing.prim == prim.path for missing in stage.unresolved)


def _says_what_it_is(prim: Prim) -> bool:
    return prim.type not in _SAYS_NOTHING or bool(set(prim.apis) & {BODY_API, *FRAME_APIS})


def unresolved_frames_at(
    target: str, stage: StageModel, *, expands: bool
) -> Iterator[UnresolvedFrames]:
    """Yield what is unknown of a target; below one that stands for its links there may be more."""
    missing = stage.unresolved_above(target)
    if missing is not None and is_target_unresolved(target, stage):
        yield UnresolvedFrames(target, links=stage.prim(target) is not None, asset=missing.asset)
    elif expands:
        for below in stage.unresolved:
            if is_at_or_below(below.prim, target) and is_unresolved(stage, below.prim):
                yield UnresolvedFrames(below.prim, links=True, asset=below.asset)
