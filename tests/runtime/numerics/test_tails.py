from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2, norm

from modelgen.runtime.numerics.tails import (
    chi_square_beyond,
    chi_square_tail,
    likely_square,
    normal_beyond,
    normal_tail,
)

SHARES = (1e-15, 1e-9, 1e-4, 0.01, 0.05, 0.5, 0.9, 1.0 - 1e-9)


@pytest.mark.parametrize("share", SHARES)
def test_normal_tails_are_those_of_scipy(share: float) -> None:
    assert normal_beyond(share) == pytest.approx(norm.isf(share), rel=1e-12, abs=1e-15)
    assert normal_tail(normal_beyond(share)) == pytest.approx(share, rel=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("degrees", [1, 2, 3, 4, 7, 20, 25, 101, 1000, 5001])
def test_chi_square_tails_are_those_of_scipy(degrees: int) -> None:
    for share in SHARES[:-1]:
        assert chi_square_beyond(share, degrees) == pytest.approx(chi2.isf(share, degrees), rel=1e-10)
    for x in np.geomspace(1e-3, 10.0 * degrees, 40).tolist():
        assert chi_square_tail(x, degrees) == pytest.approx(chi2.sf(x, degrees), rel=1e-10, abs=1e-300)
    assert chi_square_tail(0.0, degrees) == 1.0


def test_what_rows_exclude_is_not_likely() -> None:
    assert likely_square(0.0, 1e-3) < 1e-5
    assert likely_square(1.0, 1e-3) == pytest.approx(1.0, abs=1e-4)
    # rows that say nothing leave one as likely as none
    assert likely_square(0.0, 1e6) == pytest.approx(0.5, abs=1e-3)
