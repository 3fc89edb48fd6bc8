"""A page that loads itself again after each save, for `--watch`.

A page from disk may not read files, but it may load a script. So a script beside the page says
which version of it is the last.
"""

from __future__ import annotations

import json
import re
from base64 import b64encode
from hashlib import sha256
from pathlib import Path

from lab3_usd.errors import UsageError
from lab3_usd.files import write_whole

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
    name = json.dumps(version_file(path).name).replace("<", "\\u003c")
    script = _SCRIPT.format(version=version, name=name, interval=_INTERVAL)
    digest = b64encode(sha256(script.encode()).digest()).decode()
    page = _POLICY.sub(f"script-src file: 'sha256-{digest}' ", page, count=1)
    head, _, tail = page.rpartition("</body>")
    return f"{head}<script>{script}</script>\n</body>{tail}"


def write_live_page(page: str, path: Path, version: int) -> None:
    """Write a version of a page, then the script that has open browsers load it.

    Raises:
        UsageError: a file beside the page, which the first version would replace, is another's.
    """
    script = version_file(path)
    is_ours = not script.exists() or script.read_bytes().startswith(b"window.lab3Version")
    if version == 1 and not is_ours:
        raise UsageError(f"{script}: is not of this program; move it away")
    text = live_page(page, path, version)
    write_whole(path, text.encode("utf-8", "replace"), force=True)
    write_whole(script, version_script(version).encode(), force=True)


def end_live_page(page: str, path: Path) -> None:
    """Replace the live page with a plain report."""
    write_whole(path, page.encode("utf-8", "replace"), force=True)
    version_file(path).unlink(missing_ok=True)
