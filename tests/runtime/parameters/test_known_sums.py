"""What is said of inertias that are known only together."""

from __future__ import annotations

import numpy as np
import pytest

from modelgen.runtime.model.model import Model
from modelgen.runtime.parameters.known_sums import with_known_sums
from modelgen.runtime.parameters.physical_parameters import Covariances, physical_parameters
from tests.runtime.iv.physical.swinging_servo import SERVO, TRUTH, servo
from tests.runtime.iv.physical.test_composite_iv import model_of

GEARED = SERVO.replace('damping = "D" }', 'damping = "D", ratio = 4 }')
WHY = dict.fromkeys(("J_m", "J_l", "K"), "too uncertain")


def told(model: Model, share: float, sum_std: float) -> dict[str, str]:
    """Return the reasons where J_m is 60 % uncertain, and its sum with that share of J_l by so much."""
    names = model.parameters
    ways = np.zeros((len(names), 2))
    ways[names.index("J_m")] = 0.6 * TRUTH["J_m"], sum_std
    ways[names.index("J_l"), 0] = -0.6 * TRUTH["J_m"] / share
    small = np.diag([1e-4 * TRUTH[name] for name in names])
    slope = model.base_jacobian(TRUTH)
    covariance = slope @ (ways @ ways.T + small @ small) @ slope.T
    covariances = Covariances(covariance, covariance, np.zeros_like(covariance), covariance)
    base = model.base_from_physical(TRUTH)
    found = physical_parameters(model, base, covariances, {}, {}, TRUTH)
    return with_known_sums(model, covariances, found, WHY)


@pytest.mark.parametrize(("text", "share", "terms"), [(SERVO, 1.0, "J_m + J_l"), (GEARED, 0.0625, "0.0625")])
def test_the_sum_is_told_as_the_motor_feels_it(text: str, share: float, terms: str) -> None:
    model = servo() if text is SERVO else model_of(text, "motor")
    found = told(model, share, 2e-5)
    total = TRUTH["J_m"] + share * TRUTH["J_l"]
    for name in ("J_m", "J_l"):
        assert found[name].startswith("too uncertain; J_m + ")
        assert terms in found[name]
        value, half = found[name].split(" = ")[1].split(" kg m^2 is known")[0].split(" +- ")
        assert float(value) == pytest.approx(total, rel=2e-3)
        assert float(half) == pytest.approx(1.96 * 2e-5, rel=0.05)
    assert found["K"] == "too uncertain"


def test_nothing_is_told_of_a_sum_that_is_not_known() -> None:
    assert told(servo(), 1.0, 0.2 * TRUTH["J_m"]) == WHY
    # nor of one body
    assert "is known" not in told(servo(), 0.5, 2e-5)["J_m"]
