"""The groupings against the closed formulas of Gautier and Khalil (1990), as in Khalil and Dombre (2002).

For revolute joints, the second not parallel to the first, which is vertical: the parameters Iyy, mz and m of
link j go into those of link j and j - 1. These lines know nothing of the derivation.
"""

from __future__ import annotations

import math
from collections import Counter

import pytest

from modelgen.symbolic.arms.arm_rows import arm_rows
from modelgen.symbolic.arms.base_parameters import arm_base_model
from tests.symbolic.arms.made_arms import LWR, PANDA, PUMA, RX90, UR10, serial

KEPT = ("Ixx", "Ixy", "Ixz", "Iyz", "Izz", "mx", "my")


def closed_form(rows: list[tuple[float, ...]]) -> dict[str, dict[str, float]]:
    """Return what every kept parameter stands for, by its name."""
    count = len(rows)
    kinds = (*KEPT, "Iyy", "mz", "m")
    sums = {(kind, j): Counter({f"{kind}{j}": 1.0}) for kind in kinds for j in range(1, count + 1)}
    for j in range(count, 0, -1):
        alpha, d, theta, r = rows[j - 1]
        assert theta == 0
        c, s = math.cos(math.radians(alpha)), math.sin(math.radians(alpha))
        yy, mz, m = (sums[kind, j] for kind in ("Iyy", "mz", "m"))
        add(sums["Ixx", j], -1, yy)
        if j == 1:
            break
        for kind, of_yy, of_mz, of_m in (
            ("Ixx", 1, 2 * r, r * r),
            ("Ixy", 0, d * s, d * r * s),
            ("Ixz", 0, -d * c, -d * r * c),
            ("Iyy", c * c, 2 * r * c * c, d * d + r * r * c * c),
            ("Iyz", c * s, 2 * r * c * s, r * r * c * s),
            ("Izz", s * s, 2 * r * s * s, d * d + r * r * s * s),
            ("mx", 0, 0, d),
            ("my", 0, -s, -r * s),
            ("mz", 0, c, r * c),
            ("m", 0, 0, 1),
        ):
            target = sums[kind, j - 1]
            for factor, source in ((of_yy, yy), (of_mz, mz), (of_m, m)):
                add(target, factor, source)
    names = {f"{kind}{j}": sums[kind, j] for j in range(2, count + 1) for kind in KEPT}
    return {
        name: {n: x for n, x in found.items() if abs(x) > 1e-15}
        for name, found in {"Izz1": sums["Izz", 1], **names}.items()
    }


def add(target: Counter[str], factor: float, source: Counter[str]) -> None:
    for name, value in source.items():
        target[name] += factor * value


@pytest.mark.parametrize("rows", [PUMA, RX90, UR10, PANDA, LWR], ids=["puma", "rx90", "ur10", "panda", "lwr"])
def test_groupings_are_those_of_the_closed_form(rows: list[tuple[float, ...]]) -> None:
    model = arm_base_model(arm_rows(serial(rows)))
    wanted = closed_form(rows)
    found = {b.combination[0][0]: b.factors({}) for b in model.base}
    assert found.keys() == wanted.keys()
    for name, factors in found.items():
        assert factors == pytest.approx(wanted[name], abs=1e-14), name
