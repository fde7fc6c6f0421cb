"""Held commands that tachometers read, and dampers give torque sensors, which positions do not show."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from modelgen.runtime.identification.elastic import speeds_at_changes
from modelgen.runtime.least_squares.delays import with_holds
from modelgen.runtime.records.record import Record

FS, COUNT, GEAR = 1000.0, 4000, 30.0
NAMES = ("Ia_1", "K_1", "D_1")
INERTIA, STIFFNESS, DAMPING = VALUES = np.array([0.1, 2500.0, 1.5])
ROLES = {
    "Ia_1": SimpleNamespace(role="inertia", bodies=("1",)),
    "K_1": SimpleNamespace(role="stiffness", bodies=("1",)),
    "D_1": SimpleNamespace(role="damping", bodies=("1",)),
}


@dataclass(frozen=True)
class Rows:
    """A job of which delays of the force are asked for."""

    late: tuple[str, ...] = ("tau_1",)


class Task:
    """What the torques of one joint are cleaned in."""

    def __init__(self, records: tuple[Record, ...], measures: str = "torque", side: str = "between") -> None:
        sensor = {"key": "t_1", "joint": "1", "measures": measures, "side": side}
        self.model = SimpleNamespace(
            actuators=(SimpleNamespace(key="tau_1", lever=GEAR),),
            roles=ROLES,
            base_parameters=NAMES,
            module=SimpleNamespace(SENSORS=(sensor,)),
        )
        self.job, self.records, self.sensor = Rows(), records, (measures, side)

    def changed(self, change: Any) -> Task:
        return Task(change(self.records), *self.sensor)


def turned() -> tuple[Record, np.ndarray, np.ndarray]:
    """Return a motor turned by a held force, exactly: its record, position, and speed, shape (n,).

    The motion is periodic; the torque is that of spring and damper against a link at rest.
    """
    t, rng = np.arange(COUNT) / FS, np.random.default_rng(1)
    force = sum(np.sin(2.0 * np.pi * f * t + rng.uniform(0.0, 6.0)) for f in (2.0, 5.5, 11.0, 18.0))
    steps = force / INERTIA / FS
    speed = np.concatenate([[0.0], np.cumsum(steps)[:-1]])
    speed -= np.mean(speed + 0.5 * steps)
    position = np.concatenate([[0.0], np.cumsum(speed / FS + 0.5 * steps / FS)[:-1]])
    torque = STIFFNESS * position + DAMPING * speed
    return Record({"t_1": torque, "tau_1": force / GEAR}, FS, "held"), position, speed


def test_a_torque_is_that_of_the_speed_that_positions_say(monkeypatch: pytest.MonkeyPatch) -> None:
    record, position, speed = turned()
    fit = SimpleNamespace(all_parameters=lambda names: VALUES)

    def least_squares(job: Rows) -> tuple[None, SimpleNamespace]:
        assert not job.late, "motion from point to point may not tell delays, and nothing came out then"
        return None, fit

    monkeypatch.setattr(speeds_at_changes, "run_wls", least_squares)
    spectrum = 2j * np.pi * np.fft.rfftfreq(COUNT, 1.0 / FS) * np.fft.rfft(position)
    read = np.fft.irfft(spectrum, COUNT)
    said = STIFFNESS * position + DAMPING * read
    held: Any = Task(with_holds((record,), ("tau_1",)))
    cleaned: Any = speeds_at_changes.with_speeds_of_positions(held, ("tau_1",), "torque")
    # holds do not know what was before the record
    inside = slice(200, -200)
    before = np.std((record.signals["t_1"] - said)[inside])
    after = np.std((cleaned.records[0].signals["t_1"] - said)[inside])
    assert before > 1e-4 * DAMPING * np.std(speed)
    assert after < 0.01 * before


@pytest.mark.parametrize(("side", "turns"), [("motor", GEAR), ("deflection", 1.0)])
def test_a_tachometer_reads_the_speed_that_positions_say(
    monkeypatch: pytest.MonkeyPatch, side: str, turns: float
) -> None:
    record, position, speed = turned()
    record = Record({**record.signals, "t_1": turns * speed}, FS, "held")
    monkeypatch.setattr(
        speeds_at_changes, "run_wls", lambda job: (None, SimpleNamespace(all_parameters=lambda names: VALUES))
    )
    said = turns * np.fft.irfft(2j * np.pi * np.fft.rfftfreq(COUNT, 1.0 / FS) * np.fft.rfft(position), COUNT)
    held: Any = Task(with_holds((record,), ("tau_1",)), "velocity", side)
    cleaned: Any = speeds_at_changes.with_speeds_of_positions(held, ("tau_1",), "velocity")
    inside = slice(200, -200)
    before = np.std((record.signals["t_1"] - said)[inside])
    after = np.std((cleaned.records[0].signals["t_1"] - said)[inside])
    assert before > 1e-4 * np.std(said)
    assert after < 0.01 * before


def test_what_feels_no_held_command_stays_as_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    record, *_ = turned()
    monkeypatch.setattr(speeds_at_changes, "run_wls", lambda job: pytest.fail("no rows are needed"))
    for task, held in ((Task((record,)), ()), (Task((record,), "position"), ("tau_1",))):
        given: Any = task
        for measured in ("velocity", "torque"):
            assert speeds_at_changes.with_speeds_of_positions(given, held, measured) is task
