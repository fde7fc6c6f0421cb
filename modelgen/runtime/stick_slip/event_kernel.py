"""Exact steps through stick and slip one by one: the arithmetic of `hybrid_system`, written for a compiler.

The same mathematics as `linear_mode` and `hybrid_system`, in plain loops over arrays, so that
numba can compile it; without numba it runs uncompiled, only slowly. Between steps a sampled controller may
form the input from the state. Matrices come from `compiled_steps`, everything in time units of steps.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from modelgen.runtime.stick_slip.cubic_spring_kernel import INPUTS, TERMS, dot, expand
from modelgen.runtime.stick_slip.event_free_kernel import (
    CALM,
    LANES,
    calm_steps,
    first_unbounded,
    is_finite,
    keep,
)
from modelgen.runtime.stick_slip.hybrid_system import MOST_EVENTS_A_STEP
from modelgen.runtime.stick_slip.root_finding import horner, when_negative

# A step with springs may be divided into so many parts.
MOST_PARTS = 100
DONE, EVENTS_FULL, UNBOUNDED, TOO_MANY = 0, 1, 2, 3
TRUE_VELOCITY, BACKWARD, CENTRAL = 0, 1, 2


def mode_at_rest(z: Any, m: int, body: int, tables: Any) -> int:
    """Return the mode of a body whose velocity is zero: the net force on it decides."""
    free, bodies, deflections, pulls = tables[3], tables[6], tables[7], tables[9]
    rate = dot(free[m, body], z)
    for s in range(len(deflections)):
        rate += pulls[s, body] * dot(deflections[s], z) ** 3
    force = rate * bodies[body, 1]
    return int(force > bodies[body, 2]) - int(force < -bodies[body, 3])


def cross(z: Any, m: int, tables: Any, events: Any, count: int, k: int) -> tuple[int, int]:
    """Go through step k from event to event: z becomes the state at its end.

    Return the mode at its end, and the number of events; -1 for too many of them.
    """
    _, guards, M, _, owners, guard_count, bodies, deflections, pushes, pulls, _, _ = tables
    size, body_count, springs = len(z), len(bodies), len(deflections)
    series, cubes = np.empty((TERMS, size)), np.empty((springs, TERMS))
    coefficients = np.empty(TERMS)
    released = np.zeros(body_count, dtype=np.bool_)
    left, first_count, parts = 1.0, count, 0
    while left > 0.0 and parts < MOST_PARTS:
        parts += 1
        share, terms = expand(z, M[m], deflections, pushes[m], left, series, cubes)
        polynomial = coefficients[:terms]
        u, guard = 1.0, -1
        for g in range(guard_count[m]):
            for order in range(terms):
                polynomial[order] = dot(guards[m, g], series[order])
            # what a held body has in reserve: friction minus or plus all forces on it, those of springs, too
            owner, sign = owners[m, g, 0], owners[m, g, 1]
            if m // 3**owner % 3 == 1:
                for s in range(springs):
                    for order in range(terms):
                        polynomial[order] -= sign * pulls[s, owner] * cubes[s, order]
            if released[owners[m, g, 0]]:
                polynomial[1] = 0.0
            found = when_negative(polynomial)
            if found <= 1.0 and (found < u or guard < 0):
                u, guard = found, g
        for i in range(size):
            z[i] = horner(series[:terms, i], u)
        left -= u * share * left
        if guard < 0:
            if share == 1.0:
                break
            released[:] = False
            continue
        body, sign = owners[m, guard, 0], owners[m, guard, 1]
        if u != 0.0:
            released[:] = False
        place = 3**body
        now = m // place % 3 - 1
        if now == 0:
            released[body] = True
        else:
            follow = mode_at_rest(z, m, body, tables)
            # its velocity has just left this direction: only rounding could send it back there
            sign = 0 if follow == sign else follow
            z[int(bodies[body, 0])] = 0.0
        m += (sign - now) * place
        if count == len(events) or count - first_count >= MOST_EVENTS_A_STEP:
            return m, -1
        events[count, 0], events[count, 1], events[count, 2] = k + 1.0 - left, body, sign
        count += 1
    if parts == MOST_PARTS:
        z[0] = np.nan  # a spring that swings so fast has left all bounds
    return m, count


def release(z: Any, m: int, tables: Any, events: Any, count: int, k: int) -> tuple[int, int]:
    """Release sticking bodies whose friction a jump of the command at step k exceeds; returns as `cross`."""
    for j in range(len(tables[6])):
        if m // 3**j % 3 == 1:
            follow = mode_at_rest(z, m, j, tables)
            if follow != 0:
                if count == len(events):
                    return m, -1
                m += follow * 3**j
                events[count, 0], events[count, 1], events[count, 2] = float(k), j, follow
                count += 1
    return m, count


def command(x: Any, seen: Any, law: Any, reference: Any, tick: int) -> float:
    """Return the sampled controller's command, and shift what it has seen; see `drive.Drive`."""
    kp, kv, step, limit, velocity_kind, position_row, velocity_row, tick_s, step_s = law
    q = x[int(position_row)]
    if step > 0.0:
        q = step * np.floor(q / step + 0.5)
    v = x[int(velocity_row)] / step_s
    if velocity_kind == BACKWARD:
        v = (q - seen[0]) / tick_s
    elif velocity_kind == CENTRAL:
        v = 0.5 * (q - seen[1]) / tick_s
    seen[1] = seen[0]
    seen[0] = q
    force = kp * (reference[tick, 0] - q) + kv * (reference[tick, 1] - v) + reference[tick, 2]
    return float(min(max(force, -limit), limit))


