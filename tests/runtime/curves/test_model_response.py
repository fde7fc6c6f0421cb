"""Responses with bands: the delta method is what drawn parameters do; what is left open is not drawn."""

from __future__ import annotations

import numpy as np
import pytest

from generated import emps300_qm_ac
from modelgen.errors import DataError
from modelgen.runtime.curves.equivalent_gains import linear_chain
from modelgen.runtime.curves.model_response import EstimatedChain, model_response
from modelgen.runtime.model.model import model_from_module
from modelgen.runtime.modes.uncertain_chain import UncertainChain

MODEL = model_from_module(emps300_qm_ac)
TRUTH = dict(MODEL.parameter_sets["light"])
NAMES = MODEL.parameters
F = np.geomspace(5.0, 300.0, 40)


def chain_of(root: np.ndarray, *open_names: str) -> EstimatedChain:
    values = np.array([TRUTH[name] for name in NAMES])
    open_ = np.array([[float(name == lost) for lost in open_names] for name in NAMES])
    roles = {name: MODEL.roles[name].role for name in NAMES}
    solid = np.array([[c * (roles[n] not in ("viscous", "damping")) for c in row] for n, row in
                      zip(NAMES, open_, strict=True)])  # fmt: skip
    return EstimatedChain(MODEL, UncertainChain(NAMES, values, root, open_, solid))


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("output", ["q_m", "a_c"])
def test_bands_are_what_drawn_parameters_do(seed: int, output: str) -> None:
    rng = np.random.default_rng(seed)
    values = np.array([TRUTH[name] for name in NAMES])
    root = 1e-4 * values[:, None] * rng.standard_normal((len(NAMES), len(NAMES)))
    chain = chain_of(root)
    found = model_response(chain, output, "Gamma_m", F)
    row = [s.key for s in MODEL.sensors].index(output)
    draws = []
    for _ in range(400):
        moved = dict(zip(NAMES, values + root @ rng.standard_normal(len(NAMES)), strict=True))
        draws.append(np.log(linear_chain(chain.plant(moved), None, F).response(F, row, 0) / found.response))
    spread = np.array(draws)
    np.testing.assert_allclose(found.factor_std, np.std(spread.real, axis=0), rtol=0.2)
    np.testing.assert_allclose(found.phase_std, np.std(spread.imag, axis=0), rtol=0.2)
    low, high = found.magnitude_band()
    assert (low < np.abs(found.response)).all()
    assert (high > np.abs(found.response)).all()


def test_what_the_records_leave_open_is_not_drawn() -> None:
    none = np.zeros((len(NAMES), 1))
    told = model_response(chain_of(none), "a_c", "Gamma_m", F)
    assert np.isfinite(told.response).all()
    assert told.notes == ()
    lost = model_response(chain_of(none, "K"), "q_m", "Gamma_m", F)
    # far below the resonance a spring is stiff, and far above it soft, whatever it is
    near = (F > 80.0) & (F < 160.0)
    assert np.isnan(lost.response[near]).all()
    assert np.isfinite(lost.response[[0, -1]]).all()
    assert "it needs K, which the records leave open" in lost.notes[0]
    damped = model_response(chain_of(none, "F_vm"), "a_c", "Gamma_m", F)
    assert np.isfinite(damped.response).all()
    assert "leave F_vm open: drawn with F_vm =" in damped.notes[0]


def test_names_are_those_of_the_model() -> None:
    chain = chain_of(np.zeros((len(NAMES), 1)))
    with pytest.raises(DataError, match="has no sensor q_c"):
        model_response(chain, "q_c", "Gamma_m", F)
    with pytest.raises(DataError, match="has no actuator q_m"):
        model_response(chain, "a_c", "q_m", F)
