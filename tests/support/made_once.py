"""What many tests make alike is made once: parsed YAML, platforms, starters, judged stages."""

from __future__ import annotations

import hashlib
import pickle
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path
from typing import Any
from unittest.mock import patch

import yaml
from pxr import Sdf, Ts, Usd

from lab3_usd.check.checker import judge
from lab3_usd.check.registry import all_rules
from lab3_usd.check.rule_runs import RuleResults
from lab3_usd.fix import repairing
from lab3_usd.isaac.load import platform
from lab3_usd.isaac.platform import Platform
from lab3_usd.spec.lab import SCENE, STARTER, Checkpoint, Lab
from lab3_usd.stage.read import properties
from lab3_usd.stage.read.stage_reader import read_model
from lab3_usd.stage.write import builder

LOAD = yaml.load


@contextmanager
def yaml_parsed_once() -> Iterator[None]:
    """Let whoever reads a text that was read before have a copy of what it said."""
    with patch.object(yaml, "load", _load):
        yield


def _load(stream: Any, Loader: Any) -> Any:  # noqa: N803 - PyYAML's name
    is_text = isinstance(stream, (bytes, str))
    return pickle.loads(_copied(stream, Loader)) if is_text else LOAD(stream, Loader)  # noqa: S301


@lru_cache(maxsize=256)
def _copied(text: bytes | str, loader: Any) -> bytes:
    return pickle.dumps(LOAD(text, loader))


ASSEMBLE = platform.assemble_platform
_PLATFORMS: dict[tuple[str, bytes], Platform] = {}


@contextmanager
def platform_assembled_once() -> Iterator[None]:
    """Let whoever reads files that were read before have the platform that they describe."""
    with patch.object(platform, "assemble_platform", _assembled):
        yield


def _assembled(folder: Path) -> Platform:
    digest = hashlib.sha256()
    for path in sorted(path for path in folder.rglob("*") if path.is_file()):
        digest.update(path.name.encode() + b"\0")
        digest.update(hashlib.sha256(path.read_bytes()).digest())
    key = (folder.name, digest.digest())
    if key not in _PLATFORMS:
        _PLATFORMS[key] = ASSEMBLE(folder)
    return _PLATFORMS[key]


MAKE = builder.starter_layer
_STARTERS: dict[tuple[bytes, ...], Sdf.Layer] = {}


@contextmanager
def starter_made_once() -> Iterator[None]:
    """Let whoever builds on one have the layer that was made before."""
    with patch.object(builder, "starter_layer", _layer):
        yield


def _layer(folder: Path) -> Sdf.Layer:
    files = [folder / STARTER, folder / SCENE]
    if not all(file.is_file() for file in files):
        return MAKE(folder)
    key = tuple(file.read_bytes() for file in files)
    if key not in _STARTERS:
        layer = MAKE(folder)
        layer.SetPermissionToEdit(False)  # noqa: FBT003 - pxr takes no keyword
        _STARTERS[key] = layer
    return _STARTERS[key]


COPY = "copy.usdc"  # how the identifiers of copies end
MAY_HAVE, SET = properties._may_have_splines, Usd.Attribute.SetSpline
_WITH_SPLINES: set[str] = set()  # identifiers; that of a layer that is gone may come again


@contextmanager
def splines_noted() -> Iterator[None]:
    """Note who sets splines, and look through no copy in which nobody did."""
    with (
        patch.object(properties, "_may_have_splines", _may_have),
        patch.object(Usd.Attribute, "SetSpline", _set),
    ):
        yield


def copy_of(layer: Sdf.Layer) -> Sdf.Layer:
    """Copy a layer in memory, which takes a third of the time where it is binary."""
    copy = Sdf.Layer.CreateAnonymous(COPY)
    copy.TransferContent(layer)
    if layer.identifier in _WITH_SPLINES or not layer.anonymous:
        _WITH_SPLINES.add(copy.identifier)
    return copy


def _may_have(layer: Sdf.Layer) -> bool:
    is_copy = layer.anonymous and layer.identifier.endswith(COPY)
    return layer.identifier in _WITH_SPLINES if is_copy else MAY_HAVE(layer)


def _set(attribute: Usd.Attribute, spline: Ts.Spline) -> bool:
    _WITH_SPLINES.add(attribute.GetStage().GetEditTarget().GetLayer().identifier)
    done: bool = SET(attribute, spline)
    return done


_USUAL = tuple(all_rules())
_JUDGED: dict[tuple[str, str], tuple[Lab, RuleResults]] = {}


@contextmanager
def judged_once() -> Iterator[None]:
    """Let repairs have the judgement of a stage that was equal; a test's own rules are asked."""
    with patch.multiple(repairing, read_model=_Unread, judge=_judged):
        yield


class _Unread:
    """A stage that is read where nobody knows how it was judged."""

    def __init__(self, stage: Usd.Stage, platform: Platform, name: str) -> None:
        self.stage, self.platform, self.name = stage, platform, name

    def read(self) -> Any:
        return read_model(self.stage, self.platform, self.name)


def _judged(lab: Lab, checkpoint: Checkpoint, unread: _Unread) -> RuleResults:
    content = _content(unread.stage) if tuple(all_rules()) == _USUAL else ""
    if not content:
        return judge(lab, checkpoint, unread.read())
    key = (checkpoint.id, content)
    if key not in _JUDGED or _JUDGED[key][0] is not lab:
        _JUDGED[key] = (lab, judge(lab, checkpoint, unread.read()))
    return _JUDGED[key][1]


def _content(stage: Usd.Stage) -> str:
    """Return the text of a stage's only layer; '' of a stage of several."""
    root = stage.GetRootLayer()
    if any(layer not in {root, stage.GetSessionLayer()} for layer in stage.GetUsedLayers()):
        return ""
    if not root.dirty:
        data = Path(root.realPath).read_bytes()
        if data.startswith(b"#usda"):
            return data.decode()
    return str(root.ExportToString())
