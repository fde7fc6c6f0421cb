"""The motion of an arm in closed loop: Newton's method on stretches of time, stick and slip step by step.

Around a motion that is supposed, the equations are linear with coefficients that change in time; those are
computed for all nodes of a stretch at once. Runge and Kutta's fourth order makes of them one matrix a step,
through which the states, and the friction of every speed, go node by node: a speed sticks where friction can
hold it over the step. The motion found is supposed next; it converges to that of the nonlinear equations.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from modelgen.array_types import FloatArray
from modelgen.errors import DataError
from modelgen.runtime.simulation.arms.arm_plant import ArmPlant
from modelgen.runtime.simulation.arms.friction_steps import FrictionSteps
from modelgen.runtime.simulation.arms.joint_motion import JointMotion
from modelgen.runtime.simulation.arms.thresholds import (
    RENEWED,
    ROUNDS,
    RUNAWAY,
    SETTLED,
    SMALLEST_WINDOW,
    WINDOW,
)


class Push(Protocol):
    """What pushes the rows: a controller's law, with or without measured forces."""

    def at(self, q: FloatArray, v: FloatArray, start: int) -> FloatArray:
        """Return the push in the rows, shape (joints, N), at half steps from node `start` on."""

    def slopes(self, q: FloatArray, v: FloatArray, start: int) -> tuple[FloatArray, FloatArray]:
        """Return its derivatives by q and q', shape (N, joints, joints) each, at the same places."""


@dataclass(frozen=True, eq=False)
class ArmMotion:
    """The motion found, signs of friction's speeds (+1, -1; 0 sticks), shape (C, N), and the rows' push."""

    motion: JointMotion
    modes: npt.NDArray[np.int8]
    push: FloatArray


@dataclass(frozen=True, eq=False)
class _Linear:
    """q'' = at_rest + by_q q + by_v v + by_signs s, at the half steps of a stretch."""

    at_rest: FloatArray
    by_q: FloatArray
    by_v: FloatArray
    by_signs: FloatArray


def arm_motion(plant: ArmPlant, reference: JointMotion, push: Push, start: FloatArray) -> ArmMotion:
    """Return the motion from a state, positions then speeds, shape (2 joints,), at the reference's nodes.

    Raises
    ------
    DataError
        When it grows without bound.
    """
    n, rub = len(plant.joints), plant.rubbing
    q, v, a = (np.empty_like(one) for one in (reference.q, reference.v, reference.a))
    modes = np.zeros((len(rub.names), reference.n), dtype=np.int8)
    pushes = np.empty_like(q)
    begin, window, state = 0, WINDOW, np.asarray(start, dtype=float)
    while begin < reference.n - 1:
        stop = min(begin + window, reference.n - 1)
        found = _stretch(plant, reference.part(begin, stop + 1), push, state, begin)
        if found is None:
            if window <= SMALLEST_WINDOW:
                remedy = "check the controller, and that the parameters are those of links"
                at = f"after {begin / reference.rate_hz:.3g} s"
                raise DataError.at("simulation", f"the motion grows without bound {at}", remedy)
            window //= 2
            continue
        motion, signs, pushed = found
        part = slice(begin, stop + 1)
        q[:, part], v[:, part], a[:, part] = motion.q, motion.v, motion.a
        modes[:, part], pushes[:, part] = signs, pushed
        state, begin = np.r_[motion.q[:, -1], motion.v[:, -1]], stop
        window = min(2 * window, WINDOW)
    assert n == len(q)
    return ArmMotion(JointMotion(q, v, a, reference.rate_hz), modes, pushes)


def _stretch(
    plant: ArmPlant, reference: JointMotion, push: Push, state: FloatArray, begin: int
) -> tuple[JointMotion, npt.NDArray[np.int8], FloatArray] | None:
    """Return motion, signs and push of one stretch; None where the rounds do not come to rest."""
    n = len(plant.joints)
    q = reference.q + (state[:n] - reference.q[:, 0])[:, None]
    supposed = JointMotion(q, reference.v, reference.a, reference.rate_hz)
    slopes = None
    size = max(float(np.ptp(reference.q, axis=1).max()), 1e-3), max(float(np.abs(reference.v).max()), 1e-3)
    farthest = RUNAWAY * (np.array(size) + float(np.abs(state).max()))
    for turn in range(ROUNDS):
        if turn < RENEWED:
            slopes = plant.slopes(supposed.q, supposed.v, supposed.a)
        assert slopes is not None
        linear = _linear(plant, supposed, push, slopes, begin)
        steps = FrictionSteps(*_maps(linear, 1.0 / reference.rate_hz), plant.rubbing.levers)
        states, signs, forces = steps.run(state, 1.0 / reference.rate_hz)
        if not np.isfinite(states).all() or np.abs(states[:n]).max() > farthest[0]:
            return None
        now = _accelerated(linear, states, forces, reference.rate_hz)
        moved = [float(np.abs(x - y).max()) for x, y in ((now.q, supposed.q), (now.v, supposed.v))]
        supposed = now
        if all(m <= SETTLED * s for m, s in zip(moved, size, strict=True)):
            fine = now.finer(2)
            return now, signs, push.at(fine.q, fine.v, begin)[:, ::2]
    return None


