"""Low-passes that a channel may have gone through and the others not, as effects: a lag, or an average.

A current loop, an amplifier or an analogue filter lags: 1 / (1 + tau s). A command held over a sample, a
velocity from differences and a converter that integrates are averages, sinc(f T). Both are late as well,
which is looked for apart; what is left differs in the third order of frequency only, by a phase as large as
that of a damping. Small sizes do not tell the two apart: both are tried, and the better one is taken.

A sensor may also have two poles (an accelerometer, an anti-aliasing filter): 1 / (1 + a s + r a^2 s^2), late
by a. What it leaves of a delay is of third order where r is a half (Butterworth): it is tried with a delay.

Accelerometers with their amplifier in the sensor, and inputs with AC coupling, lose slow motion: s / (s + w).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from modelgen.array_types import ComplexArray, FloatArray
from modelgen.runtime.filters.one_pass import one_pole
from modelgen.runtime.iv.companion_simulation import Simulated
from modelgen.runtime.iv.effect import HIGH_PASS, TWO_POLES, Changes, Effect, Response, curvature
from modelgen.runtime.iv.thresholds import (
    BENDS,
    BUTTERWORTH,
    LARGEST_BEND_STEPS,
    LEAST_PASSED,
    LEAST_PASSED_BEND,
    USUAL_CORNER,
)
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
                   remedy.format(key), _bent(key), key, _at_rate_of(without_average),
                   response=_average)  # fmt: skip
    name = f"{'lag' if force else 'bandwidth'} of {key}"
    return Effect(name, "lag", read.format(key), acts.format(key), remedy.format(key), _bent(key), key,
                  _at_rate_of(without_lag), forms=(other,), at=_bent_further(key), response=_lag)  # fmt: skip


def lag_for_delay(key: str, delay: float, force: bool) -> Effect:
    """Return that a delay of so many s is that of a lag: of the size 1 where all of it is."""
    lag, size = low_pass(key, force), 0.5 * delay**2

    def changes(simulated: Simulated) -> Changes:
        return {channel: size * more for channel, more in lag.changes(simulated).items()}

    return replace(lag, name=f"{lag.name} for its delay", changes=changes)


def two_poles(key: str, bend: float = BUTTERWORTH, late: float = 0.0) -> Effect:
    """Return that a sensor is read through a low-pass of two poles; its size is by how many s that is late.

    `bend` is the r of 1 + a s + r a^2 s^2, with a the size, `late` a size near which r changes: the two are
    found together.
    """

    def memory(size: float, fs: float) -> float:
        return max(1.0, 2.0 * bend) * abs(size) * fs

    def response(size: float, fs: float) -> Response:
        return _set_right(lambda phase: 1.0 / (1.0 + phase + bend * phase**2), abs(size) * fs, size)

    def edit(channel: str, size: float, record: Record) -> Edit:
        return behind(channel, response(size, record.fs), memory(size, record.fs))

    def by_delay(simulated: Simulated, size: float) -> Changes:
        return changed(simulated, size, lambda s: s + 2.0 * bend * abs(size) * s**2)

    def by_bend(simulated: Simulated) -> Changes:
        return changed(simulated, late, lambda s: s**2)

    def changed(simulated: Simulated, size: float, more: Callable[[ComplexArray], ComplexArray]) -> Changes:
        fs = 1.0 / simulated.record.dt

        def less(frequency: FloatArray) -> ComplexArray:
            s = np.asarray(2.0j * np.pi * fs * frequency)
            phase = abs(size) * s
            return np.asarray(-more(s) / (1.0 + phase + bend * phase**2))

        way = behind(key, less, memory(size, fs), still=0.0)
        return {key: way.whole(simulated.record.signals[key])}

    def moved(size: float, steps: Sequence[float]) -> Effect:
        # where another channel is behind it, more of it here is less of a difference
        step = float(np.clip(steps[0] / (size * abs(size)), *LARGEST_BEND_STEPS)) if size else 0.0
        return two_poles(key, float(np.clip(bend + step, *BENDS)), size)

    read, other, _, _, remedy = _SENSOR
    damping = f", of second order with a damping ratio of {0.5 / np.sqrt(bend):.2g}"
    shape = Effect(f"damping of {key}", TWO_POLES, "", "", "", by_bend, key)
    return Effect(f"low-pass of {key}", TWO_POLES, read.format(key) + damping, other.format(key) + damping,
                  remedy, lambda simulated: by_delay(simulated, 0.0), key, edit, at=by_delay,
                  response=response, shape=lambda records: (shape,), moved=moved)  # fmt: skip


def high_pass(key: str, near: float = 0.0, starts: Sequence[float] = ()) -> Effect:
    """Return that a sensor is read behind a high-pass; its size is the corner, in rad/s.

    It stays in the rows: undone in the channel, it would integrate the sensor's noise and zero. `starts` are
    the integrals with which records begin, in the channel's unit times s, found at a size `near`.
    """

    def lost(simulated: Simulated, size: float) -> Changes:
        size, dt = max(size, 0.0), simulated.record.dt
        motion, read = simulated.record.signals[key], (simulated.measured or simulated.record).signals[key]
        # what is read, and what of it is lost itself: it does not matter that the simulation is a little off
        less = -_integral(read + size * _integral(motion, dt, size), dt, size)
        return {key: less - starts[simulated.index] * _dying(len(less), dt, size) if starts else less}

    def quiet(simulated: Simulated) -> Changes:
        return {key: -_integral(simulated.record.signals[key], simulated.record.dt, near)}

    def moved(size: float, steps: Sequence[float]) -> Effect:
        if size <= 0.0:
            return high_pass(key)
        before = starts or [0.0] * len(steps)
        return high_pass(key, size, [one - step / size for one, step in zip(before, steps, strict=True)])

    def start(index: int) -> Effect:
        def changes(simulated: Simulated) -> Changes:
            record = simulated.record
            return {key: _dying(record.n, record.dt, near)} if simulated.index == index else {}

        name = f"start of the high-pass of {key} in record {index + 1}"
        return Effect(name, HIGH_PASS, "", "", "", changes, key, record=index)

    def each(records: int) -> tuple[Effect, ...]:
        return tuple(start(index) for index in range(records))

    words, remedy = f"{key} is read behind a high-pass (AC coupling)", "couple it by DC, or lower its corner"
    return Effect(f"high-pass of {key}", HIGH_PASS, words, "", remedy, lambda one: lost(one, 0.0), key,
                  at=lost, quiet=quiet, shape=each, moved=moved, elsewhere=each)  # fmt: skip


def undone_high_pass(key: str) -> Effect:
    """Return a high-pass that is undone in whole channels without their means: where to start from."""

    def edit(channel: str, size: float, record: Record) -> Edit:
        read = record.signals[channel]
        more = size * record.dt * np.cumsum(read - np.mean(read))
        return Edit(channel, lambda samples, start: samples + more[start : start + len(samples)])

    return replace(high_pass(key), edit=edit)


def without_starts(effect: Effect, size: float = 0.0) -> Effect:
    """Return an effect as other records have it, which begin otherwise, near to a size."""
    return high_pass(effect.channel, size) if effect.kind == HIGH_PASS and effect.record is None else effect


def _integral(samples: FloatArray, dt: float, corner: float) -> FloatArray:
    """Return samples dt s apart behind 1 / (s + corner), the usual one for zero rad/s, shape (n,)."""
    half = 0.5 * dt * (corner or USUAL_CORNER)
    # the trapezoidal rule has no delay
    means = 0.5 * dt / (1.0 + half) * (samples + np.concatenate([[0.0], samples[:-1]]))
    return one_pole((1.0 - half) / (1.0 + half)).apply(means)


def _dying(n: int, dt: float, corner: float) -> FloatArray:
    """Return what of a one at the first sample is left behind a high-pass, shape (n,)."""
    return np.asarray(np.exp(-(corner or USUAL_CORNER) * dt * np.arange(n)))


def _at_rate_of(undone: Callable[[str, float, float], Edit]) -> Callable[[str, float, Record], Edit]:
    return lambda key, size, record: undone(key, size, record.fs)


def without_lag(key: str, size: float, fs: float) -> Edit:
    """Return what undoes 1 + size s^2 as a lag has it: e^(tau s) / (1 + tau s), tau = sqrt(-2 size).

    A force that acts behind a lag is its command through that low-pass; the delay is looked for apart. A
    positive size is that of a low-pass in the reading, which is undone.
    """
    return behind(key, _lag(size, fs), _memory("lag", size, fs))


def without_average(key: str, size: float, fs: float) -> Edit:
    """Return what undoes 1 + size s^2 as an average over T = sqrt(-24 size) has it: sinc(f T), centred.

    What an average takes away cannot be restored near its zeros: no more than a share of it is, with a bend
    in place of a corner, which would be felt at all frequencies.
    """
    return behind(key, _average(size, fs), _memory("average", size, fs))


def noise_passed(effect: Effect, size: float, frequency_hz: FloatArray, fs: float) -> FloatArray:
    """Return what setting a channel right makes of its noise, as a share of its power, shape (lines,).

    One for what is neither a low-pass nor a gain; fs in Hz.
    """
    if effect.response is None or not size:
        return np.full(len(frequency_hz), (1.0 + size) ** -2 if effect.kind == "gain" else 1.0)
    return np.asarray(np.abs(effect.response(size, fs)(frequency_hz / fs)) ** 2)


def _memory(kind: str, size: float, fs: float) -> float:
    """Return the time constant of a lag, or the length of an average, in samples."""
    return float(np.sqrt((24.0 if kind == "average" else 2.0) * abs(size))) * fs


def _lag(size: float, fs: float) -> Response:
    return _set_right(lambda phase: np.exp(phase) / (1.0 + phase), _memory("lag", size, fs), size)


def _average(size: float, fs: float) -> Response:
    def passed(phase: ComplexArray) -> ComplexArray:
        share = np.sinc(np.imag(phase) / (2.0 * np.pi))
        if size > 0.0:
            bend = np.maximum(share, 0.0) ** LEAST_PASSED_BEND + LEAST_PASSED**LEAST_PASSED_BEND
            share = bend ** (1.0 / LEAST_PASSED_BEND)
        return np.asarray(share, dtype=complex)

    return _set_right(passed, _memory("average", size, fs), size)


def _set_right(low_pass: Callable[[ComplexArray], ComplexArray], memory: float, size: float) -> Response:
    """Return the response, frequencies in cycles a sample, that undoes a low-pass; or is one, if below 0.

    That takes 2 pi j times the cycles in its memory, in samples.
    """

    def response(frequency: FloatArray) -> ComplexArray:
        passed = low_pass(np.asarray(2.0j * np.pi * memory * frequency, dtype=complex))
        return np.asarray(1.0 / passed if size > 0.0 else passed)

    return response


def _bent(key: str) -> Callable[[Simulated], Changes]:
    return lambda simulated: {key: curvature(simulated.record.signals[key], simulated.record.dt)}


def _bent_further(key: str) -> Callable[[Simulated, float], Changes]:
    """Return what a longer time constant adds behind a lag of this size: s^2 / (1 + tau s)."""

    def changes(simulated: Simulated, size: float) -> Changes:
        dt, tau = simulated.record.dt, float(np.sqrt(2.0 * abs(size)))
        return {key: _integral(curvature(simulated.record.signals[key], dt), dt, 1.0 / tau) / tau}

    return changes
