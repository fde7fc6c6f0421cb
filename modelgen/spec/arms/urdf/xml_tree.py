"""XML -> elements with their lines, of bounded size; what names other files or grows by itself is refused.

Expat is asked directly: a text with a document type is refused before an entity of it is read, so that none
is ever expanded, and each element keeps the line on which it begins, which messages name.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from xml.parsers import expat

from modelgen.errors import SpecError, shortened

DEEPEST, MOST_ELEMENTS = 32, 100_000
_NO_ENTITIES = "remove the document type; URDF has none"


@dataclass(frozen=True)
class Element:
    """An element: its name, attributes and line, and the elements in it. Texts between them are left out."""

    name: str
    attributes: Mapping[str, str]
    line: int
    inside: list[Element] = field(default_factory=list)

    def all(self, name: str) -> Iterator[Element]:
        """Return the elements of a name directly in this one."""
        return (element for element in self.inside if element.name == name)

    def first(self, name: str) -> Element | None:
        """Return the first of them, or None."""
        return next(self.all(name), None)


class _Refused(Exception):
    """What is wrong with the text, and the remedy."""


def xml_tree(text: str, source: str) -> Element:
    """Return the outermost element of an XML text.

    Raises
    ------
    SpecError
        When the text is no XML, has a document type, or is too deep or too large.
    """
    parser = expat.ParserCreate("utf-8")  # the text is decoded: another encoding that it names is not
    top: list[Element] = []
    open_ones: list[Element] = []
    count = 0

    def start(name: str, attributes: dict[str, str]) -> None:
        nonlocal count
        count += 1
        if count > MOST_ELEMENTS:
            raise _Refused(f"has more than {MOST_ELEMENTS} elements", "check what the file is")
        if len(open_ones) >= DEEPEST:
            raise _Refused("nests elements too deeply", "check what the file is")
        element = Element(name, attributes, parser.CurrentLineNumber)
        (open_ones[-1].inside if open_ones else top).append(element)
        open_ones.append(element)

    def refuse(*_: object) -> None:
        raise _Refused("has a document type, which can name entities and other files", _NO_ENTITIES)

    parser.StartElementHandler = start
    parser.EndElementHandler = lambda _: open_ones.pop() and None
    parser.StartDoctypeDeclHandler = refuse
    parser.EntityDeclHandler = refuse
    try:
        parser.Parse(text.encode(), True)
    except _Refused as refused:
        where = f"{source}: line {parser.CurrentLineNumber}"
        raise SpecError.at(where, *refused.args) from None
    except expat.ExpatError as error:
        what = f"is not valid XML ({shortened(expat.ErrorString(error.code) or '')})"
        raise SpecError.at(f"{source}: line {error.lineno}", what, "correct the XML there") from None
    return top[0]
