"""Open loop and predictions: chains of every kind, the truth fits, horizons, what is missing."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from generated import emps300_qm_ac, emps300_qm_qc, emps_rigid_asymmetric_qm, three_mass_qa_qb_ac, tree_mixed
from modelgen.errors import DataError
from modelgen.runtime.model.model import Model, model_from_module
from modelgen.runtime.prediction.compare import compare
from modelgen.runtime.records.record import Record
from modelgen.runtime.simulation.default_excitation import default_excitation
from modelgen.runtime.simulation.simulate import simulate
from tests.runtime.curves.test_equivalent_gains import BOTH, VALUES
from tests.runtime.two_mass_records import GEARED, GEARED_TRUTH

MODELS = {
    "encoder and accelerometer": emps300_qm_ac,
    "two encoders": emps300_qm_qc,
    "rigid, friction by direction": emps_rigid_asymmetric_qm,
    "three bodies": three_mass_qa_qb_ac,
    "tree": tree_mixed,
}


def truth_of(model: Model) -> dict[str, float]:
    return dict(next(iter(model.parameter_sets.values())))


@cache
def case(name: str, noise: float = 0.0) -> tuple[Model, dict[str, float], Record]:
    """A model, its true parameters and a record of half a second; noise in shares of each sensor."""
    if name == "gear 100":
        model, truth = GEARED, dict(GEARED_TRUTH)
    elif name == "cubic spring":
        model, truth = BOTH, VALUES
    else:
        model = model_from_module(MODELS[name])
        truth = truth_of(model)
    excitation = default_excitation("chirp", model, truth, 2000.0, duration_s=0.8)
    clean = simulate(model, truth, excitation, fs=2000.0).record
    rng = np.random.default_rng(1)
    signals = {
        key: samples + noise * float(np.std(samples)) * rng.standard_normal(samples.size)
        if key in [s.key for s in model.sensors]
        else samples
        for key, samples in clean.signals.items()
    }
    return model, truth, Record(signals, 2000.0, name)


EVERY = (*MODELS, "gear 100", "cubic spring")


@pytest.mark.slow
@pytest.mark.parametrize("name", EVERY)
@pytest.mark.parametrize("horizon", [None, 1, 10])
def test_the_true_parameters_fit(name: str, horizon: int | None) -> None:
    model, truth, record = case(name)
    (found,) = compare(model, truth, [record], horizon)
    assert [check.channel for check in found.checks] == [s.key for s in model.sensors]
    for check in found.checks:
        # what a filter of positions says of an acceleration is little, where nothing is noisy
        assert check.fit > (90.0 if check.kind == "acceleration" else 95.0), check.channel
        assert check.start == (horizon or 0)
        assert check.measured.size == record.n - check.start


@pytest.mark.parametrize("name", ["encoder and accelerometer", "two encoders", "gear 100"])
def test_one_sample_ahead_only_the_noise_is_left(name: str) -> None:
    model, truth, record = case(name, 1e-3)
    (found,) = compare(model, truth, [record], np.int64(1))
    for check in found.checks:
        noise = 1e-3 * float(np.std(case(name)[2].signals[check.channel]))
        # once the state at the beginning is forgotten
        error = (check.measured - check.simulated)[400:]
        assert float(np.sqrt(np.mean(error**2))) < 2.0 * noise


@pytest.mark.slow
def test_wrong_parameters_fit_worse() -> None:
    model, truth, record = case("two encoders", 1e-3)
    for horizon in (None, 20):
        right, wrong = (
            compare(model, {**truth, "J_m": factor * truth["J_m"]}, [record], horizon)[0]
            for factor in (1.0, 1.3)
        )
        assert all(w.fit < r.fit for w, r in zip(wrong.checks, right.checks, strict=True))


def test_the_state_at_the_beginning_is_found() -> None:
    """The second half of a record begins in full motion."""
    model, truth, record = case("two encoders", 1e-3)
    later = record.part(700, record.n, "later")
    (found,) = compare(model, truth, [later])
    assert min(check.fit for check in found.checks) > 95.0


def test_a_record_may_lack_sensors_but_no_force() -> None:
    model, truth, record = case("encoder and accelerometer")
    for kept in ("q_m", "a_c"):
        (found,) = compare(model, truth, [record.select([kept, "Gamma_m"])])
        assert [check.channel for check in found.checks] == [kept]
    with pytest.raises(DataError, match="has no force Gamma_m"):
        compare(model, truth, [record.select(["q_m"])])
    with pytest.raises(DataError, match="has none of the sensors q_m, a_c"):
        compare(model, truth, [record.select(["Gamma_m"])])


def test_friction_that_was_refused_counts_as_zero_and_a_stiffness_does_not() -> None:
    model, truth, record = case("two encoders")
    without = {name: value for name, value in truth.items() if name not in ("F_sm", "F_vmc")}
    (found,) = compare(model, without, [record])
    assert found.notes == ("taken as zero: F_sm, F_vmc",)
    assert "taken as zero: F_sm, F_vmc" in str(found)
    with pytest.raises(DataError, match="parameters: K: is missing; give its value in N m/rad"):
        compare(model, {name: value for name, value in truth.items() if name != "K"}, [record])


@pytest.mark.parametrize("horizon", [0, -1, 1.5, True, "10"])
def test_a_horizon_is_a_number_of_samples(horizon: object) -> None:
    model, truth, record = case("two encoders")
    with pytest.raises(DataError, match=r"horizon: is .*give a whole number of samples"):
        compare(model, truth, [record], horizon)  # type: ignore[arg-type]


def test_a_horizon_is_shorter_than_the_record() -> None:
    model, truth, record = case("two encoders")
    with pytest.raises(DataError, match=f"is {record.n}, and two encoders has {record.n} samples"):
        compare(model, truth, [record], record.n)
    with pytest.raises(DataError, match="there are none"):
        compare(model, truth, [])


@pytest.mark.slow
def test_what_it_is_stands_in_the_text() -> None:
    model, truth, record = case("two encoders")
    for horizon, kind in ((None, "open loop"), (1, "1 sample ahead"), (25, "25 samples ahead")):
        (found,) = compare(model, truth, [record], horizon, used=["two encoders"])
        assert (found.kind, found.held_out) == (kind, False)
        assert str(found).startswith(f"two encoders, used; {kind}\n  q_m: position")
