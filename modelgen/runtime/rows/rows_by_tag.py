"""Which records feed which rows: by tag, or as the paper pairs them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from modelgen.runtime.model.model import Model

PAPER = "pham2002"
RowsForTag = Mapping[str, Sequence[str]]


def rows_for_tags(model: Model, given: RowsForTag | str | None) -> RowsForTag | None:
    """Return the rows (by name) that records of a tag may feed; None where every record feeds every row.

    "pham2002" is the paper's pairing: records tagged ``chirp`` feed the differentiated rows, as friction is
    constant while the motor turns one way, and records tagged ``trapezoid`` the others, which hold it. Models
    without differentiated rows need no pairing.
    """
    if not isinstance(given, str):
        return given
    differentiated = [row.name for row in model.rows if row.differentiated]
    others = [row.name for row in model.rows if not row.differentiated]
    return {"chirp": differentiated, "trapezoid": others} if differentiated else None
