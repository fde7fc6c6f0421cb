"""Texts of users in the languages of other tools, and names that are free in them."""

from __future__ import annotations

import re
from collections.abc import Collection
from xml.sax.saxutils import escape, quoteattr


def one_line(text: str) -> str:
    """Return a text for a comment of one line: without line ends and control characters."""
    return " ".join("".join(c if c.isprintable() else " " for c in text).split())


def xml_attribute(text: str) -> str:
    """Return a text as an attribute of XML, with its quotes."""
    return quoteattr(one_line(text))


def xml_comment(text: str) -> str:
    """Return a comment of XML, in which no two hyphens may stand together."""
    return f"<!-- {re.sub('-(?=-)', '- ', escape(one_line(text))).removesuffix('-')} -->"


def quoted(text: str) -> str:
    """Return a text as a string of Modelica or C, in quotes."""
    return '"' + one_line(text).replace("\\", "\\\\").replace('"', '\\"') + '"'


def free_name(name: str, taken: Collection[str]) -> str:
    """Return the name, with underscores behind it until no other has it."""
    while name in taken:
        name += "_"
    return name
