"""Maps the assets of a server to local folders.

usd-core's default resolver takes an address for the name of a file: `https://server/robot.usd` is
`https:/server/robot.usd` below one of the folders that it searches. So a folder to search is made,
of links that lead from addresses to where the assets lie. Layers stay as they are, and say the
address.
"""

from __future__ import annotations

import os
import re
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path, PurePosixPath

from lab3_usd.errors import UsageError

SEARCH_PATH = "PXR_AR_DEFAULT_SEARCH_PATH"  # of usd-core, which reads it when it starts
_ADDRESS = r"[A-Za-z][A-Za-z0-9+.-]+:/+[^/]"


def check_place(address: str, folder: Path) -> None:
    """Make sure that assets of an address can lie in a folder.

    Raises:
        UsageError: it is no address, or there is no such folder.
    """
    if not re.match(_ADDRESS, address) or ".." in address.split("/"):
        raise UsageError(f"{address}: is not an address, as https://server/Assets is")
    if not folder.is_dir():
        raise UsageError(f"{folder}: there is no such folder, in which assets of {address} lie")


@contextmanager
def assets_at(places: Mapping[str, Path]) -> Iterator[None]:
    """Let addresses lead to folders, in the stages that are opened meanwhile, also by processes.

    An address stands for all below it; the longest one counts first, and then what else usd-core
    searches.

    Raises:
        UsageError: one is no address, a folder is missing, or no link can be made.
    """
    for address, folder in places.items():
        check_place(address, folder)
    if not places:
        yield
        return
    before = os.environ.get(SEARCH_PATH)
    with tempfile.TemporaryDirectory(prefix="lab3-assets-") as top:
        links = list(_link(places, Path(top).resolve()))
        try:
            _search(filter(None, (*links, before)))
            yield
        finally:
            _search(filter(None, [before]))


def _link(places: Mapping[str, Path], top: Path) -> Iterator[str]:
    """Make the links, and yield the folders to search, in order."""
    ranked = sorted(places.items(), key=lambda place: -len(place[0]))
    for number, (address, folder) in enumerate(ranked):
        link = top / str(number) / PurePosixPath(address)
        try:
            link.parent.mkdir(parents=True)
            link.symlink_to(folder.resolve(), target_is_directory=True)
        except OSError as error:
            raise UsageError(f"{address}: cannot be linked here ({error.strerror})") from error
        yield str(top / str(number))


def _search(folders: Iterable[str]) -> None:
    """Let usd-core search these folders, in this process and in later subprocesses."""
    from pxr import Ar

    path = os.pathsep.join(folders)
    if path:
        os.environ[SEARCH_PATH] = path
    else:
        os.environ.pop(SEARCH_PATH, None)
    Ar.DefaultResolver.SetDefaultSearchPath(path.split(os.pathsep) if path else [])


def local_file(path: str) -> str:
    """Return the file of a layer, which usd-core names by a link where it had to search."""
    searched = filter(None, os.environ.get(SEARCH_PATH, "").split(os.pathsep))
    is_found = path.startswith(tuple(f"{folder}{os.sep}" for folder in searched))
    return os.path.realpath(path) if is_found else path
