"""Which sensors, before they are bought: predicted precision of every parameter, per sensor set.

An experiment is simulated; what instruments of a stated noise and resolution make of it is what the default
of `identify` states of noisy copies, or follows in closed form for one method, its bias included. Monte Carlo
confirms it on request.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import inf

from modelgen.errors import IdentifiabilityError
from modelgen.runtime.model.model import Model
from modelgen.runtime.planning.planned_experiment import PAIR, Experiment, experiment
from modelgen.runtime.planning.precision import Precision, Predicted
from modelgen.runtime.planning.predicted_precision import predict
from modelgen.runtime.simulation.excitation import Excitation
from modelgen.runtime.simulation.instrument import Instrument
from modelgen.runtime.simulation.sensor_readings import instrument_keys

DEFAULT_METHOD = "auto"


@dataclass(frozen=True)
class Prediction:
    """What one sensor set promises.

    `missing` are parameters that it leaves open, and `reason` says why; where it cannot identify the chain at
    all, `precisions` are empty. `planned` is the experiment, and `promised` all that it promises.
    """

    sensor_set: str
    channels: tuple[str, ...]
    price: float
    precisions: tuple[Precision, ...]
    missing: tuple[str, ...]
    condition_number: float
    reason: str = ""
    planned: Experiment | None = field(default=None, compare=False, repr=False)
    promised: Predicted | None = field(default=None, compare=False, repr=False)

    @property
    def worst(self) -> float:
        """Largest error of a parameter in %; infinite where one cannot be had."""
        if self.missing or not self.precisions:
            return inf
        return max(entry.error for entry in self.precisions)


def judge_set(
    name: str,
    model: Model,
    parameters: Mapping[str, float],
    instruments: Mapping[str, Instrument],
    excitations: Sequence[str | Excitation] = PAIR,
    *,
    fs: float = 5000.0,
    duration_s: float = 2.0,
    method: str | None = None,
) -> Prediction:
    """Return the predicted precision of a sensor set, by default of what `identify` does, or why it cannot
    identify the chain.
    """
    channels = instrument_keys(model)
    price = sum(instruments[key].price for key in channels if key in instruments)
    own = {key: instruments[key] for key in channels if key in instruments}
    try:
        how = method or DEFAULT_METHOD
        planned = experiment(model, parameters, own, excitations, fs=fs, duration_s=duration_s, method=how)
        found = predict(planned)
    except IdentifiabilityError as error:
        reason = "; ".join(str(problem) for problem in error.problems)
        return Prediction(name, channels, price, (), model.parameters, inf, reason)
    reason = "; ".join(_grouped(found.refused))
    condition = found.condition_number
    missing = tuple(found.refused)
    return Prediction(
        name, channels, price, found.precisions, missing, condition, reason, planned=planned, promised=found
    )


def _grouped(refused: Mapping[str, str]) -> list[str]:
    """Return every reason once, with the parameters it holds for."""
    names: dict[str, list[str]] = {}
    for name, reason in refused.items():
        # how uncertain each one is does not matter here
        names.setdefault(re.sub(r"is \S+ % of its value, ", "is ", reason), []).append(name)
    return [f"{', '.join(alike)}: {reason}" for reason, alike in names.items()]


def rank(predictions: Sequence[Prediction]) -> tuple[Prediction, ...]:
    """Return the predictions, most precise first; sets that leave parameters open come last."""
    return tuple(sorted(predictions, key=lambda p: (p.worst, len(p.missing), p.price, p.sensor_set)))


def cheapest(predictions: Sequence[Prediction], wanted_percent: float) -> Prediction | None:
    """Return the cheapest set whose every parameter is within the wanted error in %, or None."""
    able = [p for p in predictions if p.worst <= wanted_percent]
    return min(able, key=lambda p: (p.price, p.worst, p.sensor_set), default=None)
