from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from generated import emps300_qm_ac, emps300_qm_qc
from modelgen.render.arms.arm_writer import arm_files
from modelgen.runtime.diagnostics import parameter_checks
from modelgen.runtime.diagnostics.parameter_checks import (
    negative_values,
    null_columns,
    null_solution,
    slowest_mode_hz,
    uncertain_parameters,
)
from modelgen.runtime.diagnostics.row_noise import row_noise
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.identification.options import values_of
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.wls import fit_matched
from modelgen.runtime.model.model import model_from_module, model_from_text
from modelgen.runtime.numerics.regressor import plain_regressors
from modelgen.runtime.parameters.parameter import Parameter
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.observation import observe
from modelgen.runtime.simulation.simulate import simulate
from modelgen.spec.arms.arm import ArmMeasures, ArmSensor, Payload
from modelgen.spec.arms.load import load_arm
from modelgen.spec.arms.parameters import link_names
from modelgen.spec.load import catalog_path
from tests.runtime.identification.test_assemble_estimate import observation
from tests.runtime.rigid_motion import CHOICE, FS, RIGID, SETTINGS, kinds, rigid_record, swings

TWO_MASS = model_from_module(emps300_qm_qc)


def test_the_slowest_mode_is_that_of_the_parameters() -> None:
    p = TWO_MASS.parameter_sets["light"]
    expected = np.sqrt(p["K"] * (1.0 / p["J_m"] + 1.0 / p["J_c"])) / (2.0 * np.pi)
    assert slowest_mode_hz(TWO_MASS, p) == pytest.approx(expected, rel=1e-6)
    assert slowest_mode_hz(RIGID, {"M": 95.0}) is None
    assert slowest_mode_hz(TWO_MASS, {"J_m": 1.0}) is None


def test_a_motion_that_is_too_slow_for_the_inertia_is_named() -> None:
    slow = rigid_record(swings((2e-3, 0.05), (1e-3, 0.11)), noise=1e-7)
    estimate = identify(RIGID, slow, **values_of("wls", cutoff_hz=20.0, direction_cutoff_hz=10.0))
    assert estimate.relative_std["M"] > 10.0
    (advice,) = [one for one in estimate.checks.advice if one.kind == "too slow"]
    assert advice.where == "M"
    assert "accelerate harder" in advice.remedy
    assert "noisy derivative" in kinds(estimate)


@pytest.mark.parametrize("sensor", ["gyro", "accelerometer"])
def test_whatever_is_uncertain_has_a_remedy(sensor: ArmMeasures) -> None:
    """Of every kind of parameter that an arm can have, mountings of sensors among them."""
    arm = load_arm(catalog_path("elastic_two_link"))
    estimated = ArmSensor("s", "2", "link", sensor, estimated=True)
    joints = tuple(
        replace(one, stiffness3=f"K3_{one.name}", gain=f"gain_{one.name}") for one in arm.joints[1:]
    )
    arm = replace(
        arm,
        joints=(arm.joints[0], *joints),
        sensor_sets={"all": (*arm.sensor_sets["encoders"], estimated)},
        payloads=(Payload("disc", "2", link_names("disc")),),
    )
    ((file, text),) = arm_files(arm, "all").items()
    model = model_from_text(text, file)
    assert {"mounting", "gain", "stiffness3", "link"} <= {role.role for role in model.roles.values()}
    fit = _fit_of_two_rows(1e-6)
    entry = identify(RIGID, rigid_record(), **values_of(**SETTINGS)).parameters.identified[0]
    for name in model.parameters:
        uncertain = replace(entry, name=name, value=1.0, std=0.3)
        named = replace(fit, columns=tuple(name if one == "K" else one for one in fit.columns))
        (advice,) = uncertain_parameters(model, named, [uncertain], 10.0, None, None)
        assert advice.remedy


def test_a_stiffness_below_its_mode_is_called_too_slow() -> None:
    estimate = identify(RIGID, rigid_record(), **values_of(**SETTINGS))
    entry = replace(estimate.parameters.identified[0], name="K", value=1.0, std=0.5)
    fit = _fit_of_two_rows(1e-6)
    (slow,) = uncertain_parameters(TWO_MASS, fit, [entry], 10.0, 106.0, 5.0)
    assert slow.kind == "too slow"
    assert "excite up to 5 Hz, the mode lies at 106 Hz" in slow.what
    (small,) = uncertain_parameters(TWO_MASS, fit, [entry], 10.0, 106.0, 200.0)
    assert small.kind == "too small"
    assert uncertain_parameters(TWO_MASS, fit, [replace(entry, std=0.05)], 10.0, 106.0, 5.0) == ()
    assert uncertain_parameters(TWO_MASS, _fit_of_two_rows(1.0), [entry], 10.0, 106.0, 5.0) == ()


def _fit_of_two_rows(scale: float):
    """A fit in which the column of K is `scale` times as large as the others, against a residual of 0.1."""
    rows = observation()
    weights = np.array([1.0, 1.0, 1.0, 1.0, 1.0, scale])
    blocks = tuple(replace(block, W=block.W * weights) for block in rows.blocks)
    return fit_matched(replace(rows, blocks=blocks))


