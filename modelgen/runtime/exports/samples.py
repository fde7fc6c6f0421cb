"""Samples of an estimate's parameters, from the covariance of its base parameters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from modelgen.array_types import FloatArray, IntArray
from modelgen.errors import DataError
from modelgen.keyword_options import check_seed
from modelgen.runtime.exports.sums import DETERMINED, Sums
from modelgen.runtime.exports.values import FOLLOWS, Values, role_of
from modelgen.runtime.model.model import Model
from modelgen.runtime.results.estimate import Estimate

MOST_SAMPLES = 10_000
MOST_DRAWS = 100  # times the number of samples
NON_NEGATIVE = ("inertia", "viscous", "coulomb", "damping", "stiffness")


def with_samples(model: Model, values: Values, estimate: Estimate, count: int, seed: int) -> Values:
    """Return the values with samples of the estimated parameters, normal with the estimate's covariance.

    A sample with a negative inertia, stiffness, damping or friction is impossible and is drawn again; of
    stiffness, damping and friction only where the estimate itself is not negative.

    Raises
    ------
    DataError
        When the numbers make no sense, or hardly any sample is possible.
    """
    if not 0 < count <= MOST_SAMPLES:
        raise DataError.at("samples", f"is {count}", f"give 1 to {MOST_SAMPLES}")
    check_seed(seed)
    names = [name for name in values.nominal if values.origin[name] == "estimate"]
    spread = np.array([values.std[name] for name in names])
    if not np.isfinite(spread).all():
        raise DataError.at("samples", "need standard deviations, which the estimate lacks", "identify again")
    drawing = Drawing.of(model, values, estimate, names)
    joined, rng = bool(estimate.model.joined), np.random.default_rng(seed)
    sums = None if joined else Sums.of(model, estimate)
    fixed = {name: value for name, value in values.nominal.items() if values.origin[name] != FOLLOWS}
    kept: list[Mapping[str, float]] = []
    draws = 0
    while len(kept) < count:
        if draws >= MOST_DRAWS * count:
            bounded = [n for n in names if role_of(model, n) in NON_NEGATIVE and values.nominal[n] >= 0.0]
            worst = min(bounded, key=lambda name: values.nominal[name] / max(values.std[name], 1e-300))
            what = f"of {draws} samples {len(kept)} are possible: {worst} is uncertain by its own size"
            raise DataError.at("samples", what, f"identify it better, or give --set {worst}=NUMBER")
        base, moved = drawing.draw(rng, estimate)
        sample = {
            **fixed,
            **{n: values.nominal[n] + s * m for n, s, m in zip(names, spread, moved, strict=True)},
        }
        sample |= sums.following(model, base, sample) if sums is not None else {}
        draws += 1
        if _is_possible(model, values.nominal, sample):
            kept.append({name: float(sample[name]) for name in values.nominal})
    return Values(values.nominal, values.origin, values.std, tuple(kept), draws - count)


def _is_possible(model: Model, nominal: Mapping[str, float], sample: Mapping[str, float]) -> bool:
    roles = {name: role_of(model, name) for name in nominal}
    return all(
        sample[name] > 0.0 if roles[name] == "inertia" else sample[name] >= 0.0
        for name in nominal
        if roles[name] in NON_NEGATIVE and nominal[name] >= 0.0
    )


@dataclass(frozen=True, eq=False)
class Drawing:
    """Base parameters drawn from their covariance, and what that moves physical ones by, in their deviations.

    To first order, by the inverse of the model's Jacobian; scaled to the standard deviations of the estimate.
    """

    rows: IntArray
    deviations: FloatArray
    root: FloatArray
    inverse: FloatArray

    @classmethod
    def of(cls, model: Model, values: Values, estimate: Estimate, names: list[str]) -> Drawing:
        """Return how to draw base parameters, and what they move the named ones by."""
        if estimate.model.joined:  # what is drawn are physical parameters
            found = list(estimate.params)
            deviations, root = _deviations_and_root(estimate)
            return cls(
                np.arange(len(found)), deviations, root, np.eye(len(found))[[found.index(n) for n in names]]
            )
        full = {**dict.fromkeys(model.parameters, 1.0), **values.nominal}
        rows = np.array([model.base_parameters.index(name) for name in estimate.params])
        size = np.array([abs(full[name]) or 1.0 for name in model.parameters])
        deviations, root = _deviations_and_root(estimate)
        divisor = np.where(deviations == 0.0, 1.0, deviations)
        slopes = model.base_jacobian(full)[rows] * size / divisor[:, None]
        inverse = np.linalg.pinv(slopes, rcond=DETERMINED)[[model.parameters.index(name) for name in names]]
        spread = np.sqrt(np.sum((inverse @ root) ** 2, axis=1))
        return cls(rows, deviations, root, inverse / np.where(spread == 0.0, 1.0, spread)[:, None])

    def draw(self, rng: np.random.Generator, estimate: Estimate) -> tuple[FloatArray, FloatArray]:
        """Return all base parameters, shape (columns,), and the named physical ones in deviations."""
        moved = self.root @ rng.standard_normal(len(self.root))
        base = estimate.base.copy()
        base[self.rows] += self.deviations * moved
        return base, self.inverse @ moved


def _deviations_and_root(estimate: Estimate) -> tuple[FloatArray, FloatArray]:
    """Return standard deviations and a root of the correlations, shape (parameters, parameters)."""
    deviations = np.sqrt(np.diag(estimate.cov_params()))
    divisor = np.where(deviations == 0.0, 1.0, deviations)
    sizes, shapes = np.linalg.eigh(estimate.cov_params() / np.outer(divisor, divisor))
    return deviations, shapes * np.sqrt(np.maximum(sizes, 0.0))
