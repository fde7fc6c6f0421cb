"""Flow: a system with Coulomb friction in time units of steps, and the integration of a step with events.

The net force decides on the mode after an event, so that a body does not chatter around rest.
"""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from numpy.linalg import matrix_power

from modelgen.array_types import FloatArray
from modelgen.errors import DataError
from modelgen.runtime.stick_slip.linear_mode import CoulombBody, CubicForce, FrictionSystem, Mode, ModeMotion
from modelgen.runtime.stick_slip.root_finding import LARGEST_NORM, power_series, value_at

# A step may be divided into as many parts, where the chain has motions much faster than it.
FINEST_STEP = 1000
# More events than this within one step mean that the input is sampled too coarsely to resolve them.
MOST_EVENTS_A_STEP = 200


class Event(NamedTuple):
    """At `time_s` the body (index into `FrictionSystem.bodies`) changes to `mode`."""

    time_s: float
    body: int
    mode: int


@dataclass(frozen=True, eq=False)
class Trajectory:
    """States, shape (N, states), in SI, and modes, shape (N, bodies), at every `stride`-th step.

    `changes` are all events: time in s, body, mode, shape (events, 3).
    """

    states: FloatArray
    modes: npt.NDArray[np.int8]
    changes: FloatArray

    @cached_property
    def events(self) -> tuple[Event, ...]:
        """The changes of mode, in their order; thousands, where noise moves a body about rest."""
        times_s, *numbers = self.changes.T
        return tuple(map(Event, times_s.tolist(), *(one.astype(int).tolist() for one in numbers)))


def refinement(system: FrictionSystem, step_s: float) -> int:
    """Return into how many parts a step is to be divided, as few as the series of an event allows.

    Exact steps stay exact. The series has M^24 = (M^8)^3: the root of the norm of M^8 tells how it converges.

    Raises
    ------
    DataError
        When the system has motions too fast for any reasonable part of the step.
    """

    def norm(parts: int, power: int) -> float:
        part_s = step_s / parts
        scale = system.scale(part_s)
        moves = (matrix_power(part_s * scale[:, None] * A / scale, power) for A in system.both_ways)
        return max(float(np.abs(M).sum(axis=0).max()) for M in moves)

    whole = norm(1, 1)
    if not whole < LARGEST_NORM * FINEST_STEP:
        what = f"has a motion too fast ({step_s / whole:.2g} s) for steps of {step_s:.2g} s"
        raise DataError.at("simulation", what, "raise fs, or leave out what is almost rigid")
    # velocities take positions along by one a part, whatever its length; all else is shorter with it
    enough = max(1, int(np.ceil(whole)))
    return bisect_left(range(1, enough), -(LARGEST_NORM**8), key=lambda parts: -norm(parts, 8)) + 1


class Flow:
    """The system in time units of steps, with one `ModeMotion` per mode, made when first needed."""

    def __init__(self, system: FrictionSystem, step_s: float) -> None:
        self.step_s = step_s
        self.scale = system.scale(step_s)
        rate = step_s * self.scale
        forward, backward = (rate[:, None] * A / self.scale for A in system.both_ways)
        own = [body.velocity for body in system.bodies]

        def matrix(mode: Mode) -> FloatArray:
            # a direction matters in its body's own damping only, and at rest not at all
            A: FloatArray = forward.copy()
            for row, sign in zip(own, mode, strict=True):
                if sign < 0:
                    A[row, row] = backward[row, row]
            return A

        self.system = FrictionSystem(
            matrix=matrix,
            B=rate[:, None] * system.B,
            drift=rate * system.drift,
            bodies=tuple(
                CoulombBody(body.velocity, body.inertia / step_s**2, body.plus, body.minus)
                for body in system.bodies
            ),
            springs=tuple(
                CubicForce(spring.deflection / self.scale, rate * spring.push) for spring in system.springs
            ),
        )
        self._motions: dict[Mode, ModeMotion] = {}

    def motion(self, mode: Mode) -> ModeMotion:
        """Return the motion in this mode."""
        if mode not in self._motions:
            self._motions[mode] = ModeMotion(self.system, mode)
        return self._motions[mode]

    def start(self, x: FloatArray, w: FloatArray) -> Mode:
        """Return the mode of every body at state x, shape (2n + lags,), and input w, shape (m,)."""
        resting = self.motion((0,) * len(self.system.bodies))
        z = np.r_[x, w, 0.0 * w, 1.0]
        signs = (int(np.sign(x[body.velocity])) for body in self.system.bodies)
        return tuple(sign or resting.mode_at_rest(j, z) for j, sign in enumerate(signs))

    def cross(
        self, k: int, mode: Mode, x: FloatArray, w: FloatArray, w_end: FloatArray
    ) -> tuple[FloatArray, Mode, list[Event]]:
        """Integrate step k from event to event; return the state and mode at its end, and the events.

        The state `x` has shape (2n + lags,), in the time unit of steps; the inputs `w` at the start and
        `w_end` at the end have shape (m,).
        """
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
                raise too_many_events(events[-1].time_s)
        return z[: x.size], mode, events


def too_many_events(time_s: float) -> DataError:
    """Return the error for a step within which a body sticks and slips without end."""
    what = f"sticks and slips more than {MOST_EVENTS_A_STEP} times within one step"
    return DataError.at(f"simulation at {time_s:.6g} s", what, "raise oversample")


def unbounded(time_s: float) -> DataError:
    """Return the error for a motion that leaves all bounds."""
    what = f"grows without bound before {time_s:.6g} s"
    return DataError.at("simulation", what, "lower the gains, or check the signs of the parameters")
