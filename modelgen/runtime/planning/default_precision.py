"""The precision that the default of `identify` promises: what it states of noisy copies of the experiment.

It has no closed form. Delays of forces that are free, effects that a residual cannot exclude and what other
filters would change widen its intervals; weights by the spectrum of the noise narrow them; and composites it
need not know, where it estimates the physical parameters themselves.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from modelgen.errors import DataError, IdentifiabilityError
from modelgen.runtime.identification.identify import identify_whole
from modelgen.runtime.planning.planned_experiment import Experiment
from modelgen.runtime.planning.precision import Precision, Predicted
from modelgen.runtime.planning.thresholds import COPIES
from modelgen.runtime.results.estimate import Estimate


def default_estimate(planned: Experiment, seed: int) -> Estimate:
    """Return what `identify` makes of one noisy copy of the experiment, with its defaults.

    Raises
    ------
    IdentifiabilityError
        When it gives no parameter.
    """
    try:
        return identify_whole(planned.model, planned.records(seed))
    except DataError as error:  # a record too short for the filter that this noise asks for, say
        raise IdentifiabilityError(*error.problems) from error


def stated_in_copies(
    copy: Callable[[int], Estimate],
    told: Callable[[Estimate], Mapping[str, float]],
    copies: int = COPIES,
) -> tuple[list[Estimate], dict[str, float]]:
    """Return estimates from noisy copies, and the root mean squares of the deviations that most of them give.

    Parameters
    ----------
    copy : callable
        Takes a seed to the estimate from the copy with its noise.
    told : callable
        Takes an estimate to the deviations of its parameters, by name.
    copies : int

    Raises
    ------
    IdentifiabilityError
        When most copies give no parameter.
    """
    estimates: list[Estimate] = []
    for seed in range(copies):
        try:
            estimates.append(copy(seed))
        except IdentifiabilityError:
            if 2 * (seed + 1 - len(estimates)) > copies:
                raise
    stated = [told(one) for one in estimates]
    names = dict.fromkeys(name for one in stated for name in one)
    found = {name: [one[name] for one in stated if name in one] for name in names}
    return estimates, {
        name: float(np.sqrt(np.mean(np.square(stds))))
        for name, stds in found.items()
        if 2 * len(stds) > copies
    }


def default_precision(planned: Experiment) -> Predicted:
    """Return what the experiment promises.

    Raises
    ------
    IdentifiabilityError
        When most copies give no parameter.
    """
    estimates, stated = stated_in_copies(
        lambda seed: default_estimate(planned, seed),
        lambda one: {entry.name: entry.std for entry in one.parameters.physical},
    )
    true = {**planned.model.known, **planned.parameters}
    precisions, refused = [], {}
    for name in planned.model.parameters:
        if name in stated:
            percent = 100.0 / (abs(true[name]) or np.nan)
            precisions.append(Precision(name, true[name], stated[name] * percent, 0.0))
        else:
            reasons = (one.not_identifiable[name] for one in estimates if name in one.not_identifiable)
            refused[name] = next(reasons, "is refused")
    return Predicted(estimates[0].condition_number, tuple(precisions), refused)
