"""The walls around a worker: what the kernel keeps it from, and what it may use."""

from __future__ import annotations

import socket
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import forking
import pytest
from machine import eventually, has_ended

from lab3_usd.grade.workers.sandbox import fence_files

Run = Callable[..., subprocess.CompletedProcess[Any]]


def confined(code: str, *arguments: Path, run: Run = forking.run) -> str:
    """What a process prints that has confined itself to `arguments[0]` before it runs `code`."""
    opening = (
        "import sys\nfrom pathlib import Path\n"
        "from lab3_usd.grade.workers.sandbox import *\n"
        "place = Path(sys.argv[1])\n"
    )
    command = [sys.executable, "-c", opening + code, *map(str, arguments)]
    done = run(command, capture_output=True, text=True, check=False, timeout=60)
    return done.stdout.strip() or done.stderr


def landlock() -> bool:
    return confined("print(fence_files([place], []))", Path("/")) == "True"


@pytest.fixture
def kernel_fence() -> None:
    if not landlock():
        pytest.skip("this kernel has no Landlock")


ATTEMPT = """
def attempt(what):
    try:
        what()
    except OSError as error:
        return type(error).__name__
    return "done"
fence_files([place], [place / "scratch"])
print(attempt(lambda: {attempt}))
"""


@pytest.mark.usefixtures("kernel_fence")
@pytest.mark.parametrize(
    ("attempt", "outcome"),
    [
        ("(place / 'mine').read_bytes()", "done"),
        ("(place / 'scratch' / 'new').write_bytes(b'x')", "done"),
        ("(place / 'new').write_bytes(b'x')", "PermissionError"),
        ("(place / 'mine').write_bytes(b'x')", "PermissionError"),
        ("(place / 'mine').unlink()", "PermissionError"),
        ("Path(sys.argv[2]).read_bytes()", "PermissionError"),
        ("(place / 'scratch' / 'link').symlink_to(sys.argv[2])", "PermissionError"),
        ("__import__('os').mkfifo(place / 'scratch' / 'pipe')", "PermissionError"),
        ("__import__('subprocess').run(['/bin/true'])", "PermissionError"),
    ],
)
def test_the_kernel_keeps_a_worker_inside_its_folders(
    tmp_path: Path, attempt: str, outcome: str
) -> None:
    place = tmp_path / "place"
    (place / "scratch").mkdir(parents=True)
    (place / "mine").write_bytes(b"x")
    (tmp_path / "secret").write_bytes(b"s")
    code = ATTEMPT.replace("{attempt}", attempt)
    assert confined(code, place, tmp_path / "secret") == outcome


NETWORK = """
import socket
given = give_up_privileges()["network"]
try:
    socket.create_connection(("127.0.0.1", int(sys.argv[2])), timeout=5)
    print(given, "reached")
except OSError:
    print(given, "not reached")
"""


def test_a_worker_reaches_no_network(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = str(server.getsockname()[1])
        said = confined(NETWORK, tmp_path, Path(port))
    if said.startswith("False"):
        pytest.skip("this platform lets no process give up its network")
    assert said == "True not reached"


@pytest.mark.parametrize("forbidden", ["os.chroot('/')", "os.chown(place, 1, 1)", "os.setuid(1)"])
def test_a_worker_has_no_privileges_even_when_root_started_it(
    tmp_path: Path, forbidden: str
) -> None:
    file = tmp_path / "file"
    file.touch()
    code = (
        "import os\nprint(give_up_privileges()['privileges'], end=' ')\n"
        f"try:\n    {forbidden}\n    print('done')\n"
        "except PermissionError:\n    print('refused')\n"
    )
    said = confined(code, file)
    if said.startswith("False"):
        pytest.skip("this platform has no privileges to give up")
    assert said == "True refused"


@pytest.mark.parametrize(
    ("code", "outcome"),
    [
        ("bytearray(600 << 20)", "MemoryError"),
        ("bytearray(10 << 20)", "fine"),
        ("[open(place) for _ in range(400)]", "OSError"),
    ],
)
def test_a_worker_has_limits(tmp_path: Path, code: str, outcome: str) -> None:
    pytest.importorskip("resource", reason="this platform has no limits for a process")
    file = tmp_path / "file"
    file.touch()
    script = (
        "from lab3_usd.grade.intake.submission_copy import Limits\n"
        "limit_resources(Limits(memory=512 << 20))\n"
        f"try:\n    {code}\n    print('fine')\n"
        "except (MemoryError, OSError) as error:\n    print(type(error).__name__)\n"
    )
    assert confined(script, file, run=subprocess.run) == outcome


def test_where_there_is_no_landlock_nothing_is_fenced() -> None:
    assert fence_files([Path("/")], [], None) is False


def test_a_worker_dies_with_the_process_that_started_it(tmp_path: Path) -> None:
    if sys.platform != "linux":
        pytest.skip("only Linux ends a process with its parent")
    code = (
        "import os, time\nchild = os.fork()\nif not child:\n"
        "    give_up_privileges()\n    (place / 'ready').touch()\n    time.sleep(60)\n"
        "while not (place / 'ready').exists():\n    time.sleep(0.01)\nprint(child, flush=True)\n"
        "os._exit(0)\n"
    )
    child = int(confined(code, tmp_path))
    assert eventually(lambda: has_ended(child))
