"""What a planned experiment promises, whatever it was predicted by."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import hypot

from modelgen.runtime.planning.closed_form_information import Information


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


@dataclass(frozen=True, eq=False)
class Predicted:
    """What an experiment promises; `refused` maps the physical parameters it leaves open to the reason.

    `information` is that of a prediction in closed form.
    """

    condition_number: float
    precisions: tuple[Precision, ...]
    refused: Mapping[str, str]
    information: Information | None = None

    @property
    def worst(self) -> float:
        """Largest error in % of the parameters that are not refused."""
        return max((entry.error for entry in self.precisions), default=0.0)
