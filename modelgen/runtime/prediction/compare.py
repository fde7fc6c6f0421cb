"""Measured and modelled signals side by side, without a controller: open loop, or some samples ahead."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from numbers import Integral

from modelgen.errors import DataError, Problem, listed
from modelgen.magnitudes import shown_number
from modelgen.runtime.model.model import Model
from modelgen.runtime.prediction.open_loop import open_loop_readings
from modelgen.runtime.prediction.predictor import predicted_readings
from modelgen.runtime.prediction.thresholds import JUDGED_SAMPLES
from modelgen.runtime.records.record import Record, refuse_lacking
from modelgen.runtime.records.same_data import is_held_out
from modelgen.runtime.simulation.plant import Plant, make_plant
from modelgen.runtime.simulation.thresholds import CUTOFF_SHARE
from modelgen.runtime.simulation.validate import initial_state
from modelgen.runtime.simulation.validation import SignalCheck, Validation

RUBBING = ("viscous", "damping", "coulomb", "offset")


def compare(
    model: Model,
    parameters: Mapping[str, float],
    records: Sequence[Record],
    horizon: int | None = None,
    used: Sequence[str] = (),
) -> tuple[Validation, ...]:
    """Compare all sensors with what the chain does under the measured forces; no controller is needed.

    Parameters
    ----------
    model : Model
    parameters : mapping of str to float
        Physical parameters (SI); known ones may be left out. Friction and damping that are absent count as
        zero, and the result says so.
    records : sequence of Record
        With the forces of all actuators, and one sensor at least.
    horizon : int, optional
        Predict so many samples ahead of the readings (1, 10, ...). By default the whole record is simulated
        in open loop, from the state at its beginning that suits it best.
    used : sequence of str
        Records that the parameters were identified from, `Estimate.identified_from`: their contents, or their
        names; the others are held out.

    Raises
    ------
    DataError
        When a parameter, a force or all sensors are missing, the motion grows without bound, or the horizon
        is longer than a record.
    """
    whole = isinstance(horizon, Integral) and not isinstance(horizon, bool)
    if horizon is not None and not (whole and horizon > 0):
        remedy = "give a whole number of samples, 1 or more, or none for open loop"
        raise DataError.at("horizon", f"is {shown_number(horizon)}", remedy)
    horizon = None if horizon is None else int(horizon)
    refuse_lacking(records, (), model.channel_units)
    sensors = [sensor.key for sensor in model.sensors]
    problems = [
        Problem(record.name, f"has none of the sensors {listed(sensors)}", "map a column to one of them")
        for record in records
        if not any(key in record.signals for key in sensors)
    ]
    DataError.raise_any(problems)
    given = {**model.known, **parameters}
    lost = [name for name in model.parameters if name not in given and name in model.roles]
    zero = [name for name in lost if model.roles[name].role in RUBBING]
    notes = (f"taken as zero: {listed(zero)}",) if zero else ()
    plant = make_plant(model, {**given, **dict.fromkeys(zero, 0.0)})
    return tuple(
        _compared(plant, record, horizon, is_held_out(record, model.channels, used), notes)
        for record in records
    )


def _compared(
    plant: Plant, record: Record, horizon: int | None, held_out: bool, notes: tuple[str, ...]
) -> Validation:
    cutoff_hz = CUTOFF_SHARE * record.fs
    start = initial_state(plant, record, cutoff_hz)
    if horizon is None:
        kind, first, found = "open loop", 0, open_loop_readings(plant, record, start)[1]
    else:
        kind = f"{horizon} sample{'s' if horizon > 1 else ''} ahead"
        begin = record.part(0, min(record.n, JUDGED_SAMPLES), record.name)
        start, _ = open_loop_readings(plant, begin, start)
        first, found = horizon, predicted_readings(plant, record, horizon, start)
    checks = tuple(
        SignalCheck(s.key, s.measures, s.unit, False, first, record.signals[s.key][first:], found[s.key])
        for s in plant.model.sensors
        if s.key in found
    )
    return Validation(record.name, held_out, record.fs, cutoff_hz, checks, kind, notes)
