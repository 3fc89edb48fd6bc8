"""Connects to the scheduler of a Dask cluster, where nobody but the grader reaches it."""

from __future__ import annotations

import asyncio
import importlib
import ipaddress
import logging
import socket
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any
from urllib.parse import urlsplit

from msgspec import Struct

from lab3_usd.errors import UsageError
from lab3_usd.grade.intake.addresses import without_secrets
from lab3_usd.installation import install_command

_WITH_TLS = ("tls", "wss")
_TO_ANSWER = 0.5  # seconds more than to connect, whose own error says why that failed
_TIMEOUTS = (TimeoutError, asyncio.TimeoutError)  # not the same before Python 3.11
_GUIDE = "see docs/cluster.md"
_CERTIFICATES = ("ca-file", "client.cert", "client.key")
_LOGGERS = ("distributed", "tornado", "asyncio")


class Patience(Struct, frozen=True):
    """Seconds to wait for a scheduler, for a worker, and for one to return after all have gone."""

    to_connect: float = 20.0
    to_find: float = 20.0
    to_return: float = 20.0


PATIENCE = Patience()


@contextmanager
def connected(
    address: str,
    notify: Callable[[str], None],
    *,
    insecure: bool = False,
    patience: Patience = PATIENCE,
) -> Iterator[Any]:
    """Yield a client of the scheduler at an address, which has a worker.

    `notify` receives a line where others may reach the scheduler. With `insecure`, it may be one
    without TLS that has a public address.

    Raises:
        UsageError: Dask is not installed, the address holds a password, there is no scheduler or
            no worker, TLS is not configured, or the scheduler is public and has no TLS.
    """
    try:
        distributed = importlib.import_module("distributed")
    except ImportError as error:
        raise UsageError(
            f"--cluster needs the extra cluster: {install_command('cluster')}"
        ) from error
    if "@" in address:
        raise UsageError(
            f"{shown_scheduler(address)}: a Dask scheduler knows neither users nor passwords; give "
            "tls://host:port"
        )
    _refuse_exposed(address, notify, insecure=insecure)
    with _quiet():
        try:
            security = _security(address, distributed)
            _await_answer(distributed, address, security, patience.to_connect)
            client = distributed.Client(address, timeout=patience.to_connect, security=security)
        except (OSError, ValueError) as error:
            lines = str(error).splitlines() or [type(error).__name__]
            why = lines[0].rpartition(">: ")[2]  # after Dask's name of the connection
            hint = "" if _scheme(address) in _WITH_TLS else "; one with TLS is at tls://..."
            raise UsageError(f"{address}: there is no Dask scheduler ({why}){hint}") from error
        try:
            own = str(client.scheduler_info()["address"])
            if own != address:
                _refuse_exposed(own, notify, insecure=insecure)
            try:
                client.wait_for_workers(1, timeout=patience.to_find)
            except _TIMEOUTS as error:
                raise UsageError(
                    f"{address}: the cluster has no worker; start one with `dask worker {address}`"
                ) from error
            with client.as_current():  # Dask may be in use by somebody else in this process
                yield client
        finally:
            client.close()


def shown_scheduler(address: str) -> str:
    """Return the address of a scheduler without a user and a password."""
    return address if "@" not in address else without_secrets(_with_scheme(address))


def _await_answer(distributed: Any, address: str, security: Any, seconds: float) -> None:
    """Ask a scheduler who it is: a client of Dask waits for ever where nothing answers.

    Raises:
        OSError: nothing listens at the address, or does not answer as a scheduler.
    """

    async def ask() -> None:
        connection = security.get_connection_args("client")
        async with distributed.rpc(
            address, timeout=seconds, connection_args=connection
        ) as scheduler:
            await scheduler.identity()

    try:
        asyncio.run(asyncio.wait_for(ask(), seconds + _TO_ANSWER))
    except _TIMEOUTS as error:
        raise OSError(f"no answer in {seconds:g} s") from error


def _security(address: str, distributed: Any) -> Any:
    """Return how Dask is configured to prove who it is.

    Raises:
        UsageError: the address asks for TLS, and the configuration has no certificates.
    """
    security = distributed.Security()
    if _scheme(address) not in _WITH_TLS:
        return security
    keys = ", ".join(f"distributed.comm.tls.{key}" for key in _CERTIFICATES)
    try:
        context = security.get_connection_args("client").get("ssl_context")
    except OSError as error:  # ssl.SSLError is one
        why = f"{error.strerror or error}: {error.filename}" if error.filename else str(error)
        raise UsageError(f"{address}: Dask cannot read its certificates ({why}); {keys}") from error
    if context is None or not security.tls_client_cert:
        raise UsageError(
            f"{address}: Dask has no certificates for TLS here; name them in its configuration "
            f"({keys}), {_GUIDE}"
        )
    return security


def _refuse_exposed(address: str, notify: Callable[[str], None], *, insecure: bool) -> None:
    """Refuse a scheduler without TLS that everybody reaches, and say who reaches any other.

    Raises:
        UsageError: it has a public address.
    """
    if _scheme(address) in _WITH_TLS:
        return
    reached = [ip for ip in _addresses(address) if not ip.is_loopback and not ip.is_unspecified]
    if not reached:
        return
    danger = "has no TLS: whoever reaches it runs programs on its machines"
    if any(ip.is_global for ip in reached) and not insecure:
        raise UsageError(
            f"{address}: has a public address and {danger}; use tls://, or --insecure-cluster if "
            f"a firewall protects it, {_GUIDE}"
        )
    notify(f"{address}: {danger}; {_GUIDE}")


def _scheme(address: str) -> str:
    return address.partition("://")[0] if "://" in address else "tcp"


def _with_scheme(address: str) -> str:
    return address if "://" in address else f"tcp://{address}"


def _addresses(address: str) -> list[ipaddress.IPv4Address | ipaddress.IPv6Address]:
    """Return the addresses of the computer that an address names; none where nobody knows it."""
    try:
        host = urlsplit(_with_scheme(address)).hostname
        entries = socket.getaddrinfo(host, None)
    except (OSError, ValueError):
        return []
    texts = {str(entry[4][0]).partition("%")[0] for entry in entries}
    return [ipaddress.ip_address(text) for text in sorted(texts)]


@contextmanager
def _quiet() -> Iterator[None]:
    """Keep Dask's own lines out of ours: what happens to a cluster is said in one line here."""
    levels = {
        name: logging.getLogger(name).level
        for name in [*logging.root.manager.loggerDict, *_LOGGERS]
        if name.partition(".")[0] in _LOGGERS
    }
    for name in levels:
        logging.getLogger(name).setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        for name, level in levels.items():
            logging.getLogger(name).setLevel(level)
