"""Advice: one thing about an experiment or its estimate that a user should know, and what to do about it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

# The kind of what may be the rows' own: no warning, but a note.
ROWS_OWN = "near reversals"


@dataclass(frozen=True)
class Advice:
    """A warning with its remedy.

    `kind` is for programs ("never reversing", "dependent columns", ...), `where` names the record, the row or
    the parameters, `what` says what is wrong with it, `remedy` what to do.
    """

    kind: str
    where: str
    what: str
    remedy: str

    @property
    def sentence(self) -> str:
        """The advice as one line."""
        return f"{self.kind}: {self.where} {self.what}; {self.remedy}"


def noted(told: Sequence[Advice]) -> tuple[tuple[Advice, ...], tuple[str, ...]]:
    """Return the warnings among some advice, and notes on what may be the rows' own."""
    notes = tuple(
        f"{one.kind}, where directions are those of a low-passed velocity, {one.where} {one.what}"
        for one in told
        if one.kind == ROWS_OWN
    )
    return tuple(one for one in told if one.kind != ROWS_OWN), notes
