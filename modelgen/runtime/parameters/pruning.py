"""Which parameters a record cannot support: the paper's rule, those of 10 % or more removed one by one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from modelgen.array_types import FloatArray

# names kept -> values, relative standard deviations in %, relative error
Refit = Callable[[tuple[str, ...]], tuple[FloatArray, FloatArray, float]]


@dataclass(frozen=True)
class PruningStep:
    """One removal: which parameter, its relative standard deviation in %, the relative error without it."""

    removed: str
    relative_std: float
    relative_error: float


@dataclass(frozen=True)
class Pruning:
    """What is left when parameters with a relative standard deviation of `percent` or more are removed.

    `relative_error` is that of the full estimate, `kept` maps by pairs name to value and relative standard
    deviation in %.
    """

    percent: float
    relative_error: float
    steps: tuple[PruningStep, ...]
    kept: tuple[tuple[str, float, float], ...]


def prune(
    candidates: Sequence[str], refit: Refit, percent: float = 10.0, keep: Sequence[str] = ()
) -> Pruning:
    """Remove the parameter of the largest relative standard deviation until all are below `percent`.

    Parameters
    ----------
    candidates : sequence of str
        Names that may be removed.
    refit : callable
        Fits with the names given; returns values, relative standard deviations in %, and the relative error.
    percent : float
        The bound (Pham 2002, section III: 10 %).
    keep : sequence of str
        Names that are not removed, however large their relative standard deviation is.
    """
    names = tuple(candidates)
    values, spread, error = refit(names)
    before, steps = error, list[PruningStep]()
    while len(names) > 1:
        removable = np.where([name in keep for name in names], -np.inf, spread)
        worst = int(np.argmax(removable))
        if not removable[worst] >= percent:
            break
        removed, removed_spread = names[worst], float(spread[worst])
        names = names[:worst] + names[worst + 1 :]
        values, spread, error = refit(names)
        steps.append(PruningStep(removed, removed_spread, error))
    kept = tuple(zip(names, values.tolist(), spread.tolist(), strict=True))
    return Pruning(percent, before, tuple(steps), kept)
