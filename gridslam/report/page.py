"""HTML pages from the templates of this package."""

from __future__ import annotations

import jinja2

from gridslam.core.texts import visible


def page_bytes(template: str, **values: object) -> bytes:
    """The page of a template and its values, with invisible characters as escapes."""
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("gridslam.report"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    page = environment.get_template(template).render(**values)
    return visible(page).encode(errors="replace")  # file names may have bytes that are not text
