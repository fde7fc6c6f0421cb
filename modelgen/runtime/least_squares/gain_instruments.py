"""Instruments for what drives report, where their gains are columns: what it should be by the rows.

A drive's signal is measured with noise. On the left side that averages out; as a column of the regressor it
adds its power to W^T W, and every parameter shrinks, most where a payload of known mass, small against the
forces of the arm itself, fixes the scale. The column without what the row leaves is free of that noise (it is
the orthogonal projection of total least squares): as an instrument it leaves the estimate unbiased.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.projected_least_squares import two_stage
from modelgen.runtime.least_squares.thresholds import GAIN_ROUNDS, SMALLEST_CHANGE
from modelgen.runtime.model.model import Model
from modelgen.runtime.rows.row_block import RowBlock

Noise = Callable[[int, str], float]


def gain_columns(model: Model) -> dict[str, str]:
    """Return the columns of drives' gains, each with the channel of its drive."""
    of_body = {actuator.body: actuator.key for actuator in model.actuators}
    gains = [name for name in model.base_parameters if name in model.roles]
    return {name: of_body[model.roles[name].bodies[0]] for name in gains if model.roles[name].role == "gain"}


def with_gain_instruments(fit: Fit, gains: Mapping[str, str], noise: Noise) -> Fit:
    """Return the fit of the same weighted rows with instruments for the columns of gains.

    Rows that are not kept in memory stay fitted by least squares.

    Parameters
    ----------
    fit : Fit
        By least squares.
    gains : mapping of str to str
        As `gain_columns` has them.
    noise : callable
        Power of a channel's noise as a share of that of its readings, by the record's index and the channel.
    """
    columns = {fit.columns.index(name): key for name, key in gains.items() if name in fit.columns}
    if not columns or not all(block.in_memory for block in fit.blocks):
        return fit
    fit = found = fit.dense()
    for _ in range(GAIN_ROUNDS):
        before = found.solution.x
        Z = tuple(_instruments(block, before, columns, noise) for block in fit.blocks)
        found = two_stage(fit, Z)
        if np.all(np.abs(found.solution.x - before) <= SMALLEST_CHANGE * np.abs(before)):
            break
    return found


def _instruments(block: RowBlock, x: FloatArray, columns: Mapping[int, str], noise: Noise) -> FloatArray:
    """Return W with what the row leaves taken out of its columns of gains, by the noise of each, (n, c)."""
    W = block.W
    own = [column for column in columns if np.any(W[:, column])]
    power = [noise(block.record, columns[column]) * float(W[:, column] @ W[:, column]) for column in own]
    share = x[own] * np.array(power)
    total = float(share @ x[own])
    if not total > 0.0:
        return W
    Z = W.copy()
    Z[:, own] += np.outer(block.residual(x), share / total)
    return Z
