"""Exact motion of a linear system with true Coulomb friction, from one stick or slip event to the next.

Blocks of steps are propagated at once in the present mode (`friction_mode`) and checked for events; only a
step with an event is entered, where the event is a root of a polynomial (`crossing`). No smoothing, no solver
tolerance. What follows an event is decided by the net force, so that a body does not chatter around rest.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from modelgen.errors import DataError
from modelgen.runtime.crossing import LARGEST_NORM, power_series, value_at
from modelgen.runtime.friction_mode import CoulombBody, FrictionSystem, Mode, ModeMotion

FloatArray = npt.NDArray[np.float64]

# Steps propagated at once: few after an event, twice as many after every calm block.
FIRST_BLOCK = 64
LARGEST_BLOCK = 4096
# A step may be divided into as many parts, where the chain has motions much faster than it.
FINEST_STEP = 1000
# More events than this within one step mean that the input is sampled too coarsely to resolve them.
MOST_EVENTS_A_STEP = 200


@dataclass(frozen=True)
class Event:
    """At `time_s` the body (index into `FrictionSystem.bodies`) changes to `mode`."""

    time_s: float
    body: int
    mode: int


@dataclass(frozen=True, eq=False)
class Trajectory:
    """States, shape (N, 2n), and modes, shape (N, bodies), at every `stride`-th step; all events."""

    states: FloatArray
    modes: npt.NDArray[np.int8]
    events: tuple[Event, ...]


def integrate(
    system: FrictionSystem, initial: FloatArray, inputs: FloatArray, step_s: float, stride: int = 1
) -> Trajectory:
    """Return the exact motion under a piecewise linear input.

    Parameters
    ----------
    system : FrictionSystem
        The system (SI). Every body starts in the mode that its velocity, or else the force on it, asks for.
    initial : ndarray, shape (2n,)
        State at time 0.
    inputs : ndarray, shape (K + 1, m)
        Input w at the times 0, step_s, ..., K step_s; linear in between.
    step_s : float
        Step in s.
    stride : int
        Keep every `stride`-th step.

    Raises
    ------
    DataError
        When the motion grows without bound, is too fast for the steps, or sticks and slips too often.
    """
    refine = _refinement(system, step_s)
    step_s, stride, steps = step_s / refine, stride * refine, (len(inputs) - 1) * refine
    flow = _Flow(system, step_s)
    states = np.empty((steps // stride + 1, initial.size))
    modes = np.empty((len(states), len(system.bodies)), dtype=np.int8)
    x = initial * flow.scale
    mode = flow.start(x, inputs[0])
    states[0], modes[0] = x, mode
    events: list[Event] = []
    k, block = 0, FIRST_BLOCK
    while k < steps:
        count = min(block, steps - k)
        w = _between(inputs, np.arange(k, k + count + 1) / refine)
        path, calm = flow.motion(mode).advance(x, w)
        if not np.isfinite(path).all():
            what = f"grows without bound before {(k + count) * step_s:.6g} s"
            raise DataError.at("simulation", what, "lower the gains, or check the signs of the parameters")
        _keep(states, modes, stride, k + 1, path[:calm], mode)
        k += calm
        x = path[calm - 1] if calm else x
        block = min(2 * block, LARGEST_BLOCK)
        if calm < count:
            x, mode, found = flow.cross(k, mode, x, w[calm], w[calm + 1])
            k += 1
            _keep(states, modes, stride, k, x[None], mode)
            events += found
            block = FIRST_BLOCK
    return Trajectory(states / flow.scale, modes, tuple(events))


def _refinement(system: FrictionSystem, step_s: float) -> int:
    """Return into how many parts a step is to be divided; exact steps stay exact."""
    n = system.drift.size // 2
    scale = np.r_[np.ones(n), np.full(n, step_s)]
    matrices = (system.matrix((sign,) * len(system.bodies)) for sign in (1, -1))
    norm = max(np.abs(step_s * scale[:, None] * A / scale).sum(axis=0).max() for A in matrices)
    if not norm < LARGEST_NORM * FINEST_STEP:
        what = f"has a motion too fast ({step_s / norm:.2g} s) for steps of {step_s:.2g} s"
        raise DataError.at("simulation", what, "raise fs, or leave out what is almost rigid")
    return max(1, int(np.ceil(norm / LARGEST_NORM)))


def _between(inputs: FloatArray, k: FloatArray) -> FloatArray:
    """Return the piecewise linear inputs at the fractional steps k."""
    i = np.minimum(k.astype(int), len(inputs) - 2)
    values: FloatArray = inputs[i] + (k - i)[:, None] * (inputs[i + 1] - inputs[i])
    return values


def _keep(
    states: FloatArray, modes: npt.NDArray[np.int8], stride: int, first: int, path: FloatArray, mode: Mode
) -> None:
    """Store those rows of `path`, which begins at step `first`, that fall on the stride."""
    skip = -first % stride
    kept = path[skip::stride]
    row = (first + skip) // stride
    states[row : row + len(kept)] = kept
    modes[row : row + len(kept)] = mode


class _Flow:
    """The system in time units of steps, with one `ModeMotion` per mode, made when first needed."""

    def __init__(self, system: FrictionSystem, step_s: float) -> None:
        n = system.drift.size // 2
        self.step_s = step_s
        self.scale = np.r_[np.ones(n), np.full(n, step_s)]
        rate = step_s * self.scale
        self.system = FrictionSystem(
            matrix=lambda mode: rate[:, None] * system.matrix(mode) / self.scale,
            B=rate[:, None] * system.B,
            drift=rate * system.drift,
            bodies=tuple(
                CoulombBody(body.velocity, body.inertia / step_s**2, body.plus, body.minus)
                for body in system.bodies
            ),
        )
        self._motions: dict[Mode, ModeMotion] = {}

    def motion(self, mode: Mode) -> ModeMotion:
        """Return the motion in this mode."""
        if mode not in self._motions:
            self._motions[mode] = ModeMotion(self.system, mode)
        return self._motions[mode]

    def start(self, x: FloatArray, w: FloatArray) -> Mode:
        """Return the mode of every body at the start."""
        resting = self.motion((0,) * len(self.system.bodies))
        z = np.r_[x, w, 0.0 * w, 1.0]
        signs = (int(np.sign(x[body.velocity])) for body in self.system.bodies)
        return tuple(sign or resting.mode_at_rest(j, z) for j, sign in enumerate(signs))

    def cross(
        self, k: int, mode: Mode, x: FloatArray, w: FloatArray, w_end: FloatArray
    ) -> tuple[FloatArray, Mode, list[Event]]:
        """Go through step k from event to event; return the state and mode at its end, and the events."""
        z = np.r_[x, w, w_end - w, 1.0]
        left = 1.0
        events: list[Event] = []
        released: tuple[int, ...] = ()
        while left > 0.0:
            motion = self.motion(mode)
            series = power_series(motion.M * left, z)
            u, guard = motion.first_event(series, released)
            z = value_at(series, u)
            left -= u * left
            if guard is None:
                break
            released = released if u == 0.0 else ()
            body, sign = motion.after(guard, z)
            if mode[body] == 0:
                released = (*released, body)
            else:
                z[self.system.bodies[body].velocity] = 0.0
            mode = (*mode[:body], sign, *mode[body + 1 :])
            events.append(Event((k + 1.0 - left) * self.step_s, body, sign))
            if len(events) > MOST_EVENTS_A_STEP:
                what = f"sticks and slips more than {MOST_EVENTS_A_STEP} times within one step"
                raise DataError.at(f"simulation at {events[-1].time_s:.6g} s", what, "raise oversample")
        return z[: x.size], mode, events
