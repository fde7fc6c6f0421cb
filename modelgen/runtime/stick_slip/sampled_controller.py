"""A sampled controller together with forces of further actuators: steps between changes of its command.

The steps of `compiled_steps` take one input; here there are several: the command, constant while it is held,
and the other forces, linear from step to step. Between two changes the motion is that of `exact_steps`.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.stick_slip.compiled_steps import Sampling
from modelgen.runtime.stick_slip.event_kernel import command
from modelgen.runtime.stick_slip.exact_steps import LARGEST_BLOCK, between, to_next_event
from modelgen.runtime.stick_slip.hybrid_system import Event, Flow, Trajectory
from modelgen.runtime.stick_slip.linear_mode import Mode


@np.errstate(over="ignore", invalid="ignore")  # a motion that grows without bound gets one clear error
def follow_ticks(
    flow: Flow,
    initial: FloatArray,
    sampling: Sampling,
    further: FloatArray,
    stride: int,
    steps_a_node: int = 1,
) -> tuple[Trajectory, FloatArray]:
    """Return the motion under a sampled controller and further forces, and its commands at the ticks.

    Parameters
    ----------
    flow : Flow
        The command is the first input, the others are as in `further`.
    initial : ndarray, shape (states,)
        SI.
    sampling : Sampling
    further : ndarray, shape (nodes, m)
        Forces at every `steps_a_node`-th step of the flow, linear in between.
    stride : int
        Keep every `stride`-th step.
    steps_a_node : int

    Raises
    ------
    DataError
        When the motion grows without bound, or sticks and slips too often.
    """
    x, steps, law = initial * flow.scale, (len(further) - 1) * steps_a_node, sampling.law
    # positions before the start, which the controller needs: at the constant initial speed
    seen = x[int(law[5])] - np.array([1.0, 2.0]) * law[7] * initial[int(law[6])]
    mode = flow.start(x, np.r_[0.0, further[0]])
    states = np.empty((steps // stride + 1, x.size))
    modes = np.empty((len(states), len(mode)), dtype=np.int8)
    states[0], modes[0] = x, mode
    commands = np.zeros(steps // sampling.per_tick + 1)
    events: list[Event] = []
    for k, end in pairwise(_changes(sampling, steps)):
        tick, late = k // sampling.per_tick, k - sampling.delay
        if k % sampling.per_tick == 0:
            commands[tick] = command(x, seen, law, sampling.reference, tick)
        if k == steps:
            break
        held = commands[late // sampling.per_tick] if late >= 0 else 0.0
        mode, released = _released(flow, mode, x, np.r_[held, between(further, k, k, steps_a_node)[0]], k)
        events += released
        while k < end:
            w = between(further, k, min(k + LARGEST_BLOCK, end), steps_a_node)
            w = np.column_stack((np.full(len(w), held), w))
            k, x, mode, found = to_next_event(flow, k, x, mode, w, stride, states, modes)
            events += found
    return Trajectory(states / flow.scale, modes, np.reshape(events, (-1, 3)).astype(float)), commands


def _changes(sampling: Sampling, steps: int) -> list[int]:
    """Return the steps at which the controller samples or its command changes, then the last one twice."""
    ticks = np.arange(0, steps + 1, sampling.per_tick)
    acting = np.arange(sampling.delay, steps + 1, sampling.per_tick)
    return [*np.unique(np.r_[ticks, acting, steps]).tolist(), steps]


def _released(flow: Flow, mode: Mode, x: FloatArray, w: FloatArray, k: int) -> tuple[Mode, list[Event]]:
    """Release sticking bodies whose friction a jump of the command at step k exceeds."""
    z, events = np.r_[x, w, 0.0 * w, 1.0], []
    for body, sign in enumerate(mode):
        follow = flow.motion(mode).mode_at_rest(body, z) if sign == 0 else sign
        if follow != sign:
            mode = (*mode[:body], follow, *mode[body + 1 :])
            events.append(Event(k * flow.step_s, body, follow))
    return mode, events
