"""RecordFactors: a record in constant memory -> one small triangle for each row of the model."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import reduce

import numpy as np

from modelgen.runtime.model.model import RowInfo
from modelgen.runtime.numerics.qr_update import compiled_take_in
from modelgen.runtime.rows.chunk import Chunk
from modelgen.runtime.rows.record_rows import RecordRows
from modelgen.runtime.rows.row_factor import RowFactor, empty_factor


@dataclass(frozen=True, eq=False)
class RecordFactors:
    """The rows of one record.

    Attributes
    ----------
    name : str
        Of the record.
    grid : int
        Samples kept, masked or not.
    rows : tuple of RowFactor
        A triangle for each row of the model.
    force_power : mapping of int to float
        Number of differentiations to the sum over the grid of the squared forces (times their levers),
        differentiated so often.
    """

    name: str
    grid: int
    rows: tuple[RowFactor, ...]
    force_power: Mapping[int, float]

    def force_scale(self, row: RowInfo) -> float:
        """Return the rms of the forces, differentiated as often as a row and in its unit."""
        power = self.force_power.get(row.differentiated, 0.0) / self.grid
        return float(np.sqrt(power)) / row.lever

    def joined(self, other: RecordFactors, fast: bool | None = None) -> RecordFactors:
        """Return the factors of both stretches of the record; `fast` as for `RowFactor.with_rows`."""
        rows = tuple(a.joined(b, fast) for a, b in zip(self.rows, other.rows, strict=True))
        power = {
            times: self.force_power.get(times, 0.0) + other.force_power.get(times, 0.0)
            for times in dict.fromkeys((*self.force_power, *other.force_power))
        }
        return replace(self, grid=self.grid + other.grid, rows=rows, force_power=power)


def record_factors(rows: RecordRows, threads: int | None = None) -> RecordFactors:
    """Return the factors of a record, chunk after chunk; those of no samples for an empty grid.

    The chunks' factors are joined in their order, whatever thread they come from: the result is the same to
    the last bit.
    """
    if not len(rows.grid):
        empty = tuple(empty_factor(terms.row, terms.columns) for terms in rows.terms)
        return RecordFactors(rows.source.name, 0, empty, {})
    if rows.plan.fast is not False:
        compiled_take_in()  # once, before threads ask for it side by side

    def of(chunk: Chunk) -> RecordFactors:
        return chunk_factors(rows, chunk)

    def joined(a: RecordFactors, b: RecordFactors) -> RecordFactors:
        return a.joined(b, rows.plan.fast)

    return reduce(joined, rows.over_chunks(of, threads))


def chunk_factors(rows: RecordRows, chunk: Chunk) -> RecordFactors:
    """Return the factors of one chunk."""
    signals = chunk.signals()
    factors = []
    for terms, place in zip(rows.terms, rows.places(chunk), strict=True):
        lines = terms.evaluate(signals)
        used = lines if place is None else lines[:, place]
        factor = replace(empty_factor(terms.row, terms.columns), masked=chunk.count - used.shape[1])
        factors.append(factor.with_rows(used, rows.plan.fast) if used.shape[1] else factor)
        signals.forget(terms.row)
    return RecordFactors(rows.source.name, chunk.count, tuple(factors), dict(signals.force_power))
