"""Where a signal changes faster than its samples show.

What lies beyond half the sampling frequency is folded: of a force that jumps, or bends, the samples do not
tell when in between. A steady motion has little near half the sampling frequency, and noise is even there: a
jump stands out in a high difference.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import comb

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from modelgen.array_types import FloatArray, IntArray
from modelgen.runtime.filters.thresholds import (
    BEND,
    BEND_APART,
    BEND_BACK,
    BEND_NEAR,
    BEND_STEPS,
    JUMP,
    JUMP_ORDER,
    LEAST_JUMP,
    MEDIAN_OF_NORMAL,
    MOST_JUMPS,
    MOST_STEPPING,
    STEP,
    STEP_APART,
    STEP_NOISE,
    STEP_ORDER,
    STEP_PASSES,
    STEP_ROUNDS,
    STEP_ROWS,
    STEP_SHARE,
)

# Differences of even order are symmetric: a jump is in the middle.
DIFFERENCE = np.array([comb(JUMP_ORDER, k) * (-1.0) ** k for k in range(JUMP_ORDER + 1)]) / 2.0**JUMP_ORDER

# Samples that are looked at together: they stay in the processor's cache.
BLOCK = 1 << 13

# What it makes of a signal whose slope grows by 1 a sample, there.
BENT = -comb(JUMP_ORDER - 2, JUMP_ORDER // 2 - 1) / 2.0**JUMP_ORDER


def jumps(samples: FloatArray) -> IntArray:
    """Return the samples at which a signal, in any unit, (n,), jumps by more than its noise explains.

    None where many do: that is how the signal is, and its own noise is not known.
    """
    return _standing_out(_high_difference(samples), JUMP, samples) + JUMP_ORDER // 2


def steps(samples: FloatArray, others: Sequence[FloatArray] = ()) -> tuple[IntArray, FloatArray]:
    """Return the samples at which a signal, shape (n,), takes a step, and how large it is, in its unit.

    Shape (steps,) each. A step stands out of what samples before predict, of the signal and of others that it
    may follow, and may come as often as in a random binary signal; where the usual change is as large there
    are none.
    """
    places, sizes = np.zeros(0, dtype=np.int64), np.zeros(0)
    if len(samples) < STEP_APART * STEP_ORDER:
        return places, sizes
    for done in range(STEP_PASSES):
        # what is no step follows its own samples and those of all channels, and tells the steps better
        taken = np.zeros(len(samples))
        taken[places] = sizes
        new = taken + _unpredicted(samples - np.cumsum(taken), (samples, *others) if done else others)
        before, places = places, _stepping(samples, new)
        if not places.size:
            return places, np.zeros(0)
        plain, change = _plain_sizes(samples, places)
        usual = [float(np.median(np.abs(one))) for one in (new[STEP_ORDER:], np.diff(change))]
        sizes = new[places] if done and usual[0] < usual[1] else plain
        if done and np.array_equal(places, before):
            break
    return places, sizes


def _plain_sizes(samples: FloatArray, places: IntArray) -> tuple[FloatArray, FloatArray]:
    """Return how large steps are of a signal that changes as before up to them, and how it changes.

    A controller that feels a step answers behind it.
    """
    change, still = np.diff(samples, prepend=samples[:1]), np.ones(len(samples), dtype=bool)
    still[places] = False
    before = np.maximum.accumulate(np.where(still, np.arange(len(samples)), 0))[places]
    return change[places] - change[before], change


def _stepping(samples: FloatArray, new: FloatArray) -> IntArray:
    """Return where a signal takes a step, of what samples before do not predict of it, shape (n,) each."""
    left, change = np.abs(new), np.abs(np.diff(samples, prepend=samples[:1]))
    usual = float(np.median(left[STEP_ORDER:])) / MEDIAN_OF_NORMAL
    places = np.flatnonzero(left > max(STEP * usual, LEAST_JUMP * float(np.std(samples))))
    if usual == 0.0 or len(places) > MOST_STEPPING * len(samples):
        return places[:0]
    places = places[left[places] > STEP * _usual_near(left, places)]
    # what bends is not predicted either, and changes as much from there on; what steps bends there, and back.
    # Nor is the answer to a step that noise hides elsewhere, which is smaller than the step
    bend = np.diff(samples, 2, prepend=samples[:1], append=samples[-1:])
    at, behind = bend[places - 1], bend[places]
    back = -behind * np.sign(at) > BEND_BACK * np.abs(at)
    places = places[back & (np.abs(at) > STEP_SHARE * left[places])]
    return places[change[places] > STEP_SHARE * _largest_around(change, places, STEP_ORDER)]


def _unpredicted(samples: FloatArray, others: Sequence[FloatArray]) -> FloatArray:
    """Return what the samples before do not predict of a signal, shape (n,), zero at the first ones.

    A controller answers a step in the samples behind it, as it answers everything: the prediction is the one
    that leaves least of what is no step. It answers what sensors read, and of a mode that rings behind every
    step they tell more than its own samples.
    """
    channels, n = (samples, *others), len(samples) - STEP_ORDER
    few = np.arange(0, n, -(-n // STEP_ROWS))
    some = [np.ones(len(few)), *(one for channel in channels for one in _before(channel, few))]
    wanted = samples[STEP_ORDER:][few]
    sizes = np.array([float(np.linalg.norm(one)) or 1.0 for one in some])
    rows, usual, share = np.column_stack(some) / sizes, np.ones(len(wanted), dtype=bool), sizes
    for _ in range(STEP_ROUNDS):
        share = np.linalg.lstsq(rows[usual], wanted[usual], rcond=None)[0]
        size, before = np.abs(wanted - rows @ share), usual
        usual = size <= STEP_NOISE * float(np.median(size)) / MEDIAN_OF_NORMAL
        if np.array_equal(usual, before):
            break
    share = share / sizes
    left = np.zeros(len(samples))
    # in blocks that stay in the processor's cache
    for start in range(0, n, BLOCK):
        stop = min(start + BLOCK, n)
        block = samples[start + STEP_ORDER : stop + STEP_ORDER] - share[0]
        told = (one for channel in channels for one in _before(channel, slice(start, stop)))
        for part, one in zip(share[1:], told, strict=True):
            block -= part * one
        left[start + STEP_ORDER : stop + STEP_ORDER] = block
    return left


def _before(channel: FloatArray, which: IntArray | slice) -> Iterator[FloatArray]:
    """Yield the sample before of a channel and its differences, shape (count,) each, at some samples.

    Those behind the first STEP_ORDER ones, counted from there.
    """
    change = sliding_window_view(channel[:-1], STEP_ORDER)[which].T
    yield change[-1]
    for _ in range(STEP_ORDER - 1):
        change = np.diff(change, axis=0)
        yield change[-1]


def _usual_near(sizes: FloatArray, places: IntArray) -> FloatArray:
    """Return the usual one of some sizes before and behind each place; of normal noise its deviation."""
    around = np.clip(places[:, None] + np.arange(-STEP_APART, STEP_APART + 1), 0, len(sizes) - 1)
    return np.asarray(np.median(sizes[around], axis=1) / MEDIAN_OF_NORMAL)


def bends(samples: FloatArray) -> tuple[IntArray, FloatArray]:
    """Return the samples at which a signal, shape (n,), bends, and by how much its slope grows at each.

    Shape (bends,) each, the second in the signal's unit a sample. A bend grows with the steps of a
    difference, its noise does not: wide steps find what noise hides from narrow ones. Those say its sample
    and its size; about halfway between two samples they show hardly any, and little is folded.
    """
    high, found = _high_difference(samples), np.zeros(0, dtype=np.int64)
    for step in BEND_STEPS:
        wide = _high_difference(samples, step)
        ahead = (len(high) - len(wide)) // 2
        seen = _standing_out(wide, BEND, samples)
        # the difference rings on both sides of a bend
        seen = seen[np.abs(wide[seen]) >= _largest_around(np.abs(wide), seen, BEND_APART * step)] + ahead
        if step > 1:
            seen = _sharpest(high, wide, seen, ahead)
        known = np.abs(seen[:, None] - found[None, :]).min(axis=1, initial=len(samples)) <= BEND_APART
        found = np.concatenate([found, seen[~known]])
    found = np.sort(found)
    return found + JUMP_ORDER // 2, high[found] / BENT


def _largest_around(values: FloatArray, places: IntArray, reach: int) -> FloatArray:
    """Return the largest of some values up to so many places before and after each place."""
    around = np.arange(2 * reach + 1)
    return np.asarray(np.max(np.pad(values, reach)[places[:, None] + around], axis=1, initial=0.0))


def _sharpest(high: FloatArray, wide: FloatArray, seen: IntArray, ahead: int) -> IntArray:
    """Return where a narrow difference shows most of what a wide one shows about some places, of its sign."""
    near = np.clip(seen[:, None] + np.arange(-BEND_NEAR, BEND_NEAR + 1), 0, len(high) - 1)
    sign = np.sign(wide[seen - ahead])
    best = np.argmax(high[near] * sign[:, None], axis=1)
    found = near[np.arange(len(seen)), best]
    return np.asarray(np.unique(found[high[found] * sign > 0.0]))


def _high_difference(samples: FloatArray, step: int = 1) -> FloatArray:
    """Return the difference of a signal, shape (n - order * step - step + 1,), that is as high.

    Of means over so many neighbours, an odd number, which are as far apart; the first one is around the
    sample (order * step + step - 1) / 2.
    """
    if len(samples) < (JUMP_ORDER + 1) * step:
        return np.zeros(0)
    if step == 1:
        return np.convolve(samples, DIFFERENCE, "valid")
    kernel = np.zeros(JUMP_ORDER * step + 1)
    kernel[::step] = DIFFERENCE
    return np.convolve(samples, np.convolve(kernel, np.full(step, 1.0 / step)), "valid")


def _standing_out(high: FloatArray, multiple: float, samples: FloatArray) -> IntArray:
    """Return where a difference exceeds that multiple of its noise; nowhere if it does so in many places."""
    none = np.zeros(0, dtype=np.int64)
    if not high.size:
        return none
    size = np.abs(high)
    noise = float(np.median(size)) / MEDIAN_OF_NORMAL
    found = np.flatnonzero(size > max(multiple * noise, LEAST_JUMP * float(np.std(samples))))
    return none if noise == 0.0 or len(found) > MOST_JUMPS * len(samples) else np.asarray(found)
