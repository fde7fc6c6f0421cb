"""Up to which frequency speeds show when a body reverses: as far as noise changes them little meanwhile.

A speed bends where friction jumps, and a low-pass of it turns late; noise behind a wide one turns by itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from math import pi, sqrt

import numpy as np

from modelgen.array_types import BoolArray, FloatArray
from modelgen.runtime.filter_choice.thresholds import (
    CERTAIN_SIGN,
    FASTER,
    FEWEST_TURNS,
    HIGHEST_CUTOFF,
    LATE_BY_CHANCE,
    SWALLOWED_TURNS,
    TURNING_ORDER,
    TURNS_CLEARLY,
    WRONG_SIGNS,
)
from modelgen.runtime.filters.derivatives import differentiate
from modelgen.runtime.filters.zero_phase import zero_phase
from modelgen.runtime.model.deflected_kernel import DeflectedKernel
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record


def turning_band_hz(acceleration: float, noise: float, derivative: int, fs: float) -> float:
    """Return the band in Hz in which noise changes a speed by a small share of what turning does in its time.

    Parameters
    ----------
    acceleration : float
        Of what turns, in SI.
    noise : float
        Density of the reading's white noise, unit^2/Hz.
    derivative : int
        How often the reading is differentiated to be a speed.
    fs : float
        Hz; a share of it is the most.
    """
    # what noise changes a speed by grows with f^(m + 1/2), and the time of a turn is a share of 1/f
    least = 2.0 * pi * speed_noise(noise, derivative, 1.0)
    ratio = TURNS_CLEARLY * acceleration / max(least, float(np.finfo(float).tiny))
    return min(float(ratio ** (1.0 / (derivative + 1.5))), HIGHEST_CUTOFF * fs)


def direction_cutoff(
    model: Model, records: Sequence[Record], cutoff_hz: float, dynamics_hz: float | None
) -> float:
    """Return the cut-off in Hz of velocities whose signs are directions, from that of the rows and dynamics.

    Of arms it is the lowest one at which no sensed speed reverses later than in the band in which all of them
    show when they reverse: where friction bends the motion of a joint, that band itself; where it does not,
    noise in it turns friction for nothing. Where springs give some of the speeds it is that of the rows, as
    these hold far more noise. What of a chain's velocities is beyond the dynamics is motion where it stands
    out of its noise only (`faster_turns`).
    """
    if not model.is_arm:
        return min(dynamics_hz or cutoff_hz, cutoff_hz)
    if isinstance(model.kernel, DeflectedKernel) and model.kernel.speeds:
        return cutoff_hz
    keys, turning = frozenset(model.direction_keys), []
    for signal in model.signals:
        if signal.key in keys and (signal.sensor is not None or signal.actuator is not None):
            turning.append((signal.channel, signal.derivative))
    bands = [seen_to_hz(record, *one, cutoff_hz) for one in turning for record in records]
    return max(cutoff_hz, _as_early(records, turning, cutoff_hz, min(bands, default=0.0)))


def seen_to_hz(record: Record, channel: str, derivative: int, cutoff_hz: float) -> float:
    """Return the band in Hz in which a record's reading shows when what it reads reverses.

    `derivative` says how often the channel is differentiated to be a speed; its motion is below a cut-off.
    """
    spectrum = record.facts.spectrum(channel)
    moving = spectrum.signal(derivative + 1)[spectrum.frequency_hz < cutoff_hz]
    size = sqrt(float(moving.sum()) * float(spectrum.frequency_hz[0]))
    return turning_band_hz(size, spectrum.noise, derivative, record.fs)


@dataclass(frozen=True)
class FasterTurns:
    """A channel that turns faster than the low-pass of directions sees.

    Its speed counts below `band_hz`, in Hz; `noise` is the density of the reading's noise, unit^2/Hz.
    """

    channel: str
    noise: float
    band_hz: float


def faster_turns(
    model: Model, records: Sequence[Record], direction_hz: float, cutoff_hz: float
) -> tuple[FasterTurns, ...]:
    """Return what turns faster than a low-pass sees; cut-offs in Hz, of directions and of the rows.

    Of a chain's readings those whose speeds, low-passed for directions, have the wrong sign at more than a
    few samples of a record. Noise is that of the record in which it is largest, and the band the widest in
    which every record shows when it reverses: what the rows' low-pass takes off moves reversals as well. Arms
    have no band beyond their directions'.
    """
    if model.is_arm:
        return ()
    keys, found = frozenset(model.direction_keys), dict[str, FasterTurns]()
    for signal in model.signals:
        if signal.key not in keys or signal.sensor is None:
            continue
        share = partial(
            wrong_share, channel=signal.channel, order=signal.derivative, direction_hz=direction_hz
        )
        if max(map(share, records)) > WRONG_SIGNS:
            noise = max(one.facts.spectrum(signal.channel).noise for one in records)
            bands = [seen_to_hz(one, signal.channel, signal.derivative, cutoff_hz) for one in records]
            found[signal.channel] = FasterTurns(signal.channel, noise, max(cutoff_hz, min(bands)))
    return tuple(found.values())


def wrong_share(record: Record, channel: str, order: int, direction_hz: float) -> float:
    """Return the share of a record's samples at which a low-passed speed has the wrong sign, but for noise.

    `order` says how often the channel is differentiated to be a speed; a band a few times as wide tells.
    """
    wide_hz = min(FASTER * direction_hz, HIGHEST_CUTOFF * record.fs)
    certain = CERTAIN_SIGN * speed_noise(record.facts.spectrum(channel).noise, order, wide_hz)

    def share() -> float:
        wrong = list[BoolArray]()
        for samples in record.facts.stretches(channel):
            low, wide = (_speed(samples, order, hertz, record.fs) for hertz in (direction_hz, wide_hz))
            wrong.append((np.abs(wide) > certain) & (wide * low < 0.0))
        return float(np.mean(np.concatenate(wrong)))

    return record.facts.kept(("wrong signs", channel, order, direction_hz), share)


def speed_noise(noise: float, derivative: int, band_hz: float) -> float:
    """Return the rms, in SI, of the noise of a speed below a frequency, of white noise in unit^2/Hz."""
    m = derivative
    return sqrt(noise) * (2.0 * pi) ** m * float(band_hz ** (m + 0.5)) / sqrt(2.0 * m + 1.0)


def _as_early(
    records: Sequence[Record], turning: Sequence[tuple[str, int]], least_hz: float, widest_hz: float
) -> float:
    """Return the lowest of halved bands at which speeds reverse as early as in the widest.

    `turning` are channels, and how often each is differentiated to be a speed.
    """
    if widest_hz < 2.0 * least_hz:
        return widest_hz
    reference = [
        [_speed(samples, order, widest_hz, record.fs) for samples in record.facts.stretches(channel)]
        for channel, order in turning
        for record in records
    ]
    owners = [(channel, order, record) for channel, order in turning for record in records]
    kept = widest_hz
    while kept >= 2.0 * least_hz:
        tried = 0.5 * kept
        for (channel, order, record), wide in zip(owners, reference, strict=True):
            narrow = (_speed(one, order, tried, record.fs) for one in record.facts.stretches(channel))
            if turns_late(list(narrow), wide, record.fs / tried):
                return kept
        kept = tried
    return kept


def _speed(samples: FloatArray, derivative: int, cutoff_hz: float, fs: float) -> FloatArray:
    """Return the speed of a reading below a cut-off, shape (n,)."""
    low = zero_phase(samples, TURNING_ORDER, cutoff_hz, fs)
    return differentiate(low, 1.0 / fs, derivative)


def turns_late(narrow: Sequence[FloatArray], wide: Sequence[FloatArray], period: float) -> bool:
    """Return whether a speed reverses later behind a low-pass than it does in a wide band.

    Friction bends a motion where it reverses, always so that a low-pass crosses zero behind the reversal;
    noise moves crossings either way. Reversals that the low-pass swallows are late, too.

    Parameters
    ----------
    narrow, wide : sequence of array
        The speed in stretches, shape (n,) each, behind the low-pass and in the wide band.
    period : float
        That of the low-pass's cut-off in samples: crossings farther apart are not of one reversal.
    """
    late: list[float] = []
    seen = crossed = 0
    for low, own in zip(narrow, wide, strict=True):
        at, true = _crossings(low), _crossings(own)
        crossed += len(true)
        if not at.size or not true.size:
            continue
        place = np.clip(np.searchsorted(true, at), 1, max(len(true) - 1, 1))
        near = np.where(
            np.abs(at - true[place - 1]) < np.abs(at - true[place % len(true)]), place - 1, place % len(true)
        )
        apart = at - true[near]
        late += apart[np.abs(apart) < period].tolist()
        seen += int(np.sum(np.abs(apart) < period))
    if crossed == 0:
        return False
    if seen < FEWEST_TURNS or seen < (1.0 - SWALLOWED_TURNS) * crossed:
        return True
    chance = float(np.std(late)) / sqrt(seen)
    return float(np.mean(late)) > LATE_BY_CHANCE * chance


def _crossings(speed: FloatArray) -> FloatArray:
    """Return where a speed crosses zero, in samples, between which it is a straight line."""
    place = np.flatnonzero(speed[:-1] * speed[1:] < 0.0)
    return np.asarray(place + speed[place] / (speed[place] - speed[place + 1]))
