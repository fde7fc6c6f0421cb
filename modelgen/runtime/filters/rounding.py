"""To which step readings are rounded, as those of an encoder and of a file with so many digits are."""

from __future__ import annotations

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.filters.thresholds import (
    ENOUGH_STEPS,
    EXCERPT,
    EXCERPTS,
    MOST,
    MOST_PARTS,
    MOST_STEPS,
    NEARLY,
    NEIGHBOURS,
    REACHES,
    ROUNDING,
)


def excerpt(samples: FloatArray) -> FloatArray:
    """Return samples from all over a channel, shape (n,), that show what is usual; all of a short one."""
    if len(samples) <= EXCERPTS * EXCERPT:
        return samples
    starts = np.linspace(0, len(samples) - EXCERPT, EXCERPTS).astype(int)
    return np.concatenate([samples[start : start + EXCERPT] for start in starts])


def rounding(samples: FloatArray) -> float:
    """Return the step, in their unit, that readings, shape (n,), are rounded to; 0 for none.

    The coarser one where it differs: with so many significant digits it is coarser far from zero.
    """
    shown = excerpt(samples)
    least = ROUNDING * float(np.ptp(samples))  # values that were scaled or shifted differ by that as well
    ordered = np.sort(shown)
    apart = np.diff(ordered)
    first = np.flatnonzero(apart)
    apart = apart[first]
    # where no reading repeats, rounding does not show
    again = np.flatnonzero(np.diff(first, prepend=-1) > 1)
    if not again.size:
        return _rounding_at_turns(samples, least)
    parts = np.unique(again // NEIGHBOURS)
    some = parts[:: -(-len(parts) // MOST_PARTS)]
    near = [apart[part * NEIGHBOURS : (part + 1) * NEIGHBOURS] for part in some.tolist()]
    found = [_common_step(part[part > least]) for part in near]
    step = float(np.quantile(found, MOST, method="lower"))
    # readings that are many steps apart have only steps in time as small as one
    return step or _step_in_time(shown, least)


def step_of_counts(samples: FloatArray) -> float:
    """Return the step, in their unit, of which readings, shape (n,), differ by multiples in time; 0 for none.

    It shows in a motion at any speed: changes from sample to sample differ by it.
    """
    least = ROUNDING * float(np.ptp(samples))
    changes = np.unique(np.abs(np.diff(excerpt(samples))))
    apart = np.diff(changes, prepend=0.0)
    step = _common_step(apart[apart > least])
    return float(np.sum(changes) / np.sum(np.round(changes / step))) if step else 0.0


def _rounding_at_turns(samples: FloatArray, least: float) -> float:
    """Return the same where a motion is so fast that readings repeat next to its turning points only."""
    repeated = np.flatnonzero(samples[1:] == samples[:-1])
    some = repeated[:: max(-(-len(repeated) // MOST_PARTS), 1)].tolist()
    near = [samples[max(place - NEIGHBOURS, 0) : place + NEIGHBOURS] for place in some]
    found = [_step_in_time(part, least) for part in near]
    return float(np.quantile(found, MOST, method="lower")) if found else 0.0


def _step_in_time(samples: FloatArray, least: float) -> float:
    """Return the step of which the changes from sample to sample, all above `least`, are multiples, or 0."""
    steps = np.unique(np.abs(np.diff(samples)))
    return _common_step(steps[steps > least])


def _common_step(apart: FloatArray) -> float:
    """Return the largest step of which most differences are multiples, among them the least; otherwise 0."""
    if not apart.size:
        return 0.0
    least = float(np.min(apart))
    # few differences are multiples of some part of the least by chance
    for part in range(1, 1 + (MOST_STEPS if apart.size >= ENOUGH_STEPS else 1)):
        step = least / part
        for reach in REACHES:
            # the larger multiples tell the step more exactly
            near = apart[apart < reach * step]
            step = float(np.sum(near)) / float(np.sum(np.round(near / step))) if near.size else step
        multiples = np.abs(apart / step - np.round(apart / step)) < NEARLY
        if float(np.mean(multiples)) > MOST:
            return step
    return 0.0
