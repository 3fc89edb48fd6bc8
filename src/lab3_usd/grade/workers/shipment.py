"""What every machine of a cluster needs to judge, packed to be sent there and unpacked there."""

from __future__ import annotations

import os
from pathlib import Path

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.errors import UsageError
from lab3_usd.grade.intake.scratch import scratch_folder
from lab3_usd.grade.workers.worker_messages import PoolSettings

_STARTER, _RUBRIC, _LAB = Path("starter"), Path("rubric.yaml"), Path("lab")


class Shipment(Struct, frozen=True):
    """What a machine of the cluster needs to judge: the files themselves, not where they lie.

    `files` are the starter and its assets, wherever they lie, by their paths below one folder, the
    rubric, and those that describe the lab, where it is not the bundled one. The `settings` name
    them by these paths.
    """

    files: tuple[tuple[str, bytes], ...]
    settings: PoolSettings


def packed(settings: PoolSettings) -> Shipment:
    """Return what every machine needs to judge by these settings.

    Raises:
        UsageError: there is no starter, or it refers to files where other machines have none.
    """
    from lab3_usd.stage.sandboxed_open import files_of

    if settings.starter is None:
        raise UsageError("--cluster needs a starter")
    starter = settings.starter.resolve()
    used = files_of(starter)
    paths = sorted({Path(path.partition("[")[0]) for path in used})
    root = Path(os.path.commonpath([starter.parent, *(path.parent for path in paths)]))
    files = {_STARTER / path.relative_to(root): path for path in paths}
    if settings.rubric is not None:
        files[_RUBRIC] = settings.rubric
    lab_files = [] if settings.lab is None else sorted(settings.lab.glob("*.yaml"))
    files |= {_LAB / path.name: path for path in lab_files}
    shipment = Shipment(
        tuple((name.as_posix(), path.read_bytes()) for name, path in files.items()),
        replace(
            settings,
            starter=_STARTER / starter.relative_to(root),
            rubric=settings.rubric and _RUBRIC,
            lab=_LAB if lab_files else None,
            readable=tuple(path.absolute() for path in settings.readable),
        ),
    )
    with scratch_folder("lab3-starter-") as folder:
        copy = unpacked(shipment, folder).starter
        copied: frozenset[str] = frozenset() if copy is None else files_of(copy)
        real = folder.resolve()
        if len(copied) < len(used) or not all(Path(file).is_relative_to(real) for file in copied):
            raise UsageError(
                f"{settings.starter}: refers to files in a way that other machines cannot follow; "
                "use paths relative to the starter, and no links"
            )
    return shipment


def unpacked(shipment: Shipment, folder: Path) -> PoolSettings:
    """Write the files of a shipment into a folder, and return the settings that name them there."""
    for name, data in shipment.files:
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)
    settings = shipment.settings
    return replace(
        settings,
        starter=settings.starter and folder / settings.starter,
        rubric=settings.rubric and folder / settings.rubric,
        lab=settings.lab and folder / settings.lab,
    )
