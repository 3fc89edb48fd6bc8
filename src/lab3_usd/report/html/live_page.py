"""Makes a page load itself again when its file was written anew: from disk, without a server.

A page from disk may not read files, but it may load a script. So a script beside the page says
which version of it is the last.
"""

from __future__ import annotations

import re
from base64 import b64encode
from hashlib import sha256
from pathlib import Path

_SCRIPT = """
const version = {version};
const look = () => {{
  const script = document.createElement("script");
  script.src = {name} + "?" + Date.now();
  script.onload = () => {{
    script.remove();
    if (window.lab3Version !== version) location.reload();
    else setTimeout(look, {interval});
  }};
  script.onerror = () => script.remove();
  document.head.append(script);
}};
setTimeout(look, {interval});
"""
_INTERVAL = 250  # milliseconds
_POLICY = re.compile(r"(?<=; )script-src ")


def version_file(page: Path) -> Path:
    """Return the script that says which version of a page is the last."""
    return page.with_name(f".{page.name}.version.js")


def version_script(version: int) -> str:
    """Return what that script holds."""
    return f"window.lab3Version = {version};\n"


def live_page(page: str, path: Path, version: int) -> str:
    """Return a page that loads itself again when the script beside `path` names another version.

    It allows itself scripts from disk, and still nothing from the network.
    """
    from json import dumps  # noqa: PLC0415 - strings of JSON are strings of JavaScript

    name = dumps(version_file(path).name).replace("<", "\\u003c")
    script = _SCRIPT.format(version=version, name=name, interval=_INTERVAL)
    digest = b64encode(sha256(script.encode()).digest()).decode()
    page = _POLICY.sub(f"script-src file: 'sha256-{digest}' ", page, count=1)
    head, _, tail = page.rpartition("</body>")
    return f"{head}<script>{script}</script>\n</body>{tail}"
