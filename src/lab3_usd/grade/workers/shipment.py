"""What every machine of a cluster needs to judge, packed to be sent there and unpacked there."""

from __future__ import annotations

import os
from pathlib import Path

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.errors import UsageError
from lab3_usd.grade.intake.scratch import scratch_folder
from lab3_usd.grade.workers.worker_messages import PoolSettings


class Shipment(Struct, frozen=True):
    """What a machine of the cluster needs to judge: the files themselves, not where they lie.

    `files` are the starter and its assets, wherever they lie, by their paths below one folder,
    `lab` those that describe the lab, where it is not the bundled one.
    """

    files: tuple[tuple[str, bytes], ...]
    starter: str
    rubric: bytes | None
    lab: tuple[tuple[str, bytes], ...]
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
    lab_files = [] if settings.lab is None else sorted(settings.lab.glob("*.yaml"))
    paths = sorted({Path(path.partition("[")[0]) for path in files_of(starter)})
    root = Path(os.path.commonpath([starter.parent, *(path.parent for path in paths)]))
    shipment = Shipment(
        files=tuple((path.relative_to(root).as_posix(), path.read_bytes()) for path in paths),
        starter=starter.relative_to(root).as_posix(),
        rubric=None if settings.rubric is None else settings.rubric.read_bytes(),
        lab=tuple((path.name, path.read_bytes()) for path in lab_files),
        settings=replace(settings, readable=tuple(path.absolute() for path in settings.readable)),
    )
    with scratch_folder("lab3-starter-") as folder:
        copy = unpacked(shipment, folder).starter
        copied: frozenset[str] = frozenset() if copy is None else files_of(copy)
        real = folder.resolve()
        if len(copied) < len(files_of(starter)) or not all(
            Path(file).is_relative_to(real) for file in copied
        ):
            raise UsageError(
                f"{settings.starter}: refers to files in a way that other machines cannot follow; "
                "use paths relative to the starter, and no links"
            )
    return shipment


def unpacked(shipment: Shipment, folder: Path) -> PoolSettings:
    """Write the files of a shipment into a folder, and return the settings that name them there."""
    for name, data in shipment.files:
        path = folder / "starter" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)
    lab = folder / "lab" if shipment.lab else None
    for name, data in shipment.lab:
        path = folder / "lab" / name
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(data)
    rubric = None
    if shipment.rubric is not None:
        rubric = folder / "rubric.yaml"
        rubric.write_bytes(shipment.rubric)
    starter = folder / "starter" / shipment.starter
    return replace(shipment.settings, starter=starter, rubric=rubric, lab=lab)
