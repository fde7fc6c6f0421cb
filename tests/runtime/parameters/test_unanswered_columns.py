from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from generated import emps300_qm_qc, emps_rigid_qm, three_mass_qa_qb_ac, two_mass_bench_qm_qc
from modelgen.cli.candidates import spec_model
from modelgen.runtime.filter_choice.filter_choice import FilterChoice, choose_filter
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.wls import fit_matched
from modelgen.runtime.model.model import Model, model_from_module
from modelgen.runtime.parameters import unanswered_columns
from modelgen.runtime.parameters.unanswered_columns import (
    columns_that_vanish,
    friction_without_steady_motion,
    like_delays,
    not_identifiable,
)
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.observation import observe
from modelgen.spec.load import parse_spec

BENCH, RIGID = model_from_module(two_mass_bench_qm_qc), model_from_module(emps_rigid_qm)
TRUTH = {
    "Jm": 5e-3, "Fvm": 0.1, "Fsm": 0.2, "Om": 0.0, "Jc": 4e-3, "Fvc": 0.05, "Fsc": 0.1, "Oc": 0.0,
    "Fd": 0.02, "K": 500.0,
}  # fmt: skip
FS = 2500.0


def bench_record(steady: float, zero: float = 0.0, name: str = "run") -> Record:
    """The bench in steady vibration on a velocity; the load's motion is chosen, motor and torque follow."""
    t = np.arange(20000) / FS
    motion = {body: [steady * t, np.full(t.size, steady), np.zeros(t.size)] for body in "mc"}
    slip = np.sign(steady)
    for hertz, size in ((23.0, 0.02), (47.0, 3e-3), (71.0, 2e-3), (97.0, 1e-3)):
        omega = 2.0 * np.pi * hertz
        link = TRUTH["K"] + 1j * omega * TRUTH["Fd"]
        own = -TRUTH["Jc"] * omega**2 + 1j * omega * TRUTH["Fvc"]
        for body, response in (("c", 1.0), ("m", (link + own) / link)):
            wave = size * response * np.exp(1j * omega * t)
            for k in range(3):
                motion[body][k] = motion[body][k] + ((1j * omega) ** k * wave).real
    # what the load's constant friction twists the link by
    motion["m"][0] = motion["m"][0] + (TRUTH["Fvc"] * steady + TRUTH["Fsc"] * slip) / TRUTH["K"]
    force = (
        sum(TRUTH[f"J{body}"] * motion[body][2] + TRUTH[f"Fv{body}"] * motion[body][1] for body in "mc")
        + (TRUTH["Fsm"] + TRUTH["Fsc"]) * slip
    )
    return Record({"q_m": motion["m"][0], "q_c": motion["c"][0] + zero, "i": np.asarray(force)}, FS, name)


def fitted(model: Model, records: list[Record]) -> tuple[Fit, FilterChoice]:
    choice = choose_filter(model, records, cutoff_hz=150.0)
    return fit_matched(observe(model, records, choice)), choice


def test_vibration_alone_does_not_tell_friction() -> None:
    records = [bench_record(0.0, name="shake")]
    choice = choose_filter(BENCH, records)
    reasons = friction_without_steady_motion(BENCH, records, choice)
    assert sorted(reasons) == ["Fsc", "Fsm", "Fvc", "Fvm"]
    assert "no constant-velocity motion of m in record shake" in reasons["Fvm"]


def test_one_record_in_steady_motion_is_enough() -> None:
    records = [bench_record(0.0), bench_record(40.0)]
    assert friction_without_steady_motion(BENCH, records, choose_filter(BENCH, records)) == {}


def test_no_spectrum_is_taken_of_a_body_without_friction_of_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    model, asked = model_from_module(emps300_qm_qc), []
    record = Record(
        {"q_m": np.arange(5000) / FS, "q_c": np.arange(5000) / FS, "Gamma_m": np.ones(5000)}, FS, "run"
    )
    power = record.facts.power

    def spied(channel: str, *given: int, **named: bool) -> tuple[np.ndarray, np.ndarray]:
        asked.append(channel)
        return power(channel, *given, **named)

    monkeypatch.setattr(record.facts, "power", spied)
    choice = FilterChoice(4, 100.0, 50.0, (5,), 100.0, None, (), (), ())
    assert friction_without_steady_motion(model, [record], choice) == {}
    assert asked == ["q_m"]


def test_composites_vanish_with_their_friction_and_sums_do_not() -> None:
    model = model_from_module(three_mass_qa_qb_ac)
    assert columns_that_vanish(model, {"F_sc": "never steady"}) == {"F_sc*K_bc/(J_b*J_c)": "never steady"}
    assert columns_that_vanish(model, {"F_va": "one", "F_vb": "two"}) == {"F_va": "one", "F_vb": "two"}
    assert columns_that_vanish(model, {}) == {}


def test_encoder_zeros_hide_offsets_and_nothing_else() -> None:
    records = [bench_record(40.0, zero=3.0, name="one"), bench_record(-40.0, zero=3.0, name="two")]
    fit, choice = fitted(BENCH, records)
    reasons = not_identifiable(BENCH, records, choice, fit)
    assert sorted(reasons) == ["Oc", "Om"]
    assert "the link m-c would carry 1.5e+03 on average in record one" in reasons["Om"]
    values = dict(zip(fit.columns, fit.solution.x.tolist(), strict=True))
    assert values["K"] == pytest.approx(500.0, rel=1e-3)


