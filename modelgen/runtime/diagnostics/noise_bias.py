"""How far noise of the sensors pulls a least-squares estimate, worked out from the noise of their readings.

Noise in the columns of W does not average out: it adds its own power, N = E[dW^T dW], to W^T W, and
E[dW^T dY] to W^T Y. What least squares would have found without them is (W^T W - N)^-1 (W^T Y - E[dW^T dY])
(Fuller 1987, ch. 1). Of columns that are not linear in the readings noise moves the mean, too: the square
of a noisy speed is too large. What that adds to residuals, times W, is added to E[dW^T dY]. Where it is most
of a column it is in N, too, and so is what the square varies by. The noises are those of `noise_floor`, white
before filter and derivatives.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from modelgen.array_types import FloatArray, IntArray
from modelgen.runtime.advice import Advice
from modelgen.runtime.diagnostics.noise_ways import noise_ways
from modelgen.runtime.diagnostics.row_noise import row_noise
from modelgen.runtime.diagnostics.thresholds import (
    HARMLESS_BIAS,
    LEAST_BIAS,
    LEAST_DEVIATIONS,
    LEAST_SIGNAL,
    LOST_PART,
    LOST_SHARE,
    MOST_SHARES,
    PRODUCTS_UNKNOWN,
    SAME_SHARE,
)
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.filter_choice.signal_to_noise import noise_band
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.hac_covariance import hac_covariance
from modelgen.runtime.model.model import Model
from modelgen.runtime.parameters.parameter import Parameter
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.row_block import RowBlock
from modelgen.runtime.simulation.arms.arm_coordinates import follows


def noise_bias(model: Model, records: Sequence[Record], choice: FilterChoice, fit: Fit) -> FloatArray:
    """Return by how much noise of the sensors shifts a least-squares fit, in SI, shape (c,).

    Infinite where a parameter rests on combinations of columns that are nearly all noise.
    """
    return noise_effect(model, records, choice, fit).bias


@dataclass(frozen=True, eq=False)
class NoiseEffect:
    """What noise of the sensors does to a least-squares fit.

    Attributes
    ----------
    bias : array, shape (c,)
        By how much it shifts each parameter, in SI; infinite where nearly all that one rests on is noise.
    spread : array, shape (c, c)
        Applied from both sides to the covariance of the fit: that of an estimator which noise does not bias,
        as instruments are, from the same rows. Where a share of what columns hold is noise, the scores have
        that share less of a variance, and the solution is divided by what is left.
    inverse : array, shape (c, c)
        (W^T W - N)^-1, N the power of the noise in the columns.
    most : float
        The largest share of N in W^T W along a direction.
    """

    bias: FloatArray
    spread: FloatArray
    inverse: FloatArray
    most: float


def less_noise(
    model: Model, records: Sequence[Record], choice: FilterChoice, fit: Fit
) -> tuple[Fit, NoiseEffect]:
    """Return a fit less what noise of the sensors does to it, and that.

    Its estimate and (W^T W - N)^-1, which its covariance follows from (Fuller 1987, ch. 2), stand in place of
    those of least squares; residuals stay, to first order they are the same. What is biased infinitely stays
    where it is. No row has more noise than it leaves: jumps of friction look like noise in forces' spectra.
    What it leaves is that of the estimate without bias: the bias is what makes residuals smallest.
    """
    every = [_of_row(model, records, choice, fit, index) for index in range(len(fit.blocks))]
    shares, freed = np.zeros(len(every)), fit
    for _ in range(MOST_SHARES):
        before = shares
        shares = np.array([_left(model, records, choice, freed, index) for index in range(len(every))])
        effect = _summed(fit, every, shares)
        x = fit.solution.x - np.where(np.isfinite(effect.bias), effect.bias, 0.0)
        freed = replace(fit, solution=replace(fit.solution, x=x, inverse=effect.inverse))
        if np.max(np.abs(shares - before), initial=0.0) < SAME_SHARE:
            break
    return freed, effect


def noise_effect(model: Model, records: Sequence[Record], choice: FilterChoice, fit: Fit) -> NoiseEffect:
    """Return what noise of the sensors does to a fit, as large as their spectra say."""
    every = []
    for index, block in enumerate(fit.blocks):
        # forces that are left open take noise below the cut-off with them
        band = min(1.0, 2.0 * choice.cutoff_hz * choice.decimation[block.record] / records[block.record].fs)
        closed = max(0.0, 1.0 - block.opened / (band * block.count))
        every.append(_of_row(model, records, choice, fit, index, closed))
    return _summed(fit, every, np.ones(len(every)))


class _RowNoise(NamedTuple):
    """What all noise, and products of it, add to W^T W, (k, k) at some places, and to W^T (Y - W X), (c,)."""

    at: IntArray
    added: FloatArray
    squared: FloatArray
    crossed: FloatArray


def _of_row(
    model: Model, records: Sequence[Record], choice: FilterChoice, fit: Fit, index: int, closed: float = 1.0
) -> _RowNoise:
    """Return what all noise of the sensors adds to the products of a weighted block.

    `closed` is the share of noise that forces which are left open do not take with them; means of columns are
    taken along what is left.
    """
    block, c = fit.blocks[index], len(fit.columns)
    record, size = records[block.record], fit.weights[index] ** 2
    # instruments keep what drives report from biasing the columns of their gains
    free = {one.key for one in model.actuators} if fit.projected is not None else set()
    places = {name: at for at, name in enumerate(fit.columns)}
    place = np.array([places.get(name, -1) for name in model.base_parameters])
    ways = noise_ways(model, record, choice, choice.decimation[block.record])[block.row]
    own = np.flatnonzero(place[ways.columns] >= 0)
    at, crossed = place[ways.columns[own]], np.zeros(c)
    added = np.zeros((len(at), len(at)))
    for channel in ways.slopes:
        if channel in free:
            continue
        noise = closed * size * block.count * record.facts.spectrum(channel).noise
        shared = ways.products(channel, noise_band(record, choice))
        added += noise * shared[np.ix_(own, own)]
        crossed[at] += noise * shared[own, -1]
    # products of noise: means of columns, which are in W, and what is about them
    means = size * _along_columns(block, ways.at, ways.means, c)
    even = 0.5 * (means[at][:, own] + means[at][:, own].T)
    spread = closed * size * block.count * ways.spread
    squared = even + spread[np.ix_(own, own)]
    x = fit.all_parameters(model.base_parameters)
    crossed += means @ np.append(-x[ways.columns], 1.0)
    crossed[at] += even @ x[ways.columns[own]] + spread[own, -1]
    return _RowNoise(at, added + squared, squared, crossed)


def lifted_along(
    model: Model, records: Sequence[Record], choice: FilterChoice, fit: Fit, blocks: Sequence[RowBlock]
) -> FloatArray:
    """Return the products of other columns with what noise adds to residuals on average, shape (columns,).

    Parameters
    ----------
    fit : Fit
        Less what noise does to it.
    blocks : sequence of RowBlock
        Of the other columns, in the order of those of the fit, in SI.
    """
    width = blocks[0].W.shape[1] if blocks else 0
    total, x = np.zeros(width), fit.all_parameters(model.base_parameters)
    for index, (own, block) in enumerate(zip(fit.blocks, blocks, strict=True)):
        ways = noise_ways(model, records[own.record], choice, choice.decimation[own.record])[own.row]
        share = _left(model, records, choice, fit, index) * fit.weights[index] ** 2
        total += share * _along_columns(block, ways.at, ways.of_residual(x).means, width)[:, 0]
    return total


def _left(model: Model, records: Sequence[Record], choice: FilterChoice, fit: Fit, index: int) -> float:
    """Return what share of the noise that sensors give a block's Y - W X the block leaves, at most all."""
    block = fit.blocks[index]
    record, factor = records[block.record], choice.decimation[block.record]
    x = fit.all_parameters(model.base_parameters)
    expected = row_noise(model, record, choice, factor, block.row, x) ** 2 * block.count
    return min(1.0, block.summary.residual_norm(fit.solution.x) ** 2 / expected) if expected else 0.0


