"""Model: the validated view of a generated module, and the functions that load one.

The module speaks of itself in plain tuples and dicts (so that it needs NumPy alone); here the same entries
become small frozen records. `contract_check` says what a module must offer, `module_file` executes a file.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from importlib import import_module
from pathlib import Path
from types import MappingProxyType
from typing import Any, cast

import numpy as np
import numpy.typing as npt

from modelgen.array_types import FloatArray
from modelgen.errors import DataError, IdentifiabilityError
from modelgen.runtime.model.arm_functions import ArmFunctions
from modelgen.runtime.model.arm_kernel import Kernel
from modelgen.runtime.model.arm_model import arm_fields
from modelgen.runtime.model.chain_fields import chain_fields
from modelgen.runtime.model.contract_check import is_arm, module_problems
from modelgen.runtime.model.deflected_kernel import DeflectedKernel
from modelgen.runtime.model.mechanical_parts import Actuator, CubicSpring, Friction, Role, RowInfo, Sensor
from modelgen.runtime.model.module_file import MADE_BY, execute_file, execute_text
from modelgen.runtime.numerics.rational_functions import RationalFunctions, rational_functions

# (coefficient, signal or feature key) pairs to be summed; the key "1" is the constant
Terms = tuple[tuple[float, str], ...]


@dataclass(frozen=True)
class Signal:
    """An array the model needs: a derivative of one sensor's or actuator's own reading.

    Without sensor and actuator the record must bring the signal itself (a direction of motion, ``sign_c``).
    """

    key: str
    sensor: str | None
    actuator: str | None
    derivative: int
    unit: str

    @property
    def channel(self) -> str:
        """The record's channel that it derives from."""
        return self.sensor or self.actuator or self.key


@dataclass(frozen=True)
class Feature:
    """A nonlinear function ("sign", "forward", "backward", "cube") of signals, times a signal or None."""

    key: str
    function: str
    of: str | Terms
    times: str | None


