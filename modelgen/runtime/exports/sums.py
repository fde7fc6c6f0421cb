"""What sums of parameters an estimate holds, and which parameters follow from them once others are known."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from modelgen.array_types import BoolArray, FloatArray, IntArray
from modelgen.runtime.model.model import Model
from modelgen.runtime.results.estimate import Estimate

LINEAR = 1e-12  # how little a gradient may differ between two points of a linear function
DETERMINED = 1e-9  # share of a singular value below which nothing is determined


def linear_shares(model: Model) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Return base parameters as shares @ physical + constant, and which of them are such sums.

    Shapes (columns, parameters), (columns,) and (columns,): gradients of sums are the same at any point.
    """
    rng = np.random.default_rng(0)
    points = [{**model.known, **{name: rng.uniform(0.5, 2.0) for name in model.parameters}} for _ in range(2)]
    here, there = (model.base_jacobian(point) for point in points)
    constant = model.base_from_physical(points[0]) - here @ [points[0][n] for n in model.parameters]
    return here, constant, np.all(np.abs(here - there) <= LINEAR * np.abs(here), axis=1)


@dataclass(frozen=True, eq=False)
class Sums:
    """Identified base parameters that are sums of physical ones.

    base[rows] = shares @ physical + constant; rows has shape (r,), shares (r, parameters).
    """

    rows: IntArray
    shares: FloatArray
    constant: FloatArray

    @classmethod
    def of(cls, model: Model, estimate: Estimate) -> Sums:
        """Find them: their gradients are the same at any point."""
        shares, constant, linear = linear_shares(model)
        rows = np.flatnonzero(np.isfinite(estimate.base) & linear)
        return cls(rows, shares[rows], constant[rows])

    def following(self, model: Model, base: FloatArray, nominal: Mapping[str, float]) -> dict[str, float]:
        """Return the parameters without a value that the sums determine, the others being known.

        `base`, shape (base parameters,), and values in SI.
        """
        unknown = [i for i, name in enumerate(model.parameters) if name not in nominal]
        known = np.array([nominal.get(name, 0.0) for name in model.parameters])
        used = np.any(self.shares[:, unknown] != 0.0, axis=1)
        if not used.any():
            return {}
        rest = (base[self.rows] - self.constant - self.shares @ known)[used]
        matrix = self.shares[used][:, unknown]
        size = np.abs(matrix).max(axis=0)
        size[size == 0.0] = 1.0
        scale = np.abs(matrix).max(axis=1)
        left, sizes, right = np.linalg.svd(matrix / scale[:, None] / size)
        rank = int(np.sum(sizes > DETERMINED * sizes[0]))
        found = right[:rank].T @ ((left.T @ (rest / scale))[:rank] / sizes[:rank])
        free = np.abs(right[rank:]).max(axis=0, initial=0.0) > DETERMINED
        values = zip((model.parameters[i] for i in unknown), found / size, free, strict=True)
        return {name: float(value) for name, value, is_free in values if not is_free}