def _summed(fit: Fit, every: Sequence[_RowNoise], shares: FloatArray) -> NoiseEffect:
    """Return what so much of the noise of every row does to the solution; shares, shape (blocks,)."""
    c = len(fit.columns)
    added, squared, crossed = np.zeros((c, c)), np.zeros((c, c)), np.zeros(c)
    for one, share in zip(every, shares.tolist(), strict=True):
        added[np.ix_(one.at, one.at)] += share * one.added
        squared[np.ix_(one.at, one.at)] += share * one.squared
        crossed += share * one.crossed
    return _without_noise(fit, added, crossed, squared)


def _along_columns(
    block: RowBlock, stretches: Sequence[range], lifted: FloatArray, columns: int
) -> FloatArray:
    """Return the products of a row's columns with what noise adds on average to others, shape (c, others).

    `lifted`, shape (others, samples), is that in stretches of the record; they stand for all of it.
    """
    total, used = np.zeros((columns, len(lifted))), 0
    if not lifted.any():
        return total
    touched = np.arange(columns) if block.touched is None else block.touched
    for one, values in zip(stretches, np.split(lifted, len(stretches), axis=1), strict=True):
        first = round((one.start - block.start) / one.step)
        rows = block.between(max(first, 0), first + len(one))
        total[touched] += rows.W.T @ values.T[rows.place - first]
        used += len(rows.place)
    return total * (block.count / max(used, 1))


