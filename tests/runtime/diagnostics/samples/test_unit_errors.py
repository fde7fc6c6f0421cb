"""Units and signs of two sensors that springs let move as one: degrees, revolutions, a reversed encoder."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from modelgen.errors import DataError, IdentifiabilityError
from modelgen.runtime.diagnostics.samples import unit_errors
from modelgen.runtime.diagnostics.samples.low_frequencies import Ratios, low_frequency_ratios
from modelgen.runtime.diagnostics.samples.unit_errors import _off_ratio, unlike_nominal, unlike_units
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.identification.options import values_of
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record
from modelgen.runtime.simulation.simulate import simulate
from tests.runtime.faulty_records import AC, BENCH, QC, RIGID, TREE, faulty, only, simulated
from tests.runtime.iv.physical.swinging_servo import SERVO, TRUTH
from tests.runtime.iv.physical.test_composite_iv import model_of

BOTH = SERVO + 'q_l = { body = "l", measures = "position" }\n'
ACCELERATION = SERVO + 'a_l = { body = "l", measures = "acceleration" }\n'
TO_GROUND = BOTH.replace("links = [", 'links = [{ bodies = ["l", "ground"], stiffness = "K_g" },')


@cache
def clean() -> tuple[Model, Record]:
    model = model_of(BOTH, "motor")
    return model, simulate(
        model, TRUTH, "chirp", fs=1000.0, duration_s=3.0, noise={"q_m": 1e-5, "q_l": 1e-5}
    ).record


def with_load(factor: float) -> Record:
    _, record = clean()
    return record.edited({"q_l": factor * record.signals["q_l"]})


def said(record: Record, model: Model | None = None) -> list[tuple[str, str]]:
    found = unlike_units(model or clean()[0], record, ("q_m", "q_l"))
    return [(one.kind, one.what) for one in found]


@pytest.mark.parametrize(("factor", "unit"), [(180.0 / np.pi, "degrees"), (0.5 / np.pi, "revolutions")])
def test_an_encoder_in_another_unit_is_told_with_that_unit(factor: float, unit: str) -> None:
    ((kind, what),) = said(with_load(factor))
    assert kind == "unit"
    assert what.endswith(f"what q_m says at low frequencies: one of them may be in {unit}")


def test_an_encoder_in_degrees_is_told_from_an_accelerometer_as_well() -> None:
    model = model_of(ACCELERATION, "motor")
    noise = {"q_m": 1e-5, "a_l": 1e-2}
    record = simulate(model, TRUTH, "chirp", fs=1000.0, duration_s=3.0, noise=noise).record
    record = record.edited({"q_m": np.degrees(record.signals["q_m"])})
    ((kind, what),) = [(one.kind, one.what) for one in unlike_units(model, record, ("q_m", "a_l"))]
    assert kind == "unit"
    assert what.endswith("what q_m says at low frequencies: one of them may be in degrees")


@pytest.mark.slow
def test_an_encoder_that_is_reversed_is_told_by_its_motion() -> None:
    ((kind, what),) = said(with_load(-1.0))
    assert (kind, what) == (
        "swapped",
        "moves against q_m at low frequencies: one of them is reversed in sign",
    )
    with pytest.raises(IdentifiabilityError, match="moves against q_m"):
        identify(clean()[0], with_load(-1.0))


def test_a_gear_that_turns_the_load_round_is_not_told_to_be_reversed() -> None:
    turned = model_of(BOTH.replace('damping = "D"', 'damping = "D", ratio = -1.0'), "motor")
    _, record = clean()
    assert [kind for kind, _ in said(record, turned)] == ["swapped"]
    mirrored = record.edited({"q_l": -record.signals["q_l"]})
    assert said(mirrored, turned) == []


@pytest.mark.parametrize("factor", [20.0, 1.25, 0.8])
def test_a_wrong_ratio_in_the_spec_is_told_where_bodies_move_as_one(factor: float) -> None:
    ((kind, what),) = said(with_load(factor))
    assert kind == "unit"
    assert what.endswith("times as far at low frequencies as q_m and the spec's ratios say")
    assert float(what.split()[1]) == pytest.approx(factor, rel=0.02)


@pytest.mark.parametrize("factor", [1.006, 0.97])
def test_a_ratio_that_is_slightly_wrong_is_told_by_how_far_both_go(factor: float) -> None:
    """A gear of 161 taken for one of 160: thousands of deflections where the load has turned for a while."""
    ((kind, what),) = said(with_load(factor))
    assert kind == "unit"
    assert what.endswith("times as far as q_m and the spec's ratios say, the farther both go")
    assert float(what.split()[1]) == pytest.approx(factor, rel=3e-4)
    turned = model_of(BOTH.replace('damping = "D"', 'damping = "D", ratio = -1.0'), "motor")
    ((kind, _),) = said(clean()[1].edited({"q_l": -factor * clean()[1].signals["q_l"]}), turned)
    assert kind == "unit"


@pytest.mark.parametrize("resonance_hz", [3.0, 6.0, 10.0, 20.0, 40.0])
def test_a_resonance_not_far_above_the_motion_is_no_wrong_ratio(resonance_hz: float) -> None:
    _, record = clean()
    n, f = record.n, np.fft.rfftfreq(record.n, 1.0 / record.fs)
    passed = 1.0 / (1.0 - (f / resonance_hz) ** 2 + 0.1j * f / resonance_hz)
    for slope in (1, 2, 3):
        falls = 1.0 / np.arange(1.0, n // 2 + 2) ** slope
        lines = falls * np.fft.rfft(np.random.default_rng(slope).standard_normal(n))
        moved = record.edited({"q_m": np.fft.irfft(lines, n), "q_l": np.fft.irfft(passed * lines, n)})
        assert [what for _, what in said(moved) if "farther" in what] == []


@pytest.mark.parametrize("seconds", [7.3, 8.7, 10.0])
def test_vibration_at_the_ends_of_a_stretch_is_no_wrong_ratio(seconds: float) -> None:
    """A line through its first and last sample is tilted by it, and a slope leaks into the lowest lines."""
    fs, mode_hz = 500.0, 40.0
    t = np.arange(int(fs * seconds)) / fs
    chirp = np.sin(2.0 * np.pi * (0.15 * mode_hz + 0.5 * 1.65 * mode_hz * t / seconds) * t)
    n = 4 * len(t)
    f = np.fft.rfftfreq(n, 1.0 / fs) / mode_hz
    passed = np.fft.irfft(np.fft.rfft(chirp, n) / (1.0 - f**2 + 0.1j * f), n)[: len(t)]
    moved = Record({"q_m": 5.0 * t + 0.3 * chirp, "q_l": 5.0 * t + 0.3 * passed}, fs)
    assert said(moved) == []


def off(values: list[float], noise: float) -> float | None:
    found = Ratios(np.array(values), np.full(3, noise), np.array([1.0, 4.0, 9.0]))
    return _off_ratio(found.values, found)


def test_nothing_is_told_of_right_channels() -> None:
    assert said(clean()[1]) == []
    assert said(with_load(1.001)) == []
    # the lowest band of an acceleration is noise: those of the tutorial's record
    assert off([1.261, 1.086, 1.073], 0.0) is None
    assert off([1.25, 1.28, 1.36], 0.0) == pytest.approx(1.25 * (1.25 / 1.28) ** (1.0 / 3.0))
    # noise may lower the ratio by as much
    assert off([0.89, 0.90, 0.92], 0.08) is None
    assert off([1.25, 1.28, 1.36], 0.08) is not None
    # beside a spring to ground a body may move as little as it likes, and against another
    held = model_of(TO_GROUND, "motor")
    assert said(with_load(-1.0), held) == said(with_load(180.0 / np.pi), held) == []
    assert said(with_load(1.2), held) == []


@pytest.mark.parametrize("seed", [10, 24, 28, 34])
def test_an_encoder_of_a_small_motion_is_not_told_to_be_off_by_a_ratio(seed: int) -> None:
    """Noise of the first of two sensors lowers what the other seems to move."""
    _, record = clean()
    rng = np.random.default_rng(seed)
    falls = 1.0 / np.arange(1.0, record.n // 2 + 2)
    motion, noise = (np.fft.irfft(falls * np.fft.rfft(rng.standard_normal(record.n))) for _ in range(2))
    assert said(record.edited({"q_m": motion + 0.4 * noise, "q_l": motion})) == []


def test_bodies_that_move_against_each_other_beyond_an_antiresonance_are_not_told_to_be_reversed() -> None:
    """A long chain's antiresonance may lie within the lowest bands of a short record."""
    model, record = clean()
    n = record.n
    lines = np.fft.rfft(np.random.default_rng(0).standard_normal(n)) / np.arange(1.0, n // 2 + 2) ** 3
    gain = np.full(len(lines), -0.3)
    gain[:12], gain[12:20], gain[20:28] = 1.3, -1.13, -0.65
    moved = record.edited({"q_m": np.fft.irfft(lines, n), "q_l": np.fft.irfft(lines * gain, n)})
    assert low_frequency_ratios(moved, model.sensors[0], model.sensors[1]) is None
    assert said(moved) == []


def test_a_load_far_above_its_resonance_has_no_other_unit() -> None:
    """There it moves the less the faster the motor does; a unit is the same in every band."""
    model, record = clean()
    n = record.n
    lines = np.fft.rfft(np.random.default_rng(0).standard_normal(n))
    bands = np.maximum(np.arange(len(lines)), 1.0)
    motor = {"q_m": np.fft.irfft(lines / bands, n)}
    for gain, kinds in ((-0.5 / bands**2, []), (np.full(len(lines), 1e-3), ["unit"])):
        moved = record.edited({**motor, "q_l": np.fft.irfft(lines / bands * gain, n)})
        assert [one.kind for one in unlike_units(model, moved, ("q_m", "q_l"))] == kinds


@pytest.mark.parametrize(
    ("values", "kinds"), [((-0.32, -0.53, -0.70), []), ((-0.95, -0.96, -0.98), ["unit", "swapped"])]
)
def test_a_load_that_is_moved_about_a_motor_that_sticks_is_not_told_to_be_reversed(
    values: tuple[float, ...], kinds: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A hand swings it about its spring; a sensor that is reversed says so in every band alike."""
    found = Ratios(np.array(values), np.full(3, 1e-3), np.array([1.0, 4.0, 9.0]))
    monkeypatch.setattr(unit_errors, "low_frequency_ratios", lambda *_: found)
    assert set(kinds) >= {kind for kind, _ in said(clean()[1])} >= set(kinds[1:])


MILL = """
chain = { name = "mill", motion = "rotation" }
bodies = [
    { name = "m", inertia = "J_m", coulomb = "F_sm" },
    { name = "g", inertia = "J_g", coulomb = "F_sg" },
    { name = "l", inertia = "J_l", actuator = "F" },
]
links = [
    { bodies = ["m", "g"], stiffness = "K_m", damping = "D_m" },
    { bodies = ["g", "l"], stiffness = "K_g", damping = "D_g" },
]
[sensors.ends]
q_m = { body = "m", measures = "position" }
q_l = { body = "l", measures = "position" }
[sensors.all]
q_m = { body = "m", measures = "position" }
q_g = { body = "g", measures = "position" }
q_l = { body = "l", measures = "position" }
"""
SMOOTH = MILL.replace(', coulomb = "F_sg"', "")


@pytest.mark.parametrize(
    ("text", "pair", "ways", "told"),
    [
        (MILL, ("q_g", "q_l"), {"q_m": 1e-3, "q_g": 1.0, "q_l": 5.0}, False),
        (MILL, ("q_g", "q_l"), {"q_m": 1.0, "q_g": 1.0, "q_l": 5.0}, True),
        (MILL, ("q_m", "q_l"), {"q_m": 1.0, "q_l": 5.0}, False),
        (SMOOTH, ("q_m", "q_l"), {"q_m": 1.0, "q_l": 5.0}, True),
    ],
)
def test_what_goes_a_part_of_the_way_about_a_body_that_sticks_has_no_wrong_ratio(
    text: str, pair: tuple[str, str], ways: dict[str, float], told: bool
) -> None:
    """A hand on the load bends two springs; who sees the third body go along knows that it is not held."""
    model = model_of(text, "all" if len(ways) > 2 else "ends")
    lines = np.fft.rfft(np.random.default_rng(0).standard_normal(4000))
    push = np.fft.irfft(lines / np.maximum(np.arange(len(lines)), 1.0) ** 2, 4000)
    record = Record({key: way * push for key, way in {**ways, "F": 1.0}.items()}, 1000.0, "pushed")
    assert [one.kind for one in unlike_units(model, record, pair)] == ["unit"] * told


def test_a_motion_that_ends_elsewhere_is_not_told_to_be_reversed() -> None:
    # the transform of such a position is that of its drift, which (j omega)^2 made a motion of its own
    model = model_of(ACCELERATION, "motor")
    times = np.arange(3000) / 1000.0
    rates = 2.0 * np.pi * np.array([0.4, 1.1, 2.3, 5.0])
    position = 4.0 * times**2 + sum(np.sin(rate * times) / rate for rate in rates)
    acceleration = 8.0 - sum(rate * np.sin(rate * times) for rate in rates)
    signals = {"q_m": position, "a_l": acceleration, "torque": acceleration}
    for sign, kinds in ((1.0, []), (-1.0, ["swapped"])):
        record = Record({**signals, "a_l": sign * acceleration}, 1000.0, "drifts")
        assert [one.kind for one in unlike_units(model, record, ("q_m", "a_l"))] == kinds


def test_a_sensor_that_reads_one_number_is_refused_beside_one_that_moves() -> None:
    model, record = clean()
    with pytest.raises(DataError, match="it does not say how l moves"):
        identify(model, record.edited({"q_l": np.full(record.n, 0.5)}))


def test_a_stroke_of_hundreds_of_metres_is_in_millimetres(emps: Record) -> None:
    found = only(RIGID, faulty(emps, "q_m", lambda samples: 1000.0 * samples))
    assert (found.kind, found.what) == ("unit", "spans 246.4 m, more than machines do (100 m)")


@pytest.mark.parametrize("factor", [1e3, 1e-3])
@pytest.mark.parametrize("kind", ["chirp", "trapezoid"])
@pytest.mark.parametrize("model", [QC, AC], ids=["qm_qc", "qm_ac"])
def test_millimetres_beside_metres_are_told(model: Model, kind: str, factor: float) -> None:
    key = model.sensors[1].key
    record = faulty(simulated(model, kind), key, lambda samples: factor * samples)
    found = only(model, record)
    assert (found.kind, found.where) == ("unit", f"{kind}, channel {key}, samples 0 to {record.n - 1}")
    assert "what q_m says at low frequencies: one of them has another unit" in found.what
    ratios = low_frequency_ratios(record, *model.sensors)
    assert ratios is not None
    assert 0.5 < np.median(ratios.values) / factor < 2.0


def test_gears_are_allowed_for() -> None:
    record = simulated(TREE, "chirp")
    motor, load = (next(s for s in TREE.sensors if s.body == body) for body in ("m", "b"))
    ratios = low_frequency_ratios(record, motor, load)
    assert ratios is not None
    assert np.median(ratios.values) == pytest.approx(0.05, rel=0.2)  # the gear's


def test_sensors_that_do_not_move_together_are_not_compared() -> None:
    random = np.random.default_rng(3)
    signals = {"q_m": random.normal(size=4000), "q_c": 1e4 * random.normal(size=4000)}
    record = Record({**signals, "i": random.normal(size=4000)}, 1000.0)
    assert low_frequency_ratios(record, *BENCH.sensors) is None


@pytest.mark.parametrize(("key", "factor"), [("F", 1e3), ("F", 1e-3), ("q_m", 1e-3)])
def test_an_estimate_far_from_every_parameter_set_is_told(emps: Record, key: str, factor: float) -> None:
    estimate = identify(
        RIGID, faulty(emps, key, lambda samples: factor * samples), **values_of(drift_check=False)
    )
    (found,) = unlike_nominal(RIGID, estimate.physical, estimate.records)
    assert found in estimate.checks.advice
    assert found.kind == "unit"
    assert "what the spec's parameter sets say (published_2019)" in found.what


@pytest.mark.parametrize(("longer", "said"), [(1000.0, "1000 times too long"), (1e-2, "times too short")])
def test_times_in_another_unit_are_told_by_inertias_alone(longer: float, said: str) -> None:
    """Times a thousand times too long: inertias go with their square, springs do not care."""
    table = dict(AC.parameter_sets["table_1"])
    power = {"inertia": 2, "damping": 1, "viscous": 1}
    found = {name: value * longer ** power.get(AC.roles[name].role, 0) for name, value in table.items()}
    (advice,) = unlike_nominal(AC, found, ["a"])
    assert advice.kind == "unit" and said in advice.what and "--time-unit" in advice.remedy
    assert unlike_nominal(AC, {**found, "K": 2.0 * table["K"]}, ["a"]) == ()


def test_values_near_a_parameter_set_or_unlike_each_other_are_not_told() -> None:
    table = dict(AC.parameter_sets["table_1"])
    assert unlike_nominal(AC, table, ["a"]) == ()
    assert unlike_nominal(AC, {name: 8.0 * value for name, value in table.items()}, ["a"]) == ()
    guessed = {name: 50.0 * value * (1.0 + place) for place, (name, value) in enumerate(table.items())}
    assert unlike_nominal(AC, guessed, ["a"]) == ()
    # degrees for radians in all channels: no guess is off by the same in everything
    assert len(unlike_nominal(AC, {name: value / 57.3 for name, value in table.items()}, ["a"])) == 1
    assert unlike_nominal(AC, {**table, "K": 1e4 * table["K"]}, ["a"]) == ()
    (found,) = unlike_nominal(AC, {name: 1000.0 * value for name, value in table.items()}, ["a", "b"])
    assert found.where == "a, b, channels q_m, a_c, Gamma_m"
