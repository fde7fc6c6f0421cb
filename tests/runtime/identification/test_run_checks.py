from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from generated import emps300_qm_qc
from modelgen.cli.candidates import spec_model
from modelgen.errors import DataError
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.identification.options import values_of
from modelgen.runtime.identification.refusals import late_refusals
from modelgen.runtime.least_squares.wls import fit_matched
from modelgen.runtime.model.model import model_from_module
from modelgen.runtime.parameters.pruning import prune
from modelgen.runtime.records.record import Record
from modelgen.runtime.results.estimate import Estimate
from modelgen.runtime.simulation.simulate import simulate
from modelgen.spec.load import parse_spec
from tests.runtime.identification.test_assemble_estimate import TRUTH, observation
from tests.runtime.measured_records import bench, emps
from tests.runtime.rigid_motion import ONE_WAY, RIGID, SETTINGS, kinds, rigid_record, swings
from tests.runtime.rigid_motion import TRUTH as RIGID_TRUTH

TWO_MASS = model_from_module(emps300_qm_qc)
VIBRATION = swings((0.1, 1.3), (0.05, 3.1))


def simulated(noise: bool = True) -> list[Record]:
    truth = TWO_MASS.parameter_sets["table_1"]
    levels = {"q_m": 2e-5, "q_c": 2e-5, "Gamma_m": 1e-4} if noise else {}
    return [
        simulate(TWO_MASS, truth, kind, fs=5000.0, duration_s=4.0, oversample=n, noise=levels).record
        for kind, n in (("chirp", 32), ("trapezoid", 8))
    ]


def test_a_trapezoid_alone_leaves_combinations_and_says_which() -> None:
    chirp, trapezoid = simulated()
    alone = identify(TWO_MASS, trapezoid, "wls")
    for name in ("J_c", "F_vmc", "K"):
        assert name not in alone.params
        assert alone.not_identifiable[name]
    (advice,) = [one for one in alone.checks.advice if one.kind == "dependent columns"]
    # the sum of the inertias is known, and that is said with its number
    truth = TWO_MASS.parameter_sets["table_1"]
    assert "J_m, J_c, F_vmc and K move together" in advice.where
    assert "condition index" in advice.what
    told = re.search(r"J_m \+ ([\d.]*) ?J_c = (\S+)", advice.where)
    assert told is not None
    share = float(told[1] or 1.0)
    assert share == pytest.approx(1.0, abs=0.02)
    assert float(told[2]) == pytest.approx(truth["J_m"] + share * truth["J_c"], rel=0.02)
    # together with the chirp nothing is missing, and nothing is said
    both = identify(TWO_MASS, [chirp, trapezoid], "wls")
    assert set(both.params) == set(TWO_MASS.base_parameters)
    assert kinds(both) == []


HOIST = """
[chain]
name = "hoist"
motion = "rotation"
[[bodies]]
name = "m"
inertia = "J_m"
viscous = "F_vm"
coulomb = "F_sm"
actuator = "T"
[[bodies]]
name = "g"
inertia = "J_g"
[[bodies]]
name = "d"
inertia = "J_d"
viscous = "F_vd"
[[links]]
bodies = ["m", "g"]
stiffness = "K_1"
damping = "D_1"
ratio = "21/2"
[[links]]
bodies = ["g", "d"]
stiffness = "K_2"
damping = "D_2"
[sensors.s]
q_m = { body = "m", measures = "position" }
q_d = { body = "d", measures = "position" }
"""


@pytest.mark.slow
def test_composites_may_move_together_where_physical_parameters_are_told() -> None:
    model = spec_model(parse_spec(HOIST, "hoist.toml"), "s")
    truth = {"J_m": 2e-3, "F_vm": 1e-2, "F_sm": 0.3, "J_g": 0.08, "J_d": 0.5, "F_vd": 0.4}
    truth |= {"K_1": 9000.0, "D_1": 3.0, "K_2": 20000.0, "D_2": 6.0}
    noise = {"q_m": 1e-4, "q_d": 1e-5, "T": 0.01}
    records = [
        simulate(model, truth, kind, fs=4000.0, duration_s=4.0, noise=noise).record
        for kind in ("chirp", "trapezoid")
    ]
    estimate = identify(model, records)
    assert {entry.name for entry in estimate.parameters.physical} == {*truth}
    assert max(entry.relative_std for entry in estimate.parameters.identified) > 10.0
    assert "dependent columns" not in kinds(estimate)