def test_a_reversed_sign_is_named_as_negative() -> None:
    good = rigid_record()
    wrong = Record({"q_m": -good.signals["q_m"], "F": good.signals["F"]}, FS, "run")
    negative = [
        one for one in identify(RIGID, wrong, **values_of(**SETTINGS)).checks.advice if one.kind == "negative"
    ]
    assert [one.where for one in negative] == ["M", "Fv", "Fc"]
    assert "check signs of channels" in negative[0].remedy


@pytest.mark.parametrize(
    ("value", "std", "speaks"), [(-4.0, 1.0, True), (-2.0, 1.0, False), (2.0, 1.0, False)]
)
def test_chance_is_not_called_negative(value: float, std: float, speaks: bool) -> None:
    entry = Parameter("Fv", "N s/m", value, std, std, 0.0, std)
    assert bool(negative_values(RIGID, [entry])) is speaks
    # an offset may have either sign
    assert negative_values(RIGID, [replace(entry, name="offset")]) == ()


def test_a_row_that_is_explained_by_nothing_is_the_null_solution() -> None:
    t = np.arange(25000) / FS
    noise = np.random.default_rng(0).standard_normal(len(t))
    other = 30.0 * np.sin(2.0 * np.pi * 2.0 * t) + noise
    estimate = identify(
        RIGID,
        Record({"q_m": rigid_record().signals["q_m"], "F": other}, FS, "mixed"),
        **values_of("wls", **SETTINGS),
    )
    (advice,) = [one for one in estimate.checks.advice if one.kind == "null solution"]
    assert "mixed, row m" in advice.where


def test_a_row_that_noise_drowns_is_no_null_solution() -> None:
    model = model_from_module(emps300_qm_ac)
    noise, truth = {"q_m": 2e-5, "a_c": 20.0, "Gamma_m": 1e-3}, model.parameter_sets["light"]
    records = [
        simulate(model, truth, kind, fs=5000.0, duration_s=1.0, noise=noise, seed=seed).record
        for seed, kind in enumerate(("chirp", "trapezoid"))
    ]
    estimate = identify(model, records, **values_of(drift_check=False))
    (row,) = [one for one in estimate.fit.rows if (one.record, one.row) == ("trapezoid", "m")]
    assert row.relative_error is not None
    assert row.relative_error > 0.95
    assert "null solution" not in kinds(estimate)


