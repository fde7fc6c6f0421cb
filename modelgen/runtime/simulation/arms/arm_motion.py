"""The motion of an arm in closed loop: Newton's method on stretches of time, stick and slip step by step.

Around a motion that is supposed, the equations are linear with coefficients that change in time; those are
computed for all nodes of a stretch at once. Magnus' expansion makes of them one exponential a step: of fourth
order, and exact, however stiff springs are, where the coefficients do not change. Through these the states,
and the friction of every speed, go node by node: a speed sticks where friction can hold it over the step. The
motion found is supposed next; it converges to that of the nonlinear equations.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from math import factorial
from typing import Protocol

import numpy as np
import numpy.typing as npt

from modelgen.array_types import FloatArray
from modelgen.errors import DataError
from modelgen.runtime.simulation.arms.arm_plant import ArmPlant
from modelgen.runtime.simulation.arms.friction_steps import FrictionSteps
from modelgen.runtime.simulation.arms.joint_motion import JointMotion
from modelgen.runtime.simulation.arms.thresholds import (
    DEGREES,
    PARTS,
    RENEWED,
    ROUNDED,
    ROUNDS,
    RUNAWAY,
    SETTLED,
    SLOWEST,
    SMALLEST_WINDOW,
    WINDOW,
)


class Push(Protocol):
    """What pushes the rows, in SI: a controller's law, with or without measured forces."""

    def at(self, q: FloatArray, v: FloatArray, start: int) -> FloatArray:
        """Return the push in the rows, shape (coordinates, N), at half steps from node `start` on."""

    def slopes(self, q: FloatArray, v: FloatArray, start: int) -> tuple[FloatArray, FloatArray]:
        """Return its derivatives by q and q', shape (N, coordinates, coordinates), at the same places."""


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
    """Return the motion from a state, positions then speeds, shape (2 coordinates,), SI, at the nodes.

    `reference` is the motion of the coordinates that is supposed at first.

    Raises
    ------
    DataError
        When it grows without bound.
    """
    rub = plant.rubbing
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
    return ArmMotion(JointMotion(q, v, a, reference.rate_hz), modes, pushes)


def _stretch(
    plant: ArmPlant, reference: JointMotion, push: Push, state: FloatArray, begin: int
) -> tuple[JointMotion, npt.NDArray[np.int8], FloatArray] | None:
    """Return motion, signs and push of one stretch; None where the rounds do not come to rest."""
    n = len(reference.q)
    q = reference.q + (state[:n] - reference.q[:, 0])[:, None]
    supposed = JointMotion(q, reference.v, reference.a, reference.rate_hz)
    slopes = None
    size = max(float(np.ptp(reference.q, axis=1).max()), 1e-3), max(float(np.abs(reference.v).max()), 1e-3)
    farthest = RUNAWAY * (np.array(size) + float(np.abs(state).max()))
    for turn in range(ROUNDS):
        if turn < RENEWED:
            slopes = plant.slopes(supposed.q, supposed.v, supposed.a)
        assert slopes is not None
        try:
            linear = _linear(plant, supposed, push, slopes, begin)
        except np.linalg.LinAlgError:  # rounds that diverge pass motions whose masses are all rounding
            return None
        step_s = 1.0 / reference.rate_hz
        # the first round is around a motion that is not the one sought
        parts = partial(_parts, linear, step_s) if turn else None
        steps = FrictionSteps(*_maps(linear, step_s), plant.rubbing.levers, parts)
        states, signs, forces = steps.run(state, step_s)
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
    """Return matrices at nodes, of any unit, shape (N, ...), at half steps as well: cubic between nodes."""
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
    """Return what a step makes of (q, v, 1), shape (K, 2 n, 2 n + 1), and of the signs, (K, 2 n, C).

    Magnus' expansion by Simpson's rule (Iserles et al. 2000): the exponential of
    h (A0 + 4 A1 + A2) / 6 + h^2 (A2 A0 - A0 A2) / 12, with A at begin, middle and end of the step. What does
    not depend on the state is a parabola in time through the same places, integrated exactly.
    """
    h, n = step_s, linear.by_q.shape[1]
    further = np.concatenate((linear.at_rest, linear.by_signs), axis=2)
    # speeds in a unit in which both halves of the exponent are about as large
    unit = float(np.sqrt(np.clip(h**2 * np.abs(linear.by_q).sum(axis=2).max(), SLOWEST, 1.0)))
    by_q, by_v, forced = h**2 / unit * linear.by_q, h * linear.by_v, h**2 / unit * further
    (q0, q1, q2), (v0, v1, v2), (f0, f1, f2) = ((x[:-1:2], x[1::2], x[2::2]) for x in (by_q, by_v, forced))
    exponent = np.zeros((len(q0), 2 * n, 2 * n))
    exponent[:, :n, :n], exponent[:, :n, n:] = unit * (q0 - q2) / 12.0, unit * (np.eye(n) + (v0 - v2) / 12.0)
    exponent[:, n:, :n] = (q0 + 4.0 * q1 + q2) / 6.0 + (v2 @ q0 - v0 @ q2) / 12.0
    exponent[:, n:, n:] = (v0 + 4.0 * v1 + v2) / 6.0 + (unit * (q2 - q0) + v2 @ v0 - v0 @ v2) / 12.0
    parabola = np.zeros((3, len(q0), 2 * n, forced.shape[2]))
    parabola[0, :, n:] = f0 + (v2 - v0) @ (f0 + 4.0 * f1 + f2) / 72.0
    parabola[1, :, n:], parabola[2, :, n:] = 4.0 * f1 - 3.0 * f0 - f2, 4.0 * (f0 - 2.0 * f1 + f2)
    found = _series(exponent, parabola)
    found[:, n:] *= unit / h
    found[:, :, n : 2 * n] *= h / unit
    return found[:, :, : 2 * n + 1], found[:, :, 2 * n + 1 :]


def _parts(linear: _Linear, step_s: float, k: int) -> tuple[FloatArray, FloatArray]:
    """Return the maps of the parts of step k: coefficients are parabolas in time through its three places."""
    t = np.arange(2 * PARTS + 1) / (2.0 * PARTS)
    shares = np.stack(((1.0 - t) * (1.0 - 2.0 * t), 4.0 * t * (1.0 - t), t * (2.0 * t - 1.0)), axis=1)
    every = (linear.at_rest, linear.by_q, linear.by_v, linear.by_signs)
    fine = (np.tensordot(shares, one[2 * k : 2 * k + 3], axes=1) for one in every)
    return _maps(_Linear(*fine), step_s / PARTS)


def _series(exponent: FloatArray, parabola: FloatArray) -> FloatArray:
    """Return the exponential and the sums of E^j p_k / (j + k + 1)!, k = 0, 1, 2: Horner's rule."""
    size = exponent.shape[1]
    norm = float(np.abs(exponent).sum(axis=2).max(initial=0.0))
    degree = next((k for k in range(4, DEGREES) if norm**k < ROUNDED * factorial(k)), DEGREES)
    total = np.zeros((len(exponent), size, size + parabola.shape[3]))
    for j in range(degree, -1, -1):
        total = exponent @ total
        total[:, :, :size] += np.eye(size) / factorial(j)
        total[:, :, size:] += sum(one / factorial(j + k) for k, one in enumerate(parabola, start=1))
    return total


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
