"""The guards speak where they must, and keep silent where the experiment is sound."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from generated import emps300_qm_qc, emps_rigid_asymmetric_qm, three_mass_va_vb_vc
from modelgen.errors import IdentifiabilityError
from modelgen.runtime.diagnostics.motion_checks import (
    band_above_filter,
    one_way_friction,
    resting_bodies,
    short_records,
)
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.identification.job import Job
from modelgen.runtime.identification.methods import METHODS
from modelgen.runtime.identification.options import values_of
from modelgen.runtime.least_squares.wls import fit_matched
from modelgen.runtime.model.model import model_from_module
from modelgen.runtime.records.record import Record
from modelgen.runtime.results.estimate import Estimate
from modelgen.runtime.rows.observation import Observation
from modelgen.runtime.rows.row_block import RowBlock
from modelgen.runtime.simulation.simulate import simulate
from tests.runtime.rigid_motion import (
    CHOICE,
    FS,
    LIVELY,
    ONE_WAY,
    RIGID,
    SETTINGS,
    TRUTH,
    Motion,
    kinds,
    rigid_record,
    swings,
)

TWO_MASS = model_from_module(emps300_qm_qc)
TACHOMETERS = model_from_module(three_mass_va_vb_vc)
ASYMMETRIC = model_from_module(emps_rigid_asymmetric_qm)


@pytest.mark.slow
def test_a_sound_experiment_is_left_alone() -> None:
    for seed in range(3):
        estimate = identify(RIGID, rigid_record(seed=seed), **values_of(**SETTINGS))
        assert kinds(estimate) == []
        assert not estimate.not_identifiable
        assert "Warnings" not in estimate.summary()


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_without_a_reversal_friction_and_offset_are_one(sign: float) -> None:
    estimate = identify(RIGID, rigid_record(ONE_WAY[sign]), **values_of(**SETTINGS))
    assert set(estimate.params) == {"M", "Fv"}
    for name in ("Fc", "offset"):
        assert "the velocity of m never reverses" in estimate.not_identifiable[name]
    (advice,) = [one for one in estimate.checks.advice if one.kind == "dependent columns"]
    # their sum, as the direction of motion has it, is a number all the same
    number = float(re.findall(r"= (-?[0-9.]+)", advice.where)[0])
    assert abs(number) == pytest.approx(TRUTH["Fc"] + sign * TRUTH["offset"], abs=0.1)


def test_a_row_that_counts_the_other_way_is_no_reversal() -> None:
    negated = {
        column: tuple((-coefficient, key) for coefficient, key in terms)
        for column, terms in RIGID.regressor_columns[0].items()
    }
    measured = tuple((-coefficient, key) for coefficient, key in RIGID.measurement_columns[0])
    model = replace(
        RIGID,
        rows=RIGID.rows * 2,
        regressor_columns=(RIGID.regressor_columns[0], negated),
        measurement_columns=(RIGID.measurement_columns[0], measured),
    )
    for motion, one_way in ((ONE_WAY[1.0], True), (LIVELY, False)):
        fit = METHODS["wls"].run(Job(model, (rigid_record(motion),), CHOICE))[1]
        assert bool(one_way_friction(model, fit)) is one_way


def test_a_reversal_in_another_record_is_enough() -> None:
    records = [rigid_record(ONE_WAY[1.0], name="there"), rigid_record(ONE_WAY[-1.0], name="back")]
    estimate = identify(RIGID, records, **values_of(**SETTINGS))
    assert set(estimate.params) == set(TRUTH)
    assert not estimate.not_identifiable


@pytest.mark.slow
def test_without_an_offset_in_the_model_the_friction_holds_it() -> None:
    truth = TWO_MASS.parameter_sets["light"]
    chirp, trapezoid = (
        simulate(TWO_MASS, truth, kind, fs=5000.0, duration_s=3.0, oversample=8).record
        for kind in ("chirp", "trapezoid")
    )
    alone, both = identify(TWO_MASS, chirp), identify(TWO_MASS, [chirp, trapezoid])
    assert "never reversing" in kinds(alone)
    assert "never reversing" not in kinds(both)


def test_a_direction_that_no_sample_has_is_named() -> None:
    estimate = identify(ASYMMETRIC, rigid_record(ONE_WAY[1.0]), **values_of(**SETTINGS))
    for name in ("Fv_minus", "Fc_minus"):
        assert estimate.not_identifiable[name] == "no sample used moves backward"


def test_a_body_that_rests_gets_no_inertia() -> None:
    rest = rigid_record(swings(speed=0.0))
    with_motion = rigid_record(name="moving")
    estimate = identify(RIGID, rest, **values_of("wls", **SETTINGS))
    assert set(estimate.params) == {"offset"}
    assert "m never moves: q_m" in estimate.not_identifiable["M"]
    both = identify(RIGID, [with_motion, replace(rest, name="still")], **values_of("wls", **SETTINGS))
    assert set(both.params) == set(TRUTH)
    assert [one.where for one in both.checks.advice if one.kind == "never moving"] == ["still"]


def test_a_steady_velocity_is_a_motion_and_a_zero_one_is_not() -> None:
    noise = 1e-3 * np.random.default_rng(0).standard_normal((4, 5000))
    keys = [*TACHOMETERS.channels]
    speeds = {"v_a": 0.5, "v_b": -0.5, "v_c": 0.0}
    assert set(speeds) <= set(keys)
    signals = {key: speeds.get(key, 1.0) + noise[i % 4] for i, key in enumerate(keys)}
    reasons = resting_bodies(TACHOMETERS, [Record(signals, 1000.0, "steady")])
    inertias = {role.bodies[0]: name for name, role in TACHOMETERS.roles.items() if role.role == "inertia"}
    assert inertias["c"] in reasons
    assert inertias["a"] not in reasons
    assert inertias["b"] not in reasons


def test_a_steady_crawl_is_a_motion_that_answers_no_friction() -> None:
    estimate = identify(RIGID, rigid_record(swings(speed=0.01)), **values_of("wls", **SETTINGS))
    assert not any("never moves" in reason for reason in estimate.not_identifiable.values())
    for name in ("Fv", "Fc", "offset"):
        assert name in estimate.not_identifiable
    (advice,) = [one for one in estimate.checks.advice if one.kind == "dependent columns"]
    assert "exactly dependent" in advice.what


def short(motion: Motion | None = None, n: int = 1240) -> Estimate:
    record = rigid_record(motion or swings((0.4, 1.0), (0.1, 4.3), (0.05, 9.1)), n=n)
    return identify(RIGID, record, **values_of(cutoff_hz=15.0, direction_cutoff_hz=15.0))


def test_a_record_of_which_the_filter_leaves_little_is_too_short() -> None:
    estimate = short()
    (filtered, *_) = [one for one in estimate.checks.advice if one.kind == "too short"]
    assert "1.24 s long, of which the filter's reach leaves" in filtered.what
    assert "too short" not in kinds(short(n=12000))


def test_a_record_shorter_than_its_slowest_mode_is_too_short() -> None:
    truth = dict(TWO_MASS.parameter_sets["light"]) | {"K": 0.38 / 90.0**2}  # mode at about 1.4 Hz
    record = simulate(TWO_MASS, truth, "chirp", fs=2000.0, duration_s=2.0, oversample=4).record
    estimate = identify(TWO_MASS, record, cutoff_hz=60.0)
    said = [one.what for one in estimate.checks.advice if one.kind == "too short"]
    assert any("periods of the mode at" in what for what in said)


@pytest.mark.parametrize(("decimation", "speaks"), [(10, True), (1, True), (30, False)])
def test_a_decimation_that_passes_more_than_the_filter_is_named(decimation: int, speaks: bool) -> None:
    # 0.8 * 1000 / (2 * 10) = 40 Hz against a cut-off of 25 Hz; a decimation of 16 passes 25 Hz
    record = rigid_record()
    options = {"cutoff_hz": 25.0, "decimation": decimation}
    estimate = identify(RIGID, record, **values_of("pham2002", **options))
    found = [one for one in estimate.checks.advice if one.kind == "decimation band above the filter band"]
    assert bool(found) is speaks
    if found:
        assert "decimation of 16 or more" in found[0].remedy
    # matched filters treat forces and motion alike: nothing to say
    matched = identify(RIGID, record, **values_of(**options, direction_cutoff_hz=10.0))
    assert "decimation band above the filter band" not in kinds(matched)


def test_the_least_decimation_it_asks_for_is_enough() -> None:
    record = rigid_record()
    (advice,) = band_above_filter([record], replace(CHOICE, cutoff_hz=25.0, decimation=(15,)))
    assert band_above_filter([record], replace(CHOICE, cutoff_hz=25.0, decimation=(16,))) == ()
    assert "up to 26.67 Hz" in advice.what


@pytest.mark.slow
def test_a_clamped_body_gets_no_parameters_but_the_others_do() -> None:
    t = np.arange(20000) / 5000.0
    rng = np.random.default_rng(0)
    q = 0.3 * np.sin(2.0 * np.pi * 0.7 * t) + 0.01 * np.sin(2.0 * np.pi * 23.0 * t)
    w = (2.0 * np.pi * 0.7, 2.0 * np.pi * 23.0)
    v = 0.3 * w[0] * np.cos(w[0] * t) + 0.01 * w[1] * np.cos(w[1] * t)
    a = -0.3 * w[0] ** 2 * np.sin(w[0] * t) - 0.01 * w[1] ** 2 * np.sin(w[1] * t)
    p = TWO_MASS.parameter_sets["light"]
    force = p["J_m"] * a + p["F_vm"] * v + p["F_sm"] * np.sign(v) + p["K"] * q + p["F_vmc"] * v
    clamped = 1e-7 * rng.standard_normal(len(t))
    record = Record({"q_m": q, "q_c": clamped, "Gamma_m": force}, 5000.0, "clamped")
    estimate = identify(
        TWO_MASS, record, **values_of(cutoff_hz=120.0, direction_cutoff_hz=60.0, drift_check=False)
    )
    assert "c never moves" in estimate.not_identifiable["J_c"]


def test_a_force_whose_reading_is_clipped_is_refused_and_one_at_its_limit_is_not() -> None:
    # a drive that reaches its limit moves the axis by the force that it reads
    times = np.arange(20_000) / FS
    waves = sum(np.sin(2.0 * np.pi * hertz * times + hertz) for hertz in (0.7, 1.9, 4.3, 9.1))
    wanted = 60.0 * waves
    limited = np.clip(wanted, -0.6 * np.abs(wanted).max(), 0.6 * np.abs(wanted).max())
    record = Record({"q_m": _pushed(limited), "F": limited}, FS, "drive")
    assert np.mean(np.abs(limited) == np.abs(limited).max()) > 0.01
    mass = identify(RIGID, record, **values_of("wls", **SETTINGS)).params["M"]
    assert mass == pytest.approx(TRUTH["M"], rel=0.02)
    clipped = Record({"q_m": _pushed(wanted), "F": limited}, FS, "reading")
    with pytest.raises(IdentifiabilityError, match=r"reading, channel F: reads its limit in \d+ samples"):
        identify(RIGID, clipped, **values_of("wls", **SETTINGS))


def _pushed(force: np.ndarray) -> np.ndarray:
    """Return where a force moves the rigid axis, shape (n,)."""
    q, v, found = 0.0, 0.0, []
    for one in force.tolist():
        found.append(q)
        friction = TRUTH["Fv"] * v + TRUTH["Fc"] * np.tanh(v / 1e-3) + TRUTH["offset"]
        v += (one - friction) / TRUTH["M"] / FS
        q += v / FS
    return np.array(found)


def test_few_instants_are_no_long_memory_and_a_slow_error_is() -> None:
    n = 90
    record = rigid_record(n=n * CHOICE.decimation[0])

    def told(left: np.ndarray) -> bool:
        block = RowBlock(0, 0, "run", "m", "N", np.arange(n), n, left, np.ones((n, 1)), 0, True, 8.0, 0)
        fit = fit_matched(Observation(("offset",), (block,), ()))
        return bool(short_records([record], CHOICE, fit, None))

    white = np.random.default_rng(0).standard_normal(n)
    assert not told(np.diff(white, prepend=0.0))  # as of a differentiated reading: neighbours cancel
    assert told(np.cumsum(white))
