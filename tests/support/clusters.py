"""Dask clusters on this computer: a scheduler, its machines, and machines with faults.

Machines are forked from a process that has imported the program.
"""

from __future__ import annotations

import datetime as dt
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, NamedTuple
from unittest.mock import patch

import forking
import pytest
from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import NameOID
from fork_server import FORKED_WORKERS
from other_labs import MINI, files_below, starter

from lab3_usd.data import LAB_VARIABLE
from lab3_usd.grade.class_run import ClassSettings, grade_class
from lab3_usd.grade.workers.cluster import cluster_runner
from lab3_usd.grade.workers.scheduler import PATIENCE, Patience

_BEGIN = dt.datetime(2020, 1, 1, tzinfo=dt.timezone.utc)
_END = dt.datetime(2120, 1, 1, tzinfo=dt.timezone.utc)


class Certificates(NamedTuple):
    """The files of an authority, and of one who belongs to it."""

    authority: Path
    certificate: Path
    key: Path


def certificates(folder: Path) -> Certificates:
    """Write new certificates into a folder."""
    folder.mkdir(parents=True)
    own, member = ec.generate_private_key(ec.SECP256R1()), ec.generate_private_key(ec.SECP256R1())
    authority = _signed("authority", own, "authority", own, is_authority=True)
    certificate = _signed("member", member, "authority", own, is_authority=False)
    files = Certificates(folder / "ca.pem", folder / "cert.pem", folder / "key.pem")
    files.authority.write_bytes(authority.public_bytes(serialization.Encoding.PEM))
    files.certificate.write_bytes(certificate.public_bytes(serialization.Encoding.PEM))
    files.key.write_bytes(
        member.private_bytes(
            serialization.Encoding.PEM,
            serialization.PrivateFormat.PKCS8,
            serialization.NoEncryption(),
        )
    )
    return files


def _signed(
    name: str,
    key: ec.EllipticCurvePrivateKey,
    issuer: str,
    by: ec.EllipticCurvePrivateKey,
    *,
    is_authority: bool,
) -> x509.Certificate:
    names = [x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, text)]) for text in (name, issuer)]
    usage = x509.KeyUsage(
        digital_signature=True, content_commitment=False, key_encipherment=False,
        data_encipherment=False, key_agreement=False, key_cert_sign=is_authority,
        crl_sign=is_authority, encipher_only=False, decipher_only=False,
    )  # fmt: skip
    constraints = x509.BasicConstraints(ca=is_authority, path_length=None)
    return (
        x509.CertificateBuilder()
        .subject_name(names[0])
        .issuer_name(names[1])
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(_BEGIN)
        .not_valid_after(_END)
        .add_extension(constraints, critical=True)
        .add_extension(usage, critical=True)
        .add_extension(x509.SubjectKeyIdentifier.from_public_key(key.public_key()), critical=False)
        .add_extension(
            x509.AuthorityKeyIdentifier.from_issuer_public_key(by.public_key()), critical=False
        )
        .sign(by, hashes.SHA256())
    )


class Cluster(NamedTuple):
    """A scheduler in this process, and the machines that began with it."""

    scheduler_address: str
    machines: tuple[Process, ...]


@contextmanager
def cluster_of(machines: int, temporary: Path) -> Iterator[Cluster]:
    """A scheduler and so many machines, whose temporary files lie in a place of their own."""
    with ExitStack() as stack:
        address = stack.enter_context(local_cluster(temporary)).scheduler_address
        running = [machine(address, temporary) for _ in range(machines)]
        yield Cluster(address, tuple(map(stack.enter_context, running)))


@contextmanager
def local_cluster(temporary: Path, **options: Any) -> Iterator[Any]:
    """A scheduler in this process; when it is closed, the machines that joined it end."""
    distributed = pytest.importorskip("distributed", reason="Dask is not installed")
    dask = pytest.importorskip("dask")
    temporary.mkdir()
    quick = {
        "distributed.admin.log-format": "",
        "logging.distributed": "critical",
    }
    with (
        patch.dict(os.environ, {"TMPDIR": str(temporary)}),  # which goes before what Dask is told
        dask.config.set(quick),
        distributed.LocalCluster(
            n_workers=0,
            threads_per_worker=1,
            processes=True,
            dashboard_address=None,
            **options,
        ) as running,
    ):
        yield running


def graded_on(
    cluster: Any,
    place: Path | str,
    out: Path,
    notify: Any = print,
    patience: Patience = PATIENCE,
    **changes: Any,
) -> dict[str, bytes]:
    runner = cluster_runner(cluster.scheduler_address, notify, patience=patience)
    grade_class(ClassSettings(place, starter(), out, runner=runner), **changes)
    return files_below(out)


_MACHINE = """
import asyncio, sys
exec(sys.argv[2])
from distributed import Worker

async def main():
    async with Worker(sys.argv[1], nthreads=1, host="127.0.0.1", dashboard_address=None) as worker:
        print(worker.address, flush=True)
        await worker.finished()

asyncio.run(main())
"""
_SCHEDULER = """
import asyncio, sys
exec(sys.argv[2])
from distributed import Scheduler

async def main():
    async with Scheduler(host="127.0.0.1", port=int(sys.argv[1]), dashboard=False) as scheduler:
        print(scheduler.address, flush=True)
        await scheduler.finished()

asyncio.run(main())
"""
# How a machine without this package answers each import of it.
WITHOUT_LAB3 = """
import sys
for name in [name for name in sys.modules if name.partition(".")[0] == "lab3_usd"]:
    del sys.modules[name]
class Nowhere:
    def find_spec(self, name, *_):
        if name.partition(".")[0] == "lab3_usd":
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
sys.meta_path.insert(0, Nowhere())
"""


class Process(NamedTuple):
    """A scheduler or a machine of a cluster, in a process of its own."""

    address: str
    process: subprocess.Popen[str]


@contextmanager
def machine(scheduler: str, temporary: Path, code: str = "", **variables: str) -> Iterator[Process]:
    """A machine of a cluster that runs this code first, with these variables of its environment."""
    with _running([_MACHINE, scheduler, code], temporary, **variables) as found:
        yield found


@contextmanager
def scheduler(temporary: Path, code: str = "", port: int = 0) -> Iterator[Process]:
    """A scheduler that runs this code first."""
    with _running([_SCHEDULER, str(port), code], temporary) as found:
        yield found


@contextmanager
def _running(arguments: list[str], temporary: Path, **variables: str) -> Iterator[Process]:
    temporary.mkdir(parents=True, exist_ok=True)
    environment = {
        **os.environ,
        "TMPDIR": str(temporary),
        LAB_VARIABLE: str(MINI),
        "DASK_LOGGING__DISTRIBUTED": "critical",
        **FORKED_WORKERS,
        **variables,
    }
    forking.preload("distributed")
    with forking.Popen(
        [sys.executable, "-c", *arguments],
        stdout=subprocess.PIPE,
        env=environment,
        cwd=temporary,
        text=True,
    ) as process:
        assert process.stdout is not None
        try:
            yield Process(process.stdout.readline().strip(), process)
        finally:
            process.kill()
