"""What sensor sets would find in planned motions: what they find in such records."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from modelgen import JointController, identify, simulate_arm
from modelgen.cli.arms.simulate_arm import arm_model, mounted
from modelgen.errors import DataError, IdentifiabilityError
from modelgen.runtime.model.model import Model
from modelgen.runtime.planning.arms.predicted_sets import FoundBySet, PlannedSet, predicted_sets
from modelgen.runtime.records.record import Record
from modelgen.runtime.simulation.arms.joint_motion import JointMotion
from modelgen.runtime.simulation.arms.joint_reference import JointLimits, JointReference, fourier_reference
from tests.runtime.made_arm_records import catalogued, model_of

LOOP = JointController(bandwidth_hz=8.0)


@cache
def sets() -> tuple[Model, dict[str, float], dict[str, PlannedSet]]:
    spec = catalogued("elastic_two_link")
    model = arm_model(spec)
    found = {
        name: PlannedSet(model_of(spec, sensor_set=name), mounted(spec, name))
        for name in ("encoders", "torques")
    }
    return model, dict(model.parameter_sets["nominal"]), found


@pytest.mark.slow
def test_deviations_are_those_of_a_record() -> None:
    model, values, planned = sets()
    quick = JointLimits((-0.5, 0.5), 8.0, 100.0)
    reference = fourier_reference(model, 4.0, 1000.0, {"1": quick, "2": quick})
    noise = {"rad": 1e-5, "tau_1": 0.2}
    found = predicted_sets(model, values, planned, [reference], noise, LOOP)
    encoders, torques = found["encoders"], found["torques"]
    assert isinstance(encoders, FoundBySet) and isinstance(torques, FoundBySet)
    assert torques.deviations["K_1"] < encoders.deviations["K_1"]
    for name, std in encoders.deviations.items():
        assert std == pytest.approx(np.sqrt(np.mean([one.bse[name] ** 2 for one in encoders.estimates])))
    # what is found in records with other noise: what one states varies by a factor of two
    levels = {**dict.fromkeys(("q_1", "q_2", "qm_1", "qm_2"), 1e-5), "tau_1": 0.2, "tau_2": 0.1}
    true, names = simulate_arm(model, values, reference, controller=LOOP).true, ("K_1", "K_2", "Ia_1")
    found_in = []
    for rng in map(np.random.default_rng, range(12)):
        read = {key: true[key] + size * rng.standard_normal(4001) for key, size in levels.items()}
        own = identify(planned["encoders"].model, Record(read, 1000.0, "fast")).params
        found_in.append([own[name] for name in names])
    usual = np.std(found_in, axis=0, ddof=1)
    assert np.array([encoders.deviations[name] for name in names]) / usual == pytest.approx(1.0, rel=0.25)


def test_what_cannot_be_found_and_noise_of_nothing_are_told() -> None:
    model, values, planned = sets()
    still = JointReference(JointMotion(*np.zeros((3, 2, 2001)), 1000.0))
    encoders = {"encoders": planned["encoders"]}
    assert isinstance(
        predicted_sets(model, {**values, "Fs_1": 50.0, "Fs_2": 50.0}, encoders, [still])["encoders"],
        (IdentifiabilityError, DataError),
    )
    with pytest.raises(DataError, match="q_7"):
        predicted_sets(model, values, encoders, [still], {"q_7": 1.0})


@pytest.mark.slow
def test_motors_alone_give_springs_in_fast_motion() -> None:
    model, values, _ = sets()
    spec = catalogued("elastic_two_link")
    spec = replace(spec, sensor_sets={"motors": spec.sensor_sets["encoders"][:2]})
    motors = {"motors": PlannedSet(model_of(spec, sensor_set="motors"), mounted(spec, "motors"))}
    times, rng = np.arange(3001) / 1000.0, np.random.default_rng(1)
    motion = np.zeros((3, 2, len(times)))
    for k in range(1, 6):
        rate, phases = 2.4 * np.pi * k, rng.uniform(0.0, 6.0, (2, 1))
        waves = [rate**order * np.sin(rate * times + phases + order * np.pi / 2) for order in range(3)]
        motion += 0.2 / k * np.array(waves)
    reference = JointReference(JointMotion(*motion, 1000.0))
    found = predicted_sets(model, values, motors, [reference])["motors"]
    assert isinstance(found, FoundBySet) and found.deviations["K_1"] < 5e-3 * values["K_1"]
    for name in ("K_1", "K_2", "Ia_1"):
        for one in found.estimates:
            assert abs(one.params[name] - values[name]) < 4.0 * one.bse[name]
