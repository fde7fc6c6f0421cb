"""How far columns lie from a fit, in deviations that its rows give: what bodies near it are looked for in.

The triangle of weighted rows takes these as white. Where they are not it misleads: rows of a link behind a
spring leave noise that is differentiated twice, of high frequencies, where moments of inertia are told by low
ones, ten times better than the triangle says, and the nearest bodies are then nearest to the wrong columns.
The long-run covariance (`hac_covariance`) knows better, but its inverse not: it is a mean of as many instants
as are independent, hardly more than there are columns. As Ledoit and Wolf (2004) do, it is drawn to a simpler
one, by as much as there are columns beside such instants: its diagonal in the coordinates of the triangle. In
other coordinates sums that rows tell a thousand times better than their terms would be lost.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.hac_covariance import hac_bandwidth, hac_covariance
from modelgen.runtime.parameters.thresholds import AT_BOUND


@dataclass(frozen=True, eq=False)
class RowMetric:
    """The metric of a fit's columns."""

    fit: Fit

    @cached_property
    def _triangle(self) -> FloatArray:
        c = len(self.fit.columns)
        return np.asarray(self.fit.triangle[:c, :c])

    @cached_property
    def _root(self) -> FloatArray:
        """A triangle, shape (c, c); times its transpose: the covariance of `_triangle` times the columns."""
        fit, R, c = self.fit, self._triangle, len(self.fit.columns)
        instants = sum(fit.blocks[places[0]].grid for places in fit.by_record.values())
        share = c / (c + instants / max(hac_bandwidth(fit), 1.0))
        rows = R @ hac_covariance(fit) @ R.T
        rounding = AT_BOUND * float(np.linalg.norm(R))  # what it leaves of the rows
        variances = np.diag(np.maximum(np.diag(rows), 0.0) * share + rounding**2)
        return np.asarray(np.linalg.cholesky(0.5 * (1.0 - share) * (rows + rows.T) + variances))

    @cached_property
    def whitening(self) -> FloatArray:
        """Its product with the error of the columns, in SI, has unit covariance; shape (c, c)."""
        return np.asarray(np.linalg.solve(self._root, self._triangle))

    def inverse_within(self, spread: FloatArray) -> FloatArray:
        """Return the inverse of the weighted rows with which the columns have the mean of two covariances.

        That of the metric, and `spread`, in SI, shape (c, c) like what is returned: the one symmetric matrix
        that makes this of rows of which the fit's own inverse makes that (a geometric mean of matrices).
        """
        root, white = self._root, self.whitening
        square = root.T @ root
        mean = 0.5 * (np.eye(len(root)) + white @ spread @ white.T)
        values, vectors = np.linalg.eigh(square @ mean @ square)
        half = vectors * np.maximum(values, 0.0) ** 0.25
        back = np.linalg.solve(self._triangle, np.linalg.solve(root.T, half))
        return np.asarray(back @ back.T)