def test_what_only_the_drift_leaves_without_a_value_is_refused_late() -> None:
    rows = observation()
    W = rows.blocks[0].W.copy()
    W[:, 4] = 0.3 * W[:, 3] + 0.01 * W[:, 4]
    fit = fit_matched(replace(rows, blocks=(replace(rows.blocks[0], W=W, Y=W @ TRUTH),)))
    nothing = np.zeros((6, 6))
    assert late_refusals(fit, {}, nothing, ()) == {}
    # J_c and F_vmc drift along what is not seen of them
    unseen = np.array([0.0, 0.0, 0.0, -0.3, 1.0, 0.0])
    drift = 100.0 * np.outer(unseen, unseen)
    late = late_refusals(fit, {}, drift, ())
    assert set(late) == {"J_c", "F_vmc"}
    assert late["J_c"].startswith("J_c, F_vmc cannot be distinguished in these records (")
    assert late["F_vmc"] == late["J_c"]
    # their sum does not drift: it is told with its interval
    said = re.search(r"known is (?P<sum>J_c \+ 0\.3 F_vmc) = (?P<value>\S+)", late["J_c"])
    assert said and said["sum"] in late["F_vmc"]
    assert float(said["value"]) == pytest.approx(TRUTH[3] + 0.3 * TRUTH[4], rel=1e-3)
    assert set(late_refusals(fit, {}, drift, ("J_c",))) == {"F_vmc"}
    # the last parameters stay, whatever drifts
    others = dict.fromkeys(("J_m", "F_vm", "F_sm", "K"), "for a reason")
    assert late_refusals(fit, others, drift, ()) == others


def test_what_may_be_zero_keeps_its_number_however_wide_its_interval() -> None:
    rows = observation()
    W = rows.blocks[0].W.copy()
    W[:, 4] = 0.3 * W[:, 3] + 0.01 * W[:, 4]
    fit = fit_matched(replace(rows, blocks=(replace(rows.blocks[0], W=W, Y=W @ TRUTH),)))
    unseen = np.array([0.0, 0.0, 0.0, -0.3, 1.0, 0.0])
    drift = 100.0 * np.outer(unseen, unseen)
    assert set(late_refusals(fit, {}, drift, (), model=TWO_MASS)) == {"J_c", "F_vmc"}
    offset = replace(TWO_MASS.roles["J_c"], role="offset")
    model = replace(TWO_MASS, roles={**TWO_MASS.roles, "J_c": offset})
    assert set(late_refusals(fit, {}, drift, (), model=model)) == {"F_vmc"}


@pytest.mark.parametrize("seed", range(3))
def test_friction_in_vibration_is_told_where_the_model_leaves_noise_only(seed: int) -> None:
    estimate = identify(RIGID, rigid_record(VIBRATION, seed=seed), **values_of(**SETTINGS))
    assert estimate.not_identifiable == {}
    for name, value in estimate.params.items():
        assert abs(value - RIGID_TRUTH[name]) < 3.0 * estimate.bse[name]
    assert estimate.bse["Fv"] < 0.01 * RIGID_TRUTH["Fv"]


def lacking_force(share: float) -> Record:
    """A vibration with a force that the model lacks, a share of the force's standard deviation."""
    record = rigid_record(swings((0.1, 4.3), (0.05, 7.1)))
    t = np.arange(record.n) / record.fs
    lacks = share * np.std(record.signals["F"]) * np.sin(10.0 * np.pi * t) * np.sin(0.6 * np.pi * t)
    return Record({**record.signals, "F": record.signals["F"] + lacks}, record.fs, record.name)


@pytest.mark.slow
def test_a_doubtful_parameter_can_be_kept_but_not_what_is_impossible() -> None:
    record = lacking_force(0.1)
    plain = identify(RIGID, record, **values_of("wls", cutoff_hz=40.0))
    assert "no constant-velocity motion" in plain.not_identifiable["Fv"]
    assert "times what the model leaves unexplained" in plain.not_identifiable["Fv"]
    kept = identify(RIGID, record, **values_of("wls", keep=("Fv",), cutoff_hz=40.0))
    assert "Fv" in kept.params
    assert "Fc" in kept.not_identifiable
    (advice,) = [one for one in kept.checks.advice if one.kind == "kept on request"]
    assert advice.where == "Fv"
    assert "no constant-velocity motion" in advice.what
    assert kept.checks.kept == ("Fv",)
    impossible = identify(RIGID, rigid_record(ONE_WAY[1.0]), **values_of("wls", keep=("Fc",), **SETTINGS))
    assert "Fc" not in impossible.params
    with pytest.raises(DataError, match=r"has no parameter Fx.*Fv"):
        identify(RIGID, record, **values_of(keep=("Fx",), **SETTINGS))


