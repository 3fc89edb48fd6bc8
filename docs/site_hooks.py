"""Hooks of MkDocs: bring README and its like into the site, and lead other links out of it.

Each rule has a page of its own, which is written from its manual.
"""

from __future__ import annotations

import os
import re
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING

from mkdocs.structure.files import File

from lab3_usd.server.manuals import rule_pages

if TYPE_CHECKING:
    from mkdocs.config.defaults import MkDocsConfig
    from mkdocs.structure.files import Files
    from mkdocs.structure.pages import Page

ROOT = Path(__file__).parents[1]
# Pages of the repository by their places in the site.
OUTSIDE = {
    "index.md": "README.md",
    "SECURITY.md": "SECURITY.md",
    "CONTRIBUTING.md": "CONTRIBUTING.md",
    "CHANGELOG.md": "CHANGELOG.md",
    "benchmarks/README.md": "benchmarks/README.md",
    "schema/README.md": "schema/README.md",
}
RULES = "rules"
_RULE = re.compile(r"\*\*([A-Z]+\d+)( [\w-]+)?\*\*")
_LINK = re.compile(r"(\]\()([^)#\s]*)(#[^)\s]*)?(\))")
_PREPARATION = re.compile(r"<!-- before:.*?-->\n*", re.DOTALL)
_WIDE = "---\nhide: [toc]\n---\n"
_FENCE = re.compile(r"^(\s*```)(\w+) \S.*$", re.MULTILINE)


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages that stand outside of docs/."""
    for place, source in OUTSIDE.items():
        content = (ROOT / source).read_text(encoding="utf-8")
        if place == "index.md":
            content = _WIDE + content
        files.append(File.generated(config, place, content=content))
    for rule_id, content in rule_pages():
        files.append(File.generated(config, f"{RULES}/{rule_id}.md", content=content))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Make links of the repository links of the site, and leave out what only tests read."""
    place = page.file.src_uri
    source = PurePosixPath(OUTSIDE.get(place, f"docs/{place}"))
    own = {repository: site for site, repository in OUTSIDE.items()}

    def link(match: re.Match[str]) -> str:
        target, anchor = match[2], match[3] or ""
        if not target or "://" in target or target.startswith("mailto:"):
            return match[0]
        path = os.path.normpath(source.parent / target).replace(os.sep, "/")
        site = own.get(path) or path.removeprefix("docs/")
        file = files.get_file_from_path(site)
        if file is None or not file.inclusion.is_included():
            return f"{match[1]}{config.repo_url}/blob/main/{path}{anchor}{match[4]}"
        near = os.path.relpath(site, PurePosixPath(place).parent).replace(os.sep, "/")
        return f"{match[1]}{near}{anchor}{match[4]}"

    if place == f"{RULES}.md":
        markdown = _RULE.sub(rf"[**\1\2**]({RULES}/\1.md)", markdown)
    text = _PREPARATION.sub("", markdown)
    return _LINK.sub(link, _FENCE.sub(r"\1\2", text))


def on_post_page(output: str, **_: object) -> str:
    """Keep the theme from asking GitHub for stars: no request leaves the reader's computer."""
    return output.replace(' data-md-component="source"', "")
