"""Predicted covariance and bias against what repeated experiments give."""

from __future__ import annotations

import numpy as np
import pytest

from generated import emps300_qm_ac, emps300_qm_qc
from modelgen.cli.arguments import load_chain
from modelgen.cli.candidates import Candidates, candidate_models
from modelgen.errors import DataError
from modelgen.runtime.identification.job import Job
from modelgen.runtime.identification.methods import METHODS
from modelgen.runtime.model.model import Model, model_from_module
from modelgen.runtime.parameters import physical_parameters
from modelgen.runtime.planning import predicted_precision as predictions
from modelgen.runtime.planning.monte_carlo import Spread, misorders, monte_carlo, worst_spread
from modelgen.runtime.planning.planned_experiment import Experiment, experiment
from modelgen.runtime.planning.precision import Precision
from modelgen.runtime.planning.predicted_precision import estimate_once, predict
from modelgen.runtime.planning.sensor_set_ranking import Prediction, cheapest, judge_set, rank
from modelgen.runtime.results.estimate import Estimate
from modelgen.runtime.simulation.instrument import Instrument
from modelgen.spec.chain import Sensor

QC, AC = model_from_module(emps300_qm_qc), model_from_module(emps300_qm_ac)
TOOLS = {
    "q_m": Instrument(2e-5, price=100.0),
    "q_c": Instrument(2e-5, price=120.0),
    "a_c": Instrument(2.0, price=30.0),
    "Gamma_m": Instrument(1e-4, price=50.0),
}
TABLE_2 = QC.parameter_sets["table_2"]
# light with a damping ratio of 0.5: what noise does to composites depends on friction, and so do excitations
DAMPED = {**QC.parameter_sets["light"], "F_vmc": 4.887e-4}
BENCH = {
    **{key: Instrument(2e-5) for key in ("q_m", "q_c")},
    **{key: Instrument(2.0) for key in ("a_m", "a_c")},
    "v_m": Instrument(0.01),
    "Gamma_m": Instrument(1e-4),
}


@pytest.fixture(scope="module")
def ten() -> dict[str, Model]:
    """Sensor sets that the catalogue does not have, by their channels."""
    kinds = {"q": "position", "v": "velocity", "a": "acceleration"}
    keys = ("q_m", "q_c", "v_m", "a_m")
    sensors = tuple(Sensor(key, key[-1], None, kinds[key[0]]) for key in keys)  # type: ignore[arg-type]
    return candidate_models(load_chain("emps300"), Candidates(sensors, BENCH), 2)[0]


def own(model: object, scale: float = 1.0) -> dict[str, Instrument]:
    keys = [s.key for s in model.sensors] + ["Gamma_m"]  # type: ignore[attr-defined]
    return {key: Instrument(scale * TOOLS[key].noise, price=TOOLS[key].price) for key in keys}


@pytest.mark.slow
@pytest.mark.parametrize("model", [QC, AC])
def test_predictions_hold_in_two_hundred_experiments(model: object) -> None:
    planned = experiment(model, model.parameter_sets["table_2"], own(model), method="wls")  # type: ignore[attr-defined]
    spreads = monte_carlo(planned, 200)
    assert [s.name for s in spreads] == list(model.parameters)  # type: ignore[attr-defined]
    for s in spreads:
        assert s.predicted_std == pytest.approx(s.std, rel=0.15)


@pytest.mark.slow
def test_the_bias_of_least_squares_is_predicted() -> None:
    planned = experiment(QC, QC.parameter_sets["table_1"], own(QC, 5.0), method="wls")
    spreads = {s.name: s for s in monte_carlo(planned, 40)}
    for name in ("J_c", "F_vmc", "K"):
        s = spreads[name]
        # the mean of 40 is many of its standard deviations away: this is bias, not chance
        assert abs(s.bias) > 8.0 * s.std / np.sqrt(40.0)
        assert s.predicted_bias == pytest.approx(s.bias, rel=0.2)


@pytest.mark.slow(begins="first")
def test_composites_are_predicted_through_the_estimators_own_nonlinear_step(
    ten: dict[str, Model], monkeypatch: pytest.MonkeyPatch
) -> None:
    # noise in high derivatives takes a quarter off the composites, and adds a thirtieth to the stiffness;
    # the damping of the load gets no number, by prediction and by estimates
    planned, searched = experiment(ten["q_m"], DAMPED, BENCH), list[Model]()
    search = physical_parameters.robust_starts
    monkeypatch.setattr(
        physical_parameters,
        "robust_starts",
        lambda model, *given: searched.append(model) or search(model, *given),
    )
    promised = predict(planned)
    information = promised.information
    # not once a copy, of which each gives a solution
    assert len(searched) <= 1
    assert np.min(information.bias / np.abs(information.values)) < -0.2
    spreads = {s.name: s for s in monte_carlo(planned, 30, promised)}
    s = spreads["K"]
    assert s.bias > 2.5
    assert s.predicted_bias == pytest.approx(s.bias, rel=0.1)
    assert s.predicted_std == pytest.approx(s.std, rel=0.4)
    assert np.isinf(spreads["F_vmc"].predicted_std)
    assert spreads["F_vmc"].given == 0.0


