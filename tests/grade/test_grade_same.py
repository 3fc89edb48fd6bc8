"""Two runs over files that are refused give the same gradebook, which names no temporary folder."""

from __future__ import annotations

import json
import tempfile
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest
from other_labs import files_below, stage, starter
from pxr import Sdf

from lab3_usd.grade.class_run import ClassSettings, grade_class
from lab3_usd.grade.intake.submission_copy import Limits

pytestmark = pytest.mark.usefixtures("forked_workers")
NAME = stage("04").name
LIMITS = Limits(prims=300, file_size=300_000, nesting=60)
WORLD = '#usda 1.0\ndef Xform "World"\n{\n}\n'


def nested(path: Path) -> None:
    path.write_text("#usda 1.0\n" + 'def "a" {\n' * 100 + "}\n" * 100)


def too_large(path: Path) -> None:
    path.write_text(WORLD + "#" * 400_000)


def too_many_prims(path: Path) -> None:
    path.write_text("#usda 1.0\n" + "".join(f'def "p{index}" {{\n}}\n' for index in range(400)))


def crate_of(path: Path) -> bytes:
    layer = Sdf.Layer.CreateAnonymous(".usdc")
    layer.ImportFromString(WORLD)
    layer.Export(str(path.with_suffix(".usdc")))
    data = path.with_suffix(".usdc").read_bytes()
    path.with_suffix(".usdc").unlink()
    return data


def damaged_crate(path: Path) -> None:
    path.with_suffix(".usdc").write_bytes(crate_of(path)[:-40])


def deep_crate(path: Path) -> None:
    layer = Sdf.Layer.CreateAnonymous(".usdc")
    Sdf.CreatePrimInLayer(layer, "/" + "/".join(["a"] * 100))
    layer.Export(str(path.with_suffix(".usdc")))


def crate_called_text(path: Path) -> None:
    path.write_bytes(crate_of(path)[:100])


def damaged_package(path: Path) -> None:
    path.with_suffix(".usdz").write_bytes(b"PK\x03\x04" + bytes(100))


def squeezed_package(path: Path) -> None:
    with zipfile.ZipFile(path.with_suffix(".usdz"), "w", zipfile.ZIP_DEFLATED) as package:
        package.writestr("a.usda", WORLD)


def link(path: Path) -> None:
    path.symlink_to("/etc/hostname")


def link_inside(path: Path) -> None:
    nested(path.with_name("deep.usda"))
    path.symlink_to("deep.usda")


def not_text(path: Path) -> None:
    path.write_bytes(b"#usda 1.0\n\xff\xfe\n")


def no_stage(path: Path) -> None:
    path.write_text("rubbish")


def sublayer_of(write: Callable[[Path], None]) -> Callable[[Path], None]:
    def made(path: Path) -> None:
        write(path.with_name("more.usda"))
        (more,) = path.parent.glob("more.*")
        path.write_text(f"#usda 1.0\n(\n    subLayers = [@./{more.name}@]\n)\n")

    made.__name__ = f"sublayer_{write.__name__}"
    return made


def many_references(path: Path) -> None:
    assets = ", ".join(f"@./gone_{index}.usda@" for index in range(600))
    path.write_text(f"#usda 1.0\n(\n    subLayers = [{assets}]\n)\n")


SINGLE = (nested, too_large, too_many_prims, damaged_crate, deep_crate, crate_called_text,
          damaged_package, squeezed_package, link, link_inside, not_text, no_stage)  # fmt: skip
REFUSED = (*SINGLE, *map(sublayer_of, SINGLE), many_references)


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> tuple[dict[str, bytes], dict[str, bytes]]:
    """The gradebooks of two runs over everything that is refused."""
    place = tmp_path_factory.mktemp("same")
    for write in REFUSED:
        folder = place / "class" / write.__name__ / "work"
        folder.mkdir(parents=True)
        write(folder / NAME)
    for name, jobs in (("one", 1), ("two", 2)):
        settings = ClassSettings(place / "class", starter(), place / name, limits=LIMITS, jobs=jobs)
        grade_class(settings)
    return files_below(place / "one"), files_below(place / "two")


def test_two_runs_give_the_same_bytes(
    runs: tuple[dict[str, bytes], dict[str, bytes]],
) -> None:
    one, two = runs
    assert list(one) == list(two)
    assert [name for name in one if one[name] != two[name]] == []


def test_no_report_names_a_temporary_folder(
    runs: tuple[dict[str, bytes], dict[str, bytes]],
) -> None:
    folder = tempfile.gettempdir().encode()
    named = [name for name, data in runs[0].items() if folder in data or b"lab3-grade-" in data]
    assert named == []


@pytest.mark.parametrize("write", REFUSED, ids=lambda write: write.__name__)
def test_what_is_refused_is_said(
    runs: tuple[dict[str, bytes], dict[str, bytes]], write: Callable[[Path], None]
) -> None:
    report = json.loads(runs[0][f"students/{write.__name__}/report.json"])
    said = [
        (each["rule"], each["message"])
        for part in ("results", "submissions")
        for result in report[part]
        for each in result["findings"]
        if each["rule"] in {"F01", "F03", "Z01", "Z02"}
    ]
    assert said
    assert not any(message.startswith("/") for _, message in said)
