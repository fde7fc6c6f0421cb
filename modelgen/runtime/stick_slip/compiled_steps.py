"""From a Flow to the arrays that `event_kernel` works on, and back; compiled where numba is installed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from inspect import getmembers, getsource, isfunction
from itertools import product
from typing import Any
from zlib import crc32

import numpy as np

import modelgen.runtime.stick_slip.cubic_spring_kernel as cubic_spring_kernel
import modelgen.runtime.stick_slip.event_free_kernel as event_free_kernel
import modelgen.runtime.stick_slip.event_kernel as event_kernel
import modelgen.runtime.stick_slip.root_finding as root_finding
from modelgen.array_types import FloatArray
from modelgen.errors import DataError
from modelgen.runtime.numerics.numba_support import kept_code
from modelgen.runtime.stick_slip.event_free_kernel import LANES
from modelgen.runtime.stick_slip.event_kernel import EVENTS_FULL, TOO_MANY, UNBOUNDED, run
from modelgen.runtime.stick_slip.hybrid_system import Flow, Trajectory, too_many_events, unbounded
from modelgen.runtime.stick_slip.linear_mode import FrictionSystem, Mode, ModeMotion

# All modes are tabulated in advance, three a body; with more bodies with friction the table is too large.
MOST_BODIES = 5
# Where there is no other way they are tabulated up to here: 3^8 modes.
LARGEST_TABLE = 8
FIRST_EVENTS = 4096
# Room for one event in so many steps is made at once; what is not used is never touched.
STEPS_AN_EVENT = 16
# What `run` is made of, which is compiled with it.
PARTS = (root_finding, cubic_spring_kernel, event_free_kernel, event_kernel)


@dataclass(frozen=True, eq=False)
class Sampling:
    """What a sampled controller brings to the kernel.

    Attributes
    ----------
    law : tuple of 9 floats (SI)
        kp, kv, encoder step, limit, kind of velocity, rows of position and velocity in x, period of the
        controller, internal step.
    reference : ndarray, shape (ticks, 3)
        Reference, its rate (times its gain), feedforward at the controller's instants (SI).
    per_tick, delay : int
        Steps per tick of the controller, and from a tick until its command acts.
    """

    law: tuple[float, ...]
    reference: FloatArray
    per_tick: int
    delay: int


def can_compile(system: FrictionSystem) -> bool:
    """Return whether `follow_input` would be compiled, and may be used at all."""
    return len(system.bodies) <= MOST_BODIES and system.B.shape[1] == 1 and has_numba()


@lru_cache(maxsize=1)
def has_numba() -> bool:
    """Return whether numba is installed, and goes with the other packages that are."""
    try:
        import numba  # noqa: F401
    except Exception:  # its versions are particular about NumPy's
        return False
    return True


def follow_input(
    flow: Flow,
    initial: FloatArray,
    w: FloatArray,
    stride: int,
    steps_a_node: int = 1,
    mode: Mode | None = None,
) -> Trajectory:
    """Return the motion under an input `w` known every so many steps, shape (nodes,), linear in between.

    `initial` is the state in SI, shape (2n + lags,); `mode` are those of the bodies where a motion goes on.
    """
    nothing = Sampling((0.0,) * 7 + (1.0, 1.0), np.zeros((1, 3)), steps_a_node, 0)
    steps = (len(w) - 1) * steps_a_node
    return _run(flow, initial, np.ascontiguousarray(w), nothing, stride, steps, mode)[0]


def follow_controller(
    flow: Flow, initial: FloatArray, sampling: Sampling, stride: int, steps: int
) -> tuple[Trajectory, FloatArray]:
    """Return the motion under a sampled controller, and its commands at the ticks, shape (ticks,).

    `initial` is the state in SI, shape (2n + lags,).
    """
    return _run(flow, initial, np.empty(0), sampling, stride, steps)


def _run(
    flow: Flow,
    initial: FloatArray,
    w: FloatArray,
    sampling: Sampling,
    stride: int,
    steps: int,
    mode: Mode | None = None,
) -> tuple[Trajectory, FloatArray]:
    bodies = len(flow.system.bodies)
    if bodies > LARGEST_TABLE:
        what = f"has {bodies} bodies with Coulomb friction, where {LARGEST_TABLE} are possible"
        remedy = "leave some friction out, or take a continuous controller and linear springs"
        raise DataError.at("simulation", what, remedy)
    x = initial * flow.scale
    q = x[int(sampling.law[5])]
    # positions before the start, which the controller needs: at the constant initial speed
    before = q - np.array([1.0, 2.0]) * sampling.law[7] * initial[int(sampling.law[6])]
    first = np.array([w[0] if w.size else 0.0])
    index = _index(flow.start(x, first) if mode is None else mode)
    capacity = max(FIRST_EVENTS, steps // STEPS_AN_EVENT)
    tables = _tables(flow)
    while True:
        states = np.empty((steps // stride + 1, x.size))
        modes = np.empty((len(states), bodies), dtype=np.int8)
        commands = np.zeros(0 if w.size else steps // sampling.per_tick + 1)
        events = np.empty((capacity, 3))
        events[-1] = -1.0
        with np.errstate(over="ignore", invalid="ignore"):
            status, count, k = _kernel()(
                x.copy(), index, tables, w,
                (sampling.law, sampling.reference, sampling.per_tick, sampling.delay, before.copy()),
                stride, steps, (states, modes, commands, events),
            )  # fmt: skip
        if status != EVENTS_FULL:
            break
        capacity *= 4
    if status == UNBOUNDED:
        raise unbounded((k + 1) * flow.step_s)
    if status == TOO_MANY:
        raise too_many_events((k + 1) * flow.step_s)
    return Trajectory(states, modes, events[:count] * (flow.step_s, 1.0, 1.0)), commands


@lru_cache(maxsize=4)
def _tables(flow: Flow) -> tuple[Any, ...]:
    """Return what one step needs of every mode, guards, M, free accelerations, owners, and the bodies."""
    bodies = flow.system.bodies
    motions = [flow.motion(mode) for mode in _modes(len(bodies))]
    most = max(len(motion.owners) for motion in motions)
    size, nx = len(motions[0].M), flow.scale.size
    guards, rates = np.zeros((2, len(motions), most, size))
    owners = np.zeros((len(motions), most, 2), dtype=np.int64)
    blocks = -(-nx // LANES)
    # z at the end of a step: x moves, the input by its slope
    ends = np.zeros((len(motions), size, size))
    ends[:] = np.eye(size)
    ends[:, nx, nx + 1] = 1.0
    for i, motion in enumerate(motions):
        here = len(motion.owners)
        guards[i, :here], rates[i, :here] = motion.guards, motion.rates
        owners[i, :here] = np.array(motion.owners, dtype=np.int64).reshape(here, 2)
        ends[i, :nx] = motion.step
    ahead = np.zeros((len(motions), LANES * blocks + LANES * most, size))
    ahead[:, :nx] = ends[:, :nx]
    ahead[:, LANES * blocks :: LANES], ahead[:, LANES * blocks + 1 :: LANES] = guards @ ends, rates
    ahead[:, LANES * blocks + 2 :: LANES], ahead[:, LANES * blocks + 3 :: LANES] = rates @ ends, guards
    deflections, pushes, pulls = _spring_tables(flow, size, motions)
    numbers = [[body.velocity, body.inertia, body.plus, body.minus] for body in bodies]
    return (
        np.ascontiguousarray(ahead.reshape(len(motions), -1, LANES, size).swapaxes(2, 3)),
        guards,
        np.array([motion.M for motion in motions]),
        np.array([motion.free for motion in motions]).reshape(len(motions), len(bodies), size),
        owners,
        np.array([len(motion.owners) for motion in motions]),
        np.array(numbers, dtype=float).reshape(len(bodies), 4),
        deflections,
        pushes,
        pulls,
        np.array(_modes(len(bodies)), dtype=np.int8).reshape(len(motions), len(bodies)),
        flow.scale,
    )


def _spring_tables(
    flow: Flow, size: int, motions: list[ModeMotion]
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return of every cubic spring its deflection, its push in every mode, and what it does to each body."""
    springs, bodies, nx = flow.system.springs, flow.system.bodies, flow.scale.size
    deflections, pulls = np.zeros((len(springs), size)), np.zeros((len(springs), len(bodies)))
    pushes = np.zeros((len(motions), len(springs), size))
    for s, spring in enumerate(springs):
        deflections[s, :nx] = spring.deflection
        pulls[s] = spring.push[[body.velocity for body in bodies]]
        for i, motion in enumerate(motions):
            held = [b.velocity for b, sign in zip(bodies, motion.mode, strict=True) if sign == 0]
            pushes[i, s, :nx] = spring.push
            pushes[i, s, held] = 0.0
    return deflections, pushes, pulls


