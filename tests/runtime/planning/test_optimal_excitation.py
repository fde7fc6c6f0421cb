"""Optimised excitations keep the limits, and tell more than the pair that set them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from generated import emps300_qm_qc
from modelgen.errors import DataError
from modelgen.runtime.model.model import model_from_module
from modelgen.runtime.planning.optimal_excitation import LIMITS, optimise
from modelgen.runtime.records.read_record import read_record
from modelgen.runtime.simulation.excitation import excitation_from_record
from modelgen.runtime.simulation.fourier_excitation import write_references
from modelgen.runtime.simulation.instrument import Instrument
from modelgen.runtime.simulation.multisine import multisine
from modelgen.runtime.simulation.simulate import simulate
from modelgen.runtime.simulation.thresholds import PIECES_A_SAMPLE

QC = model_from_module(emps300_qm_qc)
TABLE_2 = QC.parameter_sets["table_2"]
TOOLS = {"q_m": Instrument(2e-5), "q_c": Instrument(2e-5), "Gamma_m": Instrument(1e-4)}


@pytest.mark.slow
def test_a_few_trials_beat_the_pair_within_its_limits(tmp_path: Path) -> None:
    found = optimise(QC, TABLE_2, TOOLS, rounds=1, method="wls")
    assert tuple(found.limits) == LIMITS
    for key, limit in found.limits.items():
        assert found.reached[key] <= limit
    assert found.worst < found.pair_worst / 1.5
    assert found.worst == max(error for _, _, error in found.parameters)
    assert [e.reference.size for e in found.excitations] == [PIECES_A_SAMPLE * 9999 + 1] * 2
    # a controller plays the samples of the file; what lies between them makes no difference to speak of
    paths = write_references(tmp_path / "best.csv", found.excitations, 5000.0)
    assert [path.name for path in paths] == ["best_1.csv", "best_2.csv"]
    played = excitation_from_record(read_record(paths[0]))
    a, b = (simulate(QC, TABLE_2, e).true["q_m"] for e in (found.excitations[0], played))
    assert np.abs(a - b).max() < 2e-3 * np.abs(a).max()
    with pytest.raises(DataError, match=r"best_2.csv: exists already"):
        write_references(tmp_path / "best.csv", found.excitations, 5000.0)


@pytest.mark.slow
@pytest.mark.parametrize("criterion", ["d-optimal", "condition"])
def test_other_criteria_can_be_asked_for(criterion: str) -> None:
    found = optimise(QC, TABLE_2, TOOLS, rounds=1, duration_s=1.0, criterion=criterion)
    # the same first trials, of which another may be the best
    assert 0.0 < found.worst < np.inf
    for key, limit in found.limits.items():
        assert found.reached[key] <= limit


@pytest.mark.slow
def test_given_limits_are_kept() -> None:
    limits = {"velocity": 40.0, "force": 0.03}
    found = optimise(QC, TABLE_2, TOOLS, rounds=1, limits=limits, duration_s=1.0, method="wls")
    assert found.limits["velocity"] == 40.0
    assert 30.0 < found.reached["velocity"] <= 40.0
    assert found.reached["force"] <= 0.03


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"criterion": "best"}, "criterion: is 'best'; choose one of worst, d-optimal, condition"),
        ({"limits": {"speed": 1.0}}, "limits: 'speed' is unknown; choose from position"),
        ({"limits": {"force": 0.0}}, r"limits: force: is 0.0; give a finite positive number"),
    ],
)
def test_wrong_options_are_explained(options: dict[str, object], message: str) -> None:
    with pytest.raises(DataError, match=message):
        optimise(QC, TABLE_2, TOOLS, **options)  # type: ignore[arg-type]


@pytest.mark.parametrize(("low", "high", "tilt"), [(60.0, 150.0, 0.0), (20.0, 200.0, 1.0), (50.0, 50.0, 0.0)])
def test_a_multisine_has_its_band_and_a_low_crest(low: float, high: float, tilt: float) -> None:
    t = np.arange(20000) / 10000.0
    wave = multisine(t, low, high, tilt)
    assert np.abs(wave).max() == pytest.approx(1.0, abs=0.02)
    assert np.abs(wave).max() / np.sqrt(np.mean(wave**2)) < 1.9
    power = np.abs(np.fft.rfft(wave)) ** 2
    hz = np.fft.rfftfreq(t.size, 1e-4)
    inside = (hz >= low - 2.1) & (hz <= high + 2.1)
    assert power[~inside].sum() < 1e-12 * power.sum()
    lines = np.flatnonzero(power > 1e-6 * power.max())
    if tilt:
        np.testing.assert_allclose(
            power[lines] / power[lines[0]], (hz[lines] / hz[lines[0]]) ** -2.0, rtol=1e-6
        )
