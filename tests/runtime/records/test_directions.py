from __future__ import annotations

import numpy as np
import pytest

from generated import three_mass_qa_qb_ac
from modelgen.cli.candidates import spec_model
from modelgen.errors import DataError
from modelgen.runtime.model.model import model_from_module
from modelgen.runtime.records.directions import (
    accelerated_sources,
    direction_problems,
    direction_sentences,
    direction_sources,
    rigid_motion,
    summed_shares,
    wanted_directions,
    with_directions,
)
from modelgen.runtime.records.record import Record
from modelgen.spec.load import parse_spec

MODEL = model_from_module(three_mass_qa_qb_ac)
FS, RATE = 1000.0, 2.0 * np.pi
TIME = np.arange(3000) / FS
VELOCITY = np.sin(RATE * TIME)  # three periods: starts at rest and ends there
POSITION = -np.cos(RATE * TIME) / RATE
ACCELERATION = RATE * np.cos(RATE * TIME)


def record(**more: np.ndarray) -> Record:
    signals = {"q_a": POSITION, "q_b": -POSITION, "a_c": ACCELERATION, "Gamma_a": VELOCITY}
    return Record({**signals, **more}, FS, "run")


def test_the_model_asks_for_the_direction_of_the_body_that_only_accelerates() -> None:
    assert wanted_directions(MODEL) == ("sign_c",)


@pytest.mark.parametrize(("source", "sense"), [("q_a", 1), ("q_b", -1), ("a_c", 1)])
def test_direction_from_a_sensor_or_from_the_integrated_accelerometer(source: str, sense: int) -> None:
    (extended,) = with_directions(MODEL, [record()], {"sign_c": (source,)}, 50.0)
    inside = (np.abs(VELOCITY) > 0.1) & (TIME > 0.1) & (TIME < 2.9)
    np.testing.assert_array_equal(extended.signals["sign_c"][inside], sense * np.sign(VELOCITY[inside]))


def test_direction_from_a_reference_that_is_no_sensor() -> None:
    (extended,) = with_directions(MODEL, [record(reference=POSITION)], {"sign_c": ("reference",)}, 50.0)
    middle = slice(200, 400)
    assert np.all(extended.signals["sign_c"][middle] == 1.0)


def test_a_direction_in_the_record_needs_no_source() -> None:
    assert direction_problems(MODEL, [record(sign_c=np.sign(VELOCITY))], {}) == []


def test_messages_name_the_channel_and_the_remedy() -> None:
    (missing,) = direction_problems(MODEL, [record()], {})
    assert "run: channel sign_c" in missing.where
    assert "the direction in which c moves" in missing.what
    assert "--direction sign_c=q_a" in missing.remedy
    with pytest.raises(DataError, match="q_d"):
        with_directions(MODEL, [record()], {"sign_c": ("q_d",)}, 50.0)
    with pytest.raises(DataError, match="sign_x"):
        with_directions(MODEL, [record(sign_c=np.sign(VELOCITY))], {"sign_x": ("q_a",)}, 50.0)


def test_a_body_with_an_accelerometer_takes_slow_motion_from_the_nearest_sensor() -> None:
    assert accelerated_sources(MODEL, [record()], {}) == {"sign_c": ("q_b", "a_c")}
    # what the record brings or the user names stays
    assert accelerated_sources(MODEL, [record(sign_c=np.sign(VELOCITY))], {}) == {}
    assert accelerated_sources(MODEL, [record()], {"sign_c": "q_a"}) == {}
    assert rigid_motion(MODEL) == pytest.approx(dict.fromkeys(("a", "b", "c"), rigid_motion(MODEL)["a"]))


def test_the_direction_of_a_body_that_vibrates_on_its_spring_is_known_beside_an_offset_and_drift() -> None:
    rate = 2.0 * np.pi * 40.0  # the body swings against its neighbour, twice as fast as that moves at most
    slow, swing = 0.3 * np.sin(RATE * TIME), 0.6 * np.sin(rate * TIME)
    position = -0.3 * np.cos(RATE * TIME) / RATE
    acceleration = 0.3 * RATE * np.cos(RATE * TIME) + 0.6 * rate * np.cos(rate * TIME)
    felt = acceleration + 0.5 + 0.2 * TIME  # a zero that drifts
    one = record(q_b=position, a_c=felt)
    (extended,) = with_directions(MODEL, [one], {"sign_c": ("q_b", "a_c")}, 100.0)
    inside = (np.abs(slow + swing) > 0.06) & (TIME > 0.2) & (TIME < 2.8)
    np.testing.assert_array_equal(extended.signals["sign_c"][inside], np.sign(slow + swing)[inside])
    # neither sensor alone knows it
    for source in ("q_b", "a_c"):
        (alone,) = with_directions(MODEL, [one], {"sign_c": (source,)}, 100.0)
        assert np.mean(alone.signals["sign_c"][inside] == np.sign(slow + swing)[inside]) < 0.95
    (said,) = direction_sentences(MODEL, {"sign_c": ("q_b", "a_c")}, 100.0)
    assert said == "The direction of c is that of a_c, integrated, and below 10 Hz that of q_b."


@pytest.mark.parametrize(("key", "measures"), [("q_m", "position"), ("v_m", "velocity")])
def test_a_sensor_and_the_deflection_give_the_direction_of_the_other_end_of_a_gear(
    key: str, measures: str
) -> None:
    spec = f"""
        chain = {{ name = "joint", motion = "rotation" }}
        bodies = [
            {{ name = "m", inertia = "J_m", actuator = "T" }},
            {{ name = "l", inertia = "J_l", coulomb = "F_sl" }},
            {{ name = "e", inertia = "J_e", coulomb = "F_se" }},
        ]
        links = [
            {{ bodies = ["m", "l"], stiffness = "K", damping = "D", ratio = 20.0 }},
            {{ bodies = ["l", "e"], stiffness = "K_e", damping = "D_e" }},
        ]
        [sensors.s]
        {key} = {{ body = "m", measures = "{measures}" }}
        d = {{ deflection = ["m", "l"], measures = "position" }}
    """
    model = spec_model(parse_spec(spec, "joint.toml"), "s")
    assert summed_shares(model, "l") == pytest.approx({key: 1.0 / 20.0, "d": -1.0})
    assert summed_shares(model, "e") == {}  # no sensor of its link
    swing, rate = 2.0 * np.sin(40.0 * RATE * TIME), 40.0 * RATE
    motor = 20.0 * VELOCITY if measures == "velocity" else 20.0 * POSITION
    one = Record({key: motor, "d": 2.0 * np.cos(rate * TIME) / rate, "T": VELOCITY}, FS, "run")
    guessed, sources = direction_sources(model, [one], {"sign_e": key}, False, True)
    assert (guessed, sources) == ({}, {"sign_l": (key, "d"), "sign_e": (key,)})
    (extended,) = with_directions(model, [one], sources, 200.0)
    inside = (np.abs(VELOCITY + swing) > 0.1) & (TIME > 0.1) & (TIME < 2.9)
    np.testing.assert_array_equal(extended.signals["sign_l"][inside], np.sign(VELOCITY + swing)[inside])
    # what the user names stays
    assert direction_sources(model, [one], {"sign_l": key, "sign_e": key}, False, True)[1]["sign_l"] == (key,)
