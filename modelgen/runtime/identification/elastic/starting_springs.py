"""Springs to start from where rows hold positions that springs give: of a file, or by parts of the motion."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.identification.thresholds import (
    DEFLECTIONS,
    LIKELY_DEFLECTIONS,
    ROOT_STEPS,
    SCATTERED,
    SCATTERED_STARTS,
)
from modelgen.runtime.model.deflected_kernel import DeflectedKernel
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record


def springs_pull(kernel: DeflectedKernel, point: FloatArray) -> bool:
    """Return whether every spring of a point, shape (columns,) in SI, pulls the way a spring does."""
    return bool(np.all(np.isfinite(point))) and all(
        point[column] > 0.0 for row in kernel.giving for column in row.acting(0)
    )


def starting_springs(
    model: Model, kernel: DeflectedKernel, records: Sequence[Record]
) -> Iterator[FloatArray]:
    """Yield base parameters to start from, (columns,) in SI: those of parameter sets, and springs alone.

    Springs are such that they deflect by so many parts of the motion (`DEFLECTIONS`, `LIKELY_DEFLECTIONS`).
    """
    for values in model.parameter_sets.values():
        if all(name in values for name in model.parameters):
            point = model.base_from_physical({name: values[name] for name in model.parameters})
            if springs_pull(kernel, point):
                yield point
    for share in LIKELY_DEFLECTIONS if kernel.motors_alone else DEFLECTIONS:
        yield _deflected(model, kernel, records, [share] * len(kernel.giving))


def scattered_springs(
    model: Model, kernel: DeflectedKernel, records: Sequence[Record]
) -> Iterator[FloatArray]:
    """Yield base parameters to start from, (columns,) in SI: springs alone, each deflected by another part.

    Parts are spread evenly over all ratios of the springs by Kronecker's sequence, its steps powers of the
    root of x^(n + 1) = x + 1 (Roberts 2018), so that none of them is drawn.
    """
    count, root = len(kernel.giving), 2.0
    for _ in range(ROOT_STEPS):
        root = (1.0 + root) ** (1.0 / (count + 1))
    steps = root ** -np.arange(1.0, count + 1.0)
    least, most = SCATTERED
    for place in range(1, SCATTERED_STARTS + 1):
        shares = least * (most / least) ** ((0.5 + place * steps) % 1.0)
        yield _deflected(model, kernel, records, shares.tolist())


def _deflected(
    model: Model, kernel: DeflectedKernel, records: Sequence[Record], shares: Sequence[float]
) -> FloatArray:
    """Return springs that deflect by these shares of the motion, one a row that gives a position."""
    point = np.zeros(len(model.base_parameters))
    for row, share in zip(kernel.giving, shares, strict=True):
        force, motion = (max(_span(kernel, terms, one) for one in records) for terms in row.size)
        for column in row.acting(0):
            point[column] = force / (share * motion) if force and motion else 1.0
    return point


def most_deflected(kernel: DeflectedKernel, records: Sequence[Record], point: FloatArray) -> float:
    """Return by how many times the motion of its joint a spring of a point, (columns,) in SI, deflects."""
    found = 0.0
    for row in kernel.giving:
        force, motion = (
            max((_span(kernel, terms, one) for one in records), default=0.0) for terms in row.size
        )
        for column in row.acting(0):
            found = max(found, force / (point[column] * motion) if force and motion else 0.0)
    return found


def _span(kernel: DeflectedKernel, terms: Sequence[tuple[float, str]], record: Record) -> float:
    """Return over how much a sum of channels goes at most, without what is differentiated."""
    total = 0.0
    for weight, key in terms:
        source, order = kernel.reads_of.get(key, ("", 1))
        if not order and source in record.signals:
            total += abs(weight) * record.facts.extent(source).span
    return total
