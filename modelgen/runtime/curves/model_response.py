"""The frequency response that an estimate says, with the band that its covariance makes of it.

C (j w I - A)^-1 B + D of the module's state space. Coulomb friction and cubic springs enter with the gains
that they have at a record's amplitude (`equivalent_gains`). The band is the delta method on log H: magnitudes
have factors, phases have degrees; what is hardly known reaches further (`UncertainChain.cautious_root`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from modelgen.array_types import BoolArray, ComplexArray, FloatArray
from modelgen.errors import DataError, listed
from modelgen.frozen_values import FrozenValues
from modelgen.runtime.curves.equivalent_gains import (
    EquivalentGains,
    equivalent_gains,
    has_coulomb,
    is_nonlinear,
    linear_chain,
)
from modelgen.runtime.curves.thresholds import OPEN_SHARE, RELATIVE_STEP, Z_95
from modelgen.runtime.model.model import Model
from modelgen.runtime.modes.uncertain_chain import (
    UncertainChain,
    dissipative,
    uncertain_chain,
    without_inertia,
)
from modelgen.runtime.parameters.physical_parameters import NO_CHAIN
from modelgen.runtime.records.record import Record, missing_name
from modelgen.runtime.results.estimate import Estimate
from modelgen.runtime.simulation.plant import Plant, make_plant

WEIGH = "give it if it is known (--set NAME=VALUE), or record a motion that distinguishes it from the others"


@dataclass(frozen=True, eq=False)
class ModelResponse(FrozenValues):
    """Reading of a sensor over a force as the model has it, at `frequency_hz`, shape (points,).

    Attributes
    ----------
    output, input, unit : str
    response : array of complex, shape (points,)
        NaN where it depends on what the records leave open.
    factor_std : array, shape (points,)
        Standard deviation of the logarithm of the magnitude.
    phase_std : array, shape (points,)
        Of the phase in rad.
    label : str
        What the curve is of.
    notes : tuple of str
        What was taken as zero, and what is left open.
    """

    output: str
    input: str
    unit: str
    frequency_hz: FloatArray
    response: ComplexArray
    factor_std: FloatArray
    phase_std: FloatArray
    label: str
    notes: tuple[str, ...] = ()

    def magnitude_band(self) -> tuple[FloatArray, FloatArray]:
        """Return the ends of the 95 % intervals of the magnitude, shape (points,) each."""
        reach = np.exp(np.minimum(Z_95 * self.factor_std, 50.0))
        return np.abs(self.response) / reach, np.abs(self.response) * reach

    def phase_reach_deg(self) -> FloatArray:
        """Return half the width of the 95 % intervals of the phase in degrees, shape (points,)."""
        return np.asarray(np.degrees(Z_95 * self.phase_std))


@dataclass(frozen=True, eq=False)
class EstimatedChain:
    """A model with the parameters of an estimate, their covariance, and what they leave open."""

    model: Model
    chain: UncertainChain

    def plant(self, values: Mapping[str, float] | None = None) -> Plant:
        """Return the chain with these values, or its own; frictions that nothing is known of are zero.

        Raises
        ------
        DataError
            When a body of its own comes out without an inertia.
        """
        if values is None and (why := without_inertia(self.model, self.chain)):
            raise DataError.at("estimate", why, WEIGH)
        moved = dict(self.chain.by_name if values is None else values)
        for name, row in zip(self.chain.names, self.chain.open, strict=True):
            role = self.model.roles[name].role if name in self.model.roles else ""
            if role in ("coulomb", "offset"):
                moved[name] = 0.0 if np.linalg.norm(row) > OPEN_SHARE else max(moved[name], 0.0)
        return make_plant(self.model, {**self.model.known, **moved})

    def gains(self, record: Record, cutoff_hz: float) -> EquivalentGains | None:
        """Return what friction and cubic springs are at a record's amplitude; None for a linear chain."""
        plant = self.plant()
        return equivalent_gains(plant, record, cutoff_hz) if is_nonlinear(plant) else None