@dataclass(frozen=True, eq=False)
class Model:
    """A generated module, checked: y = D x with y = measurement, D = regressor, x the base parameters.

    All is in SI. Attributes are those of the module under their lower-case names; its docstring has the rows.
    `measurement_columns` holds one `Terms` per row, `regressor_columns` per row a mapping of column index to
    `Terms`: what is linear in which signal, so that filters may act on signals instead of columns.

    Of an arm, `kernel` gives the features that are nonlinear in several signals, `derived` the channels that
    are sums of others (a motor that moves two joints), `groupings` the formulas of base parameters by their
    short names, and `loads` the channels that say whether a payload is carried: 1 or 0, 0 where a record
    says nothing.
    """

    module: Any
    chain: str
    title: str
    sensor_set: str
    spec_sha256: str
    sensors: tuple[Sensor, ...]
    actuators: tuple[Actuator, ...]
    parameters: tuple[str, ...]
    known: Mapping[str, float]
    base_parameters: tuple[str, ...]
    identifiable: tuple[str, ...]
    absent: Mapping[str, str]
    composites: Mapping[str, str]
    units: Mapping[str, str]
    roles: Mapping[str, Role]
    parameter_sets: Mapping[str, Mapping[str, float]]
    signals: tuple[Signal, ...]
    features: tuple[Feature, ...]
    rows: tuple[RowInfo, ...]
    friction: tuple[Friction, ...]
    measurement_columns: tuple[Terms, ...]
    regressor_columns: tuple[Mapping[int, Terms], ...]
    cubic_springs: tuple[CubicSpring, ...] = ()
    groupings: Mapping[str, str] = field(default_factory=dict)
    derived: Mapping[str, Terms] = field(default_factory=dict)
    kernel: Kernel | DeflectedKernel | None = None
    loads: tuple[str, ...] = ()

    @cached_property
    def channels(self) -> tuple[str, ...]:
        """Keys a record must bring: every sensor and actuator in use, and signals that have neither."""
        used = dict.fromkeys(signal.channel for signal in self.signals)
        return tuple(key for key in used if key not in self.derived and key not in self.loads)

    @property
    def channel_units(self) -> dict[str, str]:
        """The SI unit of every sensor and actuator, by its channel."""
        return {one.key: one.unit for one in self.sensors} | {one.key: one.unit for one in self.actuators}

    @property
    def every_parameter(self) -> tuple[str, ...]:
        """Names of the parameters to estimate, then of those that are known."""
        return tuple(dict.fromkeys((*self.parameters, *self.known)))

    @property
    def is_arm(self) -> bool:
        """Whether it is that of an arm: its rows are nonlinear in positions, and it has no state space."""
        return isinstance(self.module, ArmFunctions)

    @property
    def by_power(self) -> bool:
        """Whether its row is a balance of power (`modelgen.runtime.model.power`)."""
        return self.kernel is not None and bool(self.kernel.orders)

    @property
    def direction_keys(self) -> tuple[str, ...]:
        """Signals whose sign matters: under a sign, forward or backward feature, or a row's reversals."""
        used = {feature.of for feature in self.features if feature.function != "cube"}
        used |= {key for row in self.rows for key in row.reversals}
        return tuple(signal.key for signal in self.signals if signal.key in used)

    def refuse_arm(self, what: str) -> None:
        """Raise DataError for an arm, where `what` takes chains alone."""
        if self.is_arm:
            remedy = "identify, simulate and validate take arms; give a chain's module here"
            raise DataError.at(self.chain, f"is an arm; {what} takes chains", remedy)

    def column_terms(self, row: int, column: int) -> Terms:
        """Return the terms of one entry of the regressor; empty where it is zero."""
        return self.regressor_columns[row].get(column, ())

    def measurement(self, signals: Mapping[str, FloatArray]) -> FloatArray:
        """Return the left-hand side y, shape (N, rows)."""
        return cast(FloatArray, self.module.measurement(signals))

    def regressor(self, signals: Mapping[str, FloatArray]) -> FloatArray:
        """Return the regressor D, shape (N, rows, columns)."""
        return cast(FloatArray, self.module.regressor(signals))

    @cached_property
    def _table(self) -> RationalFunctions | None:
        return (
            rational_functions(self.module.base_from_physical, self.parameters) if self.composites else None
        )

    def base_from_physical(self, parameters: Mapping[str, float]) -> FloatArray:
        """Return the base parameters, shape (columns,), from physical ones (name to value, SI).

        Raises IdentifiabilityError where a composite divides by one that is zero.
        """
        try:
            if self._table is not None and parameters.keys() == self._table.names:
                return self._table.values(parameters)
            return cast(FloatArray, self.module.base_from_physical(parameters))
        except ZeroDivisionError:
            zero = ", ".join(name for name, value in parameters.items() if value == 0.0)
            what, remedy = f"has no rows where {zero} is zero", "give values above zero, or sense more"
            raise IdentifiabilityError.at(self.chain, what, remedy) from None

    def base_jacobian(self, parameters: Mapping[str, float]) -> FloatArray:
        """Return d base / d parameters, shape (columns, parameters), at physical parameters (SI)."""
        if self._table is not None and parameters.keys() == self._table.names and all(parameters.values()):
            return self._table.slopes(parameters)
        return cast(FloatArray, self.module.base_jacobian(parameters))

    def physical_from_base(self, base: npt.ArrayLike) -> dict[str, float]:
        """Return the identifiable physical parameters (name to value, SI) from the base ones, shape (c,), SI.

        Raises IdentifiabilityError when none are found that give every base parameter to 1e-9 of its size.
        """
        try:
            return cast(dict[str, float], self.module.physical_from_base(np.asarray(base, dtype=float)))
        except ValueError as error:  # LinAlgError among them
            raise IdentifiabilityError.at(self.chain, str(error), "identify from records") from error

    def state_space(
        self, parameters: Mapping[str, float], directions: Mapping[str, int] | None = None
    ) -> Any:
        """Return the named tuple (A, B, C, D, E, F) of Pham 2002, eqs. (17)-(19), corrected.

        `directions` maps a body to +1 or -1 where its friction is asymmetric.
        """
        return self.module.state_space(parameters, directions)

    def __repr__(self) -> str:
        columns = ", ".join(self.base_parameters)
        return f"Model({self.chain}, {self.sensor_set}: {len(self.rows)} rows, {columns})"

    def __reduce__(self) -> tuple[Any, ...]:
        # a module cannot be sent to another process, what made it can
        return _made_again, getattr(self.module, MADE_BY, None) or (import_module, (self.module.__name__,))


