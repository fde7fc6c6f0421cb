"""Which of the effects that a model lacks the residual of a fit with instruments shows, and what it moves.

The residual is regressed on what an effect does to the rows (`model_errors`), both made orthogonal to the
fit's regressors (Frisch and Waugh 1933; Rao 1948 for the test). Noise of the sensors is in the residual, but
not in the simulated effect: only what the effect explains remains.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.iv.effect import Effect
from modelgen.runtime.iv.thresholds import (
    LARGEST_SHARE,
    LEAST_EXPLAINED,
    LEAST_MOVE,
    LEAST_MOVED_SHARE,
    LEAST_OWN_SHARE,
    LEVEL,
)
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.hac_covariance import hac_covariance, long_run_covariance
from modelgen.runtime.model.model import Model
from modelgen.runtime.numerics.tails import normal_beyond


@dataclass(frozen=True, eq=False)
class Score:
    """What a residual says of one effect.

    Attributes
    ----------
    effect : Effect
    size, std : float
        Its estimated size, in its unit, and the standard deviation of that.
    explained : float
        Share of the residual's power.
    move : array, shape (c,)
        By how much X changes when the effect is taken into account.
    own : float
        Share of the effect that lies outside of the columns.
    power : float
        Sum of squares of that part, weighted.
    least : float
        The size that would be certain.
    matters : bool
        Whether it is certain (1 % over all effects) and moves or explains enough.
    """

    effect: Effect
    size: float
    std: float
    explained: float
    move: FloatArray
    own: float
    power: float
    least: float
    matters: bool


def scores(
    fit: Fit,
    effects: Sequence[Effect],
    grown: Sequence[Sequence[FloatArray]],
    others: Sequence[Sequence[FloatArray]] = (),
    slope: FloatArray | None = None,
) -> tuple[Score, ...]:
    """Return the score of each effect that can be told from the columns, the most explained first.

    Parameters
    ----------
    fit : Fit
        With instruments.
    effects : sequence of Effect
    grown : sequence of sequence of array
        For each effect how Y - W X grows with its size: one array a block of the fit.
    others : sequence of sequence of array
        Likewise for what is estimated already: delays, effects.
    slope : array, shape (c, p), optional
        How X grows with the p parameters that were fitted in its place.
    """
    if not effects:
        return ()
    R, free = regressors(fit, others, slope)
    G = np.stack([stacked(fit, one) for one in grown], axis=1)
    r, _ = apart(R, fit.weighted_residual[:, None])
    r = r[:, 0]
    own, share = apart(R, G)
    power, whole = np.sum(own**2, axis=0), np.sum(G**2, axis=0)
    seen = np.flatnonzero(power > LEAST_OWN_SHARE * whole)
    sizes = own[:, seen].T @ r / power[seen]
    spread = np.sqrt(np.maximum(np.diag(hac_covariance(fit)), 0.0))
    critical = normal_beyond(0.5 * LEVEL / max(len(seen), 1))
    largest = largest_overlooked(fit, R[:, :free])
    share_of = (power / np.maximum(whole, np.finfo(float).tiny)).tolist()
    explained = sizes**2 * power[seen] / float(r @ r)
    stds = _deviations(fit, r, own[:, seen], sizes, power[seen])
    found = []
    for place, size, std, part in zip(seen.tolist(), sizes.tolist(), stds, explained.tolist(), strict=True):
        move = -share[:free, place] * size
        if slope is not None:
            move = slope @ move
        large = part > LEAST_EXPLAINED or bool(np.any(np.abs(move) > LEAST_MOVE * spread))
        # sampling and filters are not exact beyond that
        large = large and bool(np.any(np.abs(move) > LEAST_MOVED_SHARE * np.abs(fit.solution.x)))
        overlooked = abs(size) * float(np.sqrt(whole[place])) < largest
        matters = large and overlooked and abs(size) > critical * std
        found.append(
            Score(
                effects[place],
                size,
                float(std),
                part,
                move,
                share_of[place],
                float(power[place]),
                critical * float(std),
                matters,
            )
        )
    return tuple(sorted(found, key=lambda one: -one.explained))


def without_noise(
    found: Sequence[Score],
    fit: Fit,
    effects: Sequence[Effect],
    noise: tuple[Sequence[FloatArray], Sequence[Sequence[FloatArray]]],
    others: Sequence[Sequence[FloatArray]],
    slope: FloatArray | None,
) -> tuple[Score, ...]:
    """Return the scores without what noise of the forces makes of them, the most explained first.

    Parameters
    ----------
    effects : sequence of Effect
        Those that matter.
    noise : pair
        What noise adds to the residual and to the effects, as `noise_rows` returns it.
    """
    R, _ = regressors(fit, others, slope)
    r = apart(R, stacked(fit, noise[0])[:, None])[0][:, 0]
    shift = {
        effect.name: float(stacked(fit, change) @ r) for effect, change in zip(effects, noise[1], strict=True)
    }
    changed = []
    for one in found:
        if one.effect.name in shift:
            share = 1.0 - shift[one.effect.name] / (one.power * one.size)
            matters = one.matters and share > 0.0 and abs(share * one.size) > one.least
            one = replace(
                one,
                size=share * one.size,
                explained=share**2 * one.explained,
                move=share * one.move,
                matters=matters,
            )
        changed.append(one)
    return tuple(sorted(changed, key=lambda one: -one.explained))


def slope_of(model: Model, fit: Fit) -> FloatArray | None:
    """Return how columns grow with the physical parameters, where those were fitted in their place."""
    values = fit.physical(model.parameters)
    if values is None:
        return None
    places = [model.base_parameters.index(name) for name in fit.columns]
    return model.base_jacobian(values)[places]


def regressors(
    fit: Fit, others: Sequence[Sequence[FloatArray]], slope: FloatArray | None
) -> tuple[FloatArray, int]:
    """Return the weighted regressors, those of the parameters first, and how many these are."""
    R = np.concatenate([w * r for w, r in zip(fit.weights, fit.regressors, strict=True)])
    if slope is not None:
        R = R @ slope
    return np.column_stack([R, *(stacked(fit, one) for one in others)]), R.shape[1]


def apart(R: FloatArray, columns: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return columns, shape (r, k), without what R explains of them, and the coefficients of that."""
    scale = np.linalg.norm(R, axis=0)
    scale = np.where(scale > 0.0, scale, 1.0)
    share = np.linalg.lstsq(R / scale, columns, rcond=None)[0] / scale[:, None]
    return columns - R @ share, share


