"""Gains of friction and cubic springs: describing functions of sines, statistical linearisation of noise."""

from __future__ import annotations

import numpy as np
import pytest

from modelgen.cli.candidates import spec_model
from modelgen.runtime.curves.equivalent_gains import equivalent_gains, linear_chain
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record
from modelgen.runtime.simulation.excitation import Excitation
from modelgen.runtime.simulation.plant import make_plant
from modelgen.runtime.simulation.simulate import simulate
from modelgen.spec.load import parse_spec

FS = 2000.0
CUBIC = """
[chain]
name = "cubic"
motion = "rotation"

[[bodies]]
name = "m"
inertia = "J_m"
viscous = "F_v"
coulomb = "F_s"
actuator = "Gamma"

[[bodies]]
name = "c"
inertia = "J_c"
viscous = "F_c"
coulomb = "F_sc"

[[links]]
bodies = ["m", "c"]
stiffness = "K"
stiffness3 = "K3"
damping = "D"

[sensors.both]
q_m = { body = "m", measures = "position" }
q_c = { body = "c", measures = "position" }

[sensors.deflection]
q_m = { body = "m", measures = "position" }
d = { deflection = ["m", "c"], measures = "position" }
"""
VALUES = {"J_m": 1e-4, "F_v": 2e-3, "F_s": 0.01, "J_c": 8e-5, "F_c": 1e-4, "F_sc": 0.002, "K": 15.0,
          "K3": 3e4, "D": 2e-3}  # fmt: skip


def model_of(sensors: str) -> Model:
    return spec_model(parse_spec(CUBIC, "cubic.toml"), sensors)


BOTH, DEFLECTION = model_of("both"), model_of("deflection")


def moving(velocity: np.ndarray, deflection: np.ndarray | None = None) -> Record:
    q = np.cumsum(velocity) / FS
    other = q if deflection is None else q - deflection
    return Record({"q_m": q, "q_c": other, "Gamma": np.ones(q.size)}, FS)


@pytest.mark.parametrize(("f", "amplitude"), [(5.0, 2.0), (20.0, 0.3), (60.0, 11.0)])
def test_of_a_sine_they_are_describing_functions(f: float, amplitude: float) -> None:
    t = np.arange(40000) / FS
    wave = np.sin(2 * np.pi * f * t)
    plant = make_plant(BOTH, VALUES)
    gains = equivalent_gains(plant, moving(amplitude * wave, 0.02 * wave), 200.0)
    at = np.interp(f, gains.frequency_hz, gains.friction[0])
    assert at == pytest.approx(4.0 / (np.pi * amplitude), rel=0.02)
    assert np.interp(f, gains.frequency_hz, gains.springs[0]) == pytest.approx(0.75 * 0.02**2, rel=0.02)
    # a velocity that never reverses leaves nothing of it, one that nearly does a part
    over = equivalent_gains(plant, moving(amplitude * (wave + 1.5)), 200.0)
    assert np.interp(f, over.frequency_hz, over.friction[0]) == pytest.approx(0.0, abs=1e-3 / amplitude)
    part = equivalent_gains(plant, moving(amplitude * (wave + 0.5)), 200.0)
    expected = 4.0 / (np.pi * amplitude) * np.sqrt(1.0 - 0.5**2)
    assert np.interp(f, part.frequency_hz, part.friction[0]) == pytest.approx(expected, rel=0.05)


@pytest.mark.parametrize("seed", range(3))
def test_of_noise_they_are_those_of_statistical_linearisation(seed: int) -> None:
    rng = np.random.default_rng(seed)
    lines = np.fft.rfft(rng.standard_normal(60000))
    f = np.fft.rfftfreq(60000, 1.0 / FS)
    v = np.fft.irfft(np.where((f > 2.0) & (f < 80.0), lines, 0.0))
    v *= 1.7 / np.std(v)
    gains = equivalent_gains(make_plant(BOTH, VALUES), moving(v), 200.0)
    inside = (gains.frequency_hz > 5.0) & (gains.frequency_hz < 70.0)
    expected = np.sqrt(2.0 / np.pi) / 1.7
    assert np.median(gains.friction[0][inside]) == pytest.approx(expected, rel=0.05)


def swept(model: Model, force: float, values: dict[str, float]) -> Record:
    t = np.arange(int(4 * FS) * 4) / FS / 4.0
    wave = force * np.sin(2.0 * np.pi * (4.0 * t + (140.0 - 4.0) / 8.0 * t**2))
    rest = np.zeros(t.size)
    return simulate(model, values, Excitation(rest, rest, wave, 4.0 * FS, "sweep"), fs=FS).record


@pytest.mark.parametrize("model", [BOTH, DEFLECTION], ids=["positions", "deflection"])
@pytest.mark.parametrize(("force", "cubic"), [(0.05, 0.0), (0.2, 0.0), (0.2, 3e4), (0.6, 3e4)])
def test_the_response_is_that_at_the_records_amplitude(model: Model, force: float, cubic: float) -> None:
    """Sweeps about rest: the linear curve is wrong by tens of degrees, this one by few."""
    values = {**VALUES, "K3": cubic}
    record, plant = swept(model, force, values), make_plant(model, values)
    found = record.frequency_response("q_m", "Gamma")
    kept = (found.coherence > 0.95) & (found.frequency_hz > 6.0) & (found.frequency_hz < 130.0)
    f, H = found.frequency_hz[kept], found.response[kept]

    def median_degrees(gains: object) -> float:
        modelled = linear_chain(plant, gains, f).response(f, 0, 0)  # type: ignore[arg-type]
        return float(np.median(np.abs(np.degrees(np.angle(H / modelled)))))

    bent, linear = median_degrees(equivalent_gains(plant, record, 300.0)), median_degrees(None)
    assert bent < 6.0
    assert bent < 0.6 * linear
