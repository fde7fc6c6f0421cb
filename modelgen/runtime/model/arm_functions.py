"""ArmFunctions: the functions that a chain's module has, for the module of an arm."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import DataError


def base_factors(
    base_from_physical: Callable[[Mapping[str, float]], FloatArray], parameters: Sequence[str]
) -> tuple[FloatArray, FloatArray]:
    """Return the matrix, shape (columns, parameters), and the vector that base parameters are made with.

    They are sums: the matrix times the parameters, and the vector, shape (columns,), of what is known; in SI.
    """
    nothing = dict.fromkeys(parameters, 0.0)
    offset = base_from_physical(nothing)
    unit = [base_from_physical({**nothing, name: 1.0}) - offset for name in parameters]
    return np.column_stack(unit), offset


class ArmFunctions:
    """A module of contract 2 with what modules of chains offer besides (SI); all else is the module's own."""

    def __init__(self, module: Any) -> None:
        self._module = module
        alone = frozenset(module.IDENTIFIABLE)
        self._columns = {name: column for column, name in enumerate(module.BASE_PARAMETERS) if name in alone}

    def __getattr__(self, name: str) -> Any:
        return getattr(self._module, name)

    @cached_property
    def _jacobian(self) -> FloatArray:
        """Factors of the parameters in the base parameters, shape (columns, parameters)."""
        return base_factors(self._module.base_from_physical, self._module.PARAMETERS)[0]

    def base_jacobian(self, parameters: Mapping[str, float]) -> FloatArray:
        """Return d base / d parameters, shape (columns, parameters): base parameters are sums."""
        del parameters
        return self._jacobian.copy()

    def physical_from_base(self, base: FloatArray) -> dict[str, float]:
        """Return the parameters that are base parameters by themselves, from those, shape (columns,)."""
        return {name: float(base[self._columns[name]]) for name in self._module.IDENTIFIABLE}

    def state_space(
        self, parameters: Mapping[str, float], directions: Mapping[str, int] | None = None
    ) -> Any:
        """Raise DataError: an arm is not linear."""
        remedy = "identify it with method wls; simulation, validation and export take chains"
        raise DataError.at(self._module.ARM, "is an arm, which has no linear state space", remedy)