def estimated_chain(model: Model, estimate: Estimate) -> EstimatedChain:
    """Return the chain of an estimate: that of its fit, or that of its parameters.

    Raises
    ------
    DataError
        When the composites that were identified are those of no chain.
    """
    if estimate.source is not None:
        if estimate.source.chain is None:
            raise DataError.at("estimate", NO_CHAIN, "draw the measured response: record.frequency_response")
        return EstimatedChain(model, estimate.source.chain)
    start = {**estimate.parameters.nuisance, **estimate.params, **estimate.physical}
    found = uncertain_chain(model, np.array(estimate.base), estimate.covariances.total, start)
    return EstimatedChain(model, found)


def model_response(
    estimated: EstimatedChain,
    output: str,
    input: str,
    frequency_hz: FloatArray,
    gains: EquivalentGains | None = None,
) -> ModelResponse:
    """Return the response of a sensor to an actuator, at frequencies in Hz above zero, shape (points,).

    Raises
    ------
    DataError
        When the model has no such sensor or actuator.
    """
    model, chain = estimated.model, estimated.chain
    sensors, actuators = ([e.key for e in entries] for entries in (model.sensors, model.actuators))
    problems = [
        missing_name(f"model {model.chain}", kind, key, keys)
        for kind, key, keys in (("sensor", output, sensors), ("actuator", input, actuators))
        if key not in keys
    ]
    DataError.raise_any(problems)
    place = sensors.index(output), actuators.index(input)

    def at(values: Mapping[str, float]) -> ComplexArray:
        return linear_chain(estimated.plant(values), gains, frequency_hz).response(frequency_hz, *place)

    H = at(chain.by_name)
    slopes = _log_slopes(at, chain)
    spread = slopes @ chain.cautious_root
    left = np.abs(slopes * np.abs(chain.values)) @ np.abs(chain.open_but_damping)
    told = np.asarray((left <= OPEN_SHARE).all(axis=1))
    unit = response_unit(model, output, input)
    return ModelResponse(
        output,
        input,
        unit,
        frequency_hz,
        np.where(told, H, np.nan),
        np.linalg.norm(spread.real, axis=1),
        np.linalg.norm(spread.imag, axis=1),
        _label(estimated.plant(), gains),
        _notes(estimated, told),
    )


def response_unit(model: Model, output: str, input: str) -> str:
    """Return the unit of a sensor's reading over an actuator's force."""
    return f"({model.channel_units[output]})/({model.channel_units[input]})"


def _log_slopes(at: Callable[[Mapping[str, float]], ComplexArray], chain: UncertainChain) -> ComplexArray:
    """Return the derivatives of log H by the parameters, shape (points, parameters)."""
    columns = []
    for i, name in enumerate(chain.names):
        step = RELATIVE_STEP * (abs(chain.values[i]) or 1.0)
        ends = [at({**chain.by_name, name: chain.values[i] + sign * step}) for sign in (1.0, -1.0)]
        columns.append((np.log(ends[0] / ends[1])) / (2.0 * step))
    return np.column_stack(columns)


def _label(plant: Plant, gains: EquivalentGains | None) -> str:
    if gains is None:
        return "modelled"
    parts = ["Coulomb friction"] * has_coulomb(plant) + ["cubic springs"] * bool(plant.model.cubic_springs)
    return f"modelled, {' and '.join(parts)} at the record's amplitude"


def _notes(estimated: EstimatedChain, told: BoolArray) -> tuple[str, ...]:
    model, chain = estimated.model, estimated.chain
    notes = []
    zero = [
        name
        for name, row in zip(chain.names, chain.open, strict=True)
        if np.linalg.norm(row) > OPEN_SHARE and name in dissipative(model)
    ]
    if zero:
        notes.append(f"the records leave {listed(zero)} open: drawn with {_values(chain, zero)}")
    if not told.all():
        lost = [
            name
            for name, row in zip(chain.names, chain.open_but_damping, strict=True)
            if np.linalg.norm(row) > OPEN_SHARE
        ]
        share = "" if not told.any() else " at some frequencies"
        notes.append(f"no modelled response{share}: it needs {listed(lost)}, which the records leave open")
    return tuple(notes)


def _values(chain: UncertainChain, names: Sequence[str]) -> str:
    return listed(f"{name} = {chain.by_name[name]:.3g}" for name in names)
