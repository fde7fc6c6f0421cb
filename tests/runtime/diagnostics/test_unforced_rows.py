from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from generated import emps300_qm_qc
from modelgen.runtime.diagnostics import unforced_rows
from modelgen.runtime.diagnostics.unforced_rows import zero_columns
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.wls import fit_paper
from modelgen.runtime.model.model import model_from_module
from modelgen.runtime.records.record import Record
from tests.runtime.identification.test_assemble_estimate import CHOICE, observation

TWO_MASS = model_from_module(emps300_qm_qc)


def hidden() -> Fit:
    """Nothing but the load's row tells its parameters: its solution is zero, whatever its terms."""
    rows = observation()
    motor = np.where(rows.blocks[1].W[0] == 0.0, rows.blocks[0].W, 0.0)
    return fit_paper(replace(rows, blocks=(replace(rows.blocks[0], W=motor), rows.blocks[1])))


def test_the_columns_of_a_row_without_a_force_that_zero_solves_have_no_number() -> None:
    rows = observation()
    assert zero_columns(fit_paper(rows), TWO_MASS) == {}
    found = zero_columns(hidden(), TWO_MASS)
    load = {TWO_MASS.base_parameters[column] for column in TWO_MASS.regressor_columns[rows.blocks[1].row]}
    assert all("zero solves it as well" in why for why in found.values())
    assert {name for name, why in found.items() if why.startswith("row c has no force")} == load
    # the motor's row holds the spring: without it the motor's inertia is that of both
    motors = {TWO_MASS.base_parameters[column] for column in TWO_MASS.regressor_columns[rows.blocks[0].row]}
    assert set(found) == load | motors
    assert found["J_m"].startswith("takes over what is lost")


@pytest.mark.parametrize("times", [1.2, 30.0])
def test_noise_is_named_only_where_it_is_as_large_as_what_the_row_leaves(
    times: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A ratio 1 % off left 715 times the noise of two encoders, which was said to hide the motion."""
    fit, records = hidden(), (Record({"q_m": np.zeros(9)}, 1e3, "run"),)
    monkeypatch.setattr(unforced_rows, "block_noise", lambda fit, index, *_, **__: fit.rms(index) / times)
    found = zero_columns(fit, TWO_MASS, recorded=(records, CHOICE))
    assert set(found) == set(zero_columns(fit, TWO_MASS))
    assert all(("noise of the sensors hides" in why) == (times < 6.0) for why in found.values())
    assert all(("30 times the noise of its sensors in run" in why) == (times > 6.0) for why in found.values())


def test_a_row_that_holds_for_values_of_another_size_is_not_said_to_lack_something(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Few samples were left of the row with a force: of a right model ratio, sign and unit were doubted."""
    fit, records = hidden(), (Record({"q_m": np.zeros(9)}, 1e3, "run"),)
    noise = fit.rms(1) / 30.0
    monkeypatch.setattr(unforced_rows, "block_noise", lambda one, *_, **__: noise if one is fit else 1.0)
    found = zero_columns(fit, TWO_MASS, recorded=(records, CHOICE))
    assert all(why.endswith("rows with a force do not tell here") for why in found.values())
