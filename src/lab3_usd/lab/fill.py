"""Fills the text templates of the folder `templates`."""

from __future__ import annotations

from pathlib import Path

FOLDER = Path(__file__).resolve().parent / "templates"


def fill_template(template: str, **values: object) -> str:
    """Return the template with its values; a value that is missing is an error."""
    import jinja2  # noqa: PLC0415 - the other commands start without it

    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(FOLDER, encoding="utf-8"),
        undefined=jinja2.StrictUndefined,
        keep_trailing_newline=True,
        autoescape=False,  # noqa: S701 - YAML, Python and shell, not HTML
    )
    return environment.get_template(template).render(**values)
