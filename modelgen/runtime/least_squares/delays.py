"""Time alignment: how late each force channel is, with its standard deviation, and records set right.

A force record that is late by tau gives Gamma(t) = record(t + tau). The row's mismatch Y - W X changes with
tau at a rate D, the force's derivative; with -D as one more column the same solution gives the step of tau
and its covariance. At the end the column is taken out again by projecting it out of the regressors (Frisch
and Waugh 1933): X and its covariance are then those of the fit that leaves tau free.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from operator import is_
from typing import NamedTuple

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import IdentifiabilityError, Problem
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.further_columns import with_columns, without_columns
from modelgen.runtime.least_squares.hac_covariance import hac_covariance
from modelgen.runtime.least_squares.thresholds import (
    DELAY_ROUNDS,
    LARGEST_DELAY,
    SETTLED,
    SETTLED_DELAY,
    SETTLED_SHARE,
    SMALL_STEP,
    SMALLEST_CHANGE,
    SMALLEST_STEP,
)
from modelgen.runtime.least_squares.time_shifts import hold, mean_undone, shift
from modelgen.runtime.model.model import Model
from modelgen.runtime.numerics.block_column import BlockColumn, block_column
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.observation import Observation
from modelgen.runtime.rows.record_rows import unmasked_rows
from modelgen.runtime.rows.row_terms import channels_of_rows, row_terms

# records, first values -> rows and their fit
Run = Callable[[tuple[Record, ...], Fit | None], tuple[Observation, Fit]]
# fit, records, channel -> how Y - W X changes with the channel's delay, one array a block
Rates = Callable[[Fit, tuple[Record, ...], str], Sequence[FloatArray]]

# fit -> delays in s to start from
First = Callable[[Fit], Mapping[str, float]]


def advanced(record: Record, delays: Mapping[str, float]) -> Record:
    """Return the record with its channels earlier by so many seconds: what was late is on time."""
    return record.edited(
        {
            key: shift(key, delay * record.fs)
            for key, delay in delays.items()
            if delay and key in record.signals
        }
    )


def with_means_undone(records: Sequence[Record], lengths: Mapping[str, float]) -> tuple[Record, ...]:
    """Return the records with forces at their instants in the place of means over so many samples before."""
    return tuple(
        record.edited(
            {key: mean_undone(key, length) for key, length in lengths.items() if key in record.signals}
        )
        for record in records
    )


def with_holds(records: Sequence[Record], channels: Sequence[str], length: float = 1.0) -> tuple[Record, ...]:
    """Return the records with the commands in `channels` replaced by what a zero-order hold makes of them.

    `length` says over how many samples they are held.
    """
    return tuple(
        record.edited({key: hold(key, length) for key in channels if key in record.signals})
        for record in records
    )


def fit_with_delays(
    records: tuple[Record, ...],
    channels: Sequence[str],
    run: Run,
    rates_of: Rates,
    first_of: First,
    near: Fit | None = None,
    finish: Callable[[Fit], Fit] | None = None,
) -> tuple[Observation, Fit]:
    """Estimate delays of force channels together with the parameters, by Gauss-Newton steps.

    Parameters
    ----------
    records : tuple of Record
    channels : sequence of str
        Forces, each with one delay for all records.
    run : callable
        Takes records, and a fit to start from once there is one, to rows and their fit: one round of it.
    rates_of : callable
        Takes a fit, its records and a channel to what `delay_rates` returns.
    first_of : callable
        Takes the first fit to the delays to start from, in s.
    near : Fit, optional
        Of other stretches of the same experiment, say, with these delays: where to start from instead.
    finish : callable, optional
        What is done to the fit with columns for the delays once it has come to rest.

    Returns
    -------
    Observation, Fit
        With the delays compensated; the fit names them, and its covariance leaves them free.

    Raises
    ------
    IdentifiabilityError
        When the rounds do not come to rest.
    """
    sample = 1.0 / min(record.fs for record in records)
    start, begun = near, None
    if near is None:
        begun = run(records, None)
        delays = dict(first_of(begun[1]))
    else:
        delays = {channel: delay for channel, delay, _ in near.delays}
    for _ in range(DELAY_ROUNDS):
        moved = tuple(advanced(record, delays) for record in records)
        # rows of one round at a time are in memory; without a delay the first has those that were looked at
        begun = begun if all(map(is_, moved, records)) else None
        try:
            found = _round(moved, channels, run, rates_of, start, sample, begun)
        except IdentifiabilityError as error:
            raise IdentifiabilityError(*error.problems, *_late_so_far(delays, sample)) from error
        if isinstance(found, _AtRest):
            break
        (start, steps), begun = found, None
        for channel, step in zip(channels, steps, strict=True):
            limit = LARGEST_DELAY * sample
            delays[channel] = float(np.clip(delays[channel] + np.clip(step, -sample, sample), -limit, limit))
    else:
        remedy = "give the delays, or none of them, and see whether the parameters alone come out"
        raise IdentifiabilityError.at(
            "delays", f"parameters and delays still move after {DELAY_ROUNDS} rounds", remedy
        )
    observation, fit, larger, spread = found
    last, c = larger if finish is None else finish(larger), len(fit.columns)
    moves = dict(zip(channels, (last.solution.x - larger.solution.x)[c:].tolist(), strict=True))
    if any(moves.values()):  # rows of the delays that are told
        delays = {channel: delay + moves[channel] for channel, delay in delays.items()}
        observation, fit = run(tuple(advanced(record, delays) for record in records), fit)
    spread = spread if last is larger else _spread(last)
    stds = dict(zip(channels, spread[c:].tolist(), strict=True))
    late = tuple((channel, delays[channel], stds[channel]) for channel in channels)
    return observation, replace(without_columns(last, fit), delays=late)


class _AtRest(NamedTuple):
    """Rows and fit of the last round, that with columns for the delays, and its deviations, (columns,)."""

    observation: Observation
    fit: Fit
    larger: Fit
    spread: FloatArray


def _round(
    moved: tuple[Record, ...],
    channels: Sequence[str],
    run: Run,
    rates_of: Rates,
    start: Fit | None,
    sample: float,
    begun: tuple[Observation, Fit] | None,
) -> _AtRest | tuple[Fit, FloatArray]:
    """Return a round that has come to rest, or what the next one starts from, and steps of the delays.

    `begun` are its rows and their fit, if they are known.
    """
    observation, fit = begun or run(moved, start)
    rates = [rates_of(fit, moved, channel) for channel in channels]
    larger = with_columns(fit, fit.regressors, [steps_of(rate) for rate in rates])
    simulated = None
    if start is not None:
        spread = _spread(larger)
        if _at_rest(larger, start, sample, spread):
            return _AtRest(observation, fit, larger, spread)
        simulated = fit.simulated if _settled(larger, start, sample, spread) else None
    c = len(fit.columns)
    x, steps = larger.solution.x[:c], larger.solution.x[c:]
    solution = replace(fit.solution, x=x)
    without_rows = replace(fit, blocks=(), weights=(), residuals=(), projected=None, series=None)
    return replace(without_rows, solution=solution, simulated=simulated), steps


def _spread(fit: Fit) -> FloatArray:
    """Return the standard deviations of a fit's columns, delays among them, shape (columns,)."""
    return np.asarray(np.sqrt(np.maximum(np.diag(hac_covariance(fit)), 0.0)))


