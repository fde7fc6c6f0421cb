"""Many parameter vectors at once are the single simulations, in order."""

from __future__ import annotations

import numpy as np
import pytest

from generated import emps300_qm_ac
from modelgen.errors import DataError
from modelgen.runtime.model.model import model_from_module
from modelgen.runtime.simulation.closed_loop import default_controller
from modelgen.runtime.simulation.excitation import chirp
from modelgen.runtime.simulation.parameter_sweep import sweep
from modelgen.runtime.simulation.plant import make_plant
from modelgen.runtime.simulation.simulate import simulate

AC = model_from_module(emps300_qm_ac)
LIGHT = AC.parameter_sets["light"]
WAVE = chirp(20.0, 200.0, 0.4, 5000.0, force=0.05, velocity=20.0, oversample=2)
LOOP = default_controller(make_plant(AC, LIGHT))


def test_every_vector_is_its_own_simulation() -> None:
    stiffness = LIGHT["K"] * np.array([0.9, 1.0, 1.1, 1.2])
    found = sweep(AC, {**LIGHT, "K": stiffness}, WAVE, controller=LOOP)
    assert {key: array.shape for key, array in found.items()} == {
        key: (4, 2000) for key in ("q_m", "a_c", "Gamma_m")
    }
    for i, K in enumerate(stiffness):
        alone = simulate(AC, {**LIGHT, "K": float(K)}, WAVE, controller=LOOP).true
        for key, array in found.items():
            np.testing.assert_array_equal(array[i], alone[key])
    assert np.abs(found["a_c"][0] - found["a_c"][3]).max() > 1.0


def test_scalars_make_one_vector_and_lengths_must_agree() -> None:
    assert sweep(AC, LIGHT, WAVE, keys=["v_c"], controller=LOOP)["v_c"].shape == (1, 2000)
    with pytest.raises(DataError, match="parameters: differ in length"):
        sweep(AC, {**LIGHT, "K": [0.3, 0.4], "J_c": [1e-6, 1e-6, 1e-6]}, WAVE)
    with pytest.raises(DataError, match="parameters: J_c: is -1e-06"):
        sweep(AC, {**LIGHT, "J_c": [1e-6, -1e-6]}, WAVE)
