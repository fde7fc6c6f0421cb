"""Exact motion of a linear system with true Coulomb friction, from one stick or slip event to the next.

Blocks of steps are propagated at once in the present mode (`linear_mode`) and checked for events; only a
step with an event is divided, where the event is a root of a polynomial (`root_finding`). No smoothing, no
solver tolerance. With numba (the extra "fast") the steps are taken one by one in compiled code
(`compiled_steps`), which is faster still and agrees to rounding.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import numpy.typing as npt

from modelgen.array_types import FloatArray
from modelgen.runtime.stick_slip.compiled_steps import can_compile, follow_input
from modelgen.runtime.stick_slip.hybrid_system import Event, Flow, Trajectory, refinement, unbounded
from modelgen.runtime.stick_slip.linear_mode import FrictionSystem, Mode

# Steps propagated at once: few after an event, twice as many after every calm block.
FIRST_BLOCK = 64
LARGEST_BLOCK = 4096


def integrate(
    system: FrictionSystem,
    initial: FloatArray,
    inputs: FloatArray,
    step_s: float,
    stride: int = 1,
    mode: Mode | None = None,
    *,
    compiled: bool | None = None,
) -> Trajectory:
    """Return the exact motion under a piecewise linear input.

    Parameters
    ----------
    system : FrictionSystem
        The system (SI).
    initial : ndarray, shape (states,)
        State at time 0.
    inputs : ndarray, shape (K + 1, m)
        Input w at the times 0, step_s, ..., K step_s; linear in between.
    step_s : float
        Step in s.
    stride : int
        Keep every `stride`-th step.
    mode : tuple of int, shape (bodies,), optional
        Of every body at the start, where a motion goes on; by default the one that its velocity, or else the
        force on it, asks for.
    compiled : bool, optional
        Whether to take the steps one by one (compiled, where numba is installed); by default if numba is, and
        the system allows it. Cubic springs always ask for it.

    Raises
    ------
    DataError
        When the motion grows without bound, is too fast for the steps, or sticks and slips too often.
    """
    flow, refine = _flow(system, step_s)
    stride, steps = stride * refine, (len(inputs) - 1) * refine
    if system.springs or (can_compile(system) if compiled is None else compiled):
        return follow_input(flow, initial, inputs[:, 0], stride, refine, mode)
    states = np.empty((steps // stride + 1, initial.size))
    modes = np.empty((len(states), len(system.bodies)), dtype=np.int8)
    x = initial * flow.scale
    mode = flow.start(x, inputs[0]) if mode is None else mode
    states[0], modes[0] = x, mode
    events: list[Event] = []
    k, block = 0, FIRST_BLOCK
    while k < steps:
        w = between(inputs, k, min(k + block, steps), refine)
        k, x, mode, found = to_next_event(flow, k, x, mode, w, stride, states, modes)
        events += found
        block = FIRST_BLOCK if found else min(2 * block, LARGEST_BLOCK)
    return Trajectory(states / flow.scale, modes, np.reshape(events, (-1, 3)).astype(float))


@lru_cache(maxsize=2)
def _flow(system: FrictionSystem, step_s: float) -> tuple[Flow, int]:
    """Return the flow of a system, and into how many of its steps each is divided; a motion may go on."""
    refine = refinement(system, step_s)
    return Flow(system, step_s / refine), refine


def to_next_event(
    flow: Flow,
    k: int,
    x: FloatArray,
    mode: Mode,
    w: FloatArray,
    stride: int,
    states: FloatArray,
    modes: npt.NDArray[np.int8],
) -> tuple[int, FloatArray, Mode, list[Event]]:
    """Go on from step k under the inputs w, shape (n + 1, m), through the step of the first event at most.

    Every `stride`-th step is kept in `states`, shape (kept, states), and `modes`; w is in SI, states in
    the time unit of steps. Returns the step reached, its state and mode, and the events of its step.

    Raises
    ------
    DataError
        When the motion grows without bound.
    """
    count = len(w) - 1
    path, calm = flow.motion(mode).advance(x, w)
    if not np.isfinite(path).all():
        raise unbounded((k + count) * flow.step_s)
    _keep(states, modes, stride, k + 1, path[:calm], mode)
    x = path[calm - 1] if calm else x
    if calm == count:
        return k + calm, x, mode, []
    x, mode, found = flow.cross(k + calm, mode, x, w[calm], w[calm + 1])
    _keep(states, modes, stride, k + calm + 1, x[None], mode)
    return k + calm + 1, x, mode, found


def between(inputs: FloatArray, start: int, stop: int, steps_a_node: int) -> FloatArray:
    """Return piecewise linear inputs, in their units, (nodes, m), at steps from start to stop inclusive."""
    place = np.arange(start, stop + 1) / steps_a_node
    i = np.minimum(place.astype(int), len(inputs) - 2)
    values: FloatArray = inputs[i] + (place - i)[:, None] * (inputs[i + 1] - inputs[i])
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