def _at_rest(larger: Fit, start: Fit, sample: float, spread: FloatArray) -> bool:
    """Tell whether neither parameters nor delays, the last columns, moved by what would show."""
    c = len(start.columns)
    x, steps = larger.solution.x[:c], larger.solution.x[c:]
    still = np.abs(steps) < np.maximum(SMALL_STEP * spread[c:], SMALLEST_STEP * sample)
    small = np.maximum(SMALL_STEP * spread[:c], SMALLEST_CHANGE * np.abs(x))
    return bool(np.all(still) and np.all(np.abs(x - start.solution.x) < small))


def _settled(larger: Fit, start: Fit, sample: float, spread: FloatArray) -> bool:
    """Tell whether what moved is so little that instruments of the same simulation serve again."""
    c = len(start.columns)
    x, steps = larger.solution.x[:c], larger.solution.x[c:]
    move = np.abs(x - start.solution.x)
    settled = (move < SETTLED * spread[:c]) | (move < SETTLED_SHARE * np.abs(x))
    return bool(np.all(settled) and np.all(np.abs(steps) < SETTLED_DELAY * sample))


def _late_so_far(delays: Mapping[str, float], sample: float) -> list[Problem]:
    """Return the delays of a sample and more at which rounds have failed, as problems of their own."""
    return [
        Problem(
            channel,
            f"would be {'late' if delay > 0.0 else 'early'} by {1e3 * abs(delay):.3g} ms there "
            f"({abs(delay) / sample:.3g} samples)",
            "record all channels by one clock, or give the delay if it is known",
        )
        for channel, delay in delays.items()
        if abs(delay) >= sample
    ]


def steps_of(rates: Sequence[FloatArray]) -> BlockColumn:
    """Return the column of the step of a delay, from what `delay_rates` gives, shape (n,) a block, per s."""
    return block_column(rates).changed(np.negative)


def delay_rates(
    fit: Fit, model: Model, records: Sequence[Record], choice: FilterChoice, drop: int, channel: str
) -> BlockColumn:
    """Return d(Y - W X) / d tau of one force channel, shape (n,) a block of the fit, per s.

    An advanced force changes by its derivative, which is filtered already where a row differentiates it.
    """
    orders = {signal.key: signal.derivative for signal in model.signals if signal.actuator == channel}
    x, terms = fit.all_parameters(model.base_parameters), row_terms(model)
    slopes, rates = dict[int, FloatArray](), dict[int, FloatArray]()
    # most rows of a long chain hold other forces
    holding = {row for row, read in enumerate(channels_of_rows(model)) if channel in read}
    for index, block in enumerate(fit.blocks):
        if block.row not in holding:
            continue
        weights = terms[block.row].mismatch(x)
        shares = np.array([weights.get(key, 0.0) for key in orders])
        if block.record not in slopes:
            record, factor = records[block.record], choice.decimation[block.record]
            rows = unmasked_rows(model, record, choice, factor, drop)
            slopes[block.record] = rows.derivatives(channel, [order + 1 for order in orders.values()])
        rates[index] = slopes[block.record][block.place] @ shares
    return BlockColumn(rates, [len(block.place) for block in fit.blocks])
