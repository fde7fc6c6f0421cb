"""Readings that are not what a sensor saw at each sample: begun again after every turn, or held for several.

An encoder that counts modulo so many counts jumps from one end of its range to the other; a slow bus, or a
slow part of a controller, repeats a reading until the next one comes.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from modelgen.array_types import FloatArray
from modelgen.runtime.filters.power_spectrum import quick_length
from modelgen.runtime.filters.rounding import step_of_counts
from modelgen.runtime.filters.thresholds import (
    AS_HIGH,
    ENOUGH_READINGS,
    FEWEST_READINGS,
    FINER,
    IN_STEP,
    LATE,
    MOST_REPEATS,
    ORDINARY_STEP,
    REFINED,
    SHORTEST,
    SMOOTH_ACROSS,
    STEPS_OF_READINGS,
    WRAP_SHARE,
)

# Counters of so many bits; a turn in rad, degrees and revolutions.
COUNTERS = tuple(2.0**bits for bits in range(8, 33))
TURNS = (2.0 * np.pi, 360.0, 1.0, *COUNTERS)


def modulus(samples: FloatArray) -> float | None:
    """Return by how much a position jumps where its reading begins again; None where it does not.

    Parameters
    ----------
    samples : array, shape (n,)
        In any unit.

    Returns
    -------
    float or None
        In the unit of the samples. One jump alone counts only if it is a turn, or a power of two of numbers
        or of the steps that readings are rounded to (counts with a factor): a machine may have moved while
        nothing was recorded. Readings in such steps begin again after a whole number of them.
    """
    steps = np.diff(samples)
    span = float(np.ptp(samples))
    far = np.abs(steps) > WRAP_SHARE * span
    if span == 0.0 or not far.any() or far.all():
        return None
    usual = float(np.abs(steps[~far]).max())
    jumped = np.abs(steps[far])
    if not 0.0 < usual <= ORDINARY_STEP * span or jumped.min() < span - 2.0 * usual:
        return None
    alone = np.flatnonzero(far[1:-1] & ~far[:-2] & ~far[2:]) + 1
    if not alone.size:
        return None
    sizes = np.abs(steps[alone] - 0.5 * (steps[alone - 1] + steps[alone + 1]))
    found, bent = float(np.median(sizes)), _bends(samples, steps, far)
    usual_turns = [turn for turn in TURNS if abs(turn - found) <= bent]
    if not usual_turns:
        step = step_of_counts(samples)
        found = float(np.round(found / step)) * step if step else found
        usual_turns = [bits * step for bits in COUNTERS if abs(bits * step - found) <= bent]
    if not usual_turns and len(alone) == 1:
        return None
    size = min(usual_turns, key=lambda turn: abs(turn - found)) if usual_turns else found
    across = np.abs(np.diff(unwrapped(samples, size), 2))
    smooth = bool(across.max() <= SMOOTH_ACROSS * bent)
    return size if smooth and span <= size + 2.0 * usual else None


def _bends(samples: FloatArray, steps: FloatArray, far: np.ndarray) -> float:
    """Return the largest second difference apart from jumps, and no less than what rounding makes of one."""
    bends = np.abs(np.diff(steps))[~(far[1:] | far[:-1])]
    rounding = 4.0 * float(np.finfo(float).eps * np.abs(samples).max())
    return max(float(bends.max(initial=0.0)), rounding)


def turns(samples: FloatArray, size: float) -> FloatArray:
    """Return how many turns of `size` (unit of the samples) a reading begins at each step, shape (n - 1,)."""
    return np.asarray(np.round(np.diff(samples) / size))


def unwrapped(samples: FloatArray, size: float) -> FloatArray:
    """Return a position, shape (n,), as if its reading had not begun again after every `size` (its unit)."""
    begun = np.concatenate([[0.0], np.cumsum(turns(samples, size))])
    return np.asarray(samples - size * begun, dtype=float)


def repeats(samples: FloatArray) -> tuple[float, float] | None:
    """Return after how many samples a new reading comes, and at which sample the first; None where at each.

    Parameters
    ----------
    samples : array, shape (n,)
        Readings whose steps are no larger than their resolution repeat by themselves, and do not count.

    Returns
    -------
    tuple of float, or None
        Both in samples, and no whole numbers where the rates are in no whole ratio: a reading is then seen at
        the first sample after it has come.
    """
    steps = np.abs(np.diff(samples))
    if not FEWEST_READINGS <= np.count_nonzero(steps) <= IN_STEP * len(steps):
        return None
    changed = (np.flatnonzero(steps) + 1)[:ENOUGH_READINGS]
    sizes = steps[changed - 1]
    least = float(sizes[sizes > np.finfo(float).eps * np.abs(samples).max()].min(initial=np.inf))
    if not float(np.median(sizes)) > STEPS_OF_READINGS * least:
        return None
    for every in range(min(MOST_REPEATS, len(samples) // 2), 1, -1):
        phases = np.bincount(changed % every, minlength=every)
        if phases.max() >= IN_STEP * len(changed):
            return float(every), float(phases.argmax())
    return _between_samples(changed)


def _between_samples(changed: npt.NDArray[np.intp]) -> tuple[float, float] | None:
    """Return the same of readings that come between samples, from where they change: no whole period fits.

    A period of f per sample and one of 1 - f have the same line in the spectrum of what sampling shows.
    """
    there = changed - changed[0]
    if there[-1] < len(there):
        return None  # a new reading at every sample after a rest
    seen = np.zeros(int(there[-1]) + 1)
    seen[there] = 1.0
    size = FINER * quick_length(len(seen))
    lines = np.abs(np.fft.rfft(seen - seen.mean(), size))
    lines[: size // MOST_REPEATS] = 0.0
    # of readings that skip a sample now and then all multiples of a line are as high
    share = float(np.flatnonzero(lines > AS_HIGH * lines.max())[0]) / size
    for every in (1.0 / share, 1.0 / (1.0 - share)):
        if every < SHORTEST:
            continue
        start = every / (2.0 * np.pi) * float(np.angle(np.mean(np.exp(2j * np.pi * there / every))))
        for _ in range(REFINED):
            number = np.round((there - start) / every)
            every, start = np.polyfit(number, there, 1).tolist()
        late = there - every * number - start
        within = np.abs(late) <= 0.5 + LATE
        if min(np.mean(within), len(np.unique(number)) / len(number)) >= IN_STEP:
            first = float(changed[0]) + start + float(late[within].min())
            return every, first % every
    return None


def between_readings(samples: FloatArray, every: float, first: float) -> FloatArray:
    """Return a channel, in its unit, (n,), interpolated (cubic) between its new readings, see `repeats`."""
    from scipy.interpolate import CubicSpline

    places = np.arange(first, len(samples) - 1, every)
    # at the next sample each is seen, wherever between two it came
    values = samples[np.floor(places).astype(int) + 1]
    if first > 0:  # what is repeated at the beginning came before the record did
        places, values = np.r_[first - every, places], np.r_[samples[0], values]
    smooth = CubicSpline(places, values, bc_type="natural")
    return np.asarray(smooth(np.arange(len(samples))), dtype=float)
