"""The Jinja2 environment: undefined names are errors."""

from __future__ import annotations

from functools import cache

import jinja2

from modelgen.template_folder import template_folder


@cache
def environment() -> jinja2.Environment:
    """Return the environment for source code: no HTML escaping, values come from the printer as source.

    There is one, for it keeps the templates compiled, which takes longer than to fill them.
    """
    env = template_environment(html=False)
    env.filters["indented"] = _indented
    return env


def template_environment(html: bool) -> jinja2.Environment:
    """Return what makes text of templates; in HTML every value is escaped, the last line break dropped."""
    return jinja2.Environment(
        loader=jinja2.FileSystemLoader(template_folder()),
        undefined=jinja2.StrictUndefined,
        autoescape=html,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=not html,
    )


def _indented(source: str, name: str) -> str:
    """Shift the later lines of a wrapped literal to stand below its first, behind ``name = ``."""
    return source.replace("\n", "\n" + " " * (len(name) + 3))
