"""Closed-loop validation: one reference for the real and the simulated loop, then signals compared.

Section IV.C of Pham 2002, figures 3 and 4. Sensors and force are compared as they are; a position's velocity
and acceleration come from the same filter and differences on both sides, so that the filter causes no error.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import isfinite
from typing import Any, Protocol, TypedDict, Unpack, cast

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import DataError
from modelgen.keyword_options import with_defaults
from modelgen.runtime.filters.derivatives import differentiate
from modelgen.runtime.filters.zero_phase import support_samples, zero_phase
from modelgen.runtime.model.mechanical_parts import BENDING, Sensor
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record, refuse_lacking
from modelgen.runtime.records.same_data import is_held_out, refuse_same_data
from modelgen.runtime.simulation.closed_loop import PositionVelocityController, vibration
from modelgen.runtime.simulation.drive import Drive
from modelgen.runtime.simulation.excitation import Excitation, excitation_from_record
from modelgen.runtime.simulation.plant import Plant, make_plant, refuse_lacking_forces
from modelgen.runtime.simulation.simulate import simulate
from modelgen.runtime.simulation.thresholds import CUTOFF_SHARE, FILTER_ORDER, REACH_TOLERANCE, STEPS_A_SAMPLE
from modelgen.runtime.simulation.validation import SignalCheck, Validation

NAMES = ("position", "velocity", "acceleration")


class ValidationOptions(TypedDict, total=False):
    """Filter and steps of `validate`, which describes them."""

    cutoff_hz: float | None
    oversample: int | None


def validate(
    model: Model,
    parameters: Mapping[str, float],
    records: Sequence[Record],
    controller: PositionVelocityController,
    *,
    drive: Drive | None = None,
    actuator: str | None = None,
    used: Sequence[str] = (),
    **options: Unpack[ValidationOptions],
) -> tuple[Validation, ...]:
    """Simulate every record's reference in closed loop and compare.

    The forces of further actuators enter as measured.

    Parameters
    ----------
    model : Model
    parameters : mapping of str to float
        All physical parameters (SI); known ones may be left out.
    records : sequence of Record
        With the channels of the model and ``reference`` (of the driven body, in its unit); ``reference_rate``
        and ``feedforward`` where the controller uses them.
    controller, drive, actuator
        As in `modelgen.simulate`: the loop in which the records were made.
    used : sequence of str
        Records that the parameters were identified from, `Estimate.identified_from`: their contents, or their
        names; the others are held out.
    cutoff_hz : float, optional
        Of the low-pass in Hz (order 4, forward and backward) before a reading is differentiated, on both
        sides; by default a tenth of the sampling frequency.
    oversample : int, optional
        Internal steps per sample: 8, or 1 with a sampled controller.

    Raises
    ------
    DataError
        When a channel or a force is missing, records hold the same data, or parameters or loop do not suit
        the model.
    """
    given = with_defaults("validate", options, ValidationOptions, ValidationOptions())
    refuse_lacking(records, (*model.channels, "reference"), model.channel_units)
    refuse_same_data(records, model.channels)
    plant = make_plant(model, parameters, actuator)
    drive = drive or Drive()
    steps = given["oversample"] or (1 if drive.sampled else STEPS_A_SAMPLE)
    return tuple(
        _validate(
            plant,
            record,
            controller,
            drive,
            steps,
            is_held_out(record, model.channels, used),
            given["cutoff_hz"],
        )
        for record in records
    )


def _validate(
    plant: Plant,
    record: Record,
    controller: PositionVelocityController,
    drive: Drive,
    oversample: int,
    held_out: bool,
    cutoff_hz: float | None,
) -> Validation:
    cutoff = CUTOFF_SHARE * record.fs if cutoff_hz is None else cutoff_hz
    if not 0.0 < cutoff < 0.5 * record.fs:
        remedy = f"give a frequency between 0 and half the sampling frequency, {0.5 * record.fs:g} Hz"
        raise DataError.at("cutoff_hz", f"is {cutoff:g}", remedy)
    key = plant.model.actuators[plant.actuator].key
    simulated = simulate(
        plant.model,
        plant.parameters,
        _excitation(plant, record, controller, oversample),
        fs=record.fs,
        controller=controller,
        drive=drive,
        actuator=key,
        initial_state=initial_state(plant, record, cutoff),
    ).true
    checks: list[SignalCheck] = []
    for sensor in plant.model.sensors:
        if sensor.key in record.signals:
            checks += _sensor_checks(sensor, record, simulated[sensor.key], cutoff)
    tracking = _tracking(plant, record, simulated)
    if tracking is not None:
        checks.append(tracking)
    unit = plant.model.actuators[plant.actuator].unit
    checks.append(SignalCheck(key, "force", unit, False, 0, record.signals[key], simulated[key]))
    return Validation(record.name, held_out, record.fs, cutoff, tuple(checks))


def _excitation(
    plant: Plant, record: Record, controller: PositionVelocityController, oversample: int
) -> Excitation:
    refuse_lacking_forces(plant, record)
    if "reference_rate" not in record.signals:
        reference = record.signals["reference"]
        rate = differentiate(reference, record.dt) if controller.rate_gain else np.zeros(record.n)
        record = record.edited({"reference_rate": rate})
    return excitation_from_record(record, oversample, tuple(plant.further))


def initial_state(plant: Plant, record: Record, cutoff_hz: float) -> FloatArray:
    """Return positions, then velocities, of all bodies at the first sample, shape (2 bodies,), in SI.

    A body without an encoder or tachometer is taken to follow the driven one as if rigidly connected.
    """
    n = len(plant.bodies)
    found: dict[tuple[str, int], float] = {}
    for sensor in plant.model.sensors:
        order = sensor.order
        if sensor.body is not None and sensor.key in record.signals and order < 2:
            smooth = zero_phase(record.signals[sensor.key], FILTER_ORDER, cutoff_hz, record.fs)
            found[sensor.body, order] = float(smooth[0])
            if order == 0:
                found.setdefault((sensor.body, 1), float(differentiate(smooth, record.dt)[0]))
    driven, gears = plant.bodies[plant.driven], vibration(plant).lowest
    state = np.zeros(2 * n)
    for i, body in enumerate(plant.bodies):
        for order in (0, 1):
            state[order * n + i] = found.get((body, order), gears[i] * found.get((driven, order), 0.0))
    return state


def _sensor_checks(
    sensor: Sensor, record: Record, simulated: FloatArray, cutoff_hz: float
) -> list[SignalCheck]:
    """Return the reading itself, and its derivatives up to the acceleration."""
    measured, first = record.signals[sensor.key], sensor.order
    checks = [SignalCheck(sensor.key, sensor.measures, sensor.unit, False, 0, measured, simulated)]
    smooth = [zero_phase(array, FILTER_ORDER, cutoff_hz, record.fs) for array in (measured, simulated)]
    for k in range(1, 3 - first):
        reach = support_samples(FILTER_ORDER, cutoff_hz, record.fs, k, REACH_TOLERANCE)
        if 2 * reach >= record.n:
            break
        pair = [differentiate(array, record.dt, k)[reach : record.n - reach] for array in smooth]
        unit = _differentiated(sensor.unit, k)
        checks.append(SignalCheck(sensor.key, NAMES[first + k], unit, True, reach, *pair))
    return checks


def _differentiated(unit: str, times: int) -> str:
    """Return the unit of a derivative: rad -> rad/s -> rad/s^2."""
    base, _, per = unit.partition("/")
    order = times + {"": 0, "s": 1}.get(per, 0)
    return base if order == 0 else f"{base}/s" if order == 1 else f"{base}/s^{order}"


def _tracking(plant: Plant, record: Record, simulated: Mapping[str, FloatArray]) -> SignalCheck | None:
    """Return reference - position of the driven body, where that has an encoder."""
    driven = plant.bodies[plant.driven]
    for sensor in plant.model.sensors:
        if (sensor.body, sensor.measures) == (driven, "position") and sensor.key in record.signals:
            reference, key = record.signals["reference"], sensor.key
            pair = (reference - record.signals[key], reference - simulated[key])
            return SignalCheck(key, "tracking error", sensor.unit, False, 0, *pair)
    return None


class Documented(Protocol):
    """What gives a document of itself, as an `Estimate` does."""

    def to_dict(self) -> dict[str, Any]:
        """Return the document."""


def parameters_of(estimate: Mapping[str, object] | Documented, model: Model) -> dict[str, float]:
    """Return the physical parameters of an estimate, or of its document (`to_dict`), for this model.

    Of an arm these are its base parameters, which say all that moves it.

    Raises
    ------
    DataError
        When the estimate is no such mapping, or of another chain.
    """
    estimate = estimate if isinstance(estimate, Mapping) else estimate.to_dict()
    physical = estimate.get("physical")
    if estimate.get("format") != "modelgen estimate" or not isinstance(physical, Mapping):
        remedy = "give a file that modelgen identify -o wrote"
        raise DataError.at("estimate", "is no saved estimate", remedy)
    if estimate.get("chain") != model.chain:
        what = f"is of the chain {estimate.get('chain')}, the model of {model.chain}"
        raise DataError.at("estimate", what, "give an estimate of the same chain")
    roles = estimate.get("roles")
    if isinstance(roles, Mapping) and BENDING in roles.values():
        what = (
            "is of the chain as one body, whose springs did not show: it has no values to simulate them with"
        )
        raise DataError.at("estimate", what, "identify it from a motion that reaches the mode of vibration")
    if model.is_arm and isinstance(estimate.get("params"), Mapping):
        physical = cast("Mapping[str, Any]", estimate["params"])
    values = {str(name): value for name, value in physical.items()}
    known = estimate.get("known")
    if isinstance(known, Mapping):  # what was not estimated is part of the chain all the same
        values = {str(name): value for name, value in known.items() if name in model.parameters} | values
    return {name: float(value) for name, value in values.items() if value is not None and isfinite(value)}


def split(record: Record, share: float) -> tuple[Record, Record]:
    """Return the first `share` of a record, and the rest: one to identify from, one to hold out."""
    if not 0.0 < share < 1.0:
        raise DataError.at("split", f"is {share:g}", "give a share between 0 and 1")
    cut = round(share * record.n)
    first, rest = (record.part(*ends, record.name) for ends in ((0, cut), (cut, record.n)))
    return replace(first, name=f"{record.name}_first"), replace(rest, name=f"{record.name}_rest")
