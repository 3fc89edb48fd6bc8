"""Compiles the lab and the templates of reports into the wheel, so that no start does."""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class CompileData(BuildHookInterface):  # type: ignore[type-arg]  # hatchling leaves it open
    """Adds what is compiled to a wheel; a checkout compiles it when it first needs it."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Make the file and name it to the wheel."""
        if version != "standard":
            return
        root = Path(self.root)
        sys.path.insert(0, str(root / "src"))
        from lab3_usd.report.html.templates import compile_templates
        from lab3_usd.spec.load.compiled import FILE, compile_lab
        from lab3_usd.spec.load.loader import assemble

        self.folder = tempfile.TemporaryDirectory()
        compiled = Path(self.folder.name) / FILE
        compiled.write_bytes(compile_lab(root / "graphs", assemble(root / "graphs")))
        build_data["force_include"][str(compiled)] = f"lab3_usd/_data/graphs/{FILE}"
        templates = Path(self.folder.name) / "templates"
        compile_templates(templates)
        build_data["force_include"][str(templates)] = "lab3_usd/report/html/templates/compiled"

    def finalize(self, *_: Any) -> None:
        """Remove the file that was packed."""
        if hasattr(self, "folder"):
            self.folder.cleanup()
