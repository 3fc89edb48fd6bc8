"""The version that reports are signed with: the one that is installed."""

from __future__ import annotations

import importlib.metadata
import sys
from pathlib import Path

import pytest

from lab3_usd.report.options import UNKNOWN, tool_version


def test_it_is_the_version_of_the_installed_package() -> None:
    try:
        installed = importlib.metadata.version("lab3-usd")
    except importlib.metadata.PackageNotFoundError:
        installed = UNKNOWN
    assert tool_version() == installed


def test_the_first_installation_on_the_path_counts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for version in ("1.2.3", "4.5.6"):
        (tmp_path / version / f"lab3_usd-{version}.dist-info").mkdir(parents=True)
    (tmp_path / "1.2.3" / "lab3_usd-0.0.0.egg").mkdir()
    folders = [tmp_path / name for name in ("none", "1.2.3", "4.5.6")]
    monkeypatch.setattr(sys, "path", [str(folder) for folder in folders])
    assert tool_version() == "1.2.3"


def test_without_an_installation_the_version_is_unknown(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "path", [])
    assert tool_version() == UNKNOWN
