from __future__ import annotations

import math

import pytest

from modelgen.errors import DataError
from modelgen.runtime.diagnostics.filter_scan import scanned_settings
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.identification.options import values_of
from tests.runtime.rigid_motion import CHOICE, RIGID, SETTINGS, TRUTH, rigid_record


def test_the_scan_tries_cut_offs_and_orders_around_the_chosen_ones() -> None:
    settings = scanned_settings(CHOICE, [rigid_record(n=2000)], "auto")
    found = [(round(one.cutoff_hz, 3), one.filter_order, one.decimation) for one in settings]
    assert found == [
        (20.0, 4, (20,)),
        (28.284, 4, (14,)),
        (40.0, 2, (10,)),
        (40.0, 4, (10,)),
        (40.0, 6, (10,)),
        (40.0, 8, (10,)),
        (56.569, 4, (7,)),
        (80.0, 4, (5,)),
    ]
    assert [one.cutoff_hz for one in scanned_settings(CHOICE, [rigid_record(n=2000)], [60.0, 40.0])] == [
        40,
        60,
    ]


def test_every_point_is_the_estimate_with_that_filter() -> None:
    record = rigid_record()
    estimate = identify(RIGID, record, **values_of("wls", scan_cutoffs=[20.0, 60.0], **SETTINGS))
    scan = estimate.checks.scan
    assert scan is not None
    assert scan.names == tuple(TRUTH)
    assert [point.cutoff_hz for point in scan.points] == [20.0, 40.0, 60.0]
    assert [point.chosen for point in scan.points] == [False, True, False]
    for point in scan.points:
        options = {"cutoff_hz": point.cutoff_hz, "direction_cutoff_hz": 10.0, "drift_check": False}
        same = identify(RIGID, record, **values_of("wls", **options))
        assert dict(zip(scan.names, point.values, strict=True)) == pytest.approx(dict(same.params), rel=1e-9)
        assert dict(zip(scan.names, point.stds, strict=True)) == pytest.approx(dict(same.bse), rel=1e-9)
        assert point.relative_error == pytest.approx(same.fit.relative_error)
    table = estimate.summary().split("Scan of the filter:")[1].splitlines()
    assert [line.split()[0] for line in table if line.strip().startswith("*  ")] == ["*"]


def test_a_filter_that_the_record_is_too_short_for_is_told() -> None:
    record = rigid_record(n=3000)
    estimate = identify(RIGID, record, **values_of("wls", scan_cutoffs=[2.0], **SETTINGS))
    scan = estimate.checks.scan
    assert scan is not None
    (failed, used) = scan.points
    assert "needs at least" in str(failed.failed)
    assert all(math.isnan(value) for value in failed.values)
    assert used.failed is None
    assert "2 Hz, order 4: has 3000 samples" in " ".join(estimate.summary().split())
    assert estimate.to_dict()["checks"]["scan"]["points"][0]["values"] == [None] * len(scan.names)


@pytest.mark.parametrize("cutoffs", ["all", [], [600.0], [0.0], [float("nan")]])
def test_cut_offs_that_cannot_be_are_named(cutoffs: str | list[float]) -> None:
    with pytest.raises(DataError, match="scan_cutoffs"):
        scanned_settings(CHOICE, [rigid_record(n=2000)], cutoffs)