def test_pruning_can_be_undone() -> None:
    slow = rigid_record(swings((2e-2, 0.05), (1e-2, 0.11)), noise=1e-5, n=40000)
    options = {"cutoff_hz": 10.0, "direction_cutoff_hz": 5.0}
    pruned = identify(RIGID, slow, **values_of("wls", **options))
    assert [step.removed for step in pruned.fit.pruning.steps] == ["M"]
    undone = identify(RIGID, slow, **values_of("wls", keep=("M",), **options))
    assert "M" not in [step.removed for step in undone.fit.pruning.steps]
    assert "M" in [name for name, _, _ in undone.fit.pruning.kept]
    # the full estimate is the same in both
    assert undone.params == pruned.params


def test_a_kept_name_is_spared_even_where_it_is_the_worst() -> None:
    def refit(names: tuple[str, ...]) -> tuple[np.ndarray, np.ndarray, float]:
        spreads = {"a": 50.0, "b": np.inf, "c": 20.0, "d": 1.0}
        return np.ones(len(names)), np.array([spreads[name] for name in names]), 0.1

    assert [step.removed for step in prune("abcd", refit, 10.0, "b").steps] == ["a", "c"]
    assert prune("abcd", refit, 10.0, "abcd").steps == ()
    assert [step.removed for step in prune("abcd", refit, 10.0).steps] == ["b", "a", "c"]


@pytest.mark.slow(begins="first")
def test_where_cut_offs_of_the_bench_disagree_the_summary_says_that_its_model_lacks_something(
    shared_data: Path,
) -> None:
    model, whole = bench(shared_data)
    # four seconds of each half: their intervals are 2 to 6 %
    halves = [
        Record({key: s[2500 * a : 2500 * b] for key, s in whole.signals.items()}, whole.fs, f"half {a}")
        for a, b in ((1, 5), (10, 14))
    ]
    for hz in (120.0, 400.0):
        first, second = (identify(model, half, cutoff_hz=hz) for half in halves)
        for name in ("Jm", "Jc", "K"):
            # what noise does is in the intervals, which stay below 10 %
            assert first.conf_int()[name][0] < second.params[name] < first.conf_int()[name][1]
            assert 1.96 * first.relative_std[name] < 10.0
        # what the model lacks is the same in both halves, and named
        assert "more than noise" in kinds(first)
        assert "more than noise" in kinds(second)


def test_published_settings_of_the_emps_bench_raise_no_alarm(shared_data: Path) -> None:
    _, record = emps(shared_data)
    options = {"cutoff_hz": 100.0, "filter_order": 4, "decimation": 10, "drop": 49}
    assert identify(RIGID, record, **values_of("pham2002", **options)).checks.advice == ()
    (advice,) = identify(RIGID, record, "pham2002", cutoff_hz=20.0, decimation=10).checks.advice
    assert advice.kind == "decimation band above the filter band"


def everything() -> Estimate:
    return identify(
        RIGID,
        [rigid_record(name="one"), rigid_record(name="two", seed=1)],
        **values_of(
            hold_out="two", scan_cutoffs=[30.0], robust="huber", bounds="physical", keep=("M",), **SETTINGS
        ),
    )


@pytest.mark.slow
def test_everything_at_once_is_printed_and_written_alike_every_time() -> None:
    first, second = everything(), everything()
    assert first.to_json() == second.to_json()
    checks = json.loads(first.to_json())["checks"]
    assert set(checks) == {
        "advice", "residuals", "signals", "periods", "held_out", "scan", "bounds", "kept"
    }  # fmt: skip
    text = first.summary()
    titles = (
        "Highest derivatives behind the filter",
        "Residual tests:",
        "Held-out records:",
        "Physical bounds:",
        "Scan of the filter:",
    )
    assert [title in text for title in titles] == [True] * 5
    assert max(len(line) for line in text.splitlines()) < 140
    # robust weights do not hide what the residual itself looks like
    assert first.checks.residuals[0].is_noise


def test_warnings_say_what_to_do() -> None:
    estimate = identify(RIGID, rigid_record(ONE_WAY[1.0]), **values_of(**SETTINGS))
    warnings = " ".join(estimate.summary().split("Warnings:")[1].split())
    assert "give one of them as known" in warnings
    for advice in estimate.checks.advice:
        assert advice.remedy
        assert advice.sentence.startswith(advice.kind)


def test_checks_that_fail_take_no_answer_away(monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(*_: object) -> None:
        raise np.linalg.LinAlgError("did not converge")

    monkeypatch.setattr("modelgen.runtime.identification.run_checks.examine", fails)
    estimate = identify(RIGID, rigid_record(), **values_of(**SETTINGS))
    assert estimate.params
    assert estimate.checks.advice[-1].kind == "not checked"
    assert "did not converge" in estimate.checks.advice[-1].what
    assert estimate.verdict.word == "check"
