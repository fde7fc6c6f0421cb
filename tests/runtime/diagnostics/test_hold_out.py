from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import butter, cheby1, sosfiltfilt

from generated import emps300_qm_qc
from modelgen.errors import DataError, IdentifiabilityError
from modelgen.runtime.diagnostics.hold_out import held_apart, little_left
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.identification.options import values_of
from modelgen.runtime.model.model import model_from_module
from modelgen.runtime.records.record import Record
from modelgen.runtime.simulation.simulate import simulate
from tests.runtime.rigid_motion import FS, RIGID, SETTINGS, rigid_record, swings

QC = model_from_module(emps300_qm_qc)


def records(change: float = 0.0) -> list[Record]:
    """Two records alike, but for a load of so many kg in the second."""
    return [rigid_record(name="one"), rigid_record(name="two", seed=1, extra=lambda q, v, a: change * a)]


def test_a_held_out_record_that_agrees_changes_nothing_but_the_report() -> None:
    alone = identify(RIGID, records()[0], **values_of("wls", **SETTINGS))
    estimate = identify(RIGID, records(), **values_of("wls", hold_out="two", **SETTINGS))
    assert estimate.params == alone.params
    assert estimate.bse == alone.bse
    assert estimate.records == ("one",)
    found = estimate.checks.held_out
    assert found is not None
    (row,) = found.rows
    assert (row.record, row.row) == ("two", "m")
    assert row.relative_error == pytest.approx(estimate.fit.relative_error, rel=0.1)
    assert row.fitted_error == pytest.approx(estimate.fit.relative_error, rel=1e-9)
    assert not any(one.significant for one in found.moves)
    assert estimate.checks.advice == ()


def test_a_held_out_record_that_disagrees_widens_the_interval_and_is_named() -> None:
    alone = identify(RIGID, records()[0], **values_of("wls", **SETTINGS))
    estimate = identify(RIGID, records(change=5.0), **values_of("wls", hold_out=["two"], **SETTINGS))
    assert estimate.params == alone.params
    found = estimate.checks.held_out
    assert found is not None
    assert {one.name for one in found.moves if one.significant} == {"M"}
    # two values 5 kg apart: a standard deviation of 5 / sqrt(2)
    assert estimate.bse["M"] == pytest.approx(5.0 / np.sqrt(2.0), rel=0.02)
    assert estimate.bse["Fc"] == pytest.approx(alone.bse["Fc"], rel=1e-6)
    assert [one.kind for one in estimate.checks.advice] == ["held-out records disagree"]
    assert found.rows[0].relative_error > 1.5 * estimate.fit.relative_error
    assert "M +5.3 %" in estimate.summary()


def test_a_record_that_cannot_answer_is_looked_at_all_the_same() -> None:
    one_way = rigid_record(swings((0.4, 0.1), (0.1, 1.3), speed=2.0), name="two")
    estimate = identify(
        RIGID, [rigid_record(name="one"), one_way], **values_of("wls", hold_out="two", **SETTINGS)
    )
    found = estimate.checks.held_out
    assert found is not None
    assert found.rows[0].relative_error < 0.01
    assert {one.name for one in found.moves} == {"M", "Fv"}


def test_a_share_is_cut_from_the_end_of_every_record_in_whole_periods() -> None:
    given = records()
    kept, held = held_apart(given, 0.25, {})
    assert [record.n for record in kept] == [18750, 18750]
    assert [record.name for record in held] == ["one (held out)", "two (held out)"]
    whole = np.concatenate([kept[0].signals["F"], held[0].signals["F"]])
    np.testing.assert_array_equal(whole, given[0].signals["F"])
    kept, held = held_apart(given, 0.25, {"one": 10.0})
    assert (kept[0].n, kept[1].n) == (20000, 18750)
    estimate = identify(RIGID, given, **values_of("wls", hold_out=0.4, **SETTINGS))
    assert estimate.checks.held_out is not None
    assert len(estimate.checks.held_out.rows) == 2


@pytest.mark.parametrize(
    ("hold_out", "said"),
    [
        ("three", "has no record three"),
        (["one", "two"], "leaves no record"),
        (1.5, "between 0 and 1"),
        (0.0, "between 0 and 1"),
        (1e-6, r"leaves 0 of its 25000 samples to test with; give a share from 0\.002 to 0\.998"),
        (0.9999, r"leaves 2 of its 25000 samples to identify from; give a share from .*--hold-out 0\.3"),
    ],
)
def test_what_cannot_be_held_out_is_named(hold_out: float | str | list[str], said: str) -> None:
    with pytest.raises(DataError, match=said):
        held_apart(records(), hold_out, {})


