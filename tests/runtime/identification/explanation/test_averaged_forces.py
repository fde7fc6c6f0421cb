"""Forces that a drive reports as means: found by their half sample, held by the intervals."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from modelgen.runtime.identification.explanation import averaged_forces
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.least_squares.time_shifts import mean_undone, shift
from modelgen.runtime.records.record import Record
from modelgen.runtime.results.estimate import Estimate
from modelgen.runtime.simulation.drive import Drive
from modelgen.runtime.simulation.simulate import simulate
from tests.runtime.two_mass_records import NOISE, SMALL, TRUTH

FS, FINE = 1000.0, 8
HELD = Drive(rate_hz=FS)


@cache
def fine_record(place: int, motion: str, drive: Drive | None = None) -> Record:
    return simulate(SMALL, TRUTH, motion, fs=FINE * FS, duration_s=2.0, seed=place, drive=drive).record


def records(reported: str, loud: float = 1.0) -> list[Record]:
    """Records at FS whose force is the mean over the last sample, or over a half, or only late by a half.

    Or the command before, held over a sample. `loud` times the noise of the sensors and of the force.
    """
    found = []
    for place, motion in enumerate(("trapezoid", "chirp")):
        fine = fine_record(place, motion, HELD if reported == "command" else None)
        force = fine.signals["Gamma_m"]
        if reported == "command":
            force = fine.edited({"Gamma_m": shift("Gamma_m", -FINE)}).signals["Gamma_m"]
        length = {"mean": FINE, "half": FINE // 2}.get(reported)
        if length:
            force = np.convolve(force, np.ones(length) / length)[: fine.n]
        elif reported == "late":
            force = fine.edited({"Gamma_m": shift("Gamma_m", -0.5 * FINE)}).signals["Gamma_m"]
        signals = {**fine.signals, "Gamma_m": force}
        rng = np.random.default_rng(place)
        coarse = {key: one[::FINE] for key, one in signals.items() if key in NOISE}
        noisy = {key: one + loud * NOISE[key] * rng.standard_normal(len(one)) for key, one in coarse.items()}
        found.append(Record(noisy, FS, motion))
    return found


def held(estimate: Estimate) -> bool:
    found = [entry for entry in estimate.parameters.physical if entry.name in ("J_m", "J_c", "K")]
    return len(found) == 3 and all(abs(one.value - TRUTH[one.name]) < 2.2 * one.std for one in found)


def told(estimate: Estimate) -> list[str]:
    notes = ["either" for note in estimate.fit.notes if "means over the time before" in note]
    words = ("average", "low-pass", "mean over")
    said = [one.what for one in estimate.checks.advice]
    notes += ["mean" for what in said if any(word in what for word in words)]
    notes += ["held" for note in estimate.fit.notes if "samples, all of it is held" in note]
    return notes + ["held" for what in said if "held over the last" in what]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("reported", "loud", "what"),
    [("mean", 1.0, ["mean"]), ("half", 1.0, ["mean"]), ("command", 1.0, ["held"]), ("late", 1.0, []),
     ("exact", 1.0, []), ("mean", 100.0, ["either"]), ("late", 100.0, ["either"]), ("exact", 100.0, [])],
)  # fmt: skip
def test_a_mean_is_found_where_it_shows_and_held_where_it_does_not(
    reported: str, loud: float, what: list[str]
) -> None:
    estimate = identify(SMALL, records(reported, loud))
    assert told(estimate) == what
    assert held(estimate)


def test_a_mean_is_undone() -> None:
    times = np.arange(4000.0)
    frequency = 0.07
    mean = np.sinc(0.8 * frequency) * np.sin(2.0 * np.pi * frequency * (times - 0.4))
    record = Record({"F": mean}, 1.0, "tone")
    undone = record.edited({"F": mean_undone("F", 0.8)}).signals["F"]
    wanted = np.sin(2.0 * np.pi * frequency * times)
    assert np.allclose(undone[200:-200], wanted[200:-200], atol=1e-6)


@pytest.mark.parametrize("settles", [0.1, 0.3, 0.8])
@pytest.mark.parametrize("frequency", [0.02, 0.1])
def test_a_current_that_settles_within_each_sample_acts_as_a_mean_does(
    settles: float, frequency: float
) -> None:
    """Times in samples: a staircase of commands behind a lag, read at the end of each.

    Against straight lines between its readings it acts early, and more strongly: by half to all of what a
    mean that late would have lost. What is told names both.
    """
    s, z = 2j * np.pi * frequency, np.exp(2j * np.pi * frequency)
    acting = np.sinc(frequency) * np.exp(-0.5 * s) / (1.0 + s * settles)
    read = (1.0 - np.exp(-1.0 / settles)) / (z - np.exp(-1.0 / settles))
    ratio = acting / (read * np.sinc(frequency) ** 2)
    late = float(np.angle(ratio)) / (2.0 * np.pi * frequency)
    lost = 1.0 / np.sinc(2.0 * late * frequency) - 1.0
    assert 0.1 < late < 0.5
    assert 0.5 * (abs(ratio) - 1.0) < lost < abs(ratio) - 1.0
    assert "controller" in averaged_forces.MEAN
