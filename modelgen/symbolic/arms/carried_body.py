"""The ten parameters of a body about the origin of another frame (the parallel axes' theorem)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from modelgen.symbolic.arms.placements import Matrix

#: Parameters by their kind (Ixx ... m); those that are zero are left out.
Body = Mapping[str, Any]

_TENSOR = (("Ixx", "Ixy", "Ixz"), ("Ixy", "Iyy", "Iyz"), ("Ixz", "Iyz", "Izz"))
_MOMENT = ("mx", "my", "mz")


def carried(body: Body, rotation: Matrix, offset: Sequence[Any]) -> dict[str, Any]:
    """Return a body's parameters in the parent's frame.

    With d the first moment as the parent's axes see it and p the offset, the tensor about the parent's
    origin is R I R^T + 2 (p d) E - p d^T - d p^T + m (p p E - p p^T), the first moment is d + m p.
    """
    mass = body.get("m", 0)
    moment = [sum(rotation[i][k] * body.get(_MOMENT[k], 0) for k in range(3)) for i in range(3)]
    tensor = _rotated([[body.get(name, 0) for name in row] for row in _TENSOR], rotation)
    along = 2 * sum(p * d for p, d in zip(offset, moment, strict=True)) + mass * sum(p * p for p in offset)
    found: dict[str, Any] = {}
    for i in range(3):
        for k in range(i, 3):
            value = (
                tensor[i][k] - offset[i] * moment[k] - moment[i] * offset[k] - mass * offset[i] * offset[k]
            )
            found[_TENSOR[i][k]] = value + along if i == k else value
        found[_MOMENT[i]] = moment[i] + mass * offset[i]
    found["m"] = mass
    return {name: value for name, value in found.items() if value}


def _rotated(tensor: list[list[Any]], rotation: Matrix) -> list[list[Any]]:
    half = [[sum(rotation[i][a] * tensor[a][k] for a in range(3)) for k in range(3)] for i in range(3)]
    return [[sum(half[i][b] * rotation[k][b] for b in range(3)) for k in range(3)] for i in range(3)]
