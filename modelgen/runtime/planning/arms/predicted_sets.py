"""What sensor sets of an arm would find in planned motions: simulated in closed loop, with noise, identified.

Friction sticks and slips, motors follow their reference as well as the loop lets them, links swing: what the
sensors would read is identified as records are, so that what a set cannot give is refused as it will be.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import DataError, ModelgenError
from modelgen.progress import counted
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.identification.options import CheckOptions, Filters
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record, missing_name
from modelgen.runtime.results.estimate import Estimate
from modelgen.runtime.simulation.arms.arm_coordinates import joint_units
from modelgen.runtime.simulation.arms.arm_plant import ArmPlant, arm_plant, checked_base
from modelgen.runtime.simulation.arms.joint_controller import JointController
from modelgen.runtime.simulation.arms.joint_reference import JointReference
from modelgen.runtime.simulation.arms.mounted_sensors import MountedSensor, sensor_channels
from modelgen.runtime.simulation.arms.simulate_arm import simulate_arm

#: Standard deviations of readings where none are given, by unit: encoders of 20 bits, torques of a drive as
#: its joint feels them, in front of a gear so much smaller.
USUAL_NOISE = {
    "rad": 5e-6,
    "m": 5e-6,
    "rad/s": 1e-3,
    "m/s": 1e-3,
    "rad/s^2": 1e-1,
    "m/s^2": 1e-2,
    "N m": 0.1,
    "N": 1.0,
}


@dataclass(frozen=True, eq=False)
class PlannedSet:
    """A sensor set that might be bought: its model, and where its sensors are."""

    model: Model
    sensors: tuple[MountedSensor, ...]


def predicted_sets(
    model: Model,
    values: Mapping[str, float],
    sets: Mapping[str, PlannedSet],
    references: Sequence[JointReference],
    noise: Mapping[str, float] | None = None,
    controller: JointController | None = None,
) -> dict[str, Estimate | ModelgenError]:
    """Return what each sensor set would find along references, or why it would find nothing.

    Parameters
    ----------
    model : Model
        That the arm is simulated with: of encoders at all motors and on all links.
    values : mapping of str to float
        Physical parameters (SI).
    sets : mapping of str to PlannedSet
    references : sequence of JointReference
        A record each.
    noise : mapping of str to float, optional
        Standard deviation of the readings (SI) by channel, or by unit; `USUAL_NOISE` for the others.
    controller : JointController, optional
        By default PD at every joint.

    Raises
    ------
    DataError
        For noise of what is no channel and no unit, and as `simulate_arm`.
    """
    plant = arm_plant(model, checked_base(model, values))
    units = {name: _units(plant, one.sensors) for name, one in sets.items()}
    known = {*USUAL_NOISE, *(key for of_set in units.values() for key in of_set)}
    wrong = [key for key in noise or {} if key not in known]
    if wrong:
        raise DataError(*(missing_name("noise", "channel", key, sorted(known)) for key in wrong))
    levels = {name: _levels(plant, of_set, noise or {}) for name, of_set in units.items()}
    moved = [
        simulate_arm(model, values, reference, controller=controller)
        for reference in counted(references, "simulating")
    ]
    found: dict[str, Estimate | ModelgenError] = {}
    for name, one in counted(list(sets.items()), "predicting"):
        records = []
        for number, simulation in enumerate(moved):
            true = sensor_channels(plant, one.sensors, simulation.motion)
            true |= {key: simulation.true[key] for key in plant.forces}
            title = f"{simulation.reference.name}_{number + 1}"
            noisy = _noisy(true, levels[name], number)
            records.append(Record(noisy, simulation.record.fs, title))
        try:
            found[name] = identify(one.model, records, "wls", Filters(), CheckOptions())
        except ModelgenError as error:
            found[name] = error
    return found


def _noisy(true: Mapping[str, FloatArray], levels: Mapping[str, float], seed: int) -> dict[str, FloatArray]:
    """Return readings with noise of these levels by channel; the same in every set."""
    found = {}
    for key, line in true.items():
        stream = np.random.default_rng([seed, *key.encode()])
        found[key] = line + levels[key] * stream.standard_normal(len(line))
    return found


def _levels(plant: ArmPlant, units: Mapping[str, str], noise: Mapping[str, float]) -> dict[str, float]:
    """Return the noise of every channel: what is given for it or its unit, or `USUAL_NOISE`."""
    levers = {one.key: abs(one.lever) for one in plant.model.actuators}
    return {
        key: noise.get(key, noise.get(unit, USUAL_NOISE[unit] / levers.get(key, 1.0)))
        for key, unit in units.items()
    }


def _units(plant: ArmPlant, sensors: Sequence[MountedSensor]) -> dict[str, str]:
    """Return the units of what sensors and drives read."""
    kinds = joint_units(plant.model)
    found = {one.key: one.unit for one in plant.model.actuators}
    for sensor in sensors:
        own = kinds.get(sensor.joint, "rad")
        unit = {
            "position": own,
            "velocity": f"{own}/s",
            "acceleration": f"{own}/s^2",
            "torque": "N m" if own == "rad" else "N",
            "gyro": "rad/s",
            "accelerometer": "m/s^2",
        }[sensor.measures]
        found |= dict.fromkeys(sensor.channels, unit)
    return found