@pytest.mark.parametrize(("composites", "told"), [({}, ["quiet, row m"]), ({"J/K": "J/K"}, [])])
def test_rows_of_composites_that_another_record_explains_are_not_null(
    composites: dict[str, str], told: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    shares = (0.1, 1.04)
    names = ("busy", "quiet")
    blocks = [
        SimpleNamespace(record=k, row=0, row_name="m", record_name=name, has_force=True)
        for k, name in enumerate(names)
    ]
    fit = cast(Fit, SimpleNamespace(blocks=blocks, projected=None, unexplained=lambda index: shares[index]))
    for name in ("_drowned", "hardly_weighed"):
        monkeypatch.setattr(parameter_checks, name, lambda *_: False)
    model = replace(RIGID, composites=composites)
    record = rigid_record()
    found = null_solution(fit, model, [record, record], CHOICE)
    assert [one.where for one in found] == told


def test_the_noise_of_a_row_is_that_of_a_record_of_noise_alone() -> None:
    model, spread = model_from_module(emps300_qm_ac), {"q_m": 2e-5, "a_c": 2.0, "Gamma_m": 1e-4}
    truth = model.base_from_physical({**model.parameter_sets["light"], "F_sm": 0.0})
    rng, samples = np.random.default_rng(2), 60_000
    signals = {key: std * rng.standard_normal(samples) for key, std in spread.items()}
    # at a steady speed: no sample is near a reversal, and only the mean of a row is not noise
    signals["q_m"] += 10.0 * np.arange(samples) / 5000.0
    record = Record(signals, 5000.0, "noise")
    choice = FilterChoice(6, 200.0, 100.0, (1,), 100.0, 100.0, (), (), ())
    for block in observe(model, [record], choice).blocks:
        left = np.std(block.Y - block.W @ truth)
        assert row_noise(model, record, choice, 1, block.row, truth) == pytest.approx(left, rel=0.05)


def test_rounding_counts_as_it_follows_the_motion() -> None:
    model, step, rng = model_from_module(emps300_qm_qc), 2.0 * np.pi / 4096, np.random.default_rng(3)
    truth = model.base_from_physical({**model.parameter_sets["light"], "F_sm": 0.0})
    t = np.arange(20_000) / 5000.0
    creeping = 1e-3 * t + 5.0 * np.clip(t - 3.0, 0.0, None)  # next to no step in the first three seconds
    motion = {"q_m": creeping + 0.3 * step, "q_c": creeping - 0.1 * step, "Gamma_m": np.zeros(len(t))}
    read = {key: step * np.round(motion[key] / step) for key in ("q_m", "q_c")}
    read["Gamma_m"] = 1e-4 * rng.standard_normal(len(t))
    moved, record = Record(motion, 5000.0, "moved"), Record(read, 5000.0, "read")
    choice = FilterChoice(6, 200.0, 100.0, (1,), 100.0, 100.0, (), (), ())
    quiet = observe(model, [moved], choice).blocks
    for block, other in zip(observe(model, [record], choice).blocks, quiet, strict=True):
        change = (block.Y - other.Y) - (block.W - other.W) @ truth
        left = float(np.sqrt(np.mean(change**2)))
        white = row_noise(model, record, choice, 1, block.row, truth)
        assert white < 0.4 * left
        # readings of other zeros would be rounded otherwise
        assert 0.5 * left < row_noise(model, record, choice, 1, block.row, truth, moved) < 2.0 * left


def test_a_load_row_that_noise_pulls_to_zero_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    from modelgen.runtime.least_squares.wls import fit_paper

    rows = observation()
    fit = fit_paper(rows)
    assert null_solution(fit, TWO_MASS, (), CHOICE) == ()
    noise = np.random.default_rng(3).standard_normal(rows.blocks[1].W.shape)
    drowned = replace(rows.blocks[1], W=rows.blocks[1].W * 1e-3 + noise * (rows.blocks[1].W != 0.0))
    lost = fit_paper(replace(rows, blocks=(rows.blocks[0], drowned)))
    (advice,) = null_solution(lost, TWO_MASS, (), CHOICE)
    assert advice.where == "run, row c"
    assert "noise biases it towards zero" in advice.what
    # a row that another record explains is not lost with one in which it drowns
    with monkeypatch.context() as patched:
        patched.setattr(parameter_checks, "_drowned", lambda *_: True)
        both = fit_paper(replace(rows, blocks=(*rows.blocks, replace(drowned, record=1))))
        assert null_solution(both, TWO_MASS, (Record({"q_m": np.zeros(9)}, FS, "run"),) * 2, CHOICE) == ()
    # instruments are not biased by noise: such a row is right if noise is all that it leaves
    by_instruments = replace(lost, projected=plain_regressors(tuple(block.W for block in lost.blocks)))
    records = (Record({"q_m": np.zeros(9)}, FS, "run"),) * 2
    for drowns in (True, False):
        monkeypatch.setattr(parameter_checks, "_drowned", lambda *_, drowns=drowns: drowns)
        found = null_solution(by_instruments, TWO_MASS, records, CHOICE)
        assert len(found) == (not drowns)
        assert all("iv" not in one.remedy.split() for one in found)


def test_the_columns_of_a_row_that_explains_nothing_have_no_number(monkeypatch: pytest.MonkeyPatch) -> None:
    from modelgen.runtime.least_squares.wls import fit_paper

    rows = observation()
    records = (Record({"q_m": np.zeros(9)}, FS, "run"),) * 2
    monkeypatch.setattr(parameter_checks, "_drowned", lambda *_: False)
    assert null_columns(fit_paper(rows), TWO_MASS, records, CHOICE) == {}
    random = np.random.default_rng(4)
    load = rows.blocks[1]
    unlike = replace(load, W=random.standard_normal(load.W.shape) * (load.W != 0.0))
    found = null_columns(fit_paper(replace(rows, blocks=(rows.blocks[0], unlike))), TWO_MASS, records, CHOICE)
    own = {TWO_MASS.base_parameters[column] for column in TWO_MASS.regressor_columns[load.row]}
    assert {name for name, why in found.items() if why.startswith("row c leaves ")} == own
    # the motor's row holds the spring: its inertia was 87 % off at ten deviations beside such a row
    assert found["J_m"].startswith("takes over what is lost where row c leaves ")
    assert all("(sign, unit, faults)" in why for why in found.values())


def test_an_offset_whose_interval_holds_zero_is_no_sign_of_a_poor_motion() -> None:
    estimate = identify(RIGID, rigid_record(), **values_of(**SETTINGS))
    (entry,) = (one for one in estimate.parameters.identified if one.name == "offset")
    fit = fit_matched(observe(RIGID, [rigid_record(noise=1e-7)], CHOICE))
    zero, off = replace(entry, value=1e-9, std=1e-9), replace(entry, value=3e-9, std=1e-9)
    assert uncertain_parameters(RIGID, fit, [zero], 10.0, None, None) == ()
    (small,) = uncertain_parameters(RIGID, fit, [off], 10.0, None, None)
    assert small.kind == "too small"


@pytest.mark.parametrize(("std", "none"), [(1e-9, True), (50.0, False)])
def test_friction_that_would_be_felt_and_is_zero_is_none(std: float, none: bool) -> None:
    estimate = identify(RIGID, rigid_record(), **values_of(**SETTINGS))
    (entry,) = (one for one in estimate.parameters.identified if RIGID.roles[one.name].role == "coulomb")
    fit = fit_matched(observe(RIGID, [rigid_record(noise=1e-7)], CHOICE))
    told = uncertain_parameters(RIGID, fit, [replace(entry, value=-0.1 * std, std=std)], 10.0, None, None)
    assert [one.kind for one in told] == ["negligible"] * none
    assert all(f"--set {entry.name}=0" in one.remedy for one in told)
