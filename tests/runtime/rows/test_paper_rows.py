from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from generated import emps300_qm_ac, emps_rigid_asymmetric_qm, emps_rigid_qm
from modelgen.errors import DataError
from modelgen.runtime.filter_choice.filter_choice import choose_filter
from modelgen.runtime.filters.zero_phase import decimation_start, zero_phase
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.identification.options import Filters, values_of
from modelgen.runtime.model.model import model_from_module
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.paper_rows import observe_paper

RIGID = model_from_module(emps_rigid_qm)
ASYMMETRIC = model_from_module(emps_rigid_asymmetric_qm)
AC = model_from_module(emps300_qm_ac)
PUBLISHED = {"cutoff_hz": 100.0, "filter_order": 4, "decimation": 10, "drop": 49}


def test_the_published_result_comes_out_to_every_decimal(emps: Record) -> None:
    estimate = identify(RIGID, emps, **values_of("pham2002", residual_dof="r-1", **PUBLISHED))  # type: ignore[arg-type]
    printed = {
        "M": (95.1089, 0.1085, 0.1141),
        "Fv": (203.5034, 1.1460, 0.5631),
        "Fc": (20.3935, 0.1012, 0.4964),
        "offset": (-3.1648, 0.0444, 1.4021),
    }
    for name, (value, spread, percent) in printed.items():
        assert round(estimate.params[name], 4) == value
        assert round(estimate.bse[name], 4) == spread
        assert round(estimate.relative_std[name], 4) == percent
    assert round(estimate.fit.condition_number_raw, 4) == 25.9883
    assert round(estimate.fit.error_norm, 4) == 108.7569
    assert round(100.0 * estimate.fit.relative_error, 4) == 4.0834
    assert round(estimate.fit.sigma, 4) == 2.1843
    assert estimate.nobs == 2480


def test_equation_11_as_printed_divides_by_r_minus_c(emps: Record) -> None:
    narrow, printed = (
        identify(RIGID, emps, **values_of("pham2002", residual_dof=dof, **PUBLISHED))  # type: ignore[arg-type]
        for dof in ("r-1", "r-c")
    )
    assert dict(narrow.params) == dict(printed.params)
    assert printed.bse["Fv"] / narrow.bse["Fv"] == pytest.approx(np.sqrt(2479 / 2476))
    assert round(printed.fit.sigma, 4) == 2.1857


def test_the_published_asymmetric_result_comes_out_to_every_decimal(emps: Record) -> None:
    estimate = identify(ASYMMETRIC, emps, **values_of("pham2002", **PUBLISHED))  # type: ignore[arg-type]
    found = {name: round(value, 4) for name, value in estimate.params.items()}
    assert found == {
        "M": 95.1540,
        "Fv_plus": 166.7061,
        "Fc_plus": 20.1440,
        "Fv_minus": 240.4236,
        "Fc_minus": 20.6277,
    }
    assert round(100.0 * estimate.fit.relative_error, 4) == 3.1117


def random_record(model_channels: tuple[str, ...], n: int, name: str = "run") -> Record:
    rng = np.random.default_rng(0)
    return Record({key: np.cumsum(rng.standard_normal(n)) for key in model_channels}, 1000.0, name)


def test_forces_are_decimated_but_not_low_passed() -> None:
    record = random_record(RIGID.channels, 600)
    low, high = (
        observe_paper(RIGID, [record], choose_filter(RIGID, [record], cutoff_hz=cutoff_hz, decimation=5))
        for cutoff_hz in (20.0, 90.0)
    )
    np.testing.assert_array_equal(low.blocks[0].Y, high.blocks[0].Y)
    assert not np.allclose(low.blocks[0].W[:, 1], high.blocks[0].W[:, 1])


def test_every_row_of_every_record_is_a_block_without_masks() -> None:
    records = [random_record(AC.channels, 600, "one"), random_record(AC.channels, 700, "two")]
    choice = choose_filter(AC, records, cutoff_hz=90.0, decimation=5)
    observation = observe_paper(AC, records, choice, drop=100)
    assert [(block.record_name, block.row_name, len(block.Y)) for block in observation.blocks] == [
        ("one", "m", 100), ("one", "c", 100), ("one", "m+c", 100),
        ("two", "m", 120), ("two", "c", 120), ("two", "m+c", 120),
    ]  # fmt: skip
    assert all(block.masked == 0 for block in observation.blocks)
    assert all(block.W.shape == (len(block.Y), 6) for block in observation.blocks)


def test_a_short_record_is_refused_with_the_number_needed() -> None:
    record = random_record(RIGID.channels, 100)
    choice = choose_filter(RIGID, [record], cutoff_hz=90.0, decimation=30)
    with pytest.raises(DataError, match=r"has 100 samples.*at least 151"):
        observe_paper(RIGID, [record], choice)


def test_forces_go_through_the_filter_of_the_sensors_where_asked() -> None:
    record = random_record(RIGID.channels, 600)
    choice = replace(choose_filter(RIGID, [record], cutoff_hz=20.0, decimation=5), filtered_forces=True)
    force = zero_phase(record.signals["F"], choice.filter_order, 20.0, record.fs)
    filtered = Record({**record.signals, "F": force}, record.fs, record.name)
    found = observe_paper(RIGID, [record], choice).blocks[0]
    wanted = observe_paper(RIGID, [filtered], replace(choice, filtered_forces=False)).blocks[0]
    np.testing.assert_array_equal(found.Y, wanted.Y)
    np.testing.assert_array_equal(found.W, wanted.W)


def test_samples_slower_than_given_are_left_out() -> None:
    record = random_record(RIGID.channels, 600)
    choice = choose_filter(RIGID, [record], cutoff_hz=20.0, decimation=5)
    every = observe_paper(RIGID, [record], choice).blocks[0]
    found = observe_paper(RIGID, [record], replace(choice, slow_speeds=(("d1_q_m", 20.0),))).blocks[0]
    low_passed = zero_phase(record.signals["q_m"], choice.filter_order, 20.0, record.fs)
    fast = np.abs(np.gradient(low_passed, 1e-3))[decimation_start(600, 5) :: 5] >= 20.0
    assert 0 < found.masked == np.sum(~fast) < 120
    np.testing.assert_array_equal(found.place, np.flatnonzero(fast))
    np.testing.assert_array_equal(found.W, every.W[fast])


def test_filtered_forces_are_refused_where_they_are_filtered_in_any_case() -> None:
    record = random_record(RIGID.channels, 600)
    with pytest.raises(DataError, match=r"filtered_forces.*method wls filters forces in any case"):
        identify(RIGID, record, "wls", Filters(filtered_forces=True))