def _without_noise(
    fit: Fit, added: FloatArray, crossed: FloatArray, squared: FloatArray | float = 0.0
) -> NoiseEffect:
    """Return what N = `added`, shape (c, c), and E[dW^T dY] = `crossed`, shape (c,), do to the solution.

    In the directions in which N and W^T W are both diagonal, each is attenuated by the share of it that is
    no noise. Where hardly any of a direction may be (what products of noise, `squared`, are of it is known
    worse), that is not known: what has a part in it is lost, and what moves with it by more than chance.
    """
    x, inverse = fit.solution.x, fit.solution.inverse
    scale = np.sqrt(np.maximum(np.diag(inverse), np.finfo(float).tiny))
    values, vectors = np.linalg.eigh(inverse / np.outer(scale, scale))
    held = values > np.finfo(float).eps * len(x) * values[-1]
    root = vectors[:, held] * np.sqrt(values[held])
    share, turned = np.linalg.eigh(root.T @ (added * np.outer(scale, scale)) @ root)
    along = root @ turned
    back = (vectors[:, held] / np.sqrt(values[held])) @ turned
    signal = np.maximum(1.0 - share, LEAST_SIGNAL)
    seen = back.T @ (x / scale) - along.T @ (scale * crossed)
    found = scale * (along @ (seen / signal))
    spread = scale[:, None] * ((along / np.sqrt(signal)) @ back.T) / scale
    inverse = (along / signal) @ along.T * np.outer(scale, scale)
    # over its scale, a standard deviation as rows are weighted, a parameter is a unit vector here
    doubt = np.sum(along * (scale[:, None] * squared * scale @ along), axis=0) if np.ndim(squared) else 0.0
    lost = share + PRODUCTS_UNKNOWN * np.abs(doubt) > 1.0 - LEAST_SIGNAL
    part = np.sum(along[:, lost] ** 2, axis=1)
    least = np.abs(along[:, lost] @ (seen * (1.0 / signal - 1.0))[lost])
    moved = least > np.maximum(LEAST_DEVIATIONS, LEAST_BIAS * np.abs(x / scale))
    bias = np.where((part > LOST_PART) | moved, np.inf, x - found)
    return NoiseEffect(bias, spread, inverse, float(share.max(initial=0.0)))


def lost_in_noise(fit: Fit, bias: FloatArray, left: FloatArray) -> dict[str, str]:
    """Return the columns whose parameter noise biases by more than its whole value, with the reason.

    `bias` is that of each column of the fit, `left` what of it is still in the estimate, shape (c,) each,
    in SI. Of what may be zero the value is no measure: where the interval hardly feels what is left, nothing
    is lost.
    """
    spread = np.sqrt(np.maximum(np.diag(hac_covariance(fit)), 0.0))
    return {
        name: "its column is mostly noise of the sensors"
        if not np.isfinite(move)
        else f"noise of the sensors biases it by {100.0 * abs(move / value):.0f} % of what is left of it"
        for name, move, still, value, std in zip(fit.columns, bias, left, fit.solution.x, spread, strict=True)
        if abs(move) > LOST_SHARE * abs(value) and abs(still) > HARMLESS_BIAS * std
    }


def significant_bias(fit: Fit, bias: FloatArray, noise: FloatArray) -> FloatArray:
    """Return the bias where it is significant, else 0; in SI, shape (c,).

    `noise` is the covariance that the residuals explain, shape (c, c). An infinite bias leaves no interval.
    """
    spread = np.sqrt(np.maximum(np.diag(noise), 0.0))
    least = np.maximum(LEAST_BIAS * np.abs(fit.solution.x), LEAST_DEVIATIONS * spread)
    return np.where(np.isfinite(bias) & (np.abs(bias) > least), bias, 0.0)


def takes_instruments(model: Model) -> bool:
    """Return whether there is a simulation that makes instruments of a model: not of arms with springs."""
    return not model.is_arm or follows(model)


def bias_advice(
    model: Model, fit: Fit, bias: FloatArray, noise: FloatArray, parameters: Sequence[Parameter]
) -> tuple[Advice, ...]:
    """Return the warning that names what noise biases, and by how much, where that is significant.

    Parameters as in `significant_bias`, in SI: shapes (c,) and (c, c), in the order of the fit's columns.
    """
    told = significant_bias(fit, bias, noise)
    moves = [(entry, float(told[fit.columns.index(entry.name)])) for entry in parameters]
    pulled = [f"{one.name} by {100.0 * move / abs(one.value):+.2g} %" for one, move in moves if move]
    if not pulled:
        return ()
    return (
        Advice(
            "biased by noise",
            ", ".join(pulled),
            "is the bias that noise of the sensors gives least squares; the intervals include it",
            f"use {'method iv, ' * takes_instruments(model)}a lower cut-off or better sensors",
        ),
    )
