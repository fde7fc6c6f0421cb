from __future__ import annotations

import numpy as np
import pytest

from generated import three_mass_qa_qb_ac
from modelgen.errors import DataError
from modelgen.runtime.model.model import model_from_module
from modelgen.runtime.records.directions import direction_problems, wanted_directions, with_directions
from modelgen.runtime.records.record import Record

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
    (extended,) = with_directions(MODEL, [record()], {"sign_c": source}, 50.0)
    inside = (np.abs(VELOCITY) > 0.1) & (TIME > 0.1) & (TIME < 2.9)
    np.testing.assert_array_equal(extended.signals["sign_c"][inside], sense * np.sign(VELOCITY[inside]))


def test_direction_from_a_reference_that_is_no_sensor() -> None:
    (extended,) = with_directions(MODEL, [record(reference=POSITION)], {"sign_c": "reference"}, 50.0)
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
        with_directions(MODEL, [record()], {"sign_c": "q_d"}, 50.0)
    with pytest.raises(DataError, match="sign_x"):
        with_directions(MODEL, [record(sign_c=np.sign(VELOCITY))], {"sign_x": "q_a"}, 50.0)
