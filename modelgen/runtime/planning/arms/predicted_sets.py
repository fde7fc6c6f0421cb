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
from modelgen.runtime.identification.elastic.encoder_zeros import deflecting
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.model.deflected_kernel import DeflectedKernel
from modelgen.runtime.model.model import Model
from modelgen.runtime.planning.default_precision import stated_in_copies
from modelgen.runtime.planning.thresholds import COPIES
from modelgen.runtime.records.record import Record, missing_name
from modelgen.runtime.results.estimate import Estimate
from modelgen.runtime.simulation.arms.arm_coordinates import joint_units
from modelgen.runtime.simulation.arms.arm_plant import ArmPlant, arm_plant, checked_base
from modelgen.runtime.simulation.arms.joint_controller import JointController
from modelgen.runtime.simulation.arms.joint_reference import JointReference
from modelgen.runtime.simulation.arms.mounted_sensors import MountedSensor, sensor_channels
from modelgen.runtime.simulation.arms.simulate_arm import ArmSimulation, simulate_arm

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
class FoundBySet:
    """What a set finds in noisy copies of the planned motions: the estimates, and by base parameter the root
    mean square of the deviations (SI) that they state, of those that most give.
    """

    estimates: tuple[Estimate, ...]
    deviations: Mapping[str, float]


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
) -> dict[str, FoundBySet | ModelgenError]:
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
    found: dict[str, FoundBySet | ModelgenError] = {}
    for name, one in counted(list(sets.items()), "predicting"):
        clean = [
            sensor_channels(plant, one.sensors, simulation.motion)
            | {key: simulation.true[key] for key in plant.forces}
            for simulation in moved
        ]
        try:
            found[name] = _found(one.model, moved, clean, levels[name])
        except ModelgenError as error:
            found[name] = error
    return found


def _found(
    model: Model,
    moved: Sequence[ArmSimulation],
    clean: Sequence[Mapping[str, FloatArray]],
    levels: Mapping[str, float],
) -> FoundBySet:
    """Return what is found in noisy copies of the channels of simulated motions."""

    def copy(seed: int) -> Estimate:
        records = [
            Record(
                _noisy(true, levels, seed * len(moved) + number),
                simulation.record.fs,
                f"{simulation.reference.name}_{number + 1}",
            )
            for number, (simulation, true) in enumerate(zip(moved, clean, strict=True))
        ]
        return identify(model, records, "wls" if given else "auto")

    # rows that hold positions which springs give, and no zeros: the default states what least squares does,
    # and takes minutes where a motor or a link of three is unseen
    given = isinstance(model.kernel, DeflectedKernel) and not deflecting(model)
    estimates, deviations = stated_in_copies(copy, lambda one: one.bse, 1 if given else COPIES)
    return FoundBySet(tuple(estimates), deviations)


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
