"""Weights from the covariance of residuals between the rows of a record (Zellner 1962).

What a link's model lacks acts on both of its bodies, with opposite sign: each of the two rows leaves it,
their sum does not. Weights that know how residuals of rows go together trust that sum.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial, reduce

import numpy as np

from modelgen.array_types import FloatArray, IntArray
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.projected_least_squares import with_regressors
from modelgen.runtime.least_squares.thresholds import SMALLEST_DEVIATION
from modelgen.runtime.numerics.decorrelation import whitening
from modelgen.runtime.numerics.regressor import plain_regressors
from modelgen.runtime.rows.row_block import RowBlock


def across_rows(fit: Fit) -> Fit:
    """Return the fit of combinations of rows whose residuals, by those of the fit, are uncorrelated.

    Of the samples that all rows of a record use. Residuals count around zero: a mean is an error as well.
    """
    fit = fit.dense()
    regressors = fit.regressors
    blocks: list[RowBlock] = []
    projected: list[FloatArray] = []
    for ours in fit.by_record.values():
        places = [fit.blocks[index].place for index in ours]
        kept: list[slice | IntArray]
        common, kept = places[0], [slice(None)] * len(ours)
        if any(len(place) < fit.blocks[index].grid for place, index in zip(places, ours, strict=True)):
            common = reduce(partial(np.intersect1d, assume_unique=True), places)
            kept = [np.searchsorted(place, common) for place in places]
        left = np.stack([fit.residuals[index][rows] for index, rows in zip(ours, kept, strict=True)])
        share = whitening(left @ left.T / max(len(common), 1), SMALLEST_DEVIATION)
        Y = np.stack([fit.blocks[index].Y[rows] for index, rows in zip(ours, kept, strict=True)])
        W = np.stack([fit.blocks[index].W[rows] for index, rows in zip(ours, kept, strict=True)])
        Z = np.stack([regressors[index].samples[rows] for index, rows in zip(ours, kept, strict=True)])
        for place, index in enumerate(ours):
            part = share[place]
            one = replace(
                fit.blocks[index],
                place=common,
                Y=np.tensordot(part, Y, 1),
                W=np.tensordot(part, W, 1),
                masked=fit.blocks[index].grid - len(common),
            )
            blocks.append(one)
            projected.append(np.tensordot(part, Z, 1))
    alike = replace(fit, blocks=tuple(blocks), weights=(1.0,) * len(blocks))
    return with_regressors(alike, plain_regressors(tuple(projected)))
