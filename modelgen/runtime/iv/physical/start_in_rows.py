"""A start nearer to the records: physical parameters and delays with which the rows leave least.

Composites of least squares contradict each other where a force is late, and the chain that comes closest to
them may leave far more in the rows than another one does: steps from there lead away. The rows are linear in
composites and, for small delays, in these: one triangle stands for all of them, and many starts cost little.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import IdentifiabilityError
from modelgen.runtime.iv.instrumental_variables import Setting
from modelgen.runtime.iv.thresholds import LATE_ROUNDS, ROW_EVALUATIONS
from modelgen.runtime.least_squares.delays import delay_rates
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.model.model import Model
from modelgen.runtime.numerics.qr_triangle import triangle_of

# roles of parameters that a search may take through zero
SIGNED = ("offset", "stiffness3", "viscous", "coulomb")
# parameters (SI), delays of forces (s)
Start = tuple[Mapping[str, float], Mapping[str, float]]


def start_in_rows(
    first: Fit, setting: Setting, starts: Sequence[Mapping[str, float]], late: Sequence[str]
) -> Start | None:
    """Return physical parameters and delays with which rows leave least, None where no search leads anywhere.

    Parameters
    ----------
    first : Fit
        Least squares of the rows, in base columns, all of them.
    setting : Setting
    starts : sequence of mapping
        All physical parameters (SI), where the searches begin.
    late : sequence of str
        Forces whose delay is free.
    """
    found: list[tuple[float, Mapping[str, float], FloatArray]] = []
    sample = 1.0 / min(record.fs for record in setting.records)
    for start in starts:
        values, delays = start, np.zeros(len(late))
        try:
            with np.errstate(all="ignore"):
                # how rows change with a delay depends on the parameters
                for _ in range(LATE_ROUNDS if late else 1):
                    R = _triangle(first, setting, values, late, sample)
                    left, values, delays = _searched(setting.model, R, values, delays)
        except (ValueError, ArithmeticError, IdentifiabilityError):  # where composites have no numbers
            continue
        found.append((left, values, delays))
    if not found:
        return None
    _, values, delays = min(found, key=lambda one: one[0])
    return values, {key: sample * delay for key, delay in zip(late, delays.tolist(), strict=True)}


def _triangle(
    first: Fit, setting: Setting, values: Mapping[str, float], late: Sequence[str], sample: float
) -> FloatArray:
    """Return R of [W, what a delay by a sample changes, Y], rows weighted as in the fit."""
    model = setting.model
    there = replace(first, solution=replace(first.solution, x=model.base_from_physical(values)))
    rates = [delay_rates(there, model, setting.records, setting.choice, setting.drop, key) for key in late]
    stacked = [
        weight * np.column_stack([block.W, *(-sample * rate[index] for rate in rates), block.Y])
        for index, (block, weight) in enumerate(zip(first.blocks, first.weights, strict=True))
    ]
    return triangle_of(np.concatenate(stacked))


def _searched(
    model: Model, R: FloatArray, start: Mapping[str, float], delays: FloatArray
) -> tuple[float, Mapping[str, float], FloatArray]:
    """Return what is left of the squared rows, the parameters, and the delays in samples, near a start."""
    from scipy.optimize import least_squares

    values = np.array([start[name] for name in model.parameters])
    size, c = np.where(values == 0.0, 1.0, np.abs(values)), len(values)
    signed = np.array(
        [name not in model.roles or model.roles[name].role in SIGNED for name in model.parameters]
    )

    def parameters(u: FloatArray) -> dict[str, float]:
        p = size * np.where(signed, u[:c], np.exp(np.where(signed, 0.0, u[:c])))
        return dict(zip(model.parameters, p.tolist(), strict=True))

    def left(u: FloatArray) -> FloatArray:
        return np.asarray(R @ np.r_[model.base_from_physical(parameters(u)), u[c:], -1.0])

    begin = np.r_[np.where(signed, values / size, 0.0), delays]
    found = least_squares(left, begin, x_scale="jac", max_nfev=ROW_EVALUATIONS)
    return float(found.cost), parameters(found.x), np.asarray(found.x[c:])
