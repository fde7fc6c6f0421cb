"""The rank of an arm's regressor in double precision, against which the exact one is held."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from modelgen.symbolic.arms.arm_rows import ArmRows
from tests.symbolic.arms.regressor_samples import random_regressor


def numerical_rank(rows: ArmRows, lengths: Mapping[str, float] | None = None) -> int:
    """Return the rank of a random regressor by QR with column pivoting, at values of the lengths [m].

    It is below the exact one where lengths or angles are so small that double precision loses them.
    """
    from scipy.linalg import qr

    known = {name: 1.0 if value is None else value for name, value in rows.spec.lengths.items()}
    regressor = random_regressor(rows, {**known, **(lengths or {})})
    regressor = regressor[:, [name not in rows.spec.known for name in rows.columns]]
    scale = np.linalg.norm(regressor, axis=0)
    seen = scale > 1e-13 * scale.max(initial=0.0)
    regressor = regressor[:, seen] / scale[seen]
    diagonal = np.abs(np.diag(qr(regressor, mode="r", pivoting=True)[0]))
    return int(np.sum(diagonal > 1e-9 * diagonal[0])) if len(diagonal) else 0
