"""The regressor of an arm at random motions: modulo a prime, and in floating point."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.symbolic.arms.arm_rows import ArmRows
from modelgen.symbolic.arms.drives import coordinates
from modelgen.symbolic.arms.expressions.evaluation import residues, sampled

SEED = 2002


def residue_regressor(rows: ArmRows, columns: Sequence[int], lengths: Mapping[str, int]) -> list[list[int]]:
    """Return the named columns at random points of the field, one list a row and sample.

    There are so many samples that the row of the first joint alone, which sees every link, decides the rank.
    """
    place = {column: k for k, column in enumerate(columns)}
    keys = [key for key in rows.entries if key[1] in place]
    samples = len(columns) + 8 if len(rows.names) < 4 else 3 * len(columns) // len(rows.names) + 8
    values = residues(rows.graph, [rows.entries[key] for key in keys], samples, SEED, lengths)
    matrix = [[[0] * len(columns) for _ in rows.names] for _ in range(samples)]
    for (row, column), found in zip(keys, values, strict=True):
        for sample, value in zip(matrix, found.values, strict=True):
            sample[row][place[column]] = value
    return [row for sample in matrix for row in sample]


def random_regressor(rows: ArmRows, lengths: Mapping[str, float], seed: int = SEED) -> FloatArray:
    """Return the whole regressor at random motions of unit size, shape (samples * rows, columns)."""
    rng = np.random.default_rng(seed)
    samples = max(2 * len(rows.columns) // len(rows.names), 16) + len(rows.columns)
    motion = {
        (name, order): rng.uniform(-np.pi, np.pi, samples) if order == 0 else rng.standard_normal(samples)
        for name in coordinates(rows.spec)
        for order in range(3 + max(rows.differentiated))
    }
    gained = [joint.name for joint in rows.spec.moving if joint.gain]
    forces = {
        f"force {name}{order}": rng.standard_normal(samples)
        for order in ("", " 1")[: 1 + max(rows.differentiated)]
        for name in gained
    }
    loads = {f"load {one.name}": rng.standard_normal(samples) for one in rows.spec.payloads}
    return regressor_at(rows, motion, {**lengths, **forces, **loads}).reshape(-1, len(rows.columns))


def regressor_at(
    rows: ArmRows, motion: Mapping[tuple[str, int], FloatArray], values: Mapping[str, float | FloatArray]
) -> FloatArray:
    """Return the regressor along a motion, shape (samples, rows, columns), with arguments of `sampled`."""
    keys = list(rows.entries)
    found = sampled(rows.graph, [rows.entries[key] for key in keys], motion, values, rows.speeds)
    regressor = np.zeros((len(found), len(rows.names), len(rows.columns)))
    for (row, column), entry in zip(keys, found.T, strict=True):
        regressor[:, row, column] = entry
    return regressor
