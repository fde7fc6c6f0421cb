from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from generated import emps300_qm_ac, emps300_qm_qc, emps_rigid_qm
from modelgen.errors import DataError
from modelgen.runtime.filter_choice.filter_choice import FilterChoice, choose_filter
from modelgen.runtime.model.model import Model, model_from_module
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.observation import Observation, observe
from modelgen.runtime.rows.row_block import RowBlock
from modelgen.runtime.rows.rows_by_tag import rows_by_tag

RIGID = model_from_module(emps_rigid_qm)
QC, AC = model_from_module(emps300_qm_qc), model_from_module(emps300_qm_ac)
FS = 5000.0
TRUTH = {"J_m": 1e-5, "F_vm": 2e-5, "F_sm": 5e-3, "J_c": 7e-7, "F_vmc": 5e-4, "K": 0.3}


def moving(model: Model, reversing: bool, name: str = "run", tag: str | None = None) -> Record:
    """A record that obeys the equations exactly; positions are chosen, the rest follows.

    The load's motion is a sum of sines; the motor's follows from the load's equation, then the torque.
    """
    t = np.arange(15000) / FS
    position, velocity, acceleration = (np.zeros((2, t.size)) for _ in range(3))
    steady = 0.0 if reversing else 40.0
    for body, gain in ((0, None), (1, 1.0)):
        position[body] += steady * t
        velocity[body] += steady
        for hertz, size in ((11.0, 0.02), (47.0, 2e-3), (90.0, 4e-4)):
            omega = 2.0 * np.pi * hertz
            link = TRUTH["K"] + 1j * omega * TRUTH["F_vmc"]
            response = 1.0 if gain else (link - TRUTH["J_c"] * omega**2) / link
            wave = size * response * np.exp(1j * omega * t)
            position[body] += wave.real
            velocity[body] += (1j * omega * wave).real
            acceleration[body] += (-(omega**2) * wave).real
    torque = (
        TRUTH["J_m"] * acceleration[0]
        + TRUTH["J_c"] * acceleration[1]
        + TRUTH["F_vm"] * velocity[0]
        + TRUTH["F_sm"] * np.sign(velocity[0])
    )
    signals = {"q_m": position[0], "q_c": position[1], "a_c": acceleration[1], "Gamma_m": torque}
    return Record({key: signals[key] for key in model.channels}, FS, name, tag)


def observed(
    model: Model, record: Record, direction_cutoff_hz: float = 150.0
) -> tuple[Observation, FilterChoice]:
    choice = choose_filter(model, [record], cutoff_hz=200.0, direction_cutoff_hz=direction_cutoff_hz)
    return observe(model, [record], choice), choice


@pytest.mark.parametrize("model", [QC, AC], ids=["qm_qc", "qm_ac"])
def test_true_parameters_satisfy_every_row_to_rounding(model: Model) -> None:
    x = model.base_from_physical(TRUTH)
    observation, _ = observed(model, moving(model, reversing=False))
    assert [block.row_name for block in observation.blocks] == [row.name for row in model.rows]
    for block in observation.blocks:
        assert block.place.size > 0.9 * block.grid
        error = np.abs(block.Y - block.W @ x) / np.abs(block.W * x).max()
        assert error.max() < 5e-3
        # what the mirrored ends leave behind dies out soon
        assert error[25:-25].max() < 2e-6


def test_undifferentiated_rows_are_right_through_quick_reversals() -> None:
    x = QC.base_from_physical(TRUTH)
    observation, _ = observed(QC, moving(QC, reversing=True), direction_cutoff_hz=1000.0)
    for block in observation.blocks:
        assert block.masked == 0
        terms = np.abs(block.W * x).max()
        # sign() is known to half a sample
        np.testing.assert_allclose(block.Y, block.W @ x, atol=0.03 * terms)


def test_differentiated_rows_drop_what_a_reversal_reaches() -> None:
    record = moving(AC, reversing=True)
    observation, _ = observed(AC, record)
    blocks = {block.row_name: block for block in observation.blocks}
    # the motor reverses all the time, its differentiated row has nothing left
    assert blocks["m"].place.size == 0
    assert blocks["m"].masked == blocks["m"].grid
    assert blocks["c"].masked == 0  # no friction in it
    assert blocks["m+c"].masked == 0
    assert observation.notes == (
        "run, row m: not used, every sample lies too near to a reversal or a standstill",
    )


def test_an_elimination_differentiates_the_friction_inside_and_is_masked_alike() -> None:
    # an elimination row is not differentiated as a whole, but names the velocities whose reversals spoil it
    rows = tuple(replace(row, reversals=("d1_q_m",), order=4) for row in QC.rows)
    observation, _ = observed(replace(QC, rows=rows), moving(QC, reversing=True))
    assert [block.place.size for block in observation.blocks] == [0, 0]


def test_a_standstill_is_masked_where_sign_enters_and_only_there() -> None:
    base = moving(QC, reversing=False)
    rest = np.arange(base.n)
    velocity_like = np.where((rest > 6000) & (rest < 8000), 0.0, 1.0)
    position = np.cumsum(velocity_like) / FS
    record = Record({**base.signals, "q_m": position}, FS, "rest")
    observation, choice = observed(QC, record)
    motor, load = observation.blocks
    assert load.masked == 0
    factor = choice.decimation[0]
    assert 2000 / factor < motor.masked < 2600 / factor
    kept = motor.place * factor + (base.n - motor.grid * factor) // 2
    assert not np.any((kept > 5900) & (kept < 8100))


