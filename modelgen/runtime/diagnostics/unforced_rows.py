"""Rows without a force that zero solves as well as their parameters do, and what other rows take over."""

from __future__ import annotations

from collections.abc import Container, Sequence
from dataclasses import replace

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.diagnostics.row_noise import best_ratios, block_noise
from modelgen.runtime.diagnostics.thresholds import NO_NOISE, ZERO_LIKELY
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.hac_covariance import hac_covariance
from modelgen.runtime.model.model import Model
from modelgen.runtime.numerics.tails import chi_square_tail
from modelgen.runtime.records.record import Record


def zero_columns(
    fit: Fit,
    model: Model,
    drift: FloatArray | float = 0.0,
    lost: Container[str] = (),
    recorded: tuple[Sequence[Record], FilterChoice] | None = None,
) -> dict[str, str]:
    """Return the columns of rows without a force that are zero within their intervals, with the reason.

    Zero solves such a row, too: it leaves nothing there, weighs the more for it, and decides what other rows
    have in common with it. A body without inertia that nothing moves is none. Rows that share a column
    with it have taken over what is missing: the inertia of one body is then that of both. `drift`, in SI,
    shape (c, c), is what moves the estimate besides, squared; values of columns that are `lost` say nothing.
    What was `recorded` tells whether noise of the sensors is the cause.
    """
    forced = {block.row for block in fit.blocks if block.has_force}
    unforced = {block.row: block.row_name for block in fit.blocks if block.row not in forced}
    if not unforced:
        return {}
    covariance = hac_covariance(fit) + drift
    found, shared = dict[str, str](), dict[str, str]()
    for row, row_name in unforced.items():
        names = [model.base_parameters[column] for column in model.regressor_columns[row]]
        there = [name for name in names if name in fit.columns]
        at = [fit.columns.index(name) for name in there if name not in lost]
        far = _from_zero(fit.solution.x[at], covariance[np.ix_(at, at)]) if at else 0.0
        if not there or (at and chi_square_tail(far, len(at)) < ZERO_LIKELY):
            continue
        why = f"row {row_name} has no force, and zero solves it as well: {_hides(fit, row, model, recorded)}"
        found |= dict.fromkeys(names, why)
        shared |= taken_over(model, row, why)
    return {name: why for name, why in shared.items() if name in fit.columns} | found


def taken_over(model: Model, row: int, why: str) -> dict[str, str]:
    """Return the columns of a row that is lost, and of those that share one with it, with the reason."""
    own = {*model.regressor_columns[row]}
    beside = [columns for columns in model.regressor_columns if {*columns} & own]
    taken = f"takes over what is lost where {why}"
    return {model.base_parameters[column]: taken for columns in beside for column in columns}


def _hides(fit: Fit, row: int, model: Model, recorded: tuple[Sequence[Record], FilterChoice] | None) -> str:
    """Return why zero solves a row: noise of the sensors, or a model that leaves far more than that.

    The model holds where some values leave no more than noise: rows with a force do not tell how large they
    are.
    """
    left, least = {}, dict[str, float]()
    for index, block in enumerate(fit.blocks):
        if recorded is not None and block.row == row:
            left[block.record_name] = _over_noise(fit, index, model, recorded)
            if (balanced := best_ratios(block, len(fit.columns))) is not None:
                x = np.zeros(len(fit.columns))
                x[balanced[0]] = balanced[1]
                best = replace(fit, solution=replace(fit.solution, x=x))
                least[block.record_name] = _over_noise(best, index, model, recorded)
    where = max(left, key=lambda name: left[name], default="")
    if not where or left[where] < NO_NOISE:
        return "noise of the sensors hides its motion"
    if max(least.values(), default=NO_NOISE) < NO_NOISE:
        return "it holds, for values whose size rows with a force do not tell here"
    what = f"it leaves {left[where]:.0f} times the noise of its sensors in {where}: the model does not hold"
    return f"{what} there (ratio, sign, unit or zero of a channel, a brake or a stop)"


def _over_noise(fit: Fit, index: int, model: Model, recorded: tuple[Sequence[Record], FilterChoice]) -> float:
    """Return how many times the noise of its sensors a row leaves."""
    records, choice = recorded
    block = fit.blocks[index]
    noise = block_noise(fit, index, model, records[block.record], choice, rounded=True)
    left = float(np.linalg.norm(block.residual(fit.solution.x))) / np.sqrt(block.count)
    return float(left / noise) if noise > 0.0 else 0.0


def _from_zero(values: FloatArray, covariance: FloatArray) -> float:
    """Return the squared distance of values from zero in standard deviations (Wald); shapes (n,), (n, n)."""
    deviation = np.sqrt(np.maximum(np.diag(covariance), float(np.finfo(float).tiny)))
    variances, directions = np.linalg.eigh(covariance / np.outer(deviation, deviation))
    # what rounding has left of a variance is no distance
    known = variances > len(values) * float(np.finfo(float).eps)
    moved = directions.T @ (values / deviation)
    return float(np.sum(moved[known] ** 2 / variances[known]))
