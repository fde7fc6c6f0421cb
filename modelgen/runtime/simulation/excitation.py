"""What moves the chain: reference, its rate, a feedforward force, forces of others; piecewise linear in time.

Two experiments, as in Pham 2002: a chirp for the elastic modes, riding on a constant velocity so that no body
reverses (its Coulomb friction is then constant, and rows may be differentiated), and trapezoids with dwells
for friction and inertia.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import pi
from types import MappingProxyType
from typing import TypedDict, Unpack

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import DataError, Problem
from modelgen.frozen_values import FrozenValues
from modelgen.keyword_options import with_defaults
from modelgen.magnitudes import FREQUENCY_REMEDY, is_frequency, is_usable, shown_number
from modelgen.runtime.records.record import Record
from modelgen.runtime.simulation.thresholds import FADE, MOST_STEPS, SHORTEST_DWELL_S


@dataclass(frozen=True, eq=False)
class Excitation(FrozenValues):
    """Reference r, its rate r' and feedforward force, shape (K + 1,) each, at k / rate_hz, linear in between.

    Parameters
    ----------
    reference, reference_rate, feedforward : ndarray
        In the units of the actuator's body: rad, rad/s, N m or m, m/s, N.
    rate_hz : float
        Samples per second: a whole multiple of the sampling frequency of the simulation.
    name : str
        Becomes name and tag of the record.
    forces : mapping of str to ndarray
        Forces of further actuators, by key, in N m or N, shape (K + 1,) each, linear in between. Actuators
        that are not named rest at 0.

    Raises
    ------
    DataError
        With one problem per array that is not one-dimensional, finite and as long as the others.
    """

    reference: FloatArray
    reference_rate: FloatArray
    feedforward: FloatArray
    rate_hz: float
    name: str = "excitation"
    forces: Mapping[str, FloatArray] = field(default_factory=dict)

    def __post_init__(self) -> None:
        # a record makes the same demands: one-dimensional, finite, of equal length
        keys = ("reference", "reference_rate", "feedforward")
        if not isinstance(self.forces, Mapping) or not all(isinstance(key, str) for key in self.forces):
            remedy = "give a dict from the actuators' keys to their samples"
            raise DataError.at(f"excitation {self.name}: forces", "is no mapping from names", remedy)
        own = {key: getattr(self, key) for key in keys}
        further = {f"forces[{key}]": samples for key, samples in self.forces.items()}
        checked = Record(own | further, self.rate_hz, self.name).signals
        for key in keys:
            object.__setattr__(self, key, checked[key])
        # a record's samples are read-only already: long ones are not copied once more
        forces = {key: checked[f"forces[{key}]"] for key in self.forces}
        object.__setattr__(self, "forces", MappingProxyType(forces))

    @property
    def t(self) -> FloatArray:
        """Times in s, shape (K + 1,)."""
        return np.arange(self.reference.size) / self.rate_hz


def excitation_from_record(record: Record, oversample: int = 32, forces: Sequence[str] = ()) -> Excitation:
    """Return the user's own excitation: channels reference, reference_rate and feedforward of a record.

    Parameters
    ----------
    record : Record
        At least ``reference`` or ``feedforward``; without ``reference_rate`` the reference is differentiated,
        what else is absent is 0.
    oversample : int
        Internal steps per sample; the motion is exact with any, events are looked for step by step.
    forces : sequence of str
        Channels that hold the forces of further actuators, where the record has them.
    """
    given = record.signals
    if "reference" not in given and "feedforward" not in given:
        what = f"has no channel reference or feedforward, only {', '.join(given)}"
        raise DataError.at(record.name, what, "name one of them, or map a column to it")
    _require(("oversample", oversample >= 1, f"is {oversample}", "give a whole number, 1 or more"))
    zero, known = np.zeros(record.n), [key for key in forces if key in given]
    reference = given.get("reference", zero)
    rate = given.get("reference_rate", np.gradient(reference, record.dt))
    times = np.arange((record.n - 1) * oversample + 1) / oversample
    reference, rate, feedforward, *further = (
        np.interp(times, np.arange(record.n), array)
        for array in (reference, rate, given.get("feedforward", zero), *(given[key] for key in known))
    )
    others = dict(zip(known, further, strict=True))
    return Excitation(reference, rate, feedforward, record.fs * oversample, record.name, others)


class ChirpOptions(TypedDict, total=False):
    """Times and steps of a `chirp`, which describes them."""

    ramp_s: float
    settle_s: float
    oversample: int


def chirp(
    f_start_hz: float,
    f_stop_hz: float,
    duration_s: float,
    fs: float,
    *,
    force: float = 0.0,
    rate: float = 0.0,
    velocity: float = 0.0,
    **options: Unpack[ChirpOptions],
) -> Excitation:
    """Return a linear chirp, riding on a constant velocity.

    Parameters
    ----------
    f_start_hz, f_stop_hz : float
        Band of the sweep in Hz.
    duration_s, fs : float
        Of the whole record; sampling frequency in Hz.
    force : float
        Amplitude of the feedforward in N m or N.
    rate : float
        Amplitude of the reference's rate in rad/s or m/s.
    velocity : float
        Constant velocity underneath. Nothing reverses while it exceeds the oscillation of every body.
    ramp_s, settle_s : float
        Smooth start to `velocity`, then time to settle before the sweep, by default 0.1 s each; the same in
        reverse after it.
    oversample : int
        Internal steps per sample, by default 32.
    """
    given = with_defaults(
        "chirp", options, ChirpOptions, ChirpOptions(ramp_s=0.1, settle_s=0.1, oversample=32)
    )
    ramp_s, settle_s, oversample = given["ramp_s"], given["settle_s"], given["oversample"]
    check_band(f_start_hz, f_stop_hz, fs)
    begin, end = ramp_s + settle_s, duration_s - ramp_s - settle_s
    _require(
        ("duration_s", end > begin, f"leaves no time between {begin:g} s and {end:g} s", "make it longer")
    )
    t = _times(duration_s, fs, oversample)
    inside = np.clip((t - begin) / (end - begin), 0.0, 1.0)
    sweep_s = end - begin
    phase = 2.0 * pi * sweep_s * (f_start_hz * inside + 0.5 * (f_stop_hz - f_start_hz) * inside**2)
    wave = np.sin(phase) * raised_cosine(inside / FADE) * raised_cosine((1.0 - inside) / FADE)
    carrier = velocity * raised_cosine(t / ramp_s) * raised_cosine((t[-1] - t) / ramp_s)
    reference_rate = carrier + rate * wave
    return Excitation(integral(reference_rate, t), reference_rate, force * wave, fs * oversample, "chirp")


def trapezoid(
    speeds: Sequence[float],
    acceleration: float,
    duration_s: float,
    fs: float,
    *,
    cruise_s: float = 0.1,
    dwell_s: float = 0.05,
    oversample: int = 32,
) -> Excitation:
    """Return trapezoids of velocity: for every speed forward, dwell at rest, backward, dwell; repeated.

    Parameters
    ----------
    speeds : sequence of float
        Levels in rad/s or m/s.
    acceleration : float
        Slope of the flanks in rad/s^2 or m/s^2.
    duration_s, fs : float
        Of the record; sampling frequency in Hz.
    cruise_s, dwell_s : float
        Time at constant speed, and at rest; a dwell shorter than 0.04 s would not let the chain stick.
    oversample : int
        Internal steps per sample.
    """
    _require(
        ("speeds", min(speeds, default=0.0) > 0.0, "must be one or more positive numbers", "give them"),
        ("acceleration", acceleration > 0.0, "must be positive", "give it in rad/s^2 or m/s^2"),
        ("cruise_s", cruise_s >= 0.0, "is negative", "give a time in s"),
        ("dwell_s", dwell_s >= SHORTEST_DWELL_S, f"is {dwell_s:g} s, too short to stick",
         f"give at least {SHORTEST_DWELL_S} s"),
    )  # fmt: skip
    t = _times(duration_s, fs, oversample)
    corners, levels = [0.0], [0.0]
    while corners[-1] < t[-1]:
        for speed in speeds:
            for level in (speed, -speed):
                flank = speed / acceleration
                corners += (corners[-1] + np.cumsum([flank, cruise_s, flank, dwell_s])).tolist()
                levels += [level, level, 0.0, 0.0]
    rate = np.interp(t, corners, levels)
    return Excitation(integral(rate, t), rate, np.zeros(t.size), fs * oversample, "trapezoid")


def check_fs(fs: float) -> None:
    """Raise DataError unless the sampling frequency is finite and positive."""
    _require(("fs", is_frequency(fs), f"is {shown_number(fs)}", FREQUENCY_REMEDY))


def check_band(f_start_hz: float, f_stop_hz: float, fs: float) -> None:
    """Raise DataError unless the band lies between zero and half the sampling frequency."""
    check_fs(fs)
    low, high = min(f_start_hz, f_stop_hz), max(f_start_hz, f_stop_hz)
    where, shown = "chirp: band", f"is {f_start_hz:g} Hz to {f_stop_hz:g} Hz"
    _require(
        (where, low > 0.0, shown, "give two positive frequencies"),
        (where, high < 0.5 * fs, shown, f"stay below {0.5 * fs:g} Hz, half of fs, or raise fs"),
    )


def _require(*conditions: tuple[str, bool, str, str]) -> None:
    """Raise one DataError for all of (where, condition, what, remedy) whose condition does not hold."""
    problems = [Problem(where, what, remedy) for where, holds, what, remedy in conditions if not holds]
    DataError.raise_any(problems)


def _times(duration_s: float, fs: float, oversample: int) -> FloatArray:
    """Return the times of the internal steps, from the first sample to the last."""
    check_fs(fs)
    _require(
        ("duration_s", is_usable(duration_s) and duration_s * fs >= 2.0, f"is {duration_s:g} s",
         "give two samples or more"),
        ("oversample", oversample >= 1, f"is {oversample}", "give a whole number, 1 or more"),
    )  # fmt: skip
    remedy = f"give at most {MOST_STEPS:g} internal steps"
    _require(("duration_s", duration_s * fs * oversample <= MOST_STEPS, f"is {duration_s:g} s", remedy))
    times: FloatArray = np.arange((round(duration_s * fs) - 1) * oversample + 1) / (fs * oversample)
    return times


def raised_cosine(ramp: FloatArray) -> FloatArray:
    """Return a raised cosine, dimensionless, of the shape of `ramp`: 0 up to ramp = 0, 1 from ramp = 1 on."""
    risen: FloatArray = 0.5 - 0.5 * np.cos(pi * np.clip(ramp, 0.0, 1.0))
    return risen


def integral(rate: FloatArray, t: FloatArray) -> FloatArray:
    """Return the integral of the piecewise linear rate, exact at the times t in s, shape (n,) each."""
    return np.concatenate(([0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(t))))
