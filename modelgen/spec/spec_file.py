"""The text of a TOML file that describes a machine -> its document, and whether that is a chain or an arm."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import PurePath

from modelgen.documents import Document, toml_document
from modelgen.errors import Problem, SpecError
from modelgen.read_file import SPEC


@dataclass(frozen=True)
class SpecFile:
    """A file's document, its name without its folder, and the hash of its bytes."""

    document: Document
    source: str
    sha256: str


def spec_file(text: str, source: str) -> SpecFile:
    """Return the document of a TOML text; `source` is the name of the file that messages speak of.

    Raises
    ------
    SpecError
        If it is no TOML, too large, or of a name that cannot be printed.
    """
    source = PurePath(source).name
    if not source.isprintable():  # it becomes part of a comment in generated modules
        raise SpecError.at(ascii(source), "has a file name with control characters", "rename the file")
    content = text.encode(errors="surrogatepass")
    if len(content) > SPEC.largest:
        raise SpecError.at(
            source, "is larger than 1 MB", "check that this is a chain's or an arm's TOML file"
        )
    if text.removeprefix("\ufeff").lstrip().startswith("<"):
        raise SpecError.at(
            source, "is XML, no TOML", "of a URDF make a TOML file: modelgen new NAME --urdf FILE"
        )
    document = toml_document(text, source, ("bodies", "chain", "joints", "arm"), SpecError)
    return SpecFile(document, source, hashlib.sha256(content).hexdigest())


def describes_arm(document: Document) -> bool:
    """Return whether the tables are those of an arm: [arm], or [[joints]] without [chain]."""
    return "chain" not in document and bool(document.keys() & {"arm", "joints"})


def in_file(source: str, problems: Iterable[Problem]) -> SpecError:
    """Return the error for the mistakes of a file."""
    return SpecError(*(Problem(f"{source}: {p.where}", p.what, p.remedy) for p in problems))
