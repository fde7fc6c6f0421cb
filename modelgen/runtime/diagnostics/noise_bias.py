"""How far noise of the sensors pulls a least-squares estimate, worked out from the noise of their readings.

Noise in the columns of W does not average out: it adds its own power, N = E[dW^T dW], to W^T W, and
E[dW^T dY] to W^T Y. What least squares would have found without them is (W^T W - N)^-1 (W^T Y - E[dW^T dY])
(Fuller 1987, ch. 1). The noises are those of `noise_floor`, white before filter and derivatives.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from modelgen.array_types import FloatArray, IntArray
from modelgen.runtime.advice import Advice
from modelgen.runtime.diagnostics.kernel_noise import added_noise
from modelgen.runtime.diagnostics.kernel_slopes import RowSlopes, row_slopes, shared_noise
from modelgen.runtime.diagnostics.residual_whiteness import channel_terms, response
from modelgen.runtime.diagnostics.row_noise import noise_band
from modelgen.runtime.diagnostics.thresholds import (
    LEAST_BIAS,
    LEAST_DEVIATIONS,
    LEAST_SIGNAL,
    LOST_PART,
    LOST_SHARE,
)
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.model.deflected_kernel import DeflectedKernel
from modelgen.runtime.model.model import Model
from modelgen.runtime.parameters.parameter import Parameter
from modelgen.runtime.records.record import Record


def noise_bias(model: Model, records: Sequence[Record], choice: FilterChoice, fit: Fit) -> FloatArray:
    """Return by how much noise of the sensors shifts a least-squares fit, shape (c,).

    Infinite where a parameter rests on combinations of columns that are nearly all noise.
    """
    c = len(fit.columns)
    # instruments keep what drives report from biasing the columns of their gains
    free = {one.key for one in model.actuators} if fit.projected is not None else set()
    added, crossed = np.zeros((c, c)), np.zeros(c)
    if isinstance(model.kernel, DeflectedKernel):
        return _without_noise(fit, *_through_kernel(model, records, choice, fit))
    of_record: dict[int, tuple[RowSlopes, ...]] = {}
    if model.kernel is not None:
        of_record = {
            index: row_slopes(model, records[index], choice, choice.decimation[index])
            for index in fit.by_record
        }
    for block, weight in zip(fit.blocks, fit.weights, strict=True):
        record = records[block.record]
        touched = np.arange(c) if block.touched is None else block.touched
        band = noise_band(record, choice)
        if of_record:
            columns = [*(model.base_parameters.index(fit.columns[place]) for place in touched), -1]
            products = _of_slopes(of_record[block.record][block.row], columns, *band)
        else:
            products = _of_signals(_ways(model, fit, block.row, touched), *band)
        for channel, shared in products:
            if channel in free:
                continue
            noise = weight**2 * block.count * record.facts.spectrum(channel).noise
            added[np.ix_(touched, touched)] += noise * shared[:-1, :-1]
            crossed[touched] += noise * shared[:-1, -1]
    return _without_noise(fit, added, crossed)


def _through_kernel(
    model: Model, records: Sequence[Record], choice: FilterChoice, fit: Fit
) -> tuple[FloatArray, FloatArray]:
    """Return N and E[dW^T dY] of rows whose every entry is made of noisy readings by a kernel."""
    places = [model.base_parameters.index(name) for name in fit.columns]
    added, crossed = np.zeros((len(places),) * 2), np.zeros(len(places))
    noises = {
        index: added_noise(model, records[index], choice, choice.decimation[index])
        for index in dict.fromkeys(block.record for block in fit.blocks)
    }
    for block, weight in zip(fit.blocks, fit.weights, strict=True):
        if block.row in noises[block.record]:
            of_columns, of_left = noises[block.record][block.row]
            added += weight**2 * block.count * of_columns[np.ix_(places, places)]
            crossed += weight**2 * block.count * of_left[places]
    return added, crossed


def _of_signals(
    ways: Mapping[str, list[list[tuple[float, int]]]], frequency_hz: FloatArray, power: FloatArray
) -> Iterator[tuple[str, FloatArray]]:
    """Yield for every channel the mean products of what its noise, of power 1, adds to columns and Y."""
    for channel, terms in ways.items():
        responses = np.array([response(way, frequency_hz) for way in terms])
        yield channel, np.real(np.conj(responses) * power @ responses.T)


def _of_slopes(
    slopes: RowSlopes, columns: Sequence[int], frequency_hz: FloatArray, power: FloatArray
) -> Iterator[tuple[str, FloatArray]]:
    """Yield the same where the columns are nonlinear in the channels."""
    for channel, by_order in slopes.items():
        moved = {times: one[columns] for times, one in by_order.items()}
        yield channel, shared_noise(moved, frequency_hz, power)


def _without_noise(fit: Fit, added: FloatArray, crossed: FloatArray) -> FloatArray:
    """Return by how much N = `added`, shape (c, c), and E[dW^T dY] = `crossed` shift the solution, (c,).

    In the directions in which N and W^T W are both diagonal, each is attenuated by the share of it that is
    no noise. Where hardly any of a direction is, that share is not known: what has a part in it is lost.
    """
    x, inverse = fit.solution.x, fit.solution.inverse
    scale = np.sqrt(np.maximum(np.diag(inverse), np.finfo(float).tiny))
    values, vectors = np.linalg.eigh(inverse / np.outer(scale, scale))
    held = values > np.finfo(float).eps * len(x) * values[-1]
    root = vectors[:, held] * np.sqrt(values[held])
    share, turned = np.linalg.eigh(root.T @ (added * np.outer(scale, scale)) @ root)
    along = root @ turned
    back = (vectors[:, held] / np.sqrt(values[held])) @ turned
    seen = back.T @ (x / scale) - along.T @ (scale * crossed)
    found = scale * (along @ (seen / np.maximum(1.0 - share, LEAST_SIGNAL)))
    # a parameter over its scale is a unit vector in these directions
    part = np.sum(along[:, share > 1.0 - LEAST_SIGNAL] ** 2, axis=1)
    return np.asarray(np.where(part > LOST_PART, np.inf, x - found))


def _ways(model: Model, fit: Fit, row: int, touched: IntArray) -> dict[str, list[list[tuple[float, int]]]]:
    """Return for every channel in W its way into each column that a row touches, and last into Y."""
    nothing = np.zeros(len(model.base_parameters))
    alone = []
    for name in (fit.columns[column] for column in touched):
        own = nothing.copy()
        own[model.base_parameters.index(name)] = -1.0  # channel_terms counts columns as -W x
        alone.append(channel_terms(model, row, own, measured=False))
    left = channel_terms(model, row, nothing)
    channels = dict.fromkeys(channel for ways in alone for channel in ways)
    return {key: [*(ways.get(key, []) for ways in alone), left.get(key, [])] for key in channels}


def lost_in_noise(fit: Fit, bias: FloatArray) -> dict[str, str]:
    """Return the columns whose parameter noise biases by more than its whole value, with the reason.

    `bias` is that of each column of the fit, shape (c,).
    """
    return {
        name: "its column is mostly noise of the sensors"
        if not np.isfinite(move)
        else f"noise of the sensors biases it by {100.0 * abs(move / value):.0f} % of what is left of it"
        for name, move, value in zip(fit.columns, bias, fit.solution.x, strict=True)
        if abs(move) > LOST_SHARE * abs(value)
    }


def significant_bias(fit: Fit, bias: FloatArray, noise: FloatArray) -> FloatArray:
    """Return the bias where it is significant, else 0; shape (c,).

    `noise` is the covariance that the residuals explain, shape (c, c). An infinite bias leaves no interval.
    """
    spread = np.sqrt(np.maximum(np.diag(noise), 0.0))
    least = np.maximum(LEAST_BIAS * np.abs(fit.solution.x), LEAST_DEVIATIONS * spread)
    return np.where(np.isfinite(bias) & (np.abs(bias) > least), bias, 0.0)


def bias_advice(
    fit: Fit, bias: FloatArray, noise: FloatArray, parameters: Sequence[Parameter]
) -> tuple[Advice, ...]:
    """Return the warning that names what noise biases, and by how much, where that is significant.

    Parameters as in `significant_bias`: shapes (c,) and (c, c), in the order of the columns of the fit.
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
            "use method iv, a lower cut-off or better sensors",
        ),
    )
