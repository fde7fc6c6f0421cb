"""Plant, controller, drive and excitation -> the motion, and all exact signals at the sample instants."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from math import inf

import numpy as np
import numpy.typing as npt

from modelgen.array_types import FloatArray, IntArray
from modelgen.errors import DataError, Problem
from modelgen.runtime.records.record import missing_name
from modelgen.runtime.simulation.closed_loop import PositionVelocityController, closed_loop, open_loop
from modelgen.runtime.simulation.drive import VELOCITIES, Drive, whole_steps
from modelgen.runtime.simulation.excitation import Excitation
from modelgen.runtime.simulation.plant import Plant, felt_accelerations
from modelgen.runtime.stick_slip.compiled_steps import Sampling, follow_controller
from modelgen.runtime.stick_slip.exact_steps import integrate
from modelgen.runtime.stick_slip.hybrid_system import Flow, Trajectory, refinement
from modelgen.runtime.stick_slip.linear_mode import FrictionSystem, Mode
from modelgen.runtime.stick_slip.sampled_controller import follow_ticks


@dataclass(frozen=True, eq=False)
class Motion:
    """States, shape (N, 2 bodies), modes, shape (N, sticking), their path, and the forces that drove them.

    `forces` holds those of all actuators, shape (N, columns of B); `command` is what the controller asks for,
    shape (N,).
    """

    states: FloatArray
    modes: npt.NDArray[np.int8]
    path: Trajectory
    forces: FloatArray
    command: FloatArray


def move(
    plant: Plant,
    controller: PositionVelocityController,
    drive: Drive,
    excitation: Excitation,
    initial: FloatArray,
    oversample: int,
) -> Motion:
    """Return the motion at every `oversample`-th step of the excitation.

    The controller drives the plant's own actuator; the forces of further ones are the excitation's.
    `initial`, in SI, holds positions, then velocities, shape (2 bodies,); a current loop starts at no force.
    """
    initial = np.r_[initial, [0.0] * drive.lags]
    if drive.sampled:
        return _sampled(plant, controller, drive, excitation, initial, oversample)
    loop = ContinuousLoop(plant, controller, drive.bandwidth_hz, tuple(_further(plant, excitation)))
    return loop.moved(excitation, initial, oversample)


@dataclass(frozen=True, eq=False)
class ContinuousLoop:
    """A chain with a continuous controller, ready for any stretch of time; `further` are columns of B."""

    plant: Plant
    controller: PositionVelocityController
    bandwidth_hz: float = inf
    further: tuple[int, ...] = ()

    @cached_property
    def system(self) -> FrictionSystem:
        """The linear system with Coulomb friction."""
        return closed_loop(self.plant, self.controller, self.bandwidth_hz, self.further)

    def moved(
        self, excitation: Excitation, initial: FloatArray, oversample: int = 1, mode: Mode | None = None
    ) -> Motion:
        """Return the motion from a state, shape (states,), SI; `mode`: the bodies' modes where it goes on.

        Forces of actuators that are not among `further` are left out.
        """
        plant, controller = self.plant, self.controller
        given = {plant.further[key]: samples for key, samples in excitation.forces.items()}
        further = {column: given[column] for column in self.further}
        rate = controller.rate_gain * excitation.reference_rate
        inputs = controller.kp * excitation.reference + controller.kv * rate + excitation.feedforward
        inputs = np.column_stack((inputs, *further.values()))
        path = integrate(self.system, initial, inputs, 1.0 / excitation.rate_hz, oversample, mode)
        n = len(plant.bodies)
        x = path.states[:, : 2 * n]
        q, v = x[:, plant.driven], x[:, n + plant.driven]
        # summed up from differences: the large numbers of a long travel cancel before they are multiplied
        r, r_rate, feedforward = (
            array[::oversample] for array in (excitation.reference, rate, excitation.feedforward)
        )
        command = controller.kp * (r - q) + controller.kv * (r_rate - v) + feedforward
        lags = path.states.shape[1] > 2 * n
        forces = _forces(plant, path.states[:, -1] if lags else command, further, oversample)
        return Motion(x, path.modes, path, forces, command)


def _sampled(
    plant: Plant,
    controller: PositionVelocityController,
    drive: Drive,
    excitation: Excitation,
    initial: FloatArray,
    oversample: int,
) -> Motion:
    """The controller acts at its own rate, at a whole number of internal steps."""
    further = _further(plant, excitation)
    system = open_loop(plant, drive.bandwidth_hz, tuple(further))
    internal_hz = excitation.rate_hz
    tick_hz = drive.rate_hz or internal_hz / oversample
    refine = refinement(system, 1.0 / internal_hz)
    per_tick = whole_steps("rate_hz", 1.0 / tick_hz, internal_hz, least=1)
    delay = refine * whole_steps("delay_s", drive.delay_s, internal_hz)
    flow = Flow(system, 1.0 / (internal_hz * refine))
    n, k = len(plant.bodies), np.arange(0, excitation.reference.size, oversample) * refine
    law = (
        controller.kp,
        controller.kv,
        drive.encoder_step,
        drive.limit,
        float(VELOCITIES[drive.velocity]),
        float(plant.driven),
        float(n + plant.driven),
        1.0 / tick_hz,
        flow.step_s,
    )
    reference = np.column_stack(
        (excitation.reference, controller.rate_gain * excitation.reference_rate, excitation.feedforward)
    )[::per_tick]
    sampling = Sampling(law, reference, per_tick * refine, delay)
    steps = (excitation.reference.size - 1) * refine
    stride = oversample * refine
    if further:
        known = np.column_stack(list(further.values()))
        path, commands = follow_ticks(flow, initial, sampling, known, stride, refine)
    else:
        path, commands = follow_controller(flow, initial, sampling, stride, steps)
    command = commands[k // sampling.per_tick]
    held = np.where(k >= delay, commands[np.maximum(k - delay, 0) // sampling.per_tick], 0.0)
    forces = _forces(plant, path.states[:, -1] if drive.lags else held, further, oversample)
    return Motion(path.states[:, : 2 * n], path.modes, path, forces, command)


def _further(plant: Plant, excitation: Excitation) -> dict[int, FloatArray]:
    """Return the forces of further actuators that do not rest, by column of B."""
    where = f"excitation {excitation.name}: forces"
    strange = [
        Problem(where, f"name {key}, which the controller drives", "give it as feedforward")
        if key == plant.force
        else missing_name(where, "further actuator", key, plant.further)
        for key in excitation.forces
        if key not in plant.further
    ]
    DataError.raise_any(strange)
    return {plant.further[key]: samples for key, samples in excitation.forces.items() if samples.any()}


def _forces(
    plant: Plant, driving: FloatArray, further: Mapping[int, FloatArray], oversample: int
) -> FloatArray:
    """Return the forces of all actuators at the sample instants, shape (N, columns of B)."""
    forces = np.zeros((len(driving), len(plant.model.actuators)))
    forces[:, plant.actuator] = driving
    for column, samples in further.items():
        forces[:, column] = samples[::oversample]
    return forces


def true_signals(plant: Plant, motion: Motion) -> dict[str, FloatArray]:
    """Return the exact signals at the sample instants, shape (N,) each, in SI; channels come first."""
    model, n = plant.model, len(plant.bodies)
    x, modes, forces = motion.states, motion.modes, motion.forces
    acceleration, friction, sensed = _outputs(plant, x, modes, forces)
    true = {entry.key: forces[:, i] for i, entry in enumerate(model.actuators)}
    true |= {sensor.key: sensed[:, i] for i, sensor in enumerate(model.sensors)}
    for i, body in enumerate(plant.bodies):
        for prefix, array in (("q", x[:, i]), ("v", x[:, n + i]), ("a", acceleration[:, i])):
            true.setdefault(f"{prefix}_{body}", array)
        true.setdefault(f"sign_{body}", np.sign(x[:, n + i]))
    for j, entry in enumerate(model.friction):
        true.setdefault(f"friction_{entry.body}", friction[:, j])
    for i, j in enumerate(plant.sticking):
        true.setdefault(f"mode_{model.friction[j].body}", modes[:, i].astype(float))
    true.setdefault(f"command_{model.actuators[plant.actuator].key}", motion.command)
    return true


def readings(plant: Plant, motion: Motion) -> dict[str, FloatArray]:
    """Return what actuators and sensors read at the sample instants, shape (N,) each, in SI; no more."""
    model, space = plant.model, plant.space((1,) * len(plant.sticking))
    found = {entry.key: motion.forces[:, i] for i, entry in enumerate(model.actuators)}
    # what moves and how fast is seen alike in every mode; only what accelerates it is not
    felt = [
        sensor.measures == "acceleration" or space.D[i].any() or space.F[i].any()
        for i, sensor in enumerate(model.sensors)
    ]
    if any(felt):
        sensed = _outputs(plant, motion.states, motion.modes, motion.forces)[2]
    for i, sensor in enumerate(model.sensors):
        used = np.flatnonzero(space.C[i])  # of the states of a long chain, few
        found[sensor.key] = sensed[:, i] if felt[i] else motion.states[:, used] @ space.C[i, used]
    return found


def _outputs(
    plant: Plant, x: FloatArray, modes: npt.NDArray[np.int8], forces: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return accelerations of the bodies, friction forces and sensor readings, one column each."""
    n = len(plant.bodies)
    acceleration = np.empty((len(x), n))
    friction = np.tile(plant.offsets, (len(x), 1))
    sensed = np.empty((len(x), len(plant.model.sensors)))
    cubes = plant.cubic_forces()
    springs = np.zeros_like(x if cubes else x[:0])
    for spring in cubes:
        springs += np.outer((x @ spring.deflection) ** 3, spring.push)
    for rows, mode in _rows_by_space(plant, modes):
        space = plant.space(mode)
        moving, pushed, f = x[rows], forces[rows], friction[rows]
        # in place: arrays of a long chain are large
        free = moving @ space.A[n:].T
        free += pushed @ space.B[n:].T
        if cubes:
            free += springs[rows, n:]
        resting = []
        for j, body, sign in zip(plant.sticking, plant.coulomb_bodies, modes[rows].T, strict=True):
            f[:, j] += np.where(sign > 0, body.plus, -body.minus)
            resting.append((np.flatnonzero(sign == 0), body.velocity - n))
            at_rest, velocity = resting[-1]
            f[at_rest, j] = free[at_rest, velocity] * body.inertia  # what holds it
        free += f @ space.E[n:].T
        for at_rest, velocity in resting:
            free[at_rest, velocity] = 0.0  # exactly, where the line above leaves rounding errors
        acceleration[rows] = free
        read = moving @ space.C.T
        read += pushed @ space.D.T
        read += f @ space.F.T
        sensed[rows] = read
        friction[rows] = f
    if cubes:
        sensed += springs[:, n:] @ felt_accelerations(plant.model).T
    return acceleration, friction, sensed


def _rows_by_space(
    plant: Plant, modes: npt.NDArray[np.int8]
) -> Iterator[tuple[slice | IntArray, tuple[int, ...]]]:
    """Yield the samples that have the same matrices, and a mode with these, a sign a body.

    They depend on the directions of bodies whose friction does; in most chains on none.
    """
    asymmetric = [place for place, j in enumerate(plant.sticking) if plant.model.friction[j].asymmetric]
    # a number from 0 on for all directions together: counting needs no sorting
    codes = np.zeros(len(modes), dtype=np.int64)
    for place in asymmetric:
        codes = 2 * codes + (modes[:, place] < 0)
    for code in np.flatnonzero(np.bincount(codes)).tolist() if asymmetric else [0]:
        rows = np.flatnonzero(codes == code) if asymmetric else slice(None)
        mode = np.ones(modes.shape[1], dtype=int)
        mode[asymmetric] = [1 - 2 * (code >> k & 1) for k in reversed(range(len(asymmetric)))]
        yield rows, tuple(mode.tolist())