@pytest.mark.slow(begins="first")
def test_composites_weighted_by_their_own_drift_are_copied_until_that_is_known(
    ten: dict[str, Model], monkeypatch: pytest.MonkeyPatch
) -> None:
    taken = []

    def once(planned: Experiment, seed: int) -> Estimate:
        taken.append(seed)
        return estimate_once(planned, seed)

    monkeypatch.setattr(predictions, "estimate_once", once)
    # own weights take a fifth off the frictions' deviations, and 16 copies tell that to a tenth only
    spreads = monte_carlo(experiment(ten["q_c+a_m"], DAMPED, BENCH), 100)
    assert taken == list(range(predictions.WEIGHING))
    assert [s.name for s in spreads] == list(ten["q_c+a_m"].parameters)
    for s in spreads:
        assert s.predicted_std == pytest.approx(s.std, rel=0.15)
    taken.clear()
    predict(experiment(ten["q_c"], TABLE_2, BENCH))
    assert taken == list(range(predictions.FIRST_COPIES))


@pytest.mark.slow
def test_parameters_that_the_estimator_refuses_are_missing(ten: dict[str, Model]) -> None:
    found = judge_set("q_c", ten["q_c"], TABLE_2, BENCH, method="wls")
    assert found.worst == np.inf
    assert {"J_c", "K", "F_vmc"} <= set(found.missing)
    assert "too much for the step from the composites" in found.reason
    assert not set(found.missing) & {entry.name for entry in found.precisions}


@pytest.mark.slow(begins="first")
def test_the_order_of_sensor_sets_is_that_of_repeated_experiments(ten: dict[str, Model]) -> None:
    chosen = ("q_m+q_c", "q_c+v_m", "v_m", "q_c")
    judged = rank([judge_set(key, ten[key], TABLE_2, BENCH, method="wls") for key in chosen])
    ranked = [p.sensor_set for p in judged]
    assert ranked == ["q_c+v_m", "q_m+q_c", "v_m", "q_c"]
    worst = {
        one.sensor_set: worst_spread(monte_carlo(one.planned, 40, one.promised))
        for one in judged
        if one.planned is not None
    }
    assert misorders(ranked, worst).wrong == ()


def test_an_order_is_judged_by_what_the_draws_can_tell() -> None:
    def spread(std: float, given: float = 1.0) -> Spread:
        return Spread("K", std, 0.0, std, 0.0, 200, given)

    # the error of 200 draws is known to 5 %
    assert spread(1.0).uncertainty == pytest.approx(0.05)
    assert spread(1.0, 0.4).error == np.inf
    errors = {"a": spread(1.0), "b": spread(1.1), "c": spread(0.7), "d": spread(9.0, 0.0)}
    found = misorders(tuple(errors), errors)
    assert found.ties == (("a", "b"),)
    assert found.wrong == (("a", "c"), ("b", "c"))


def test_a_linear_estimator_is_predicted_exactly() -> None:
    # noise of the force alone: W is exact, least squares is linear, and every draw is the formula's own
    p = QC.parameter_sets["light"]
    planned = experiment(QC, p, {"Gamma_m": Instrument(1e-5)}, method="wls")
    information = predict(planned).information
    # what is left without any noise is all the bias there is
    clean = METHODS["wls"].run(Job(QC, planned.records(None), planned.choice))[1].solution.x
    np.testing.assert_allclose(clean, information.values, rtol=2e-3)
    np.testing.assert_allclose(information.values + information.bias, clean, rtol=2e-4)
    assert 1.0 < information.condition_number < 1e4


@pytest.mark.slow
def test_twice_the_noise_is_twice_the_deviation() -> None:
    p = AC.parameter_sets["light"]
    small = experiment(AC, p, own(AC, 1e-3), method="wls")
    found = []
    for scale in (1e-3, 2e-3):
        tools = own(AC, scale)
        planned = experiment(AC, p, tools, method="wls", choice=small.choice)
        planned = type(planned)(AC, p, small.simulations, tools, "wls", small.choice, small.weights)
        found.append([entry.std for entry in predict(planned).precisions])
    np.testing.assert_allclose(found[1], 2.0 * np.array(found[0]), rtol=1e-4)


def test_resolution_counts_as_noise() -> None:
    assert Instrument(3.0, 4.0 * 12.0**0.5).std == pytest.approx(5.0)
    with pytest.raises(DataError, match=r"instrument: price: is -1.0; give zero or a positive number"):
        Instrument(price=-1.0)


def prediction(name: str, error: float, price: float, missing: tuple[str, ...] = ()) -> Prediction:
    return Prediction(name, (), price, (Precision("K", 1.0, error, 0.0),), missing, 10.0)


def test_sets_are_ranked_by_their_worst_parameter() -> None:
    good, fair, cheap = prediction("a", 0.5, 300.0), prediction("b", 0.9, 200.0), prediction("c", 3.0, 10.0)
    blind = prediction("d", 0.1, 1.0, ("F_sm",))
    assert [p.sensor_set for p in rank([blind, cheap, fair, good])] == ["a", "b", "c", "d"]
    assert cheapest([blind, cheap, fair, good], 1.0) is fair
    assert cheapest([blind, cheap, fair, good], 0.1) is None
    assert Precision("K", 1.0, 3.0, -4.0).error == 5.0


def test_a_set_states_its_price_and_what_it_leaves_open() -> None:
    found = judge_set("both", AC, AC.parameter_sets["light"], TOOLS, method="wls")
    assert (found.price, found.missing, found.reason) == (180.0, (), "")
    assert found.worst == max(entry.error for entry in found.precisions)
    assert 0.0 < found.worst < 1.0


def test_what_a_set_promises_is_predicted_once(monkeypatch: pytest.MonkeyPatch) -> None:
    judged = judge_set("both", AC, AC.parameter_sets["light"], TOOLS, method="wls")
    monkeypatch.delattr("modelgen.runtime.planning.monte_carlo.predict")
    assert judged.planned is not None
    spreads = monte_carlo(judged.planned, 2, judged.promised)
    assert [s.predicted_std for s in spreads] == [entry.std for entry in judged.precisions]
