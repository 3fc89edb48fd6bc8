"""The templates of the HTML pages, with escaping and the content security policy."""

from __future__ import annotations

import os
import re
import sys
from base64 import b64encode
from collections.abc import Mapping
from functools import lru_cache
from hashlib import sha256
from pathlib import Path

import jinja2
from markupsafe import Markup, escape

from lab3_usd.data import program
from lab3_usd.report.options import NAME, tool_version
from lab3_usd.report.picture.svg import PALETTES, stylesheet
from lab3_usd.report.safe_text import visible

FOLDER = Path(__file__).resolve().parent / "templates"
COMPILED = FOLDER / "compiled"
_BREAK_AFTER = re.compile(r"(?<=\w)[/.:_](?=\w)")
_CODE = re.compile(r"`([^`]+)`")
_LONG, _LINE = 20, 32  # letters of a word that may not fit into a line, and of a short line


def fill_page(template: str, assets: tuple[str, ...], **values: object) -> str:
    """Return a template with its values, and the styles and scripts of these files."""
    return jinja_environment().get_template(template).render(**page_values(*assets), **values)


@lru_cache(maxsize=4)
def page_values(*assets: str) -> Mapping[str, object]:
    """Return what every page has: style, script, the policy that allows them, and our version.

    A page with the style of pictures has their colours as well. The policy allows nothing from
    anywhere, our style and script as they are, and the picture in the browser's tab, which is data.
    """
    style, script = (
        "".join(asset_text(name) for name in assets if name.endswith(ending))
        for ending in (".css", ".js")
    )
    if "picture.css" in assets:
        style = palette_style() + style + stylesheet()
    policy = ["default-src 'none'", "img-src data:", "base-uri 'none'", "form-action 'none'"]
    for kind, text in (("style", style), ("script", script)):
        digest = b64encode(sha256(text.encode()).digest()).decode()
        policy.append(f"{kind}-src 'sha256-{digest}'")
    return {
        "style": own_markup(style),
        "script": own_markup(script),
        "policy": "; ".join(policy),
        "tool": f"{NAME} {tool_version()}",
    }


@lru_cache(maxsize=1)
def jinja_environment() -> jinja2.Environment:
    """Return the templates: every value is escaped, for HTML and where it does not print.

    A wheel carries the templates compiled, as modules; else they are those of the checkout.
    """
    loader: jinja2.BaseLoader = jinja2.FileSystemLoader(FOLDER, encoding="utf-8")
    cache = None
    if COMPILED.is_dir():
        loader = jinja2.ModuleLoader(COMPILED)
    elif not sys.dont_write_bytecode and os.access(FOLDER, os.W_OK):
        cache_folder = FOLDER / "__pycache__"
        cache_folder.mkdir(exist_ok=True)
        cache = jinja2.FileSystemBytecodeCache(str(cache_folder))
    environment = jinja2.Environment(
        loader=loader,
        bytecode_cache=cache,
        undefined=jinja2.StrictUndefined,
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        finalize=lambda value: (
            visible(str(value))
            if isinstance(value, str) and not isinstance(value, Markup)
            else value
        ),
    )
    environment.globals["program"] = program
    environment.filters.update(
        picture=own_markup, path=_path, prose=_prose, command=_command, paper=_paper
    )
    return environment


def asset_text(name: str) -> str:
    """Return a style or script of the pages."""
    return (FOLDER / name).read_text(encoding="utf-8")


def compile_templates(target: Path) -> None:
    """Write the templates below `target` as modules, for a wheel."""
    jinja_environment().compile_templates(target, ["j2"], zip=None, ignore_errors=False)


def own_markup(text: str) -> Markup:
    """Return markup of our own: files of this package, and pictures that escape themselves."""
    return Markup(text)  # noqa: S704 - see above


def _path(text: str) -> Markup:
    """Return a path that may be broken between its names."""
    return own_markup(_BREAK_AFTER.sub(r"\g<0><wbr>", _escaped(text)))


@lru_cache(maxsize=1024, typed=True)  # the pages of a class say the same; markup is no text
def _prose(text: str) -> Markup:
    """Return a sentence, what stands between backticks as code.

    A long path moves to the next line as a whole, one that is longer than a line is broken.
    """
    words = map(_breakable, text.split(" "))
    return own_markup(_CODE.sub(r"<code>\1</code>", " ".join(words)))


def _breakable(word: str) -> str:
    if len(word) <= _LONG:
        return _escaped(word)
    return _path(word) if len(word) > _LINE else f'<span class="long">{_path(word)}</span>'


def _command(text: str) -> Markup:
    """Return a command line, broken between its words and in paths, not after a hyphen."""
    words = (
        f'<span class="flag">{_escaped(word)}</span>' if word.startswith("-") else _path(word)
        for word in text.split(" ")
    )
    return own_markup(" ".join(words))


def _escaped(text: str) -> str:
    return str(escape(visible(text)))


_SIZE = re.compile(r'<svg [^>]* width="(\d+)" height="(\d+)"')
_WIDE = 1300  # units: a wider picture is printed on a page of its own, on its side


def _paper(svg: str) -> str:
    """Return the class of a picture that needs a landscape page in print, ' ' before it."""
    size = _SIZE.search(svg)
    width, height = (int(size[1]), int(size[2])) if size else (0, 0)
    return " landscape" if width > max(_WIDE, 1.3 * height) else ""


def palette_style() -> str:
    """Return the colours of the pictures as variables of a page's style."""
    light, dark = (
        "".join(f"--{name.replace('_', '-')}:{value};" for name, value in PALETTES[theme].items())
        for theme in ("light", "dark")
    )
    return f":root{{{light}}}@media screen and (prefers-color-scheme:dark){{:root{{{dark}}}}}\n"
