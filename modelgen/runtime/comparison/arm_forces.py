"""Forces of an arm's drives from its motion, by inverse dynamics, next to what the drives reported."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from modelgen.array_types import FloatArray
from modelgen.errors import DataError
from modelgen.runtime.filter_choice.filter_choice import FilterChoice, choose_filter
from modelgen.runtime.filters.zero_phase import support_samples, zero_phase
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record, refuse_lacking
from modelgen.runtime.records.same_data import is_held_out
from modelgen.runtime.rows.derived_channels import with_derived
from modelgen.runtime.simulation.arms.arm_plant import ArmPlant, arm_plant
from modelgen.runtime.simulation.arms.carried_payloads import forces_of_motion
from modelgen.runtime.simulation.arms.measured_motion import measured_motion
from modelgen.runtime.simulation.arms.validate_arm import base_values, taken_as_zero
from modelgen.runtime.simulation.thresholds import REACH_TOLERANCE
from modelgen.runtime.simulation.validation import SignalCheck, Validation


def compare_forces(
    model: Model,
    parameters: Mapping[str, float],
    records: Sequence[Record],
    used: Sequence[str] = (),
) -> tuple[Validation, ...]:
    """Compare what the drives report with what the measured motion needs; no controller is needed.

    Positions go through the wide low-pass that rows are made with and are differentiated; forces, measured
    and predicted, through the low-pass of the rows, both chosen from each record.

    Parameters
    ----------
    model : Model
    parameters : mapping of str to float
        Base parameters by name (`Estimate.params`), or all physical ones (SI); what is absent counts as zero.
    records : sequence of Record
        With the channels of the model.
    used : sequence of str
        Records that the parameters were identified from, `Estimate.identified_from`: their contents, or their
        names; the others are held out.

    Raises
    ------
    DataError
        When a channel is missing, or a record too short for the filters.
    """
    extended = with_derived(model, records)
    refuse_lacking(extended, model.channels, model.channel_units)
    base, absent = base_values(model, parameters)
    plant = arm_plant(model, base)
    return tuple(
        _compared(plant, record, is_held_out(record, model.channels, used), taken_as_zero(absent))
        for record in extended
    )


def _compared(plant: ArmPlant, record: Record, held_out: bool, notes: tuple[str, ...]) -> Validation:
    choice, model = choose_filter(plant.model, [record]), plant.model
    found = _forces(plant, record, choice)
    order, cutoff_hz = choice.filter_order, choice.cutoff_hz
    reach = support_samples(order, cutoff_hz, record.fs, 0, REACH_TOLERANCE)
    if 2 * reach >= record.n:
        what = f"has {record.n} samples, and the low-pass of {cutoff_hz:.4g} Hz reaches over {2 * reach}"
        raise DataError.at(record.name, what, "record for longer")
    inside = slice(reach, record.n - reach)
    checks = []
    for one in (one for one in model.actuators if one.key in found):
        pair = [
            zero_phase(x, order, cutoff_hz, record.fs)[inside]
            for x in (record.signals[one.key], found[one.key])
        ]
        checks.append(SignalCheck(one.key, "force", one.unit, False, reach, *pair))
    kind = f"inverse dynamics, forces below {cutoff_hz:.4g} Hz"
    return Validation(record.name, held_out, record.fs, cutoff_hz, tuple(checks), kind, notes)


def _forces(plant: ArmPlant, record: Record, choice: FilterChoice) -> dict[str, FloatArray]:
    """Return the forces that the measured motion needs, shape (n,) each."""
    wide_hz = choice.signal_cutoff_hz or choice.cutoff_hz
    motion = measured_motion(plant.coordinates, record, choice.filter_order, wide_hz)
    return forces_of_motion(plant, motion, record)
