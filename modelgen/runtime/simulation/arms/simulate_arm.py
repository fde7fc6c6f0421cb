"""An arm in closed loop: parameters and a reference -> a record, as encoders and drives would read it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import TypedDict, Unpack

import numpy as np
import numpy.typing as npt

from modelgen.array_types import FloatArray
from modelgen.errors import DataError
from modelgen.keyword_options import with_defaults
from modelgen.runtime.model.arm_channels import LOAD
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record, missing_name
from modelgen.runtime.simulation.arms.arm_motion import ArmMotion
from modelgen.runtime.simulation.arms.arm_plant import ArmPlant, arm_plant, checked_base
from modelgen.runtime.simulation.arms.followed_reference import (
    carried_start,
    followed,
    nodes_a_sample,
    true_signals,
)
from modelgen.runtime.simulation.arms.joint_controller import JointController, controller_given
from modelgen.runtime.simulation.arms.joint_motion import JointMotion
from modelgen.runtime.simulation.arms.joint_reference import JointLimits, JointReference, fourier_reference
from modelgen.runtime.simulation.arms.mounted_sensors import MountedSensor, sensor_channels
from modelgen.runtime.simulation.arms.thresholds import (
    DURATION_S,
)
from modelgen.runtime.simulation.sensor_readings import Levels, checked_levels, drawn, instrument_keys
from modelgen.runtime.simulation.simulate import ModeChange, given_state


@dataclass(frozen=True, eq=False)
class ArmSimulation:
    """A simulated experiment with an arm.

    Attributes
    ----------
    record : Record
        What encoders (``q_NAME``), or the sensors of an elastic arm, and drives (``tau_NAME``) read, with
        noise and resolution.
    true : mapping of str to ndarray, shape (N,)
        The same without noise; the model's positions with ``d1_`` and ``d2_``, speeds and accelerations;
        ``mode_NAME``, the direction in which a joint (or a motor) with Coulomb friction slips, 0 where it
        sticks.
    joints : tuple of str
        Names of the joints that move.
    motion : JointMotion
        Of the links, then of the motors in front of springs as their joints see them.
    reference : JointReference
    changes : tuple of ModeChange
        Changes between slip and stick, at the beginning of the step in which they happen.
    controller : JointController
    """

    record: Record
    true: Mapping[str, FloatArray]
    joints: tuple[str, ...]
    motion: JointMotion
    reference: JointReference
    changes: tuple[ModeChange, ...]
    controller: JointController


class ArmSimulationOptions(TypedDict, total=False):
    """The keyword options of `simulate_arm`, which describes them."""

    fs: float
    duration_s: float | None
    noise: Mapping[str, float] | None
    resolution: Mapping[str, float] | None
    bias: Mapping[str, float] | None
    seed: int
    controller: JointController | None
    limits: Mapping[str, JointLimits] | None
    initial_state: npt.ArrayLike | None
    sensors: Sequence[MountedSensor] | None
    payloads: Sequence[str]


def simulate_arm(
    model: Model,
    parameters: Mapping[str, float],
    reference: str | JointReference = "fourier",
    **options: Unpack[ArmSimulationOptions],
) -> ArmSimulation:
    """Simulate an arm under control of its joints, with true Coulomb friction.

    Springs of joints are between motors and links; the controller sees the motors.

    Parameters
    ----------
    model : Model
        The generated module's view; of an arm with springs that of encoders at all motors and on all links.
    parameters : mapping of str to float
        Physical parameters (SI); known ones may be left out.
    reference : str or JointReference
        "fourier" (see `fourier_reference`), or the user's own: `reference_from_record`.
    fs : float
        Sampling frequency in Hz of a "fourier" reference, by default 1000; another has its own.
    duration_s : float, optional
        Of "fourier", by default 10 s.
    noise, resolution, bias : mapping of str to float, optional
        As in `modelgen.simulate`: of what a channel reads, unseen by the controller.
    seed : int
        Of the noise, by default 0.
    controller : JointController, optional
        By default PD at every joint.
    limits : mapping of str to JointLimits, optional
        Of the joints, for "fourier".
    initial_state : array_like, shape (2 coordinates,), optional
        Positions of links, and of motors in front of springs as their joints see them; then their speeds. By
        default on the reference, links where their springs carry them.
    sensors : sequence of MountedSensor, optional
        What is recorded, besides the drives' forces; by default what the model reads.
    payloads : sequence of str, optional
        Names of the payloads that the arm carries all the time.

    Raises
    ------
    DataError
        For parameters, channels or options that do not fit the model, and for a motion that runs away.
    """
    given = with_defaults(
        "simulate_arm", options, ArmSimulationOptions, ArmSimulationOptions(fs=1000.0, seed=0, payloads=())
    )
    if not model.is_arm:
        raise DataError.at(model.chain, "is a chain", "use modelgen.simulate")
    recorded = _recorded(model, given["sensors"])
    levels = _levels(model, recorded, given)
    plant = _loaded(arm_plant(model, checked_base(model, parameters)), given["payloads"])
    controller = controller_given(given)
    if isinstance(reference, str):
        if reference != "fourier":
            raise DataError.at("reference", f"there is no kind {reference!r}", "choose fourier")
        duration_s = DURATION_S if given["duration_s"] is None else given["duration_s"]
        reference = fourier_reference(model, duration_s, given["fs"], given["limits"])
    elif given["duration_s"] is not None:
        raise DataError.at("duration_s", "is given, but the reference has its own", "leave it out")
    _refuse_impossible(plant, reference.motion)
    start = given_state(given["initial_state"], plant.coordinates.names, "speeds")
    start = carried_start(plant, reference.motion) if start is None else start
    factor = nodes_a_sample(plant, controller, reference.motion)
    motion = followed(plant, reference, controller, start, factor)
    true = true_signals(plant, motion, factor)
    nodes = motion.motion
    moved = JointMotion(
        nodes.q[:, ::factor], nodes.v[:, ::factor], nodes.a[:, ::factor], nodes.rate_hz / factor
    )
    if given["sensors"] is not None:
        true |= sensor_channels(plant, given["sensors"], moved)
    measured = drawn(recorded, true, *levels[:2], given["seed"], levels[2], reference.name)
    kept = {key: line for key, line in measured.items() if key not in model.derived}
    record = Record(kept, reference.motion.rate_hz, reference.name).carrying(*given["payloads"])
    changes = _changes(plant, motion)
    return ArmSimulation(record, MappingProxyType(true), plant.joints, moved, reference, changes, controller)


def _loaded(plant: ArmPlant, payloads: Sequence[str]) -> ArmPlant:
    """Return a plant that carries payloads."""
    known = [key.removeprefix(LOAD) for key in plant.model.loads]
    problems = [missing_name("payloads", "payload", name, known) for name in payloads if name not in known]
    DataError.raise_any(problems)
    return replace(plant, carried={f"{LOAD}{name}": 1.0 for name in payloads})


def _recorded(model: Model, sensors: Sequence[MountedSensor] | None) -> tuple[str, ...]:
    """Return the channels that are recorded."""
    if sensors is None:
        return instrument_keys(model)
    read = (channel for sensor in sensors for channel in sensor.channels)
    return (*read, *(one.key for one in model.actuators))


def _levels(
    model: Model, recorded: Sequence[str], given: ArmSimulationOptions
) -> tuple[Levels, Levels, Levels]:
    """Return noise, resolution and bias, checked."""
    asked = given["noise"], given["resolution"], given["bias"]
    levels = checked_levels(recorded, *asked, given["seed"])
    keys = [key for key in recorded if key not in model.derived]
    summed = [key for level in levels for key in level if key in model.derived]
    if summed:
        raise DataError(*(missing_name("noise", "channel", key, keys) for key in summed))
    return levels


def _refuse_impossible(plant: ArmPlant, reference: JointMotion) -> None:
    """Raise DataError where the mass matrix along the reference is none: those links cannot exist."""
    some = slice(0, reference.n, max(1, reference.n // 50))
    stiff = plant.coordinates.stiff
    mass = plant.mass(stiff @ reference.q[:, some], stiff @ reference.v[:, some])
    own = np.diagonal(mass, axis1=1, axis2=2)
    bad = [
        name for name, inertias in zip(plant.coordinates.names, own.T, strict=True) if inertias.min() <= 0.0
    ]
    if bad:
        what = f"give joint {', '.join(bad)} no positive inertia somewhere along the reference"
        raise DataError.at("parameters", what, "give inertias of real links, or Ia of the drives")
    root = np.sqrt(own)
    scaled = mass / root[:, :, None] / root[:, None, :]
    if (
        plant.model.module.ROW_KIND == "joint"
        and np.linalg.eigvalsh(0.5 * (scaled + np.transpose(scaled, (0, 2, 1)))).min() <= 0.0
    ):
        what = "give a mass matrix that is not positive definite: no links have these"
        raise DataError.at("parameters", what, "give mass, centre and inertia of each link together")


def _changes(plant: ArmPlant, motion: ArmMotion) -> tuple[ModeChange, ...]:
    modes, rate_hz = motion.modes, motion.motion.rate_hz
    found = []
    for c, name in enumerate(plant.rubbing.names):
        for k in np.flatnonzero(np.diff(modes[c])).tolist():
            found.append(ModeChange(float(k / rate_hz), name, int(modes[c, k + 1])))
    return tuple(sorted(found, key=lambda change: (change.time_s, change.body)))


def record_with_joint_references(simulation: ArmSimulation) -> Record:
    """Return the record with what the joints were to do: ``reference_NAME``, ``reference_rate_NAME``.

    And ``reference_acceleration_NAME``, which computed torque uses.
    """
    motion = simulation.reference.motion
    names = simulation.joints
    lines = {
        f"{word}_{name}": line
        for word, lines in (
            ("reference", motion.q),
            ("reference_rate", motion.v),
            ("reference_acceleration", motion.a),
        )
        for name, line in zip(names, lines, strict=True)
    }
    return replace(simulation.record, signals={**simulation.record.signals, **lines})