def _modes(bodies: int) -> list[tuple[int, ...]]:
    """Return all modes in the order of the tables."""
    return [mode[::-1] for mode in product((-1, 0, 1), repeat=bodies)]


def _index(mode: tuple[int, ...]) -> int:
    """Return a mode's place in the tables: its signs as digits to the base 3."""
    return sum((sign + 1) * 3**j for j, sign in enumerate(mode))


@lru_cache(maxsize=1)
def _kernel() -> Callable[..., tuple[int, int, int]]:
    """Return the kernel, compiled where numba is installed; the machine code is cached next to the module."""
    if not has_numba():
        return run
    import numba
    from numba.extending import register_jitable

    for module in PARTS:
        for _, part in getmembers(module, isfunction):
            if part.__module__ == module.__name__:
                register_jitable(part)
    # whole modules: their constants are part of the code, too
    sources = "".join(map(getsource, PARTS))
    return kept_code(numba.njit, _dated(crc32(sources.encode())), nogil=True)


def _dated(version: int) -> Callable[..., tuple[int, int, int]]:
    """Return `run` with a version in its closure: kept machine code is used for the same one only."""

    def steps(
        x: Any, m: int, tables: Any, w: Any, sampling: Any, stride: int, count: int, outputs: Any
    ) -> tuple[int, int, int]:
        if version < 0:
            return UNBOUNDED, 0, 0
        return run(x, m, tables, w, sampling, stride, count, outputs)

    return steps