def test_where_most_is_held_out_that_may_be_why_nothing_is_found() -> None:
    lost = IdentifiabilityError.at("rows", "none has samples left", "record longer")
    with pytest.raises(IdentifiabilityError) as raised, little_left(0.96):
        raise lost
    assert str(raised.value.problems[0]).startswith("hold_out: leaves 4 % of every record to identify from")
    assert raised.value.problems[1:] == lost.problems
    for none in (0.3, None, "one", ("one", "two")):
        with pytest.raises(IdentifiabilityError) as raised, little_left(none):
            raise lost
        assert raised.value.problems == lost.problems


def scipy_rows(record: Record, decimation: int) -> tuple[np.ndarray, np.ndarray]:
    """The published recipe on one stretch, as one writes it with SciPy; W of M, Fv, Fc and offset, and Y."""
    sos = butter(4, 100.0, fs=record.fs, output="sos")
    q = sosfiltfilt(sos, record.signals["q_m"], padtype="odd", padlen=12)
    v = np.gradient(q, record.dt)
    a = np.gradient(v, record.dt)
    rows = np.column_stack([a, v, np.sign(v), np.ones(record.n), record.signals["F"]])[49:]
    low = cheby1(8, 0.05, 0.8 / decimation, output="sos")
    kept = -(-len(rows) // decimation)
    smooth = sosfiltfilt(low, rows, axis=0, padtype="odd", padlen=24)
    rows = smooth[decimation - (decimation * kept - len(rows)) - 1 :: decimation]
    return rows[:, :-1], rows[:, -1]


@pytest.mark.parametrize("decimation", [2, 10, 17])
@pytest.mark.parametrize("share", [0.3, 0.6])
def test_the_given_decimation_holds_for_what_is_held_out(emps: Record, decimation: int, share: float) -> None:
    given = {"cutoff_hz": 100.0, "filter_order": 4, "decimation": decimation, "drop": 49}
    estimate = identify(RIGID, emps, **values_of("pham2002", hold_out=share, **given))  # type: ignore[arg-type]
    at = round((1.0 - share) * emps.n)
    W, Y = scipy_rows(emps.part(0, at, "kept"), decimation)
    x = np.linalg.lstsq(W, Y, rcond=None)[0]
    W, Y = scipy_rows(emps.part(at, emps.n, "held"), decimation)
    assert estimate.checks.held_out is not None
    (row,) = estimate.checks.held_out.rows
    assert row.samples == len(Y)
    assert row.relative_error == pytest.approx(np.linalg.norm(Y - W @ x) / np.linalg.norm(Y), rel=1e-9)


@pytest.mark.parametrize("method", ["wls", "iv"])
@pytest.mark.parametrize("decimation", [3, 20])
def test_every_method_keeps_to_the_given_decimation(method: str, decimation: int) -> None:
    given = {**SETTINGS, "decimation": decimation}
    estimate = identify(RIGID, records(), **values_of(method, hold_out="two", **given))
    held = estimate.checks.held_out
    assert held is not None
    # records of one length whose rows lose no sample: as many there as where it was fitted
    (row,), (fitted,) = held.rows, estimate.fit.rows
    assert row.samples == pytest.approx(fitted.used, abs=fitted.masked)
    assert row.samples == pytest.approx(25000 / decimation, rel=0.2)


def two_encoders(zeros: tuple[float, ...]) -> list[Record]:
    """Records of an axis whose second encoder has these zeros."""
    parameters = QC.parameter_sets["light"]
    noise = {"q_m": 1e-5, "q_c": 1e-5, "Gamma_m": 1e-4}
    found = []
    for index, zero in enumerate(zeros):
        kind = ("chirp", "trapezoid")[index % 2]
        record = simulate(QC, parameters, kind, noise=noise, seed=index).record
        signals = {**record.signals, "q_c": record.signals["q_c"] + zero}
        found.append(replace(record, signals=signals, name=f"run {index}"))
    return found


@pytest.mark.slow
@pytest.mark.parametrize("hold_out", ["run 2", 0.3])
def test_zeros_of_encoders_are_those_of_the_held_out_records(hold_out: str | float) -> None:
    estimate = identify(QC, two_encoders((0.0, 0.02, -0.01)), **values_of(hold_out=hold_out))
    assert any("zero of its own" in one.sentence for one in estimate.checks.advice)
    held = estimate.checks.held_out
    assert held is not None
    assert held.rows
    assert max(row.relative_error for row in held.rows) < 0.01
    assert not any(one.significant for one in held.moves)


def test_nothing_is_held_out_unless_it_is_asked_for() -> None:
    given = records()
    assert held_apart(given, None, {}) == (tuple(given), ())
    assert identify(RIGID, given, **values_of("wls", **SETTINGS)).checks.held_out is None
    assert given[0].fs == FS
