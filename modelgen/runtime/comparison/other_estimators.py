"""Other estimators on the same records, for comparison with weighted least squares and iv."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np

from modelgen.errors import DataError, ModelgenError
from modelgen.progress import step
from modelgen.runtime.comparison.era_modes import EraMode, modes_of_parameters, modes_of_record
from modelgen.runtime.comparison.kalman_filter import filter_parameters
from modelgen.runtime.comparison.thresholds import HIGHEST_MODE
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.identification.methods import METHODS
from modelgen.runtime.iv.output_error import Response, fit_response
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record
from modelgen.runtime.results.estimate import Estimate

OURS = ("wls", "iv")


@dataclass(frozen=True)
class Yardstick:
    """A method's answer: (name, value, low, high) of each physical parameter (SI, 95 %), or why it failed."""

    method: str
    seconds: float
    parameters: tuple[tuple[str, float, float, float], ...]
    reason: str = ""


@dataclass(frozen=True)
class Measured:
    """All methods side by side, and elastic modes by source."""

    methods: tuple[Yardstick, ...]
    modes: tuple[tuple[str, tuple[EraMode, ...]], ...]


def measure(model: Model, records: Sequence[Record]) -> Measured:
    """Run every estimator on the same records; the nonlinear ones start from weighted least squares.

    Raises
    ------
    DataError
        When weighted least squares leaves physical parameters open: the others need a start for each.
    """
    found = []
    estimates: dict[str, Estimate] = {}
    for method in OURS:
        if method in METHODS:
            step(method)
            begin = time.perf_counter()
            estimates[method] = identify(model, records, method=method)
            found.append(_of_estimate(estimates[method], time.perf_counter() - begin))
    start = {**model.known, **estimates["wls"].physical}
    missing = [name for name in model.parameters if name not in start]
    if missing:
        what = f"leaves {', '.join(missing)} open, where other methods need a start"
        raise DataError.at("weighted least squares", what, "use records that excite them")
    others: tuple[tuple[str, Callable[..., Response]], ...] = (
        ("output error", fit_response),
        ("Kalman filter", filter_parameters),
    )
    for name, run in others:
        step(name)
        begin = time.perf_counter()
        try:
            response = run(model, records, start)
        except ModelgenError as error:
            reason = "; ".join(str(problem) for problem in error.problems)
            found.append(Yardstick(name, time.perf_counter() - begin, (), reason))
            continue
        found.append(_of_response(name, response, time.perf_counter() - begin))
    step("modes")
    return Measured(tuple(found), _modes(model, records, start))


def _modes(
    model: Model, records: Sequence[Record], start: dict[str, float]
) -> tuple[tuple[str, tuple[EraMode, ...]], ...]:
    own = modes_of_parameters(model, start)
    if not own:
        return (("wls", own),)
    highest_hz = HIGHEST_MODE * own[-1].frequency_hz
    return (
        ("wls", own),
        *((f"subspace, {r.name}", modes_of_record(model, r, highest_hz)) for r in records),
    )


def _of_estimate(estimate: Estimate, seconds: float) -> Yardstick:
    z = NormalDist().inv_cdf(0.975)
    rows = tuple(
        (p.name, p.value, p.value - z * p.std, p.value + z * p.std) for p in estimate.parameters.physical
    )
    return Yardstick(estimate.fit.method, seconds, rows)


def _of_response(name: str, response: Response, seconds: float) -> Yardstick:
    half = NormalDist().inv_cdf(0.975) * np.sqrt(np.maximum(np.diag(response.covariance), 0.0))
    rows = zip(response.names, response.values.tolist(), half.tolist(), strict=True)
    return Yardstick(name, seconds, tuple((n, v, v - h, v + h) for n, v, h in rows))
