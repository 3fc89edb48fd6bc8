"""Addresses of storages: what fsspec makes of them, and what of them may be printed."""

from __future__ import annotations

import html
import importlib
import os
import re
from pathlib import Path
from typing import Any
from urllib.parse import quote, unquote, urlsplit

from msgspec import Struct

from lab3_usd.errors import UsageError
from lab3_usd.installation import install_command

_SLASHES = "://"
WEB = ("http://", "https://")
# A user with a password, which may hold any character; a number behind the colon is a port.
_USER = re.compile(r"//(?:[^/?#\s]*|[^/\s:]*:(?!\d+/)\S*)@")
_QUERY = re.compile(r"\?[^\s=]*=\S*")  # a signature or a token gives access as a password does


class StorageLocation(Struct, frozen=True):
    """A storage of fsspec, and a path in it."""

    storage: Any
    root: str


def is_address(place: str) -> bool:
    """Whether a place is an address for fsspec (`s3://course/lab3`) and not a path."""
    return _SLASHES in place


def without_secrets(text: str) -> str:
    """Return a text whose addresses have neither users with passwords nor queries."""
    return _QUERY.sub("?***", _USER.sub("//***@", text))


def public_place(place: Path | str) -> str:
    """Return what a place is called in messages: a path as it is, an address without secrets."""
    return without_secrets(place) if isinstance(place, str) else str(place)


def reason_of(error: Exception) -> str:
    """Say in a few words why a storage failed, without its addresses."""
    cause = error.__cause__
    if isinstance(error, FileNotFoundError) and error.errno is None:  # whatever a web server says
        return reason_of(cause) if isinstance(cause, Exception) else "not found"
    status, message = (getattr(error, name, None) for name in ("status", "message"))
    if isinstance(status, int) and message:  # of a web server
        return f"{status} {message}"
    if isinstance(error, OSError) and error.errno is not None and error.errno > 0:
        return os.strerror(error.errno)
    return str(getattr(error, "strerror", None) or type(error).__name__)


def storage_at(address: str) -> StorageLocation:
    """Return the storage of an address; what it remembers of earlier runs is forgotten.

    Raises:
        UsageError: fsspec or a package that it needs is not installed, or it knows no such address.
    """
    called = public_place(address)
    try:
        core = importlib.import_module("fsspec.core")
    except ImportError as error:
        raise UsageError(
            f"{called}: addresses need the extra cluster: {install_command('cluster')}"
        ) from error
    # Of the pages of a web server links alone are entries, not every address in their text.
    options = {"simple_links": False} if address.startswith(WEB) else {}
    try:
        storage, root = core.url_to_fs(address, **options)
        storage.invalidate_cache()
    except ImportError as error:
        raise UsageError(f"{called}: a package for it is not installed here ({error})") from error
    except Exception as error:
        why = without_secrets(str(error))
        raise UsageError(f"{called}: fsspec does not know it ({why})") from error
    return StorageLocation(storage, str(root))


def name_at(path: str) -> str:
    """Return the name of what lies at a path of a storage: of a web page it is encoded twice."""
    if not is_address(path):
        return path.rstrip("/").rpartition("/")[2]
    return unquote(html.unescape(urlsplit(path).path.rstrip("/").rpartition("/")[2]))


def address_below(address: str, name: str, *, is_folder: bool) -> str:
    """Return the address of an entry of a folder; of a web server, folders end in a slash."""
    if not address.startswith(WEB):
        return f"{address.rstrip('/')}/{name}"
    return f"{address.rstrip('/')}/{quote(name)}{'/' * is_folder}"
