"""An instrument: its noise, its resolution and its price."""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot, sqrt

from modelgen.errors import DataError, Problem
from modelgen.magnitudes import is_usable


@dataclass(frozen=True)
class Instrument:
    """A sensor or a force measurement: noise (standard deviation) and resolution in SI."""

    noise: float = 0.0
    resolution: float = 0.0
    price: float = 0.0

    def __post_init__(self) -> None:
        problems = [
            Problem(f"instrument: {name}", f"is {getattr(self, name)!r}", "give zero or a positive number")
            for name in ("noise", "resolution", "price")
            if not (getattr(self, name) >= 0.0 and is_usable(getattr(self, name)))
        ]
        DataError.raise_any(problems)

    @property
    def std(self) -> float:
        """Standard deviation of noise and rounding together."""
        return hypot(self.noise, self.resolution / sqrt(12.0))
