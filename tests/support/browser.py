"""A headless Chromium for tests of pages, skipped visibly where there is none."""

from __future__ import annotations

import itertools
import json
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest

SWITCHES = (
    "--headless=new",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--incognito",  # no history is written
    "--disable-dev-shm-usage",
    "--hide-scrollbars",
    "--force-prefers-reduced-motion",
    # A part of its work is to divide itself up.
    "--in-process-gpu",
    "--disable-features=RenderDocument,ProactivelySwapBrowsingInstance",
)
DESKTOP = (1280, 900)
SHOWN = """[...document.querySelectorAll(arguments[0])].filter((each) => {
  const { width, height } = each.getBoundingClientRect();
  return (width || height)
    && each.checkVisibility({ opacityProperty: true, visibilityProperty: true });
})"""
PHONE = (390, 844)
# Text and the colour behind it, as far as the page sets them; pictures have their own test.
CONTRASTS = """
const number = (text) => text.match(/[\\d.]+/g).map(Number);
const light = (colour) => {
  const [r, g, b] = colour.slice(0, 3).map((v) => v / 255)
    .map((v) => (v <= 0.03928 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4));
  return 0.2126 * r + 0.7152 * g + 0.0722 * b;
};
const found = [];
for (const element of document.querySelectorAll("body *")) {
  const own = [...element.childNodes].some((node) => node.nodeType === 3 && node.data.trim());
  if (!own || !element.checkVisibility() || element.closest("script, svg")) continue;
  let behind = element;
  while (behind && number(getComputedStyle(behind).backgroundColor)[3] === 0) {
    behind = behind.parentElement;
  }
  const ground = number(getComputedStyle(behind || document.body).backgroundColor);
  const ink = number(getComputedStyle(element).color);
  const [low, high] = [light(ink), light(ground)].sort((a, b) => a - b);
  found.push([(high + 0.05) / (low + 0.05), element.className || element.tagName]);
}
return found;
"""


@contextmanager
def started() -> Iterator[Browser]:
    """Start Chromium with an empty profile; the test skips where it or its driver is missing."""
    webdriver = pytest.importorskip("selenium.webdriver", reason="selenium is not installed")
    program, driver = shutil.which("chromium"), shutil.which("chromedriver")
    if program is None or driver is None:
        pytest.skip("there is no browser: install chromium and chromium-driver")
    options = webdriver.ChromeOptions()
    options.binary_location = program
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    with TemporaryDirectory() as profile:
        for switch in (*SWITCHES, f"--user-data-dir={profile}"):
            options.add_argument(switch)
        running = webdriver.Chrome(
            options=options, service=webdriver.ChromeService(executable_path=driver)
        )
        try:
            yield Browser(running)
        finally:
            running.quit()


class Browser:
    """What the tests ask of a browser; `driver` is selenium's."""

    def __init__(self, driver: Any) -> None:
        self.driver = driver
        self.openings = itertools.count()
        self.emulated: dict[str, Any] = {}
        self.looked_at: tuple[Any, ...] = ()

    def open(
        self, path: Path, size: tuple[int, int] = DESKTOP, scheme: str = "light", at: str = ""
    ) -> None:
        """Open a page in a window of this size, as if for the first time."""
        self.resize(size)
        self.scheme(scheme)
        self.logs()
        self.requests()
        address = f"{path.as_uri()}?{next(self.openings)}"  # another one is loaded, not shown again
        self.visit(address + (f"#{at}" if at else ""))

    def visit(self, address: str) -> None:
        self.looked_at = ()
        self.driver.get(address)

    def look_at(self, path: Path, size: tuple[int, int] = DESKTOP, scheme: str = "light") -> None:
        """Open a page that the test changes nothing of, unless the last one looked at it so too."""
        wanted = (path, size, scheme)
        if self.looked_at != wanted:
            self.open(path, size, scheme)
            self.looked_at = wanted

    def resize(self, size: tuple[int, int]) -> None:
        metrics = {"width": size[0], "height": size[1], "deviceScaleFactor": 1}
        self.emulate("setDeviceMetricsOverride", mobile=size[0] < 500, **metrics)

    def scheme(self, scheme: str, media: str = "") -> None:
        features = [{"name": "prefers-color-scheme", "value": scheme}]
        self.emulate("setEmulatedMedia", media=media, features=features)

    def scripts(self, *, on: bool) -> None:
        self.emulate("setScriptExecutionDisabled", value=not on)

    def emulate(self, name: str, **values: Any) -> None:
        """Emulate this for all pages that follow, where it is not so already."""
        if self.emulated.get(name) != values:
            self.emulated[name] = values
            self.command(f"Emulation.{name}", **values)

    def command(self, name: str, **values: Any) -> Any:
        return self.driver.execute_cdp_cmd(name, values)

    def run(self, script: str, *values: Any) -> Any:
        return self.driver.execute_script(script, *values)

    def all(self, selector: str) -> list[Any]:
        return list(self.driver.find_elements("css selector", selector))

    def shown(self, selector: str) -> list[Any]:
        """Return the elements that can be seen, after one question for all of them."""
        return list(self.run(f"return {SHOWN}", selector))

    def texts(self, selector: str) -> list[str]:
        """Return the text of the elements that can be seen."""
        return list(self.run(f"return {SHOWN}.map((each) => each.innerText.trim())", selector))

    def with_text(self, selector: str, words: str) -> Any:
        """Return the first element with these words in it."""
        return self.run(
            "return [...document.querySelectorAll(arguments[0])]"
            ".find((each) => each.textContent.includes(arguments[1]))",
            selector,
            words,
        )

    def one(self, selector: str) -> Any:
        return self.driver.find_element("css selector", selector)

    def logs(self) -> list[str]:
        """Return what the console says since the last call."""
        return [entry["message"] for entry in self.driver.get_log("browser")]

    def requests(self) -> list[str]:
        """Return the addresses that were asked for since the last call."""
        found = []
        for entry in self.driver.get_log("performance"):
            message = json.loads(entry["message"])["message"]
            if message["method"] == "Network.requestWillBeSent":
                found.append(message["params"]["request"]["url"])
        return found
