"""A web server on this computer that serves a folder, and its faults."""

from __future__ import annotations

import base64
import functools
import io
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from http import HTTPStatus
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any


@dataclass
class WebServer:
    """Where a folder is served, and what was asked for.

    `fault` says of a request, by its path, what is wrong with its answer: a status, "short" for a
    body that ends too early, "half" for one that answers every part with the first half, "page" for
    a page to log in, "form" for one with links and a field for a password, "gone" for a server that
    answers nothing. `password` is asked for.
    """

    address: str = ""
    password: str = ""
    fault: Callable[[str], str | HTTPStatus | None] = lambda _path: None
    asked: list[str] = field(default_factory=list)


@contextmanager
def served(folder: Path) -> Iterator[WebServer]:
    """Serve a folder as long as this lasts."""
    server = WebServer()
    listener = ThreadingHTTPServer(
        ("127.0.0.1", 0), functools.partial(_Handler, directory=str(folder), server_=server)
    )
    server.address = f"http://127.0.0.1:{listener.server_port}"
    thread = threading.Thread(target=listener.serve_forever, kwargs={"poll_interval": 0.02})
    thread.start()
    try:
        yield server
    finally:
        listener.shutdown()
        thread.join()
        listener.server_close()


_PAGES: dict[object, bytes] = {
    "page": b"<!DOCTYPE html><title>Log in</title>",
    "form": b'<a href="help.html">Help</a> <input type="password" name="p">',
}


class _Handler(SimpleHTTPRequestHandler):
    def __init__(self, *arguments: Any, server_: WebServer, **options: Any) -> None:
        self._server = server_
        super().__init__(*arguments, **options)

    def log_message(self, *_arguments: Any) -> None:
        """Say nothing."""

    def send_head(self) -> Any:
        self._server.asked.append(self.path)
        expected = base64.b64encode(f"user:{self._server.password}".encode()).decode()
        given = self.headers.get("Authorization")
        if self._server.password and given != f"Basic {expected}":
            self.send_error(HTTPStatus.UNAUTHORIZED)
            return None
        fault = self._server.fault(self.path)
        if fault == "gone":
            self.close_connection = True
            self.connection.close()
            return None
        if isinstance(fault, HTTPStatus):
            self.send_error(fault)
            return None
        if fault in _PAGES:
            return self._page(_PAGES[fault])
        if fault == "half":
            return self._half()
        return super().send_head()

    def _page(self, page: bytes) -> Any:
        self.send_response(HTTPStatus.OK)
        self.send_header("Content-Type", "text/html; charset=utf-8")
        self.end_headers()
        return io.BytesIO(page)

    def _half(self) -> Any:
        data = Path(self.translate_path(self.path)).read_bytes()
        half = data[: len(data) // 2]
        self.send_response(HTTPStatus.OK if self.command == "HEAD" else HTTPStatus.PARTIAL_CONTENT)
        self.send_header("Accept-Ranges", "bytes")
        if self.command == "HEAD":
            self.send_header("Content-Length", str(len(data)))
        else:
            self.send_header("Content-Range", f"bytes 0-{len(half) - 1}/{len(data)}")
            self.send_header("Content-Length", str(len(half)))
        self.end_headers()
        return io.BytesIO(half)

    def copyfile(self, source: Any, outputfile: Any) -> None:
        data = source.read()
        if self._server.fault(self.path) == "short":
            data = data[: len(data) // 2]
            self.close_connection = True
        outputfile.write(data)
