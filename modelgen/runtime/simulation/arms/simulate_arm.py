"""An arm in closed loop: parameters and a reference -> a record, as encoders and drives would read it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import ceil
from types import MappingProxyType
from typing import TypedDict, Unpack

import numpy as np
import numpy.typing as npt

from modelgen.array_types import FloatArray
from modelgen.errors import DataError
from modelgen.keyword_options import with_defaults
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record, missing_name
from modelgen.runtime.simulation.arms.arm_motion import ArmMotion, arm_motion
from modelgen.runtime.simulation.arms.arm_plant import ArmPlant, arm_plant, checked_base
from modelgen.runtime.simulation.arms.joint_controller import JointController, controller_given, tracking
from modelgen.runtime.simulation.arms.joint_motion import JointMotion
from modelgen.runtime.simulation.arms.joint_reference import JointLimits, JointReference, fourier_reference
from modelgen.runtime.simulation.arms.thresholds import DURATION_S, MOST_A_SAMPLE, NODES_A_RATE, NODES_HZ
from modelgen.runtime.simulation.sensor_readings import check_levels, readings
from modelgen.runtime.simulation.simulate import ModeChange


@dataclass(frozen=True, eq=False)
class ArmSimulation:
    """A simulated experiment with an arm.

    Attributes
    ----------
    record : Record
        What encoders (``q_NAME``) and drives (``tau_NAME``) read, with noise and resolution.
    true : mapping of str to ndarray, shape (N,)
        The same without noise; ``d1_q_NAME``, ``d2_q_NAME``, speeds and accelerations; ``mode_NAME``, the
        direction in which a joint (or a motor of several) with Coulomb friction slips, 0 where it sticks.
    reference : JointReference
    changes : tuple of ModeChange
        Changes between slip and stick, at the beginning of the step in which they happen.
    controller : JointController
    """

    record: Record
    true: Mapping[str, FloatArray]
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


DEFAULTS = ArmSimulationOptions(
    fs=1000.0,
    duration_s=None,
    noise=None,
    resolution=None,
    bias=None,
    seed=0,
    controller=None,
    limits=None,
    initial_state=None,
)


def simulate_arm(
    model: Model,
    parameters: Mapping[str, float],
    reference: str | JointReference = "fourier",
    **options: Unpack[ArmSimulationOptions],
) -> ArmSimulation:
    """Simulate an arm with rigid joints under control of its joints, with true Coulomb friction.

    Parameters
    ----------
    model : Model
        The generated module's view.
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
    initial_state : array_like, shape (2 joints,), optional
        Positions, then speeds; by default on the reference.

    Raises
    ------
    DataError
        For parameters, channels or options that do not fit the model, and for a motion that runs away.
    """
    given = with_defaults("simulate_arm", options, DEFAULTS)
    if not model.is_arm:
        raise DataError.at(model.chain, "is a chain", "use modelgen.simulate")
    levels = _levels(model, given)
    plant = arm_plant(model, checked_base(model, parameters))
    controller = controller_given(given)
    if isinstance(reference, str):
        if reference != "fourier":
            raise DataError.at("reference", f"there is no kind {reference!r}", "choose fourier")
        duration_s = DURATION_S if given["duration_s"] is None else given["duration_s"]
        reference = fourier_reference(model, duration_s, given["fs"], given["limits"])
    elif given["duration_s"] is not None:
        raise DataError.at("duration_s", "is given, but the reference has its own", "leave it out")
    _refuse_impossible(plant, reference.motion)
    start = _start(plant, reference.motion, given["initial_state"])
    factor = nodes_a_sample(plant, controller, reference.motion)
    motion = followed(plant, reference, controller, start, factor)
    true = true_signals(plant, motion, factor)
    measured = readings(model, true, *levels[:2], given["seed"], levels[2], reference.name)
    kept = {key: line for key, line in measured.items() if key not in model.derived}
    record = Record(kept, reference.motion.rate_hz, reference.name)
    return ArmSimulation(record, MappingProxyType(true), reference, _changes(plant, motion), controller)


def nodes_a_sample(plant: ArmPlant, controller: JointController, reference: JointMotion) -> int:
    """Return how many steps a sample needs.

    Raises
    ------
    DataError
        When the closed loop is so fast that they would be too many.
    """
    rate = controller.fastest(plant, reference)
    if not rate < MOST_A_SAMPLE * NODES_A_RATE * reference.rate_hz:
        what = f"moves at {rate / (2.0 * np.pi):.3g} Hz with these parameters, too fast for the samples"
        raise DataError.at("closed loop", what, "check inertias (Ia of the drives) and gains")
    return max(1, ceil(max(NODES_HZ, rate / NODES_A_RATE) / reference.rate_hz))


def followed(
    plant: ArmPlant, reference: JointReference, controller: JointController, start: FloatArray, factor: int
) -> ArmMotion:
    """Return the motion at so many nodes a sample of the reference."""
    nodes = reference.motion.finer(factor)
    added = None
    if reference.forces:
        at, places = np.arange(nodes.n) / factor, np.arange(reference.motion.n)
        still = np.zeros(reference.motion.n)
        forces = [np.interp(at, places, reference.forces.get(key, still)) for key in plant.forces]
        added = plant.gears @ np.array(forces)
    return arm_motion(plant, nodes, tracking(plant, controller, nodes, added), start)


def true_signals(plant: ArmPlant, motion: ArmMotion, stride: int = 1) -> dict[str, FloatArray]:
    """Return the exact signals at every `stride`-th node, shape (N,) each, in SI; channels come first."""
    model, moved = plant.model, motion.motion
    q, v, a, push = (one[:, ::stride] for one in (moved.q, moved.v, moved.a, motion.push))
    tau: FloatArray = np.asarray(np.linalg.solve(plant.gears, push), dtype=float)
    true = dict(zip(plant.forces, tau, strict=True)) | {
        f"q_{name}": q[k] for k, name in enumerate(plant.joints)
    }
    for key, terms in model.derived.items():
        true[key] = np.sum([weight * true[of] for weight, of in terms], axis=0)
    for k, name in enumerate(plant.joints):
        true |= {f"d1_q_{name}": v[k], f"d2_q_{name}": a[k]}
    true |= plant.base_forces(q, v, a, tau)
    for c, name in enumerate(plant.rubbing.names):
        true[f"mode_{name}"] = motion.modes[c, ::stride].astype(float)
    return true


def _levels(
    model: Model, given: ArmSimulationOptions
) -> tuple[Mapping[str, float], Mapping[str, float], Mapping[str, float]]:
    """Return noise, resolution and bias, checked."""
    noise, resolution, bias = (dict(given[key] or {}) for key in ("noise", "resolution", "bias"))
    check_levels(model, "noise", noise)
    check_levels(model, "resolution", resolution)
    check_levels(model, "bias", bias, signed=True)
    keys = [s.key for s in model.sensors if s.key not in model.derived] + [a.key for a in model.actuators]
    summed = [key for level in (noise, resolution, bias) for key in level if key in model.derived]
    if summed:
        raise DataError(*(missing_name("noise", "channel", key, keys) for key in summed))
    if given["seed"] < 0:
        raise DataError.at("seed", f"is {given['seed']}", "give a whole number, 0 or more")
    return noise, resolution, bias


def _refuse_impossible(plant: ArmPlant, reference: JointMotion) -> None:
    """Raise DataError where the mass matrix along the reference is none: those links cannot exist."""
    some = slice(0, reference.n, max(1, reference.n // 50))
    mass = plant.mass(reference.q[:, some], reference.v[:, some])
    own = np.diagonal(mass, axis1=1, axis2=2)
    bad = [name for name, inertias in zip(plant.joints, own.T, strict=True) if inertias.min() <= 0.0]
    if bad:
        what = f"give joint {', '.join(bad)} no positive inertia somewhere along the reference"
        raise DataError.at("parameters", what, "give inertias of real links, or Ia of the drives")
    root = np.sqrt(own)
    scaled = mass / root[:, :, None] / root[:, None, :]
    if (
        plant.model.sensor_set == "joints"
        and np.linalg.eigvalsh(0.5 * (scaled + np.transpose(scaled, (0, 2, 1)))).min() <= 0.0
    ):
        what = "give a mass matrix that is not positive definite: no links have these"
        raise DataError.at("parameters", what, "give mass, centre and inertia of each link together")


def _start(plant: ArmPlant, reference: JointMotion, given: npt.ArrayLike | None) -> FloatArray:
    size = 2 * len(plant.joints)
    state = np.r_[reference.q[:, 0], reference.v[:, 0]] if given is None else np.array(given, dtype=float)
    if state.shape != (size,) or not np.isfinite(state).all():
        remedy = f"give {size} finite numbers: positions, then speeds, of {', '.join(plant.joints)}"
        raise DataError.at("initial_state", f"has shape {state.shape} or is not finite", remedy)
    return state


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
    names = [key.removeprefix("d1_q_") for key in simulation.true if key.startswith("d1_q_")]
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
