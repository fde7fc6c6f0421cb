"""Forces of drives that act behind a lag of their current loop: a low-pass, beside the delay that it is.

What a lag takes from a force is its second derivative. Noise of the reading, differentiated twice, is in that
column as well as in the force that it is to explain: by so much a lag would be found where there is none.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from modelgen.runtime.diagnostics.noise_ways import noise_ways
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.filter_choice.signal_to_noise import noise_band
from modelgen.runtime.iv.effect import LOW_PASSES, Effect
from modelgen.runtime.iv.low_pass import low_pass, noise_passed
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record


def force_lags(forces: Sequence[str]) -> Iterator[Effect]:
    """Yield that each force acts behind a lag, or is read behind one."""
    for key in forces:
        yield low_pass(key, force=True)


def is_lag(effect: Effect) -> bool:
    """Tell whether an effect is a low-pass that a channel is behind."""
    return effect.kind in LOW_PASSES


def lag_of_delay(
    late: Effect, size: float, effects: Sequence[Effect], held_s: float = 0.0
) -> tuple[Effect, float] | None:
    """Return the lag among effects that acts as late as a force is early by so many s, and its size.

    Where it has been taken as held for `held_s`, the lag is one in place of both.
    """
    if late.kind != "delay" or size >= 0.0:
        return None
    lags = [one for one in effects if is_lag(one) and one.channel == late.channel]
    return (lags[0], held_s**2 / 24.0 - 0.5 * (size - 0.5 * held_s) ** 2) if lags else None


def noise_along_lag(
    model: Model,
    read: Sequence[Record],
    choice: FilterChoice,
    fit: Fit,
    lag: Effect,
    undone: float = 0.0,
) -> float:
    """Return what noise of a force adds to the product of the column of its lag with Y - W X.

    Parameters
    ----------
    read : sequence of Record
        As they were read: what undoes a lag also takes noise, from which it could not be told then.
    fit : Fit
        Of the rows, from which it has its weights.
    undone : float
        The lag that the rows' records are set right by already, in s^2.
    """
    total, x = 0.0, fit.all_parameters(model.base_parameters)
    for block, weight in zip(fit.blocks, fit.weights, strict=True):
        record, factor = read[block.record], choice.decimation[block.record]
        ways = noise_ways(model, record, choice, factor)[block.row].of_residual(x)
        if lag.channel not in ways.slopes:
            continue
        band = noise_band(record, choice)
        left = ways.spectrum(lag.channel, band.frequency_hz) * band.power
        left *= record.facts.spectrum(lag.channel).noise
        left *= noise_passed(lag, undone, band.frequency_hz, record.fs)
        # by the size of a lag its response grows as minus the square of the frequency
        omega = 2.0 * np.pi * band.frequency_hz
        total -= weight**2 * (block.count - block.opened) * float(np.sum(left * omega**2))
    return total
