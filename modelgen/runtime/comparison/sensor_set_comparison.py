"""Comparison of sensor sets: conditioning and noise gain of their rows, and whether estimates agree."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from math import isfinite

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import DataError
from modelgen.runtime.comparison.thresholds import RESPONSE_PERIODS, SIGNIFICANCE
from modelgen.runtime.filters.derivatives import differentiate
from modelgen.runtime.filters.zero_phase import zero_phase
from modelgen.runtime.identification.identify import identify_whole
from modelgen.runtime.identification.methods import Method
from modelgen.runtime.identification.options import CheckOptions, Filters
from modelgen.runtime.model.model import Model
from modelgen.runtime.numerics.tails import chi_square_tail
from modelgen.runtime.records.directions import wanted_directions
from modelgen.runtime.records.record import Record, missing_name
from modelgen.runtime.results.estimate import Estimate
from modelgen.runtime.simulation.simulate import simulate

# The response to an impulse is followed over this many periods of the cut-off, either way.
EXCITATIONS = ("chirp", "trapezoid")


@dataclass(frozen=True)
class NoiseGain:
    """Standard deviation of a channel's filtered derivative per unit of white noise, in 1/s^derivative."""

    channel: str
    derivative: int
    gain: float


@dataclass(frozen=True)
class Conditioning:
    """Condition number of the weighted observation matrix (columns of unit length) on a noise-free pair.

    The pair is the default chirp and trapezoid of a named parameter set; `cutoff_hz` is what was chosen.
    """

    parameter_set: str
    condition_number: float
    cutoff_hz: float
    filter_order: int
    gains: tuple[NoiseGain, ...]


@dataclass(frozen=True)
class Consistency:
    """Whether two estimates differ by more than their covariances explain: a Wald test on what both give.

    `statistic` is chi-squared with `parameters` degrees of freedom if they agree; `p_value` is the
    probability of a larger one. `deviations` are the single differences in standard deviations.
    """

    first: str
    second: str
    names: tuple[str, ...]
    deviations: tuple[float, ...]
    statistic: float
    p_value: float

    @property
    def consistent(self) -> bool:
        """Whether the difference may be chance."""
        return self.p_value >= SIGNIFICANCE


def conditioning(
    model: Model, parameter_set: str, fs: float = 5000.0, duration_s: float = 2.0
) -> Conditioning:
    """Return condition number and noise gains of a model on the default pair of excitations.

    Raises
    ------
    DataError, IdentifiabilityError
        When the chain cannot be simulated, or its motion answers nothing.
    """
    values = model.parameter_sets[parameter_set]
    records = [simulate(model, values, kind, fs=fs, duration_s=duration_s).record for kind in EXCITATIONS]
    estimate = identify_whole(model, records, checks=CheckOptions(drift_check=False))
    choice = estimate.fit.filtering
    gains = noise_gains(model, choice.filter_order, choice.cutoff_hz, fs)
    return Conditioning(
        parameter_set, estimate.condition_number, choice.cutoff_hz, choice.filter_order, gains
    )


def noise_gains(model: Model, order: int, cutoff_hz: float, fs: float) -> tuple[NoiseGain, ...]:
    """Return the noise gain of every derivative of a channel that the model needs.

    White noise of standard deviation 1 at every sample becomes sqrt(sum of h_k^2), h the response to an
    impulse of the zero-phase filter and the differences.
    """
    gains = []
    for signal in model.signals:
        channel = signal.sensor or signal.actuator
        if channel is not None:
            response = impulse_response(order, cutoff_hz, fs, signal.derivative)
            gains.append(NoiseGain(channel, signal.derivative, float(np.linalg.norm(response))))
    return tuple(gains)


def impulse_response(order: int, cutoff_hz: float, fs: float, derivative: int) -> FloatArray:
    """Return the two-sided impulse response of filter and differences, shape (odd length,), centred.

    Its unit is s^-d for the derivative d; `cutoff_hz` and `fs` are in Hz.
    """
    half = int(np.ceil(RESPONSE_PERIODS * fs / cutoff_hz)) + 8 * (derivative + 1)
    impulse = np.zeros(2 * half + 1)
    impulse[half] = 1.0
    return differentiate(zero_phase(impulse, order, cutoff_hz, fs), 1.0 / fs, derivative)


def estimates_of(
    models: Sequence[Model],
    records: Sequence[Record],
    method: str | Method = "auto",
    filters: Filters | None = None,
    checks: CheckOptions | None = None,
) -> tuple[Estimate, ...]:
    """Return one estimate a model from records that hold the channels of all of them.

    Options are those of `modelgen.identify`; each model takes those names in `filters.directions` and
    `checks.keep` that it has.

    Raises
    ------
    DataError
        Also for a direction or parameter that none of the models has.
    """
    filters, checks = filters or Filters(), checks or CheckOptions()
    wanted = [key for model in models for key in wanted_directions(model)]
    bases = [name for model in models for name in model.base_parameters]
    problems = [
        *(missing_name("directions", "direction", k, wanted) for k in filters.directions if k not in wanted),
        *(missing_name("keep", "parameter", name, bases) for name in checks.keep if name not in bases),
    ]
    DataError.raise_any(problems)
    found = []
    for model in models:
        sources = {k: v for k, v in filters.directions.items() if k in wanted_directions(model)}
        channels = dict.fromkeys((*(k for k in model.channels if k not in sources), *sources.values()))
        keep = tuple(name for name in checks.keep if name in model.base_parameters)
        own = [record.select(tuple(channels)) for record in records]
        found.append(
            identify_whole(
                model, own, method, replace(filters, directions=sources), replace(checks, keep=keep)
            )
        )
    return tuple(found)


def consistency(estimates: Mapping[str, Estimate]) -> tuple[Consistency, ...]:
    """Test every pair of estimates (label -> estimate) on the base parameters that both give.

    The covariances are added, as if the estimates were independent. Where they share records their errors
    are correlated, mostly alike: the test then errs on the side of "consistent".
    """
    return tuple(
        _test(a, estimates[a], b, estimates[b])
        for a, b in combinations(estimates, 2)
        if set(estimates[a].params) & set(estimates[b].params)
    )


def _test(first: str, a: Estimate, second: str, b: Estimate) -> Consistency:
    common = tuple(name for name in a.params if name in b.params)
    difference = np.array([a.params[name] - b.params[name] for name in common])
    covariance = np.zeros((len(common),) * 2)
    for estimate in (a, b):
        place = [list(estimate.params).index(name) for name in common]
        covariance += estimate.cov_params()[np.ix_(place, place)]
    std = np.sqrt(np.diag(covariance))
    scaled = difference / std
    # on standard deviations of 1: the sizes of the parameters differ by many decades
    statistic = float(scaled @ np.linalg.pinv(covariance / np.outer(std, std), hermitian=True) @ scaled)
    p_value = chi_square_tail(statistic, len(common)) if isfinite(statistic) else 0.0
    return Consistency(first, second, common, tuple(float(value) for value in scaled), statistic, p_value)
