"""Excitations optimised for a sensor set, within the limits that chirp and trapezoid keep.

Every record runs at a few speeds, plus a finite Fourier series of the reference's rate (Swevers et al. 1997),
for friction and inertia, under a multisine of the feedforward force with a low crest, for the elastic
modes. A derivative-free search changes speeds, times, amplitudes and bands; every trial is scaled up to the
limits. The criterion is what `information` predicts: no random numbers, so that small gains show.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import product
from math import exp, inf, log
from typing import TypedDict, Unpack

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import DataError, IdentifiabilityError, ModelgenError, Problem
from modelgen.keyword_options import with_defaults
from modelgen.runtime.model.model import Model
from modelgen.runtime.planning.peaks import LIMITS, peaks_of
from modelgen.runtime.planning.planned_experiment import PAIR, Experiment, experiment
from modelgen.runtime.planning.precision import Predicted
from modelgen.runtime.planning.predicted_precision import predict
from modelgen.runtime.planning.random_search import best_of_trials
from modelgen.runtime.planning.thresholds import (
    FAILED,
    HIGHEST_PART_OF_FS,
    LEAST_FORCE,
    MOST_SHRINKS,
    SAFETY,
    SCALINGS,
    SHORTEST_PART,
)
from modelgen.runtime.simulation.closed_loop import bandwidth_hz, vibration
from modelgen.runtime.simulation.excitation import Excitation
from modelgen.runtime.simulation.fourier_excitation import Shape, series_excitation
from modelgen.runtime.simulation.instrument import Instrument
from modelgen.runtime.simulation.plant import Plant, make_plant
from modelgen.runtime.simulation.simulate import simulate

CRITERIA = ("worst", "d-optimal", "condition")
HARMONICS = 2
PARTS = 3
# First trials: a slow part, a fast one, the way back; the only reversal is then a steep one, which is seen in
# time. Bands in multiples of the elastic frequencies, and shares of the force: where the multisine makes the
# driven body reverse, friction is seen late.
START_SPEEDS = (0.07, 0.9, -0.9)
START_TIMES = (0.42, 0.29, 0.29)
START_BANDS = ((0.3, 1.5), (0.6, 1.3), (0.9, 1.15))
START_FORCES = ((0.9, 1.0, 1.0), (0.5, 1.0, 1.0))


@dataclass(frozen=True)
class Optimised:
    """The optimised excitations, the limits and what is reached of them, and the gain over the pair.

    `worst` and `pair_worst` are the largest predicted errors in %; `parameters` holds (name, error with the
    pair, error now), in %. `method` is the estimator that these errors are predicted for.
    """

    excitations: tuple[Excitation, ...]
    shapes: tuple[Shape, ...]
    limits: Mapping[str, float]
    reached: Mapping[str, float]
    pair_worst: float
    worst: float
    parameters: tuple[tuple[str, float, float], ...]
    method: str


class SearchOptions(TypedDict, total=False):
    """What `optimise` searches for, and how long; it describes them."""

    criterion: str
    limits: Mapping[str, float] | None
    rounds: int


def optimise(
    model: Model,
    parameters: Mapping[str, float],
    instruments: Mapping[str, Instrument],
    *,
    fs: float = 5000.0,
    duration_s: float = 2.0,
    method: str | None = None,
    **options: Unpack[SearchOptions],
) -> Optimised:
    """Return two records that are more precise than chirp and trapezoid of the same length and limits.

    Parameters
    ----------
    model, parameters, instruments
        As in `modelgen.runtime.planning.planned_experiment.experiment`.
    method : str, optional
        The estimator by whose prediction it searches, by default (and for "auto") "wls".
    criterion : str
        "worst", the default: largest predicted error of a parameter; "d-optimal": geometric mean of all;
        "condition": condition number of the weighted observation matrix.
    limits : mapping of str to float, optional
        Peaks (SI) of "position" (travel from the start), "velocity", "force", "deflection"; what is not given
        is what the pair reaches.
    rounds : int
        Trials, by default 200.
    fs, duration_s : float
        Sampling frequency in Hz; duration in s of each of the two records.

    Raises
    ------
    DataError
        For an unknown criterion or limit.
    IdentifiabilityError
        When the pair leaves parameters open.
    """
    search = with_defaults("optimise", options, SearchOptions, SearchOptions(criterion="worst", rounds=200))
    criterion, limits = search["criterion"], search["limits"] or {}
    _check(criterion, limits)
    plant = make_plant(model, parameters)
    method = "wls" if method in (None, "auto") else method  # a closed form, in a fraction of the time of iv
    pair = experiment(model, parameters, instruments, PAIR, fs=fs, duration_s=duration_s, method=method)
    bounds = {**peaks_of(plant, pair.simulations), **limits}
    trial = _Trial(plant, instruments, bounds, criterion, fs, duration_s, method)
    promised = predict(pair)
    if promised.refused:
        what = f"{', '.join(promised.refused)} cannot be had from chirp and trapezoid by method {method}"
        raise IdentifiabilityError.at("optimise", f"{what}, by whose predictions it searches", "add a sensor")
    _, best = best_of_trials(trial, trial.starts, search["rounds"])
    before = {entry.name: entry.error for entry in promised.precisions}
    planned, found = trial.planned(best)
    return Optimised(
        tuple(found.reference for found in planned.simulations),
        trial.shapes(best),
        bounds,
        peaks_of(plant, planned.simulations),
        max(before.values()),
        found.worst,
        tuple((entry.name, before.get(entry.name, inf), entry.error) for entry in found.precisions),
        method,
    )


class _Trial:
    """From a vector of search variables to shapes, excitations within the limits, and the criterion."""

    def __init__(
        self,
        plant: Plant,
        instruments: Mapping[str, Instrument],
        limits: Mapping[str, float],
        criterion: str,
        fs: float,
        duration_s: float,
        method: str,
    ) -> None:
        self._plant, self._instruments, self._limits = plant, instruments, limits
        self._criterion, self._fs, self._duration_s, self._method = criterion, fs, duration_s, method
        modes = vibration(plant)
        elastic = modes.elastic_hz if modes.elastic_hz.size else np.array([5.0 * bandwidth_hz(modes)])
        self._elastic_hz = float(elastic[0]), min(float(elastic[-1]), HIGHEST_PART_OF_FS * fs)

    @property
    def starts(self) -> list[FloatArray]:
        """Search variables of the first trials."""
        found = []
        for (low, high), forces in product(START_BANDS, START_FORCES):
            band = [log(low * self._elastic_hz[0]), log(high * self._elastic_hz[1]), 0.0]
            one = [*START_SPEEDS, *np.log(START_TIMES), *forces, *[0.0] * (2 * HARMONICS), *band]
            found.append(np.array(one))
        return found

    def shapes(self, v: FloatArray) -> tuple[Shape, ...]:
        """Return the shapes of a vector of search variables: one record, and its mirror image."""
        highest = HIGHEST_PART_OF_FS * self._fs
        speeds, times, forces, sines, cosines = np.split(v[:-3], np.cumsum([PARTS, PARTS, PARTS, HARMONICS]))
        low = float(np.clip(exp(v[-3]), 2.0 / self._duration_s, 0.5 * highest))
        high = float(np.clip(exp(v[-2]), 1.2 * low, highest))
        shares = np.maximum(np.exp(times) / np.exp(times).sum(), SHORTEST_PART)
        shares /= shares.sum()
        one = Shape(
            tuple(speeds.tolist()), tuple(shares.tolist()), tuple(np.clip(forces, LEAST_FORCE, 1.0).tolist()),
            tuple(sines.tolist()), tuple(cosines.tolist()), low, high, float(v[-1]),
        )  # fmt: skip
        speeds, sines, cosines = -speeds, -sines, -cosines
        mirrored = replace(
            one, speeds=tuple(speeds.tolist()), sines=tuple(sines.tolist()), cosines=tuple(cosines.tolist())
        )
        return one, mirrored

    def excitations(self, variables: FloatArray) -> tuple[Excitation, ...]:
        """Return the excitations, rate and multisine each scaled until a peak is at its limit."""
        return tuple(self._scaled(shape) for shape in self.shapes(variables))

    def _scaled(self, shape: Shape) -> Excitation:
        """Scale the rate up to a limit, and the multisine to the share of a limit that its shape wants."""
        wanted = min(1.0, max(shape.forces))
        rate, force = 1.0, 1.0
        for _ in range(SCALINGS):
            found, share = self._tried(shape, rate, force)
            slow = max(share.get("position", 0.0), share.get("velocity", 0.0))
            fast = max(share.get("force", 0.0), share.get("deflection", 0.0)) / wanted
            if 0.98 < slow <= 1.0 and 0.98 < fast <= 1.0:
                return found
            rate *= SAFETY / slow
            force *= SAFETY / fast
        # where both depend on one another, stay on the safe side
        for _ in range(MOST_SHRINKS):
            found, share = self._tried(shape, rate, force)
            largest = max(share.values())
            if largest <= 1.0:
                return found
            rate, force = rate * SAFETY / largest, force * SAFETY / largest
        raise DataError.at("limits", "cannot all be kept", "raise them, or leave some out")

    def _tried(self, shape: Shape, rate: float, force: float) -> tuple[Excitation, dict[str, float]]:
        """Return the excitation at these scales, and its peaks as shares of the limits."""
        scale = rate, force
        found = series_excitation(shape, self._plant, self._limits, scale, self._fs, self._duration_s)
        peaks = peaks_of(
            self._plant, [simulate(self._plant.model, self._plant.parameters, found, fs=self._fs)]
        )
        return found, {key: peaks[key] / self._limits[key] for key in LIMITS if self._limits[key] > 0.0}

    def planned(self, variables: FloatArray) -> tuple[Experiment, Predicted]:
        """Return the experiment and what it promises."""
        planned = experiment(
            self._plant.model,
            self._plant.parameters,
            self._instruments,
            self.excitations(variables),
            fs=self._fs,
            method=self._method,
        )
        return planned, predict(planned)

    def __call__(self, variables: FloatArray) -> float:
        """Return the criterion's logarithm; large where the experiment fails."""
        try:
            found = self.planned(variables)[1]
        except ModelgenError:
            return FAILED
        if found.refused:
            return FAILED
        if self._criterion == "condition":
            return log(found.condition_number)
        errors = np.log([max(entry.error, 1e-300) for entry in found.precisions])
        return float(errors.mean() if self._criterion == "d-optimal" else errors.max())


def _check(criterion: str, limits: Mapping[str, float]) -> None:
    problems = []
    if criterion not in CRITERIA:
        problems.append(Problem("criterion", f"is {criterion!r}", f"choose one of {', '.join(CRITERIA)}"))
    for name, value in limits.items():
        if name not in LIMITS:
            problems.append(Problem("limits", f"{name!r} is unknown", f"choose from {', '.join(LIMITS)}"))
        elif not 0.0 < value < inf:
            problems.append(Problem(f"limits: {name}", f"is {value!r}", "give a finite positive number"))
    DataError.raise_any(problems)