def test_a_row_without_a_force_has_none_and_the_scale_is_the_force_s() -> None:
    observation, _ = observed(AC, moving(AC, reversing=False))
    assert [block.has_force for block in observation.blocks] == [True, False, True]
    motor, load, both = observation.blocks
    assert motor.force_scale == load.force_scale
    assert motor.force_scale == pytest.approx(np.sqrt(np.mean(motor.Y**2)), rel=0.05)
    assert both.force_scale == pytest.approx(np.sqrt(np.mean(both.Y**2)), rel=1e-9)


def test_a_force_that_rests_is_no_force() -> None:
    record = moving(QC, reversing=False)
    still = Record({**record.signals, "Gamma_m": np.zeros(record.n)}, FS)
    observation, _ = observed(QC, still)
    assert not any(block.has_force for block in observation.blocks)


def test_several_records_and_drop() -> None:
    records = [moving(QC, False, "one"), moving(QC, False, "two")]
    choice = choose_filter(QC, records, cutoff_hz=200.0, direction_cutoff_hz=150.0)
    observation = observe(QC, records, choice, drop=3000)
    assert [(block.record, block.record_name) for block in observation.blocks] == [
        (0, "one"), (0, "one"), (1, "two"), (1, "two"),
    ]  # fmt: skip
    assert observation.blocks[0].grid < observe(QC, records, choice).blocks[0].grid
    assert observation.notes == ("drop = 3000 samples at the beginning of every record, as given",)


def test_constants_are_columns_too() -> None:
    rng = np.random.default_rng(0)
    record = Record({"q_m": rng.standard_normal(2000), "F": rng.standard_normal(2000)}, 1000.0)
    choice = choose_filter(RIGID, [record], cutoff_hz=100.0, direction_cutoff_hz=100.0)
    (block,) = observe(RIGID, [record], choice).blocks
    np.testing.assert_allclose(block.W[:, RIGID.base_parameters.index("offset")], 1.0, rtol=1e-15)


def test_rows_for_tags() -> None:
    records = [
        moving(AC, False, "one", "chirp"),
        moving(AC, False, "two", "trapezoid"),
        moving(AC, False, "three"),
    ]
    choice = choose_filter(AC, records, cutoff_hz=200.0, direction_cutoff_hz=150.0)
    observation = rows_by_tag(
        observe(AC, records, choice), records, {"chirp": ["m", "c"], "trapezoid": ["m+c"]}
    )
    used = [(block.record_name, block.row_name) for block in observation.blocks]
    assert used == [
        ("one", "m"), ("one", "c"), ("two", "m+c"), ("three", "m"), ("three", "c"), ("three", "m+c"),
    ]  # fmt: skip


def test_unknown_tags_and_rows_are_named_together() -> None:
    record = moving(AC, False, tag="chirp")
    observation, _ = observed(AC, record)
    with pytest.raises(DataError) as raised:
        rows_by_tag(observation, [record], {"chrip": ["m"], "chirp": ["motor"]})
    assert [problem.what for problem in raised.value.problems] == [
        "no record has the tag 'chrip'",
        "'motor' is no row",
    ]


def test_blocks_are_frozen() -> None:
    block = observed(QC, moving(QC, False))[0].blocks[0]
    with pytest.raises(AttributeError):
        block.masked = 3  # type: ignore[misc]
    assert isinstance(replace(block, masked=3), RowBlock)


def test_calm_rows_leave_out_what_feels_a_jump_of_their_force() -> None:
    record = moving(QC, reversing=False)
    rng = np.random.default_rng(4)
    steps = np.where(np.arange(record.n) < 7000, 0.0, 0.01)
    force = record.signals["Gamma_m"] + steps + 1e-5 * rng.standard_normal(record.n)
    jumping = record.edited({"Gamma_m": force})
    lower = choose_filter(QC, [jumping], cutoff_hz=200.0, direction_cutoff_hz=150.0)
    assert observe(QC, [jumping], lower, turns=False).blocks[0].masked == 0
    choice = choose_filter(QC, [jumping], cutoff_hz=600.0, direction_cutoff_hz=150.0)
    motor, load = observe(QC, [jumping], choice, turns=False).blocks
    gaps = np.setdiff1d(np.arange(motor.grid), motor.place)
    sample = motor.start + choice.decimation[0] * gaps
    assert gaps.size and np.all(np.abs(sample - 7000) < 0.02 * FS) and sample.min() < 7000 < sample.max()
    # positions do not jump, and least squares of all samples leaves none out
    assert load.masked == 0
    assert all(block.masked == 0 for block in observe(QC, [jumping], choice).blocks)
    # a force that jumps all the time is what it is
    busy = record.edited({"Gamma_m": force + 0.01 * np.sign(np.sin(0.1 * np.arange(record.n)))})
    assert observe(QC, [busy], choice, turns=False).blocks[0].masked == 0
