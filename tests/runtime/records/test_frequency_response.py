"""Measured frequency responses: known systems, noise, whole periods, records in stretches, refusals."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from scipy.signal import csd, lfilter, welch

from modelgen.errors import DataError
from modelgen.runtime.records.channels import EditedChannels
from modelgen.runtime.records.record import Record

FS = 1000.0


def fir_record(seed: int, n: int = 9000, noise: float = 0.1) -> tuple[Record, np.ndarray]:
    """A white input, its response by a random filter of 3 taps and white noise of the output."""
    rng = np.random.default_rng(seed)
    taps = rng.uniform(-1.0, 1.0, 3)
    u = rng.standard_normal(n)
    y = lfilter(taps, 1.0, u) + noise * rng.standard_normal(n)
    return Record({"u": u, "y": y}, FS, "white"), taps


def true_response(taps: np.ndarray, frequency_hz: np.ndarray) -> np.ndarray:
    return np.exp(-2j * np.pi * np.outer(frequency_hz, np.arange(len(taps))) / FS) @ taps


@pytest.mark.parametrize("seed", range(4))
def test_segments_are_those_of_welch(seed: int) -> None:
    record, _ = fir_record(seed)
    found = record.frequency_response("y", "u")
    options = {"fs": FS, "nperseg": 2000, "detrend": "linear"}
    u, y = record.signals["u"], record.signals["y"]
    f, Suu = welch(u, **options)
    Suy, Syy = csd(u, y, **options)[1], welch(y, **options)[1]
    np.testing.assert_allclose(found.frequency_hz, f[2:])
    np.testing.assert_allclose(found.response, (Suy / Suu)[2:])
    np.testing.assert_allclose(found.coherence, (np.abs(Suy) ** 2 / Suu / Syy)[2:])
    assert (found.averages, found.period_s) == (8, None)


def test_the_standard_deviation_is_that_of_the_errors() -> None:
    shares = []
    for seed in range(20):
        record, taps = fir_record(seed, noise=1.0)
        found = record.frequency_response("y", "u", resolution_hz=10.0)
        error = np.abs(found.response) - np.abs(true_response(taps, found.frequency_hz))
        shares.append(np.mean(np.abs(error) <= 1.96 * found.std))
    assert 0.93 <= np.mean(shares) <= 0.97


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("odd", [0, 1])
def test_whole_periods_leak_nothing(seed: int, odd: int) -> None:
    """The output travels, too: a ramp is no part of a period."""
    rng = np.random.default_rng(seed)
    length, taps = 1000 + odd, rng.uniform(-1.0, 1.0, 3)
    t = np.arange(8 * length + 300)
    lines = rng.choice(np.arange(1, 100), 12, replace=False)
    u = sum(np.sin(2 * np.pi * k * t / length + rng.uniform(0.0, 6.0)) for k in lines)
    y = lfilter(taps, 1.0, u) + 0.01 * t
    record = Record({"u": u, "y": y}, FS, "multisine")
    for period_s in (None, length / FS):
        found = record.frequency_response("y", "u", period_s=period_s)
        np.testing.assert_allclose(found.frequency_hz, np.sort(lines) * FS / length)
        np.testing.assert_allclose(
            found.response, true_response(taps, found.frequency_hz), rtol=1e-9, atol=1e-9
        )
        assert (found.averages, found.period_s) == (8, length / FS)
        assert found.coherence.min() > 1.0 - 1e-9
    assert record.frequency_response("y", "u", period_s="none").period_s is None


def test_noise_of_a_periodic_input_biases_nothing() -> None:
    rng = np.random.default_rng(0)
    u = np.tile(rng.standard_normal(500), 60)
    record = Record({"u": u + rng.standard_normal(u.size), "y": 2.0 * u}, FS)
    whole = record.frequency_response("y", "u", period_s=0.5)
    assert np.mean(whole.response.real) == pytest.approx(2.0, abs=0.05)
    assert np.mean(record.frequency_response("y", "u", period_s="none").response.real) < 1.2


def test_a_record_in_stretches_gives_the_same() -> None:
    record, _ = fir_record(3)
    source = EditedChannels(record, "white", record.n)
    np.testing.assert_array_equal(
        Record.over(source).frequency_response("y", "u").response,
        record.frequency_response("y", "u").response,
    )


def test_python_control_takes_it_in_rad_per_s() -> None:
    control = pytest.importorskip("control")
    found = fir_record(0)[0].frequency_response("y", "u")
    system = found.to_control()
    assert isinstance(system, control.FRD)
    np.testing.assert_allclose(system.omega, 2.0 * np.pi * found.frequency_hz)
    np.testing.assert_array_equal(np.ravel(system.frdata), found.response)
    assert (system.input_labels, system.output_labels) == (["u"], ["y"])


def test_without_python_control_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "control", None)
    with pytest.raises(DataError, match=r"needs control.*pip install 'modelgen\[control\]'"):
        fir_record(0)[0].frequency_response("y", "u").to_control()


def test_it_cannot_be_changed_and_survives_pickling() -> None:
    found = fir_record(0)[0].frequency_response("y", "u")
    with pytest.raises(ValueError, match="read-only"):
        found.response[0] = 0.0
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(found)).response, found.response)
    assert repr(found) == "FrequencyResponse(white: y over u, 1 to 500 Hz, 999 lines, 8 segments)"


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"output": "z"}, "has no channel z"),
        ({"input": "x", "output": "z"}, "has no channel x"),
        ({"input": "still"}, "is constant: it excites nothing"),
        ({"resolution_hz": 0.0}, "resolution_hz: is 0.0; give 0.1667 to 62.5 Hz"),
        ({"resolution_hz": float("nan")}, "resolution_hz: is nan"),
        ({"resolution_hz": "10"}, "resolution_hz: is '10'"),
        ({"resolution_hz": 1e4}, "resolution_hz: is 10000.0"),
        ({"period_s": -1.0}, "period_s: is -1.0; give the period in s"),
        ({"period_s": "some"}, "period_s: is 'some'"),
        ({"period_s": 0.0101001}, "no whole number"),
        ({"period_s": 6.0}, "and the record has 9 s"),
        ({"period_s": 0.9}, "does not repeat itself then"),
    ],
)
def test_what_cannot_be_is_refused(options: dict[str, object], said: str) -> None:
    record, _ = fir_record(1)
    record = record.edited({"still": np.ones(record.n)})
    with pytest.raises(DataError, match=said):
        record.frequency_response(**{"output": "y", "input": "u", **options})


def test_a_short_record_is_refused() -> None:
    record, _ = fir_record(1, n=60)
    with pytest.raises(DataError, match="too few for 8 segments; record 72 samples"):
        record.frequency_response("y", "u")
