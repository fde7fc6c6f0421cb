"""Rows with Coulomb friction without the samples that feel a reversal, where enough others are left.

A sampled sign() changes up to one sample early or late, and the low-passed velocity it is taken from crosses
zero a little off the true one. Around every reversal this leaves an error that looks like friction; it is
small against an ordinary residual, but not against the standard deviation of a consistent estimate. A moment
of rest between two motions the same way is no reversal: whether a velocity falls below a threshold there is
the filter's doing, and samples must not come and go with it (a long rest is masked in every method).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.filters.reversals import turns, widen
from modelgen.runtime.filters.zero_phase import support_samples
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.filtered_record import FilteredRecord
from modelgen.runtime.rows.observation import Observation, RowBlock, direction_keys

BoolArray = npt.NDArray[np.bool_]

# A sign that changes one sample late is felt so far: where the filter has fallen to this share of its peak.
REACH_TOLERANCE = 1e-3
# A body that reverses all the time leaves less than this share of the grid: then no sample is left out.
LEAST_SHARE = 0.3


def without_reversals(
    observation: Observation, model: Model, records: Sequence[Record], choice: FilterChoice, drop: int = 0
) -> Observation:
    """Return the observation without samples near to the reversals of a velocity whose sign is in the row."""
    filtered: dict[int, FilteredRecord] = {}
    blocks = list[RowBlock]()
    for block in observation.blocks:
        keys = direction_keys(model, block.row)
        if block.place.size and keys:
            if block.record not in filtered:
                record, factor = records[block.record], choice.decimation[block.record]
                filtered[block.record] = FilteredRecord(model, record, choice, factor, drop)
            near = _near(filtered[block.record], keys)
            thinned = _thin(block, ~near[block.place])
            if thinned.place.size >= LEAST_SHARE * block.grid:
                block = thinned
        blocks.append(block)
    return replace(observation, blocks=tuple(blocks))


def _near(signals: FilteredRecord, keys: tuple[str, ...]) -> BoolArray:
    """Return which samples kept feel a reversal, shape (grid,)."""
    choice = signals.choice
    reach = support_samples(choice.filter_order, choice.cutoff_hz, signals.record.fs, 0, REACH_TOLERANCE)
    reach += signals.direction_reach()
    near = np.zeros(signals.record.n, dtype=bool)
    for key in keys:
        near |= widen(turns(signals.direction(key)), reach)
    return np.asarray(near[signals.grid])


def _thin(block: RowBlock, keep: BoolArray) -> RowBlock:
    return replace(
        block,
        place=block.place[keep],
        Y=block.Y[keep],
        W=block.W[keep],
        masked=block.masked + int(np.sum(~keep)),
    )
