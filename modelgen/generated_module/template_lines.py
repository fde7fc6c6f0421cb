"""A part of a template as a block of the skeleton: what the generator writes stands in one place only."""

from __future__ import annotations

import re

from modelgen.template_folder import template_text

_DOCSTRING = re.compile(r'"""(?:[^"]|"(?!""))*"""')
_INCLUDED = re.compile(r'{% include "([a-z_]+\.py\.j2)" %}')
_VALUE = re.compile(r"{{ ([a-z_.]+) }}")

# The slots that values of templates fill.
SLOT_OF = {
    "row_count": "rows",
    "column_count": "columns",
    "measurement.buffers": "buffers",
    "entries.buffers": "buffers",
    "entries.outputs": "nonzeros",
}


def template_block(name: str, line: str = "") -> str:
    """Return the block of the skeleton that a template writes, with the two empty lines behind it.

    Parameters
    ----------
    name : str
        A part that the templates of modules include: its tags are loops over lines, and includes.
    line : str
        What slot each line of a loop is.
    """
    found, mark, slots = [], "  ", {**SLOT_OF, "line": line}
    for source in _DOCSTRING.sub('"""<text>"""', _text(name)).splitlines():
        if source.startswith("{% for "):
            mark = "* "
        elif source == "{% endfor %}":
            mark = "  "
        else:
            found.append(mark + _VALUE.sub(lambda value: f"<{slots[value[1]]}>", source) if source else "")
    return "\n".join((*found, "", "", ""))


def _text(name: str) -> str:
    """Return a template with those that it includes."""
    return _INCLUDED.sub(lambda part: _text(part[1]).removesuffix("\n"), template_text(name))
