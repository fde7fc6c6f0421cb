"""Which sensors, before they are bought: predicted precision of every parameter, per sensor set.

An experiment is simulated without noise; what instruments of a stated noise and resolution make of it follows
in closed form (`information`), bias of the estimator included. Monte Carlo confirms it on request.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import hypot, inf, sqrt

import numpy as np
import numpy.typing as npt

from modelgen.errors import DataError, IdentifiabilityError, Problem
from modelgen.runtime.choose import FilterChoice, choose_filter
from modelgen.runtime.contract import Model
from modelgen.runtime.data import Record
from modelgen.runtime.excitation import Excitation
from modelgen.runtime.information import Information, information
from modelgen.runtime.methods import METHODS, Job
from modelgen.runtime.readings import instrument_keys, readings
from modelgen.runtime.simulate import Simulation, simulate

FloatArray = npt.NDArray[np.float64]

PAIR = ("chirp", "trapezoid")
DEFAULT_METHOD = "wls"
RELATIVE_STEP = 1e-6


@dataclass(frozen=True)
class Instrument:
    """A sensor or a force measurement one may buy: noise (standard deviation) and resolution in SI."""

    noise: float = 0.0
    resolution: float = 0.0
    price: float = 0.0

    def __post_init__(self) -> None:
        problems = [
            Problem(f"instrument: {name}", f"is {getattr(self, name)!r}", "give zero or a positive number")
            for name in ("noise", "resolution", "price")
            if not 0.0 <= getattr(self, name) < inf
        ]
        if problems:
            raise DataError(*problems)

    @property
    def std(self) -> float:
        """Standard deviation of noise and rounding together."""
        return hypot(self.noise, self.resolution / sqrt(12.0))


@dataclass(frozen=True)
class Precision:
    """What is predicted of one physical parameter; `std` and `bias` in % of its magnitude."""

    name: str
    value: float
    std: float
    bias: float

    @property
    def error(self) -> float:
        """Root of std^2 + bias^2, in %."""
        return hypot(self.std, self.bias)


@dataclass(frozen=True)
class Prediction:
    """What one sensor set promises.

    `precisions` are empty, and `reason` says why, where the set cannot identify the chain. `missing` are
    parameters that it leaves open.
    """

    sensor_set: str
    channels: tuple[str, ...]
    price: float
    precisions: tuple[Precision, ...]
    missing: tuple[str, ...]
    condition_number: float
    log_det: float
    reason: str = ""

    @property
    def worst(self) -> float:
        """Largest error of a parameter in %; infinite where one cannot be had."""
        if self.missing or not self.precisions:
            return inf
        return max(entry.error for entry in self.precisions)


@dataclass(frozen=True, eq=False)
class Experiment:
    """A simulated experiment with noisy instruments, and the filter and weights that an estimator takes."""

    model: Model
    parameters: Mapping[str, float]
    simulations: tuple[Simulation, ...]
    instruments: Mapping[str, Instrument]
    method: str
    choice: FilterChoice
    weights: Mapping[tuple[int, int], float]

    def records(self, seed: int | None) -> tuple[Record, ...]:
        """Return the records as the instruments read them; without noise if the seed is None."""
        return _records(self.model, self.simulations, self.instruments, seed)


def experiment(
    model: Model,
    parameters: Mapping[str, float],
    instruments: Mapping[str, Instrument],
    excitations: Sequence[str | Excitation] = PAIR,
    *,
    fs: float = 5000.0,
    duration_s: float = 2.0,
    method: str | None = None,
    choice: FilterChoice | None = None,
) -> Experiment:
    """Simulate an experiment, choose the filter on a noisy copy, and take the weights of one estimate.

    Parameters
    ----------
    model, parameters
        The candidate sensor set's module, and the values expected of the chain (SI).
    instruments : mapping of str to Instrument
        By channel; a channel without one is perfect.
    excitations : sequence of str or Excitation
        As in `modelgen.simulate`, one record each.
    fs, duration_s : float
        Sampling frequency in Hz; duration in s of an excitation that is given by its kind.
    method : str, optional
        The estimator, by default "wls"; "iv" has no bias, and takes far longer.
    choice : FilterChoice, optional
        Its filter, by default chosen as from measured records.
    """
    simulations = tuple(
        simulate(model, parameters, kind, fs=fs, duration_s=duration_s if isinstance(kind, str) else None)
        for kind in excitations
    )
    name = method or DEFAULT_METHOD
    noisy = _records(model, simulations, instruments, 0)
    choice = choice or choose_filter(model, noisy)
    fit = METHODS[name].run(Job(model, noisy, choice))[1]
    weights = {(b.record, b.row): w for b, w in zip(fit.blocks, fit.weights, strict=True)}
    return Experiment(model, parameters, simulations, dict(instruments), name, choice, weights)


def predict(planned: Experiment) -> tuple[Information, tuple[Precision, ...]]:
    """Return the information about the base parameters, and the precision of the physical ones.

    Raises
    ------
    IdentifiabilityError
        When the experiment does not determine all base parameters.
    """
    noise = {key: instrument.std for key, instrument in planned.instruments.items()}
    found = information(
        planned.model,
        planned.parameters,
        planned.records(None),
        noise,
        planned.choice,
        planned.weights,
        instruments=planned.method == "iv",
    )
    return found, physical_precision(planned.model, planned.parameters, found)


def physical_precision(
    model: Model, parameters: Mapping[str, float], found: Information
) -> tuple[Precision, ...]:
    """Return standard deviation and bias of the identifiable physical parameters, to first order."""
    true = {**model.known, **parameters}
    to_physical = physical_map(model, true, found)
    covariance = to_physical @ found.covariance @ to_physical.T
    bias = to_physical @ found.bias
    return tuple(
        Precision(
            name,
            true[name],
            100.0 * float(np.sqrt(covariance[i, i])) / (abs(true[name]) or np.nan),
            100.0 * float(bias[i]) / (abs(true[name]) or np.nan),
        )
        for i, name in enumerate(model.identifiable)
    )


def physical_map(model: Model, true: Mapping[str, float], found: Information) -> FloatArray:
    """Return d physical / d base, shape (identifiable, columns).

    Where there are more base parameters than physical ones, they are weighed by their covariance.
    """
    names = model.identifiable
    if set(names) != set(model.parameters):
        return _differences(model, found.values, names)
    jacobian = np.asarray(model.base_jacobian(true), dtype=float)
    jacobian = jacobian[:, [model.parameters.index(name) for name in names]]
    size = np.array([abs(true[name]) or 1.0 for name in names])
    if len(jacobian) == len(names):
        return np.asarray(size[:, None] * np.linalg.inv(jacobian * size), dtype=float)
    std = np.sqrt(np.diag(found.covariance))
    whitened = np.linalg.pinv(found.covariance / np.outer(std, std), hermitian=True)
    J = jacobian * size / std[:, None]
    solved: FloatArray = size[:, None] * np.linalg.solve(J.T @ whitened @ J, J.T @ whitened) / std
    return solved


def _differences(model: Model, base: FloatArray, names: Sequence[str]) -> FloatArray:
    """Return d physical / d base by central differences."""
    columns = []
    for j, value in enumerate(base):
        step = RELATIVE_STEP * (abs(value) or 1.0)
        ends = []
        for sign in (1.0, -1.0):
            moved = base.copy()
            moved[j] += sign * step
            found = model.physical_from_base(moved)
            ends.append(np.array([found[name] for name in names]))
        columns.append((ends[0] - ends[1]) / (2.0 * step))
    return np.array(columns).T


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
    """Return what a sensor set promises; one that cannot identify the chain says why."""
    channels = instrument_keys(model)
    price = sum(instruments[key].price for key in channels if key in instruments)
    own = {key: instruments[key] for key in channels if key in instruments}
    missing = tuple(p for p in model.parameters if p not in model.identifiable)
    try:
        planned = experiment(model, parameters, own, excitations, fs=fs, duration_s=duration_s, method=method)
        found, precisions = predict(planned)
    except IdentifiabilityError as error:
        reason = "; ".join(str(problem) for problem in error.problems)
        return Prediction(name, channels, price, (), model.parameters, inf, -inf, reason)
    spread = np.array([entry.std for entry in precisions])
    log_det = -2.0 * float(np.log(np.maximum(spread, 1e-300)).sum())
    return Prediction(name, channels, price, precisions, missing, found.condition_number, log_det)


def rank(predictions: Sequence[Prediction]) -> tuple[Prediction, ...]:
    """Return the predictions, most precise first; sets that leave parameters open come last."""
    return tuple(sorted(predictions, key=lambda p: (p.worst, len(p.missing), p.price, p.sensor_set)))


def cheapest(predictions: Sequence[Prediction], wanted_percent: float) -> Prediction | None:
    """Return the cheapest set whose every parameter is within the wanted error in %, or None."""
    able = [p for p in predictions if p.worst <= wanted_percent]
    return min(able, key=lambda p: (p.price, p.worst, p.sensor_set), default=None)


@dataclass(frozen=True)
class Spread:
    """What Monte Carlo found of one physical parameter, beside the prediction; all in % of its magnitude."""

    name: str
    std: float
    bias: float
    predicted_std: float
    predicted_bias: float


def monte_carlo(
    planned: Experiment, draws: int = 200, progress: Callable[[str], None] | None = None
) -> tuple[Spread, ...]:
    """Repeat the experiment with other noise and compare the spread of the estimates with the prediction.

    The base parameters of every draw come from the estimator itself; physical ones follow to first order.
    """
    information, precisions = predict(planned)
    method, model = METHODS[planned.method], planned.model
    to_physical = physical_map(model, {**model.known, **planned.parameters}, information)
    found = []
    for seed in range(1, draws + 1):
        if progress and seed % 50 == 0:
            progress(f"{model.sensor_set}: {seed} of {draws} experiments")
        fit = method.run(Job(model, planned.records(seed), planned.choice))[1]
        base = np.zeros(len(model.base_parameters))
        base[[model.base_parameters.index(name) for name in fit.columns]] = fit.solution.x
        found.append(to_physical @ (base - information.values))
    values = np.array([entry.value for entry in precisions])
    relative = 100.0 * np.array(found) / np.abs(values)
    return tuple(
        Spread(entry.name, float(std), float(mean), entry.std, entry.bias)
        for entry, std, mean in zip(
            precisions, relative.std(axis=0, ddof=1), relative.mean(axis=0), strict=True
        )
    )


def _records(
    model: Model,
    simulations: Sequence[Simulation],
    instruments: Mapping[str, Instrument],
    seed: int | None,
) -> tuple[Record, ...]:
    if seed is None:
        return tuple(found.record for found in simulations)
    noise = {key: instrument.noise for key, instrument in instruments.items()}
    resolution = {key: instrument.resolution for key, instrument in instruments.items()}
    return tuple(
        replace(
            found.record,
            signals=readings(model, found.true, noise, resolution, seed * len(simulations) + i),
        )
        for i, found in enumerate(simulations)
    )