def _made_again(make: Callable[..., Any], values: tuple[Any, ...]) -> Model:
    return model_from_module(make(*values))


def model_from_module(module: Any) -> Model:
    """Return the checked view of a generated module (or of any object with the same names).

    Raises
    ------
    DataError
        With one problem per violation of the contract.
    """
    problems = module_problems(module)
    DataError.raise_any(problems)
    given = arm_fields(module) if is_arm(module) else chain_fields(module)
    return Model(
        title=module.TITLE,
        spec_sha256=module.SPEC_SHA256,
        parameters=module.PARAMETERS,
        known=MappingProxyType(dict(module.KNOWN)),
        identifiable=module.IDENTIFIABLE,
        absent=MappingProxyType(dict(module.ABSENT)),
        roles=MappingProxyType({name: Role(**entry) for name, entry in module.ROLES.items()}),
        parameter_sets=MappingProxyType(
            {name: MappingProxyType(dict(values)) for name, values in module.PARAMETER_SETS.items()}
        ),
        module=given["module"],
        chain=given["chain"],
        sensor_set=given["sensor_set"],
        sensors=tuple(Sensor(**entry) for entry in given["sensors"]),
        actuators=tuple(Actuator(**entry) for entry in given["actuators"]),
        base_parameters=given["base_parameters"],
        composites=MappingProxyType(dict(given["composites"])),
        units=MappingProxyType(dict(given["units"])),
        signals=tuple(Signal(**entry) for entry in given["signals"]),
        features=tuple(Feature(**entry) for entry in given["features"]),
        rows=tuple(RowInfo(**entry) for entry in given["rows"]),
        friction=tuple(Friction(**entry) for entry in given["friction"]),
        measurement_columns=tuple(given["measurement"]),
        regressor_columns=tuple(MappingProxyType(dict(row)) for row in given["regressor"]),
        cubic_springs=tuple(CubicSpring(**entry) for entry in given.get("cubic_springs", ())),
        groupings=MappingProxyType(dict(given.get("groupings", {}))),
        derived=MappingProxyType(dict(given.get("derived", {}))),
        kernel=given.get("kernel"),
        loads=given.get("loads", ()),
    )


def model_from_text(text: str, name: str = "model", trust: bool = False) -> Model:
    """Return the model of a generated module's text; it is executed.

    Parameters
    ----------
    text : str
    name : str
        Names the module in messages.
    trust : bool
        As for `load_model`.

    Raises
    ------
    DataError
        When the text cannot be executed or violates the contract.
    """
    return model_from_module(execute_text(text, name, trust))


def load_model(path: str | Path, trust: bool = False) -> Model:
    """Execute a generated module's file and return its model.

    Only a file that modelgen generated is executed, and only as it was generated: its header, its digest and
    every line of it are checked first (`modelgen.generated_module.module_check`).

    Parameters
    ----------
    path : str or Path
        The ``.py`` file.
    trust : bool
        Execute the file without these checks.

    Raises
    ------
    DataError
        When the file is absent, not generated, cannot be executed or violates the contract.
    """
    return model_from_module(execute_file(Path(path), trust=trust))
