"""Whoever reaches a Dask scheduler runs programs on its machines: who reaches it is looked at."""

from __future__ import annotations

import os
import socket
import sys
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import forking
import pytest
from clusters import Certificates, certificates, local_cluster, machine, scheduler
from other_labs import cut_wire, files_below, stage, starter, submission

from lab3_usd.errors import UsageError
from lab3_usd.grade.class_run import ClassSettings, grade_class
from lab3_usd.grade.workers.scheduler import Patience, connected

pytestmark = [
    pytest.mark.skipif(find_spec("distributed") is None, reason="Dask is not installed"),
    pytest.mark.timeout(300),  # machines are started and waited for
    pytest.mark.usefixtures("forked_workers"),
    pytest.mark.filterwarnings("ignore"),
]
# A scheduler that listens on all interfaces says the address of its computer.
KNOWN_AS = """
from distributed import Scheduler
identity = Scheduler.identity
Scheduler.identity = lambda *arguments, **options: {{
    **identity(*arguments, **options), "address": {address!r}
}}
"""


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("class") / "class"
    submission(folder / "ana", "00")
    cut_wire(submission(folder / "ben", "00", "01") / "work" / stage("01").name)
    return folder


@pytest.fixture(scope="module")
def known(tmp_path_factory: pytest.TempPathFactory) -> Certificates:
    return certificates(tmp_path_factory.mktemp("tls") / "course")


@pytest.fixture(scope="module")
def secured(known: Certificates, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    """A cluster that speaks TLS alone."""
    import distributed

    security = distributed.Security(
        require_encryption=True,
        tls_ca_file=str(known.authority),
        **{
            f"tls_{part}_{what}": str(getattr(known, name))
            for part in ("scheduler", "client")
            for what, name in (("cert", "certificate"), ("key", "key"))
        },
    )
    folder = tmp_path_factory.mktemp("secured") / "temporary"
    with local_cluster(folder, security=security, protocol="tls://") as cluster:
        address = cluster.scheduler_address
        with machine(address, folder, **configured(known, "WORKER")):
            yield cluster


def configured(files: Certificates, part: str = "CLIENT") -> dict[str, str]:
    """How Dask is told of certificates."""
    return {
        "DASK_DISTRIBUTED__COMM__TLS__CA_FILE": str(files.authority),
        f"DASK_DISTRIBUTED__COMM__TLS__{part}__CERT": str(files.certificate),
        f"DASK_DISTRIBUTED__COMM__TLS__{part}__KEY": str(files.key),
    }


def lab3_grade(
    place: Path, out: Path, cluster: str, *options: str, **variables: str
) -> forking.CompletedProcess[str]:
    command = [sys.executable, "-m", "lab3_usd", "grade", str(place), "--starter", str(starter())]
    forking.preload("distributed")
    return forking.run(
        [*command, "--output", str(out), "--cluster", cluster, *options],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, **variables},
    )


def test_a_cluster_with_tls_gives_the_same_gradebook(
    place: Path, secured: Any, known: Certificates, tmp_path: Path
) -> None:
    grade_class(ClassSettings(place, starter(), tmp_path / "alone"))
    address = secured.scheduler_address
    assert address.startswith("tls://")
    done = lab3_grade(place, tmp_path / "book", address, **configured(known))
    assert (done.returncode, done.stderr) == (0, "")
    assert files_below(tmp_path / "book") == files_below(tmp_path / "alone")


def test_tls_without_certificates_is_one_line_that_says_where_they_are_named(
    place: Path, secured: Any, tmp_path: Path
) -> None:
    address = secured.scheduler_address
    done = lab3_grade(place, tmp_path / "book", address)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == (
        f"lab3: {address}: Dask has no certificates for TLS here; name them in its configuration "
        "(distributed.comm.tls.ca-file, distributed.comm.tls.client.cert, "
        "distributed.comm.tls.client.key), see docs/cluster.md\n"
    )


def test_what_accepts_and_says_nothing_is_no_scheduler() -> None:
    with socket.create_server(("127.0.0.1", 0)) as silent:
        address = f"tcp://127.0.0.1:{silent.getsockname()[1]}"
        patience = Patience(to_connect=0.3)
        with (
            pytest.raises(UsageError, match=r"no Dask scheduler \(no answer in 0.3 s\)"),
            connected(address, lambda _line: None, patience=patience),
        ):
            pass


@pytest.mark.parametrize(
    "address", ["tcp://me:geheim@127.0.0.1:8786", "tls://me:geheim@8.8.8.8:1", "me:geheim@host:1"]
)
def test_a_password_in_the_address_of_a_scheduler_is_never_printed(address: str) -> None:
    with (
        pytest.raises(UsageError, match="knows neither users nor passwords") as raised,
        connected(address, lambda _line: None),
    ):
        pass
    assert "geheim" not in str(raised.value)


@pytest.mark.parametrize("fault", ["missing", "no certificate", "of somebody else"])
def test_certificates_that_do_not_fit_are_one_line(
    place: Path, secured: Any, known: Certificates, tmp_path: Path, fault: str
) -> None:
    files = certificates(tmp_path / "tls")
    if fault == "missing":
        files = known._replace(key=tmp_path / "no-key.pem")
    elif fault == "no certificate":
        files = known._replace(certificate=known.key)
    address = secured.scheduler_address
    done = lab3_grade(place, tmp_path / "book", address, **configured(files))
    assert (done.returncode, done.stdout) == (2, "")
    assert len(done.stderr.splitlines()) == 1
    assert done.stderr.startswith(f"lab3: {address}: ")


def test_a_public_scheduler_without_tls_is_refused(tmp_path: Path, place: Path) -> None:
    done = lab3_grade(place, tmp_path / "book", "tcp://8.8.8.8:8786")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == (
        "lab3: tcp://8.8.8.8:8786: has a public address and has no TLS: whoever reaches it runs "
        "programs on its machines; use tls://, or --insecure-cluster if a firewall protects it, "
        "see docs/cluster.md\n"
    )
    assert not (tmp_path / "book" / "students").exists()


def test_a_scheduler_that_listens_on_a_public_address_is_refused_by_any_address(
    tmp_path: Path,
) -> None:
    public = KNOWN_AS.format(address="tcp://8.8.8.8:8786")
    with (
        scheduler(tmp_path / "s", public) as running,
        pytest.raises(UsageError, match=r"tcp://8\.8\.8\.8:8786: has a public address"),
        connected(running.address, print),
    ):
        pass


@pytest.mark.parametrize(
    ("address", "insecure"), [("tcp://8.8.8.8:8786", True), ("tcp://10.1.2.3:8786", False)]
)
def test_who_reaches_a_scheduler_without_tls_is_said(
    tmp_path: Path,
    address: str,
    insecure: bool,  # noqa: FBT001
) -> None:
    said: list[str] = []
    options: Any = {"insecure": insecure, "patience": Patience(to_find=0.05)}
    with (
        scheduler(tmp_path / "s", KNOWN_AS.format(address=address)) as running,
        pytest.raises(UsageError, match="has no worker"),
        connected(running.address, said.append, **options),
    ):
        pass
    (line,) = said
    assert line.startswith(f"{address}: has no TLS: whoever reaches it runs programs")
