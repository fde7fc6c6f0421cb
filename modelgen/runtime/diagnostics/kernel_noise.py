"""What noise of the sensors does to rows that are nonlinear in their signals: by adding as much once more."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.observation import observe

# Samples of the record that noise is added to: its power does not depend on where the arm is by much.
MOST_SAMPLES = 1 << 16


def added_noise(
    model: Model, record: Record, choice: FilterChoice, factor: int
) -> dict[int, tuple[FloatArray, FloatArray]]:
    """Return what noise adds to W^T W and W^T Y of every row, a sample: shapes (c, c) and (c,).

    Parameters
    ----------
    model : Model
    record : Record
        Whose noise is read off its spectra; noise of the same power, seeded, is added to a part of it.
    choice : FilterChoice
    factor : int
        Decimation of the record.
    """
    start = max(0, (record.n - MOST_SAMPLES) // 2)
    part = record.part(start, min(record.n, start + MOST_SAMPLES), record.name)
    rng = np.random.default_rng(0)
    louder = part.edited(
        {
            key: part.read(key, 0, part.n)
            + record.facts.spectrum(key).spread(record.fs) * rng.standard_normal(part.n)
            for key in model.channels
        }
    )
    pair = replace(choice, decimation=(factor, factor))
    width = len(model.base_parameters)
    blocks = [block.dense(width) for block in observe(model, (part, louder), pair).blocks]
    found = {}
    for row in range(len(model.rows)):
        own = {block.record: block for block in blocks if block.row == row}
        if len(own) < 2:
            continue
        _, one, other = np.intersect1d(own[0].place, own[1].place, return_indices=True)
        if not one.size:
            continue
        moved, left = own[1].W[other] - own[0].W[one], own[1].Y[other] - own[0].Y[one]
        found[row] = (moved.T @ moved / one.size, moved.T @ left / one.size)
    return found
