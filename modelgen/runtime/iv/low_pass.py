"""Low-passes that a channel may have gone through and the others not, as effects: a lag, or an average.

A current loop, an amplifier or an analogue filter lags: 1 / (1 + tau s). A command held over a sample, a
velocity from differences and a converter that integrates are averages, sinc(f T). Both are late as well,
which is looked for apart; what is left differs in the third order of frequency only, by a phase as large as
that of a damping. Small sizes do not tell the two apart: both are tried, and the better one is taken.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from modelgen.array_types import ComplexArray, FloatArray
from modelgen.runtime.filters.one_pass import one_pass
from modelgen.runtime.iv.companion_simulation import Simulated
from modelgen.runtime.iv.effect import LOW_PASSES, Changes, Effect, curvature
from modelgen.runtime.iv.thresholds import LEAST_PASSED, LEAST_PASSED_BEND
from modelgen.runtime.least_squares.time_shifts import behind
from modelgen.runtime.records.channels import Edit
from modelgen.runtime.records.record import Record

# What is said: a lag of the reading, or else; an average of the reading, or else; what to do.
_FORCE = (
    "{} is read through a low-pass",
    "{} acts behind a lag (a current loop)",
    "{} is read as an average",
    "{} is held over a sample, or acts as an average",
    "record the force that acts; a command that is held can be named (--held {})",
)
_SENSOR = (
    "{} is read through a low-pass of its own",
    "another channel is read through a low-pass that {} has not",
    "{} is read as an average, like a velocity from differences",
    "another channel is read as an average that {} is not",
    "give all channels the same filter",
)


def low_pass(key: str, force: bool) -> Effect:
    """Return that a channel is read, or acts, behind a lag; or as an average, its other form.

    A positive size is that of the reading.
    """
    read, acts, average, averaged, remedy = _FORCE if force else _SENSOR
    other = Effect(f"average of {key}", "average", average.format(key), averaged.format(key),
                   remedy.format(key), _bent(key), key, _at_rate_of(without_average))  # fmt: skip
    name = f"{'lag' if force else 'bandwidth'} of {key}"
    return Effect(name, "lag", read.format(key), acts.format(key), remedy.format(key), _bent(key), key,
                  _at_rate_of(without_lag), forms=(other,), at=_bent_further(key))  # fmt: skip


def _at_rate_of(undone: Callable[[str, float, float], Edit]) -> Callable[[str, float, Record], Edit]:
    return lambda key, size, record: undone(key, size, record.fs)


def without_lag(key: str, size: float, fs: float) -> Edit:
    """Return what undoes 1 + size s^2 as a lag has it: e^(tau s) / (1 + tau s), tau = sqrt(-2 size).

    A force that acts behind a lag is its command through that low-pass; the delay is looked for apart. A
    positive size is that of a low-pass in the reading, which is undone.
    """
    return behind(key, _set_right("lag", size, fs), _memory("lag", size, fs))


def without_average(key: str, size: float, fs: float) -> Edit:
    """Return what undoes 1 + size s^2 as an average over T = sqrt(-24 size) has it: sinc(f T), centred.

    What an average takes away cannot be restored near its zeros: no more than a share of it is, with a bend
    in place of a corner, which would be felt at all frequencies.
    """
    return behind(key, _set_right("average", size, fs), _memory("average", size, fs))


def noise_passed(effect: Effect, size: float, frequency_hz: FloatArray, fs: float) -> FloatArray:
    """Return what setting a channel right makes of its noise, as a share of its power, shape (lines,).

    One for what is no low-pass; fs in Hz.
    """
    if effect.edit is None or effect.kind not in LOW_PASSES or not size:
        return np.ones(len(frequency_hz))
    return np.asarray(np.abs(_set_right(effect.kind, size, fs)(frequency_hz / fs)) ** 2)


def _memory(kind: str, size: float, fs: float) -> float:
    """Return the time constant of a lag, or the length of an average, in samples."""
    return float(np.sqrt((24.0 if kind == "average" else 2.0) * abs(size))) * fs


def _set_right(kind: str, size: float, fs: float) -> Callable[[FloatArray], ComplexArray]:
    """Return the response, frequencies in cycles a sample, that undoes a low-pass; or is one, if below 0."""
    memory = _memory(kind, size, fs)

    def lag(frequency: FloatArray) -> ComplexArray:
        phase = 2.0j * np.pi * frequency * memory
        return np.asarray(np.exp(phase) / (1.0 + phase))

    def average(frequency: FloatArray) -> ComplexArray:
        passed = np.sinc(frequency * memory)
        if size > 0.0:
            bend = np.maximum(passed, 0.0) ** LEAST_PASSED_BEND + LEAST_PASSED**LEAST_PASSED_BEND
            passed = bend ** (1.0 / LEAST_PASSED_BEND)
        return np.asarray(passed, dtype=complex)

    response = lag if kind == "lag" else average
    return (lambda f: 1.0 / response(f)) if size > 0.0 else response


def _bent(key: str) -> Callable[[Simulated], Changes]:
    return lambda simulated: {key: curvature(simulated.record.signals[key], simulated.record.dt)}


def _bent_further(key: str) -> Callable[[Simulated, float], Changes]:
    """Return what a longer time constant adds behind a lag of this size: s^2 / (1 + tau s)."""

    def changes(simulated: Simulated, size: float) -> Changes:
        bent = curvature(simulated.record.signals[key], simulated.record.dt)
        tau = float(np.sqrt(2.0 * abs(size))) / simulated.record.dt
        # the trapezoidal rule has no delay
        return {key: one_pass(((0.5, 0.5, 0.0, 0.5 + tau, 0.5 - tau, 0.0),)).apply(bent)}

    return changes
