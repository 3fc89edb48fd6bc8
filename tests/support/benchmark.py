"""A script of `benchmarks/` as a module."""

from __future__ import annotations

import importlib.util
import sys
from types import ModuleType

from places import REPOSITORY


def load_benchmark(name: str) -> ModuleType:
    path = REPOSITORY / "benchmarks" / f"{name}.py"
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module
