"""Which other effects explain the residual as well as one that is estimated, and what that leaves open.

Asked at the end, with all other effects estimated: two zeros and two constant forces may explain the same,
where one of either explains half of it and would move the parameters far.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.iv.effect import Effect
from modelgen.runtime.iv.score_tests import Span, stacked
from modelgen.runtime.iv.thresholds import AS_GOOD, EXACTNESS, LARGEST_SHARE, LEVEL, LITTLE_OWN
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.numerics.tails import normal_beyond


@dataclass(frozen=True, eq=False)
class Looked:
    """What rows say of effects: those estimated, those tested, and how the rows grow with each.

    Attributes
    ----------
    delays : tuple
        How Y - W X grows with delays that are estimated, one array a block each.
    estimated, tested : tuple
        Likewise with effects.
    slope : array, shape (c, p), optional
        How X grows with the p parameters that were fitted in its place.
    """

    delays: Sequence[Sequence[FloatArray]]
    estimated: Sequence[Sequence[FloatArray]]
    tested: Sequence[Sequence[FloatArray]]
    slope: FloatArray | None = None


def other_explanations(
    fit: Fit,
    effects: Sequence[Effect],
    sizes: Sequence[float],
    stds: Sequence[float],
    others: Sequence[Effect],
    looked: Looked,
) -> tuple[list[list[tuple[Effect, float]]], FloatArray]:
    """Return for each estimated effect what could stand in its place, with its size, and what that moves.

    Parameters
    ----------
    fit : Fit
        With `effects` estimated.
    sizes, stds : sequence of float
        Of these, in their units.
    others : sequence of Effect
        Those that were tested.
    looked : Looked

    What is nearly a sum of the columns is left out: a step of which so much is one tells nothing unless all
    is solved again.

    Returns
    -------
    list of list of (Effect, float)
        Those that explain most first.
    array, shape (c, c)
        Mean square of the differences of X, in SI.
    """
    c = len(fit.columns)
    found: list[list[tuple[Effect, float]]] = [[] for _ in effects]
    drift = np.zeros((c, c))
    if not others or not effects:
        return found, drift
    critical = normal_beyond(0.5 * LEVEL / len(others)) ** 2
    for index, (size, std) in enumerate(zip(sizes, stds, strict=True)):
        if not std > 0.0:
            continue
        rest = [one for place, one in enumerate(looked.estimated) if place != index]
        span, mine = Span(fit, (*looked.delays, *rest), looked.slope), looked.estimated[index]
        left = span.apart(fit.weighted_residual + size * stacked(fit, mine))
        told = span.compared((mine, *looked.tested), left)
        whole, power = told.whole, told.power
        steps = told.along / np.maximum(power, np.finfo(float).tiny)
        explained = steps**2 * power
        # as a chi square that knows the residual's colour, like the deviation of this effect's size
        chi = explained * (size / std) ** 2 / max(float(explained[0]), np.finfo(float).tiny)
        largest = span.largest_overlooked
        inexact = (EXACTNESS * largest / LARGEST_SHARE) ** 2
        forms = {one.name for one in effects[index].forms}
        alike = [
            one.name in forms or effects[index].name in [form.name for form in one.forms] for one in others
        ]
        as_good = [
            place
            for place in (1 + np.argsort(-explained[1:], kind="stable")).tolist()
            if (
                chi[0] - chi[place] < AS_GOOD
                # forms of one thing differ by less than rows hold exactly
                or (alike[place - 1] and explained[0] - explained[place] < inexact)
            )
            and chi[place] > critical
            and power[place] > LITTLE_OWN * whole[place]
            and abs(steps[place]) * float(np.sqrt(max(whole[place] - power[place], 0.0))) < largest
            and others[place - 1].possible(float(steps[place]))
        ]
        moves = -told.share * steps
        if looked.slope is not None:
            moves = looked.slope @ moves
        for place in as_good:
            difference = moves[:, place] - moves[:, 0]
            drift += np.outer(difference, difference) / len(as_good)
            found[index].append((others[place - 1], float(steps[place])))
    return found, drift
