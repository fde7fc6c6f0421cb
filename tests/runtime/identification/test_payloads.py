"""Records with and without payloads in one fit: gains of drives, and what the payload is."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
import pytest

from modelgen import CheckOptions, Filters, identify
from modelgen.errors import IdentifiabilityError
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record
from modelgen.runtime.results.estimate import Estimate
from tests.runtime.made_arm_records import model_of, record_of, values_of, written

QUICK = CheckOptions(tests=False)
ARM = """
[arm]
name = "two"
gravity = [0, -9.81, 0]
drive = ["rotor_inertia", "viscous", "coulomb", "offset"{gain}]
[[joints]]
name = "1"
gear = 50
[[joints]]
name = "2"
d = 0.4
gear = 30
[payload.disc]
mass = {mass}
[payload.tool]
"""
# light against the arm: what it adds is a tenth of the torques
MASS = 0.5


@lru_cache
def arm(gains: bool = True) -> tuple[Model, dict[str, float]]:
    model = model_of(written(ARM.format(gain=', "gain"' if gains else "", mass=MASS)))
    values = {name: 0.1 * v if "_disc" in name else v for name, v in values_of(model, 3).items()}
    return model, values | ({"gain_1": 60.0, "gain_2": 35.0} if gains else {})


def records(noise: float, seed: int, loads: Sequence[str] = ("", "disc"), gains: bool = True) -> list[Record]:
    model, values = arm(gains)
    found = []
    for number, name in enumerate(loads):
        carried = [name] if name else []
        record = record_of(model, values, 10.0, 2 * seed + number, carried=carried)
        rng, read = np.random.default_rng([seed, number]), dict(record.signals)
        for key in model.channels:
            level = 1e-5 if key.startswith("q_") else noise * float(np.std(read[key]))
            read[key] = read[key] + (level if noise else 0.0) * rng.standard_normal(record.n)
        found.append(Record(read, record.fs, name or "empty"))
    return found


def errors(estimate: Estimate, gains: bool = True) -> np.ndarray:
    """Return errors relative to the values, and in standard deviations, shape (2, parameters)."""
    model, values = arm(gains)
    truth = dict(zip(model.base_parameters, model.base_from_physical(values), strict=True))
    moves = {name: value - truth[name] for name, value in estimate.params.items()}
    return np.array([[m / truth[n], m / estimate.bse[n]] for n, m in moves.items()]).T


@pytest.mark.slow
def test_without_noise_gains_and_payloads_are_exact() -> None:
    estimate = identify(arm()[0], records(0.0, 1, ("", "disc", "tool")), checks=QUICK)
    names = ["gain_1", "gain_2", "Izz_disc", "mx_disc", "my_disc", "Izz_tool", "mx_tool", "my_tool", "m_tool"]
    assert {*names} <= {*estimate.params}
    assert np.abs(errors(estimate)[0]).max() < 1e-6


@pytest.mark.slow
def test_a_light_payload_and_noisy_currents_leave_no_bias() -> None:
    model, _ = arm()
    found = [identify(model, records(0.05, seed), "wls", checks=QUICK) for seed in range(3)]
    # least squares alone shrinks every parameter by 5 %
    assert np.mean([errors(one)[0] for one in found]) > -0.02
    assert all(one.relative_std["gain_1"] < 3.0 for one in found)
    tool = found[0].not_identifiable["mx_tool"]
    assert "no record carries payload tool" in tool


@pytest.mark.slow(begins="first")
def test_intervals_hold_the_truth() -> None:
    model, _ = arm()
    every = [identify(model, records(0.05, seed), checks=QUICK) for seed in range(12)]
    assert {one.fit.method for one in every} == {"iv"}
    found = np.array([errors(one)[1] for one in every])
    assert 0.88 <= np.mean(np.abs(found) < 1.96) <= 0.99
    assert np.abs(found.mean(axis=0)).max() < 0.7


def test_where_torques_are_measured_a_payload_is_what_the_loaded_record_has_more() -> None:
    estimate = identify(arm(False)[0], records(0.0, 1, ("", "tool"), False), checks=QUICK)
    assert np.abs(errors(estimate, False)[0]).max() < 1e-6
    assert "m_tool" in estimate.params


@pytest.mark.parametrize("loads", [("",), ("tool",), ("", "tool")])
def test_what_has_no_scale_is_refused_with_both_remedies(loads: tuple[str, ...]) -> None:
    with pytest.raises(IdentifiabilityError, match=r"measure a force.*payload of known mass"):
        identify(arm()[0], records(0.01, 1, loads), checks=QUICK)


@pytest.mark.slow
def test_records_in_stretches_say_what_they_carry() -> None:
    made = records(0.01, 1)
    whole = identify(arm()[0], made, checks=QUICK)
    stretched = [Record.over(made[0]), Record.over(Record(dict(made[1].signals), 1000.0)).carrying("disc")]
    found = identify(arm()[0], stretched, checks=QUICK)
    assert found.params == pytest.approx(dict(whole.params), rel=1e-9)
    remade = identify(arm()[0], made, "wls", Filters(memory_limit_mb=0.01), QUICK)
    assert remade.params["gain_1"] == pytest.approx(whole.params["gain_1"], rel=0.01)
