from __future__ import annotations

import pytest

from modelgen.runtime.diagnostics.filter_scan import FilterScan, ScanPoint
from modelgen.runtime.diagnostics.residual_tests import ResidualTest
from modelgen.runtime.filter_choice.signal_to_noise import SignalToNoise
from modelgen.runtime.results.check_tables import check_tables
from modelgen.runtime.results.checks import Checks, Periods


def test_without_checks_there_are_no_tables() -> None:
    assert check_tables(Checks()) == ()


@pytest.mark.parametrize(
    ("value", "std", "said"),
    [
        (95.0012345, 0.01, "95.001 ±0.02"),
        (1.06040123e-05, 1e-10, "1.060401e-05 ±2e-10"),
        (1.06043123e-05, 1e-11, "1.0604312e-05 ±2e-11"),
        (0.03, 10.0, "0.03 ±20"),
        (0.0, 1.0, "0 ±2"),
        (float("nan"), float("nan"), "-"),
    ],
)
def test_a_scan_shows_the_digits_that_its_interval_leaves(value: float, std: float, said: str) -> None:
    point = ScanPoint(40.0, 4, (10,), True, (value,), (std,), 0.05)
    (table,) = check_tables(Checks(scan=FilterScan(("M",), (point,))))
    assert table.rows[1] == ("*", "40", "4", "10", said, "5.000")


def test_of_each_channel_the_highest_derivative_is_shown() -> None:
    entries = tuple(
        SignalToNoise("run", "q_m", k, "m", 1.0, 0.1, snr, 30.0)
        for k, snr in ((0, 60.0), (2, 20.0), (1, 40.0))
    )
    (table,) = check_tables(Checks(signals=entries))
    assert [row[2] for row in table.rows[1:]] == ["2"]
    assert table.rows[1][-2:] == ("20 dB", "30 Hz")


def test_what_was_not_tested_says_why() -> None:
    tested = ResidualTest("run", "m", 12.0, 38.0, None, None)
    untested = ResidualTest("run", "c", None, None, None, None)
    (both,), (one,) = (check_tables(Checks(residuals=tests)) for tests in ((tested, untested), (tested,)))
    assert [row[-1] for row in both.rows[1:]] == ["noise", "not tested"]
    assert "Not tested: " in both.sentences[-1]
    assert len(one.sentences) == 1


def test_standard_deviations_over_periods_are_roots_of_the_diagonal() -> None:
    periods = Periods(20, (("run", 2.5),), ((4.0, 1.0), (1.0, 9.0)))
    assert periods.std == (2.0, 3.0)
    (table,) = check_tables(Checks(periods=periods))
    assert "20 periods (run 2.5 s)" in table.sentences[0]
