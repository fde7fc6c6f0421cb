"""Advice: one thing about an experiment or its estimate that a user should know, and what to do about it."""

from __future__ import annotations

from dataclasses import dataclass


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
