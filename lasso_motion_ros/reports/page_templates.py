"""The templates of the pages."""

from __future__ import annotations

import jinja2


def page_template(name: str) -> jinja2.Template:
    """A template of this room; a value that it lacks is an error, and what it is given is escaped."""
    return jinja2.Environment(
        loader=jinja2.PackageLoader("lasso_motion_ros.reports"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    ).get_template(name)
