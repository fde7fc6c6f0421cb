"""Monte Carlo: a planned experiment repeated with other noise, each record identified as a user would."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import combinations
from math import hypot, inf, sqrt

import numpy as np

from modelgen.errors import IdentifiabilityError
from modelgen.progress import counted
from modelgen.runtime.planning.planned_experiment import Experiment
from modelgen.runtime.planning.precision import Predicted
from modelgen.runtime.planning.predicted_precision import estimate_once, predict
from modelgen.runtime.planning.thresholds import GIVEN_SHARE, WEIGHING

# Other noise than that which the prediction looks at.
FIRST_SEED = WEIGHING


@dataclass(frozen=True)
class Spread:
    """The spread of `draws` estimates of a physical parameter and the predicted one, in % of its magnitude.

    `given` is the share of experiments whose estimate holds the parameter at all.
    """

    name: str
    std: float
    bias: float
    predicted_std: float
    predicted_bias: float
    draws: int
    given: float

    @property
    def error(self) -> float:
        """Root mean square error; infinite where most estimates refuse the parameter."""
        return hypot(self.std, self.bias) if self.given >= GIVEN_SHARE else inf

    @property
    def uncertainty(self) -> float:
        """Standard error of `error`: a spread from n draws is known to 1 / sqrt(2 n)."""
        if self.error in (0.0, inf):
            return 0.0
        square = (2.0 * self.std**4 + 4.0 * (self.bias * self.std) ** 2) / self.draws
        return sqrt(square) / (2.0 * self.error)


@dataclass(frozen=True)
class Misorders:
    """Pairs of sensor sets in a predicted order: which Monte Carlo turns round, and which it leaves open."""

    wrong: tuple[tuple[str, str], ...]
    ties: tuple[tuple[str, str], ...]


def worst_spread(spreads: Sequence[Spread]) -> Spread:
    """Return the spread of the least precise parameter."""
    return max(spreads, key=lambda spread: spread.error)


def misorders(order: Sequence[str], worst: Mapping[str, Spread]) -> Misorders:
    """Hold a predicted order of sensor sets against the worst spread of each.

    Two errors differ if they do by more than twice the standard error of their difference.
    """
    pairs = list(combinations(order, 2))
    wrong = [(a, b) for a, b in pairs if worst[a].error > worst[b].error and _differ(worst[a], worst[b])]
    return Misorders(tuple(wrong), tuple((a, b) for a, b in pairs if not _differ(worst[a], worst[b])))


def _differ(a: Spread, b: Spread) -> bool:
    if inf in (a.error, b.error):
        return a.error != b.error
    return abs(a.error - b.error) > 2.0 * hypot(a.uncertainty, b.uncertainty)


def monte_carlo(
    planned: Experiment, draws: int = 200, predicted: Predicted | None = None
) -> tuple[Spread, ...]:
    """Repeat the experiment with other noise, and compare the estimates with the prediction.

    Parameters
    ----------
    planned : Experiment
    draws : int
        How many times.
    predicted : Predicted, optional
        What the experiment promises, where that is known already.

    Raises
    ------
    IdentifiabilityError
        When the experiment does not determine all base parameters.
    """
    model = planned.model
    promised = {entry.name: entry for entry in (predicted or predict(planned)).precisions}
    true = {**model.known, **planned.parameters}
    found = np.full((draws, len(model.parameters)), np.nan)
    for k in counted(range(draws), f"{model.sensor_set}: experiments"):
        with suppress(IdentifiabilityError):
            physical = estimate_once(planned, FIRST_SEED + k).physical
            found[k] = [physical.get(name, np.nan) for name in model.parameters]
    spreads = []
    for name, values in zip(model.parameters, found.T, strict=True):
        here = 100.0 * (values[np.isfinite(values)] - true[name]) / (abs(true[name]) or np.nan)
        std, bias = (float(here.std(ddof=1)), float(here.mean())) if here.size > 1 else (np.nan, np.nan)
        one = promised.get(name)
        expected = (one.std, one.bias) if one else (inf, np.nan)
        spreads.append(Spread(name, std, bias, *expected, here.size, here.size / draws))
    return tuple(spreads)
