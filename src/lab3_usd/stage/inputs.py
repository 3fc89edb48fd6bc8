"""Every layer file that a stage could read, whatever is selected, active or loaded in it."""

from __future__ import annotations

import re
from pathlib import Path

from msgspec import Struct
from pxr import Ar, Sdf, Tf, Usd

from lab3_usd.stage.opening import quiet

# usd-core takes an address for a path and drops one of its slashes.
_ONE_SLASH = re.compile(r"^(\w{2,}):/(?=[^/])")


class Inputs(Struct, frozen=True):
    """The files of a stage, links followed, and what could not be found or read, in order."""

    files: frozenset[Path]
    missing: tuple[str, ...]


def inputs_of(stage: Usd.Stage) -> Inputs:
    """Follow every sublayer, reference and payload, those in unselected variants included."""
    files: set[Path] = set()
    missing: set[str] = set()
    seen: set[str] = set()
    waiting = [stage.GetRootLayer()]
    with quiet(), Ar.ResolverContextBinder(stage.GetPathResolverContext()):
        while waiting:
            layer = waiting.pop()
            if layer.realPath:
                files.add(_file(layer.realPath))
            for identifier in _leads_to(layer) - seen:
                seen.add(identifier)
                found = _open(identifier)
                if found is None:
                    missing.add(_ONE_SLASH.sub(r"\1://", identifier))
                    files.add(_file(identifier))
                else:
                    waiting.append(found)
    return Inputs(frozenset(files), tuple(sorted(missing)))


def _leads_to(layer: Sdf.Layer) -> set[str]:
    paths = (path for path in layer.GetCompositionAssetDependencies() if path)
    return {Sdf.ComputeAssetPathRelativeToLayer(layer, path) for path in paths}


def _open(identifier: str) -> Sdf.Layer | None:
    try:
        return Sdf.Layer.FindOrOpen(identifier)
    except Tf.ErrorException:  # it is damaged
        return None


def _file(path: str) -> Path:
    """Return the file itself: a layer in a package is the package."""
    return Path(path.partition("[")[0]).resolve()
