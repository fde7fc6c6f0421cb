"""What `design` promises is what `identify` states, with its defaults."""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from generated import emps300_qm_qc
from modelgen.errors import DataError, IdentifiabilityError, Problem
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.model.model import model_from_module
from modelgen.runtime.planning import default_precision as predictions
from modelgen.runtime.planning.optimal_excitation import optimise
from modelgen.runtime.planning.planned_experiment import experiment
from modelgen.runtime.planning.sensor_set_ranking import judge_set
from modelgen.runtime.planning.thresholds import COPIES
from modelgen.runtime.simulation.instrument import Instrument
from tests.runtime.iv.physical.test_composite_iv import model_of

QC = model_from_module(emps300_qm_qc)
BENCH = {key: Instrument(std) for key, std in {"q_m": 2e-5, "q_c": 2e-5, "Gamma_m": 1e-4}.items()}
HOIST = """
chain = { name = "hoist", motion = "rotation" }
bodies = [
    { name = "m", inertia = "J_m", viscous = "F_m", coulomb = "C_m", actuator = "torque" },
    { name = "g", inertia = "J_g" },
    { name = "d", inertia = "J_d", viscous = "F_d" },
]
links = [
    { bodies = ["m", "g"], stiffness = "K_1", damping = "D_1" },
    { bodies = ["g", "d"], stiffness = "K_2", damping = "D_2" },
]
[sensors.ends]
q_m = { body = "m", measures = "position" }
q_d = { body = "d", measures = "position" }
"""
VALUES = {"J_m": 3e-3, "F_m": 0.02, "C_m": 0.1, "J_g": 1e-3, "J_d": 8e-3, "F_d": 0.03}
VALUES |= {"K_1": 600.0, "D_1": 0.1, "K_2": 250.0, "D_2": 0.08}
TOOLS = {"q_m": Instrument(2e-5), "q_d": Instrument(2e-5), "torque": Instrument(0.01)}


@pytest.mark.slow
def test_deviations_are_those_that_identify_states() -> None:
    truth = QC.parameter_sets["light"]
    found = judge_set("both", QC, truth, BENCH, fs=2000.0)
    assert found.missing == ()
    records = experiment(QC, truth, BENCH, fs=2000.0, method="auto").records
    stated = [identify(QC, records(seed)).bse for seed in range(COPIES)]
    for entry in found.precisions:
        squares = [(100.0 * one[entry.name] / truth[entry.name]) ** 2 for one in stated]
        assert entry.std == pytest.approx(np.sqrt(np.mean(squares)))
        assert entry.bias == 0.0


@pytest.mark.slow
def test_what_the_default_finds_behind_a_body_without_a_sensor_is_promised() -> None:
    """Least squares knows composites, and loses most parameters on the way from these."""
    model = model_of(HOIST, "ends")
    found = judge_set("ends", model, VALUES, TOOLS, fs=2000.0)
    assert found.missing == ()
    assert found.worst < 10.0
    with pytest.raises(IdentifiabilityError, match="by method wls, by whose predictions it searches"):
        optimise(model, VALUES, TOOLS, fs=2000.0)


def promised(monkeypatch: pytest.MonkeyPatch, copies: Sequence[Any]) -> Any:
    """Return the prediction where every copy gives these parameters, or ends in this error."""

    def identified(_: Any, seed: int) -> Any:
        if isinstance(copies[seed], Exception):
            raise copies[seed]
        physical = [SimpleNamespace(name=name, std=std) for name, std in copies[seed].items()]
        reasons = dict.fromkeys({"K", "J"} - copies[seed].keys(), "drowns in noise")
        parameters = SimpleNamespace(physical=physical)
        return SimpleNamespace(parameters=parameters, not_identifiable=reasons, condition_number=7.0)

    monkeypatch.setattr(predictions, "identify_whole", identified)
    model = SimpleNamespace(known={}, parameters=("K", "J"))
    planned: Any = SimpleNamespace(model=model, parameters={"K": 50.0, "J": 2.0}, records=lambda seed: seed)
    return predictions.default_precision(planned)


def test_what_most_copies_give_is_promised(monkeypatch: pytest.MonkeyPatch) -> None:
    too_short = DataError(Problem("run", "is too short", "record longer"))
    found = promised(monkeypatch, [{"K": 0.3, "J": 0.1}, {"K": 0.4}, too_short])
    (entry,) = found.precisions
    assert (entry.name, entry.std) == ("K", pytest.approx(2.0 * np.sqrt((0.3**2 + 0.4**2) / 2.0)))
    assert found.refused == {"J": "drowns in noise"}
    with pytest.raises(IdentifiabilityError, match="run: is too short"):
        promised(monkeypatch, [too_short, {"K": 0.3}, too_short])
