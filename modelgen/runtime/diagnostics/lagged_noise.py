"""What noise of the sensors alone makes residuals follow: it is in the past of columns, too.

Behind a low-pass, noise of a reading stays correlated for as long as the filter reaches, and a column that is
largely noise, as of a rotor whose encoder is differentiated four times, is followed by what rows leave. Where
products of noise matter they are in both, too, and fluctuate by as much as their mean.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.diagnostics.noise_ways import noise_ways
from modelgen.runtime.diagnostics.row_noise import row_noise
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.filter_choice.signal_to_noise import noise_band
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record


class LaggedNoise(NamedTuple):
    """What noise makes of a residual times columns as they were 1, 2, ... samples of the grid before.

    Attributes
    ----------
    products : array, shape (columns of the fit, lags)
        Their means, in the unit of the residual times that of the column.
    squared : float
        What products of noise add to the residual, as a share of its rms.
    """

    products: FloatArray
    squared: float


def lagged_noise(
    model: Model, records: Sequence[Record], choice: FilterChoice, fit: Fit, index: int, lags: int, rms: float
) -> LaggedNoise:
    """Return what noise makes residuals of a block follow.

    Parameters
    ----------
    fit : Fit
        Of least squares; its parameters without bias.
    index : int
        Of the block.
    lags : int
        How many.
    rms : float
        Of the residual, in its unit: noise of a row is no more than it leaves.
    """
    block, x = fit.blocks[index], fit.all_parameters(model.base_parameters)
    record, factor = records[block.record], choice.decimation[block.record]
    total = np.zeros((len(model.base_parameters), lags))
    ways = noise_ways(model, record, choice, factor)[block.row]
    band, delays_s = noise_band(record, choice), np.arange(1.0, lags + 1.0) * (factor / record.fs)
    for channel in ways.slopes:
        noise = record.facts.spectrum(channel).noise
        total[ways.columns] += noise * ways.followed(channel, band, x, delays_s)
    expected = row_noise(model, record, choice, factor, block.row, x)
    share = min(1.0, (rms / expected) ** 2) if expected > 0.0 else 0.0
    places = [model.base_parameters.index(name) for name in fit.columns]
    squared = share * float(np.sqrt(np.mean(ways.of_residual(x).means ** 2)))
    return LaggedNoise(np.asarray(share * total[places]), squared / rms if rms > 0.0 else 0.0)