def _linear(
    plant: ArmPlant, supposed: JointMotion, push: Push, slopes: tuple[FloatArray, FloatArray], begin: int
) -> _Linear:
    """Return the equations around a motion."""
    fine = supposed.finer(2)
    q, v, a = fine.q, fine.v, fine.a
    inverse = np.linalg.inv(at_half_steps(plant.mass(supposed.q, supposed.v)))
    given = push.slopes(q, v, begin)
    by_q, by_v = (inverse @ (p - at_half_steps(s)) for p, s in zip(given, slopes, strict=True))
    lacking = (push.at(q, v, begin) - plant.smooth(q, v, a)).T[:, :, None]
    columns = [x.T[:, :, None] for x in (q, v, a)]
    at_rest = columns[2] + inverse @ lacking - by_q @ columns[0] - by_v @ columns[1]
    return _Linear(at_rest, by_q, by_v, -inverse @ plant.rubbing.half)


def at_half_steps(nodes: FloatArray) -> FloatArray:
    """Return matrices at nodes, shape (N, ...), at half steps as well: cubic between the nodes."""
    found = np.empty((2 * len(nodes) - 1, *nodes.shape[1:]))
    found[::2] = nodes
    if len(nodes) < 4:
        found[1::2] = 0.5 * (nodes[1:] + nodes[:-1])
        return found
    found[3:-2:2] = (9.0 * (nodes[1:-2] + nodes[2:-1]) - nodes[:-3] - nodes[3:]) / 16.0
    found[1] = (5.0 * nodes[0] + 15.0 * nodes[1] - 5.0 * nodes[2] + nodes[3]) / 16.0
    found[-2] = (5.0 * nodes[-1] + 15.0 * nodes[-2] - 5.0 * nodes[-3] + nodes[-4]) / 16.0
    return found


def _maps(linear: _Linear, step_s: float) -> tuple[FloatArray, FloatArray]:
    """Return what a step makes of (q, v, 1), shape (K, 2 n, 2 n + 1), and of the signs, (K, 2 n, C)."""
    count, n, c = len(linear.at_rest) // 2, linear.by_q.shape[1], linear.by_signs.shape[2]
    further = np.concatenate((linear.at_rest, linear.by_signs), axis=2)
    parts = [(linear.by_q[k::2][:count], linear.by_v[k::2][:count], further[k::2][:count]) for k in (0, 1)]
    parts.append((linear.by_q[2::2], linear.by_v[2::2], further[2::2]))
    begin_q = np.zeros((count, n, 2 * n + 1 + c))
    begin_q[:, :, :n] = np.eye(n)
    begin_v = np.zeros_like(begin_q)
    begin_v[:, :, n : 2 * n] = np.eye(n)
    total_q, total_v = np.zeros_like(begin_q), np.zeros_like(begin_v)
    rate_q, rate_v = total_q, total_v
    for place, reach, weight in ((0, 0.0, 1.0), (1, 0.5, 2.0), (1, 0.5, 2.0), (2, 1.0, 1.0)):
        by_q, by_v, other = parts[place]
        here_q, here_v = begin_q + reach * step_s * rate_q, begin_v + reach * step_s * rate_v
        rate_q, rate_v = here_v, by_q @ here_q + by_v @ here_v
        rate_v[:, :, 2 * n :] += other
        total_q, total_v = total_q + weight * rate_q, total_v + weight * rate_v
    maps = np.concatenate((begin_q + step_s / 6.0 * total_q, begin_v + step_s / 6.0 * total_v), axis=1)
    return maps[:, :, : 2 * n + 1], maps[:, :, 2 * n + 1 :]


def _accelerated(linear: _Linear, states: FloatArray, forces: FloatArray, rate_hz: float) -> JointMotion:
    """Return states, shape (2 n, N), with the accelerations that belong to them."""
    n = len(states) // 2
    q, v = states[:n], states[n:]
    every = (
        linear.at_rest[::2]
        + linear.by_q[::2] @ q.T[:, :, None]
        + linear.by_v[::2] @ v.T[:, :, None]
        + linear.by_signs[::2] @ forces.T[:, :, None]
    )
    return JointMotion(q, v, every[:, :, 0].T, rate_hz)
