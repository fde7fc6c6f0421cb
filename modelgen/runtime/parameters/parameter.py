"""Parameter: one number found, with its standard deviations."""

from __future__ import annotations

import math
from dataclasses import dataclass
from numbers import Real
from statistics import NormalDist

from modelgen.errors import DataError
from modelgen.magnitudes import shown_number

# Of a link that is symmetric these are zero.
SYMMETRIC = ("Ixy", "Ixz", "Iyz", "mx", "my", "mz")


def may_be_zero(name: str, role: str) -> bool:
    """Return whether a parameter of a right model may well be zero: relative to that none is certain."""
    return role in ("offset", "mounting", "bending") or (role == "link" and name.split("_")[0] in SYMMETRIC)


@dataclass(frozen=True)
class Parameter:
    """One number found, in `unit`.

    `std` is its standard deviation; it adds up (in squares) from `noise_std`, what the residuals explain, and
    `drift_std`, how far the value drifts with cut-off and weights. `printed_std` is that of eq. (11).
    """

    name: str
    unit: str
    value: float
    std: float
    noise_std: float
    drift_std: float
    printed_std: float

    def interval(self, alpha: float = 0.05) -> tuple[float, float]:
        """Return the interval that holds the truth with probability 1 - alpha (normal distribution).

        Raises
        ------
        DataError
            When alpha is no probability.
        """
        if isinstance(alpha, bool) or not isinstance(alpha, Real) or not 0.0 < alpha < 1.0:
            remedy = "give a probability between 0 and 1; intervals of 95 % have 0.05"
            raise DataError.at("alpha", f"is {shown_number(alpha)}", remedy)
        reach = NormalDist().inv_cdf(1.0 - 0.5 * alpha) * self.std
        return self.value - reach, self.value + reach

    @property
    def relative_std(self) -> float:
        """Standard deviation in % of the value's magnitude (Pham 2002, eq. (12))."""
        return 100.0 * self.std / abs(self.value) if self.value else math.inf