def test_encoders_with_a_common_zero_tell_offsets() -> None:
    records = [bench_record(40.0), bench_record(-40.0)]
    fit, choice = fitted(BENCH, records)
    assert not_identifiable(BENCH, records, choice, fit) == {}


def test_motion_in_one_direction_does_not_tell_coulomb_friction_from_an_offset() -> None:
    t = np.arange(8000) / 1000.0
    speed = 1.0 + 0.5 * np.sin(2.0 * np.pi * 3.0 * t)
    position = t - 0.5 / (6.0 * np.pi) * np.cos(6.0 * np.pi * t)
    force = 95.0 * 3.0 * np.pi * np.cos(6.0 * np.pi * t) + 200.0 * speed + 20.0
    records = [Record({"q_m": position, "F": force}, 1000.0, "forward")]
    choice = choose_filter(RIGID, records, cutoff_hz=50.0)
    fit = fit_matched(observe(RIGID, records, choice))
    reasons = not_identifiable(RIGID, records, choice, fit)
    assert list(reasons) == ["Fc", "offset"]
    assert "short of rank" in reasons["Fc"]
    values = dict(zip(fit.columns, fit.solution.x.tolist(), strict=True))
    assert values["M"] == pytest.approx(95.0, rel=1e-4)
    assert values["Fv"] == pytest.approx(200.0, rel=1e-4)


def test_a_column_that_is_never_seen_is_refused() -> None:
    records = [bench_record(40.0)]
    record = records[0]
    # a load that keeps step with the motor never twists the link
    rigid = Record({**record.signals, "q_c": record.signals["q_m"]}, FS, "rigid")
    fit, choice = fitted(BENCH, [rigid])
    reasons = not_identifiable(BENCH, [rigid], choice, fit)
    assert reasons["K"] == reasons["Fd"] == "its column is zero in every sample used"


GEAR = """
chain = { name = "gear", motion = "rotation" }
bodies = [
    { name = "a", inertia = "J_a", viscous = "Fv_a", coulomb = "Fc_a", actuator = "T" },
    { name = "b", inertia = "J_b" },
]
links = [{ bodies = ["a", "b"], stiffness = "K", damping = "D", ratio = 10.0 }]
[sensors.load]
q_b = { body = "b", measures = "position" }
"""


def test_what_cannot_be_told_from_a_delay_is_refused_with_all_that_holds_it() -> None:
    def fit(*unknown: str) -> SimpleNamespace:
        return SimpleNamespace(unknown=unknown, delays=(("i", 2e-5, 1e-6),), carried=None)

    reasons = like_delays(BENCH, fit("Jc", "K", "i"))  # type: ignore[arg-type]
    assert set(reasons) == {"Jc", "K"}
    assert reasons["K"] == "cannot be distinguished from the delay of i in these records"
    assert like_delays(BENCH, fit("i")) == {}  # type: ignore[arg-type]
    # a fit of base parameters was carried over from none
    assert like_delays(BENCH, fitted(BENCH, [bench_record(40.0)])[0]) == {}
    hidden = model_from_module(three_mass_qa_qb_ac)
    sums = like_delays(hidden, fit(hidden.parameters[0]))  # type: ignore[arg-type]
    assert all(hidden.parameters[0] in name for name in sums) and sums
    # where no sensor sees the motor, only a simulation of that chain knows which way it turns
    motor = spec_model(parse_spec(GEAR, "gear.toml"), "load")
    assert not {"Fv_a", "Fc_a"} & set(like_delays(motor, fit("J_b")))  # type: ignore[arg-type]
    assert {"Fv_a", "Fc_a"} <= set(like_delays(motor, fit("J_a")))  # type: ignore[arg-type]
    # viscous friction alone is as well known as what else moves in step
    smooth = spec_model(parse_spec(GEAR.replace(', coulomb = "Fc_a"', ""), "gear.toml"), "load")
    assert "Fv_a" not in like_delays(smooth, fit("J_a"))  # type: ignore[arg-type]


@pytest.mark.parametrize(("together", "known"), [(1e-3, True), (0.5, False)])
def test_a_sum_of_inertias_that_no_delay_hides_is_told(together: float, known: bool) -> None:
    model = spec_model(parse_spec(GEAR.replace(', coulomb = "Fc_a"', ""), "gear.toml"), "load")
    places = {name: place for place, name in enumerate(model.parameters)}
    # J_b is known to ten times its size, and what it lacks is in J_a, which feels a hundredth of it
    at = np.ones(len(places))
    at[places["J_b"]] = 10.0
    error = np.zeros(len(places))
    error[places["J_a"]], error[places["J_b"]] = -1.0, 100.0
    sums = np.zeros(len(places))
    sums[places["J_a"]] = together
    columns, series = (*model.parameters, "delay of T"), np.zeros((2, len(places) + 1))
    series[0, :-1], series[1, :-1] = error, sums
    linear = SimpleNamespace(
        columns=columns, solution=SimpleNamespace(unseen=lambda _: np.zeros(1, dtype=bool))
    )
    carried = SimpleNamespace(at=at, linear=linear)
    lost = SimpleNamespace(unknown=("J_b", "K"), delays=(("T", 0.0, 1e-5),), carried=carried)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(unanswered_columns, "hac_covariance", lambda _: series.T @ series)
        reasons = like_delays(model, lost)  # type: ignore[arg-type]
    (why,) = {*reasons.values()}
    assert why.startswith("cannot be distinguished from the delay of T in these records")
    assert ("J_a + 0.01 J_b = 1.100" in why) == known