def between(inputs: Any, k: int, parts: int, w: Any) -> None:
    """Fill w with the piecewise linear input from step k on, at so many steps between two nodes."""
    for j in range(len(w)):
        place = (k + j) / parts
        i = min(int(place), len(inputs) - 2)
        w[j] = inputs[i] + (place - i) * (inputs[i + 1] - inputs[i])


def run(
    x: Any, m: int, tables: Any, inputs: Any, sampling: Any, stride: int, steps: int, outputs: Any
) -> tuple[int, int, int]:
    """Take all steps; fill states (SI), modes, commands and events.

    `sampling` is (law, reference at the ticks, steps per tick, delay in steps, what the controller has seen).
    `inputs` is empty, or the known input at its nodes (linear in between), and the ticks are these nodes.
    Return a status, the number of events, and the step reached.
    """
    ahead, guard_count, springs, signs, scale = tables[0], tables[5], len(tables[7]), tables[10], tables[11]
    commands, events = outputs[2], outputs[3]
    law, reference, per_tick, delay, seen = sampling
    nx, known, k, count = len(x), len(inputs) > 0, 0, 0
    z = np.ones(nx + INPUTS)
    z[:nx] = x
    path = np.zeros(((nx + LANES - 1) // LANES * LANES, CALM + 1))
    path[:nx, 0] = x
    foreseen, held = np.zeros((LANES, CALM)), np.zeros(CALM + 1)
    tick, acting, until_tick, until_acting = 0, -1, 0, delay
    row, until_row = keep(path, 0, 1, signs[m], scale, stride, 0, 0, outputs)
    while True:
        if not known and until_tick == 0:
            commands[tick] = command(z, seen, law, reference, tick)
            tick, until_tick = tick + 1, per_tick
        if not known and until_acting == 0:
            acting, until_acting = acting + 1, per_tick
            held[:] = commands[acting]
        if k == steps:
            return DONE, count, k
        number = min(CALM, steps - k)
        w = inputs[k:] if known and per_tick == 1 else held
        if known and per_tick > 1:
            # where springs are, each step is taken for itself
            between(inputs, k, per_tick, held[: (1 if springs > 0 else number) + 1])
        if not known:
            number = min(number, until_tick, until_acting)
            z[nx], z[nx + 1] = held[0], 0.0
            m, count = release(z, m, tables, events, count, k)
            if count < 0:
                return EVENTS_FULL, count, k
        # with cubic springs the predictions of the tables do not hold
        calm = 0 if springs > 0 else calm_steps(z, path, foreseen, ahead[m], guard_count[m], w, number)
        if calm > 0:
            bad = first_unbounded(path, calm, nx)
            if bad > 0:
                return UNBOUNDED, count, k + bad - 1
            row, until_row = keep(path, 1, calm + 1, signs[m], scale, stride, row, until_row, outputs)
            z[:nx] = path[:nx, calm]
        taken = calm
        if calm < number:
            z[nx], z[nx + 1] = w[calm], w[calm + 1] - w[calm]
            m, count = cross(z, m, tables, events, count, k + calm)
            if count < 0:
                return (TOO_MANY if events[-1, 0] < 0.0 else EVENTS_FULL), count, k + calm
            if not is_finite(z[:nx]):
                return UNBOUNDED, count, k + calm
            path[:nx, 0] = z[:nx]
            row, until_row = keep(path, 0, 1, signs[m], scale, stride, row, until_row, outputs)
            taken += 1
        k, until_tick, until_acting = k + taken, until_tick - taken, until_acting - taken
