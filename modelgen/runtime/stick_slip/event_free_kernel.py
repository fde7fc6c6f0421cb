"""Steps without an event, many at a time, and the samples kept of them; written for a compiler.

`path` holds the states, one row a coordinate and one column a step: whatever does not wait for the step
before is computed for all columns at once, of which processors take several at a time.
"""

from __future__ import annotations

from typing import Any

import numpy as np

# Rows of a table whose sums are taken side by side.
LANES = 4
# Steps taken at once, before anything else is looked after.
CALM = 64


def calm_steps(z: Any, path: Any, foreseen: Any, ahead: Any, guards: int, w: Any, number: int) -> int:
    """Take so many steps in one mode from z on; return how many come before one with an event.

    `ahead`, shape (blocks of four rows, len(z), 4), belongs to the mode: the rows of the next state, then a
    block for every guard: its value at the end of the step, its rate at the start, its rate at the end, its
    value at the start. `w` is the input from the first step on. See `ModeMotion._calm_steps`.
    """
    blocks = len(path) // LANES
    nx = len(z) - 3
    for i in range(nx):
        path[i, 0] = z[i]
    for block in range(blocks):
        for lane in range(LANES):
            from_input(ahead, block, lane, nx, w, path[LANES * block + lane, 1 : number + 1])
    add_states(ahead, blocks, nx, path, number)
    calm = number
    for block in range(blocks, blocks + guards):
        for lane in range(LANES):
            from_input(ahead, block, lane, nx, w, foreseen[lane, :calm])
            for i in range(nx):
                add_multiple(ahead[block, i, lane], path[i], foreseen[lane, :calm])
        calm = steps_before_end(foreseen, calm)
    return calm


def from_input(ahead: Any, block: int, lane: int, nx: int, w: Any, row: Any) -> None:
    """Fill a row with what input, its slope and constants contribute at every step."""
    by_value, by_slope, always = (
        ahead[block, nx, lane],
        ahead[block, nx + 1, lane],
        ahead[block, nx + 2, lane],
    )
    for j in range(len(row)):
        row[j] = always + by_value * w[j] + by_slope * (w[j + 1] - w[j])


def add_multiple(factor: float, values: Any, row: Any) -> None:
    """Add a multiple of values to a row."""
    for j in range(len(row)):
        row[j] += factor * values[j]


def add_states(ahead: Any, blocks: int, nx: int, path: Any, number: int) -> None:
    """Add to the states at every step what those at the step before contribute."""
    for j in range(number):
        for block in range(blocks):
            i = LANES * block
            a, b, c, d = path[i, j + 1], path[i + 1, j + 1], path[i + 2, j + 1], path[i + 3, j + 1]
            for column in range(nx):
                a += ahead[block, column, 0] * path[column, j]
                b += ahead[block, column, 1] * path[column, j]
                c += ahead[block, column, 2] * path[column, j]
                d += ahead[block, column, 3] * path[column, j]
            path[i, j + 1], path[i + 1, j + 1], path[i + 2, j + 1], path[i + 3, j + 1] = a, b, c, d


def steps_before_end(foreseen: Any, number: int) -> int:
    """Return how many steps come before the one within which a guard may turn negative."""
    for j in range(number):
        after, falling, rising = foreseen[0, j], foreseen[1, j], foreseen[2, j]
        if after < 0.0:
            return j
        if falling < 0.0 and rising > 0.0 and min(foreseen[3, j] + falling, after - rising) < 0.0:
            return j
    return number


def first_unbounded(path: Any, last: int, nx: int) -> int:
    """Return the first column of `path` up to the last that is no number, or 0: they do not return."""
    if is_finite(path[:nx, last]):
        return 0
    j = 1
    while is_finite(path[:nx, j]):
        j += 1
    return j


def is_finite(x: Any) -> bool:
    """Return whether a state is made of numbers."""
    total = 0.0
    for i in range(len(x)):
        total += x[i]
    return bool(np.isfinite(total))


def keep(
    path: Any,
    first: int,
    end: int,
    signs: Any,
    scale: Any,
    stride: int,
    row: int,
    until_row: int,
    outputs: Any,
) -> tuple[int, int]:
    """Store states in SI, and modes, of those columns of `path` that fall on the stride; count on."""
    states, modes = outputs[0], outputs[1]
    for j in range(first, end):
        if until_row == 0:
            until_row = stride
            for i in range(len(scale)):
                states[row, i] = path[i, j] / scale[i]
            for body in range(len(signs)):
                modes[row, body] = signs[body]
            row += 1
        until_row -= 1
    return row, until_row
