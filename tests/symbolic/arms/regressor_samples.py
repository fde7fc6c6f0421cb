"""The regressor of an arm in floating point, along a motion or at random ones."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.symbolic.arms.arm_rows import ArmRows
from modelgen.symbolic.arms.base_parameters import SEED
from modelgen.symbolic.arms.drives import coordinates
from modelgen.symbolic.arms.expressions.evaluation import sampled


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
