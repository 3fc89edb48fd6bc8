"""Runs commands as far as Linux can be like Windows, and prints how each ended, as JSON.

Its standard streams have the code page 1252. Modules and functions that only POSIX has are absent,
in the processes that it starts as well (`SITE` is their `sitecustomize`). To read or write a file
in the encoding of the country, without naming one, is an error.
"""

from __future__ import annotations

import io
import json
import os
import sys
from pathlib import Path

SITE = """
import os
import sys
import warnings

for module in ("fcntl", "grp", "pwd", "resource", "termios"):
    sys.modules[module] = None
for name in ("chown", "geteuid", "getuid", "killpg", "wait4", "waitid", "sched_getaffinity"):
    delattr(os, name)
for flag in ("O_DIRECTORY", "O_NOFOLLOW", "O_NONBLOCK"):
    delattr(os, flag)
os.supports_dir_fd.clear()
warnings.filterwarnings("error", category=EncodingWarning, module="lab3_usd")
"""


def site_folder(folder: Path) -> dict[str, str]:
    """Write `SITE` into a folder; return the environment that makes a Python obey it."""
    (folder / "sitecustomize.py").write_text(SITE, encoding="utf-8")
    return {
        **os.environ,
        "PYTHONPATH": str(folder),
        "PYTHONIOENCODING": "cp1252",
        "PYTHONWARNDEFAULTENCODING": "1",
    }


def run(calls: dict[str, list[str]]) -> dict[str, tuple[int, str]]:
    """Return the exit status of each call and what it printed, as bytes that are UTF-8."""
    from lab3_usd import cli

    answers = {}
    for name, arguments in calls.items():
        sys.argv = ["lab3", *arguments]
        written = io.BytesIO()
        sys.stdout = sys.stderr = io.TextIOWrapper(written, encoding="cp1252")
        try:
            cli.main()
            status = 0
        except SystemExit as leaving:
            status = int(leaving.code or 0)
        sys.stdout.flush()
        answers[name] = status, written.getvalue().decode("utf-8")
    sys.stdout, sys.stderr = sys.__stdout__, sys.__stderr__
    return answers


if __name__ == "__main__":
    sys.stdout.write(json.dumps(run(json.loads(sys.argv[1]))))
