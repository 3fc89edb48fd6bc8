"""In a fresh clone the workers compile the tests together, not each of them all."""

from __future__ import annotations

import gc

import pytest
from _pytest.assertion import rewrite
from places import TESTS


def compile_share(config: pytest.Config, worker: int, workers: int) -> None:
    """Compile every so many-th test module, as pytest does, where nothing is compiled yet.

    What another worker has not compiled before this one collects it, this one compiles as well.
    """
    modules = sorted(TESTS.rglob("test_*.py"), key=lambda path: (path.stat().st_size, path))
    gc.disable()
    for module in modules[worker::workers]:
        compiled = rewrite.get_cache_dir(module) / (module.stem + rewrite.PYC_TAIL)
        if not compiled.exists() and rewrite.try_makedirs(compiled.parent):
            source, code = rewrite._rewrite_test(module, config)
            state = config.stash[rewrite.assertstate_key]
            rewrite._write_pyc(state, code, source, compiled)
    gc.enable()