def largest_overlooked(fit: Fit, R: FloatArray) -> float:
    """Return the norm of what an effect may add to the rows; R are their regressors, shape (r, p)."""
    return LARGEST_SHARE * float(np.max(np.linalg.norm(R, axis=0) * np.abs(_unknowns(fit, R))))


def _unknowns(fit: Fit, R: FloatArray) -> FloatArray:
    """Return the parameters that belong to the columns of R."""
    if R.shape[1] == len(fit.columns):
        return fit.solution.x
    return np.asarray(np.linalg.lstsq(R, fit.weighted_measurement, rcond=None)[0])


def stacked(fit: Fit, parts: Sequence[FloatArray]) -> FloatArray:
    """Return parts of the blocks of a fit in one, weighted, shape (r,)."""
    return np.concatenate([w * part for w, part in zip(fit.weights, parts, strict=True)])


def _deviations(
    fit: Fit, r: FloatArray, own: FloatArray, sizes: FloatArray, power: FloatArray
) -> list[float]:
    """Return the standard deviations of the sizes, of residuals without the effect, (effects,)."""
    ends = np.cumsum([0, *(len(block.place) for block in fit.blocks)])
    series: dict[int, FloatArray] = {}
    for index, block in enumerate(fit.blocks):
        rows = slice(ends[index], ends[index + 1])
        psi = series.setdefault(block.record, np.zeros((block.grid, len(sizes))))
        psi[block.place] += own[rows] * (r[rows, None] - own[rows] * sizes) / power
    return [
        float(np.sqrt(max(long_run_covariance([psi[:, [k]] for psi in series.values()])[0, 0], 0.0)))
        for k in range(len(sizes))
    ]
