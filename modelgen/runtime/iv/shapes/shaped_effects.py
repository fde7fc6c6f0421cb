"""Fits with effects of which more than the size is to be found: a frequency, a damping."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from modelgen.runtime.iv.effect import Effect
from modelgen.runtime.iv.freed_effects import Freed, Rows, fit_with_effects
from modelgen.runtime.iv.instrumental_variables import Setting
from modelgen.runtime.iv.thresholds import SHAPE_NUMBERS, SHAPE_ROUNDS, SHAPE_SETTLED
from modelgen.runtime.least_squares.fit import Fit


def fit_in_shape(
    setting: Setting,
    rows: Rows,
    start: Fit,
    effects: Sequence[Effect],
    known: Sequence[float] = (),
    finish: Callable[[Fit], Fit] | None = None,
    rounds: int | None = None,
) -> tuple[tuple[Effect, ...], Freed]:
    """Estimate parameters and effects as `fit_with_effects`, and the shape of effects that have one.

    What a change of shape adds stays in `others`, like a delay: standard deviations know that it was found.

    Returns
    -------
    tuple of Effect
        In their last shape.
    Freed
        Of these effects.
    """
    now, sizes, fit = tuple(effects), tuple(known), start
    for _ in range(SHAPE_ROUNDS):
        shapes = [effect.shape(len(setting.records)) for effect in now]
        parts = tuple(part for shape in shapes for part in shape)
        start_at = (*(0.0 for _ in parts), *sizes)
        found = fit_with_effects(setting, rows, fit, (*parts, *now), start_at, finish, rounds)
        sizes, first, at = found.sizes[len(parts) :], 0, found.at[len(parts) :]
        alone = replace(found, sizes=sizes, stds=found.stds[len(parts) :], at=at)
        last, settled = now, True
        for place, (effect, size, shape) in enumerate(zip(last, sizes, shapes, strict=True)):
            if effect.moved is not None:
                own = slice(first, first + len(shape))
                share = np.abs(found.sizes[own]) / np.maximum(found.stds[own], np.finfo(float).tiny)
                settled &= bool(np.all(share[:SHAPE_NUMBERS] < SHAPE_SETTLED))
                now = (*now[:place], effect.moved(size, found.sizes[own]), *now[place + 1 :])
            first += len(shape)
        if settled:
            break
        fit = found.fit
    return last, alone
