"""Which records feed which rows: by tag, or as the paper pairs them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from modelgen.errors import DataError, Problem
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.observation import Observation

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


def rows_by_tag(
    observation: Observation, records: Sequence[Record], rows_for_tag: Mapping[str, Sequence[str]]
) -> Observation:
    """Return the observation with only those rows that a record's tag may feed; other tags feed all rows.

    Raises
    ------
    DataError
        When a tag is no record's, or a row's name is unknown.
    """
    tags = dict.fromkeys(record.tag for record in records)
    names = dict.fromkeys(block.row_name for block in observation.blocks)
    problems = [
        Problem(
            "rows_for_tag",
            f"no record has the tag {tag!r}",
            f"give it to one (--tag {records[0].name}={tag}), or all rows to all records (--pairing all)",
        )
        for tag in rows_for_tag
        if tag not in tags
    ]
    problems += [
        Problem(f"rows_for_tag[{tag!r}]", f"{row!r} is no row", f"choose from {', '.join(names)}")
        for tag, rows in rows_for_tag.items()
        for row in rows
        if row not in names
    ]
    if problems:
        raise DataError(*problems)
    allowed = [rows_for_tag.get(record.tag or "", tuple(names)) for record in records]
    blocks = tuple(block for block in observation.blocks if block.row_name in allowed[block.record])
    return replace(observation, blocks=blocks)
