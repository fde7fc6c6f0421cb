"""All errors of modelgen, in one tree.

    ModelgenError                 anything modelgen can explain; exit code 2
    +-- SpecError                 the TOML file of a chain or an arm is wrong
    +-- ModelError                the chain is well written, but no model can be derived from it
    +-- RenderError               a module cannot be generated or written
    +-- DataError                 a record, a mapping or an option of the estimation is wrong
    +-- IdentifiabilityError      the data cannot answer the question; exit code 1

Every error carries one `Problem` per mistake: where it is, what is wrong and what to do about it.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from itertools import islice
from typing import ClassVar, Self

LONGEST = 600  # characters of each part of a message; names may have megabytes
COMPARED, LONGEST_NAME = 200, 64  # names, and their characters, that a misspelt one is compared with


def visible(text: str) -> str:
    """Return a text with control characters written out: a file's name must not steer the terminal."""
    return text if text.isprintable() else "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)


def shortened(text: str, width: int = 80) -> str:
    """Return a text of at most so many characters: its beginning and its end matter more than its middle."""
    if len(text) <= width:
        return text
    end = (width - 3) // 2
    return f"{text[: width - 3 - end]}...{text[-end:]}"


def listed(names: Iterable[str], between: str = ", ", most: int = 20, width: int = 80) -> str:
    """Return "a, b, c and 97 more": a line that a person can read, however many and long the names are.

    Of nothing it is "none", so that no sentence has a hole.
    """
    texts = list(names)
    if not texts:
        return "none"
    shown = between.join(shortened(text, width) for text in texts[:most])
    return shown if len(texts) <= most else f"{shown} and {len(texts) - most} more"


def signed_sum(terms: Iterable[tuple[bool, str]]) -> str:
    """Return "-a + b - c" of terms without their signs and whether each is negative; of none, no text."""
    text = ""
    for negative, term in terms:
        text += f" {'-' if negative else '+'} {term}" if text else f"{'-' if negative else ''}{term}"
    return text


def aligned(rows: Sequence[Sequence[str]], left: int | None = None) -> list[str]:
    """Return the rows of a table as lines, the first `left` columns (None: all) to the left, others right."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return [
        "  ".join(
            text.ljust(width) if left is None or i < left else text.rjust(width)
            for i, (text, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in rows
    ]


def nearest(name: str, names: Iterable[str]) -> str | None:
    """Return the right name that a misspelt one is nearest to; None if none is near.

    Only so many and so long ones are compared: the time grows with the product of both lengths.
    """
    known = [other for other in islice(names, COMPARED) if len(other) <= LONGEST_NAME]
    return next(iter(get_close_matches(name[:LONGEST_NAME], known, n=1)), None)


@dataclass(frozen=True)
class Problem:
    """One mistake: where (file, key, channel, sample), what is wrong, and the remedy.

    Each is kept in one line of visible characters, of a length that a terminal shows.
    """

    where: str
    what: str
    remedy: str

    def __post_init__(self) -> None:
        for name in ("where", "what", "remedy"):
            object.__setattr__(self, name, visible(shortened(getattr(self, name), LONGEST)))

    def __str__(self) -> str:
        return f"{self.where}: {self.what}; {self.remedy}"


class ModelgenError(Exception):
    """Base of all errors that modelgen explains; `problems` holds one entry per mistake."""

    exit_code: ClassVar[int] = 2

    def __init__(self, *problems: Problem) -> None:
        super().__init__(*problems)
        self.problems = tuple(dict.fromkeys(problems))  # an option that is wrong is wrong for every file

    def __str__(self) -> str:
        return "\n".join(str(problem) for problem in self.problems)

    @classmethod
    def at(cls, where: str, what: str, remedy: str) -> Self:
        """Return the error for a single mistake."""
        return cls(Problem(where, what, remedy))

    @classmethod
    def raise_any(cls, problems: Sequence[Problem]) -> None:
        """Raise one error for all mistakes that were found, if there are any."""
        if problems:
            raise cls(*problems)


class SpecError(ModelgenError):
    """The TOML file of a chain or an arm is wrong, or the URDF that it names."""


class ModelError(ModelgenError):
    """The chain is well written, but no model can be derived from it."""


class RenderError(ModelgenError):
    """A module cannot be generated or written."""


class DataError(ModelgenError):
    """A record, a channel mapping or an option of the estimation is wrong."""


class IdentifiabilityError(ModelgenError):
    """The data cannot answer the question."""

    exit_code: ClassVar[int] = 1
