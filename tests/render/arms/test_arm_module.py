from __future__ import annotations

import ast
import random
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from modelgen.errors import RenderError
from modelgen.generated_module.module_check import has_header, seal
from modelgen.render.arms.arm_view import BLOCK
from modelgen.render.arms.arm_writer import arm_module
from modelgen.runtime.model.model import load_model
from modelgen.spec.arms.arm import ArmSensor, ArmSpec, Payload
from modelgen.spec.arms.parameters import link_names
from modelgen.symbolic.arms.arm_rows import arm_rows
from modelgen.symbolic.arms.base_parameters import ArmBaseModel, arm_base_model
from tests.symbolic.arms.made_arms import PANDA, PUMA, joint, random_arm, serial, shift, tx40
from tests.symbolic.arms.regressor_samples import regressor_at
from tests.symbolic.arms.test_gains import with_gains

LENGTHS = {"r2": 0.2435, "d3": 0.4318, "r3": 0.0934}
SYMBOLIC = serial([(0, 0, 0, 0), (-90, 0, 0, "r2"), (0, "d3", 0, "-r3")], True, lengths=LENGTHS)
COUPLED = replace(
    tx40(),
    transmission=tuple(
        tuple(Fraction(-2 if i == 5 and k == 0 else ratio) for k, ratio in enumerate(row))
        for i, row in enumerate(tx40().transmission)
    ),
)
ARMS = [tx40(), serial(PUMA, True), serial(PANDA), SYMBOLIC, COUPLED]
ARMS += [random_arm(random.Random(seed)) for seed in (3, 5, 6, 8, 9, 11)]


def executed(model: ArmBaseModel) -> dict[str, Any]:
    names: dict[str, Any] = {}
    exec(compile(arm_module(model), "module", "exec"), names)
    return names


def motion_of(spec: ArmSpec, signals: dict[str, np.ndarray]) -> dict[tuple[str, int], np.ndarray]:
    samples = len(next(iter(signals.values())))
    return {
        (joint.name, order): signals.get(f"{start}_{joint.name}", np.zeros(samples))
        for joint in spec.moving
        for order, start in enumerate(("q", "d1_q", "d2_q"))
    }


def random_signals(module: dict[str, Any], samples: int) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(3)
    return {key: rng.standard_normal(samples) for key in module["SIGNALS"]}


def lengths_of(spec: ArmSpec) -> dict[str, float]:
    return {name: value for name, value in spec.lengths.items() if value is not None}


@pytest.mark.slow
@pytest.mark.parametrize("spec", ARMS)
@pytest.mark.parametrize("samples", [1, 2 * BLOCK + 7])
def test_module_computes_the_base_regressor(spec: ArmSpec, samples: int) -> None:
    model = arm_base_model(arm_rows(spec))
    module = executed(model)
    signals = random_signals(module, samples)
    before = {key: values.copy() for key, values in signals.items()}
    wanted = regressor_at(model.rows, motion_of(spec, signals), lengths_of(spec))[:, :, list(model.columns)]
    found = module["regressor"](signals)
    np.testing.assert_allclose(found, wanted, rtol=1e-12, atol=1e-12)
    for key, values in before.items():
        np.testing.assert_array_equal(signals[key], values)
    entries = module["entries"](signals)
    assert entries.shape == (len(module["ENTRIES"]), samples)
    for (row, column), values in zip(module["ENTRIES"], entries, strict=True):
        np.testing.assert_array_equal(values, found[:, row, column])
    out = np.full_like(entries, np.nan)
    assert module["entries"](signals, out) is out
    np.testing.assert_array_equal(out, entries)
    for start, stop, block in module["entry_blocks"](signals, 100):
        np.testing.assert_array_equal(block, entries[:, start:stop])


@pytest.mark.parametrize("kind", ["joint", "motor"])
def test_measured_side_and_base_parameters_close_the_equation(kind: str) -> None:
    # known parameters stand on the left: what is measured less what they contribute
    spec = replace(
        tx40(), known={f"{name}6": 0.05 * k for k, name in enumerate(("Ixx", "Iyy", "mz", "m"), 1)}
    )
    rows = arm_rows(spec, kind)  # type: ignore[arg-type]
    model = arm_base_model(rows)
    module = executed(model)
    signals, rng = random_signals(module, 40), np.random.default_rng(5)
    values = {name: rng.standard_normal() for name in rows.columns} | dict(spec.known)
    torque = regressor_at(rows, motion_of(spec, signals), {}) @ [values[name] for name in rows.columns]
    if kind == "joint":
        torque = np.linalg.solve(np.array(spec.transmission, dtype=float).T, torque.T).T
    for k, moved in enumerate(spec.moving):
        signals[f"tau_{moved.name}"] = torque[:, k]
    base = module["base_from_physical"]({name: values[name] for name in module["PARAMETERS"]})
    residual = module["measurement"](signals) - module["regressor"](signals) @ base
    assert np.abs(residual).max() < 1e-10 * np.abs(torque).max()


def test_gains_are_found_from_records_with_and_without_a_weighed_payload() -> None:
    """Two modules, the payload known in both (and zero in one): their rows together have one solution."""
    arm = with_gains(serial([(0, 0, 0, 0), (-90, 0, 0, 0.2), (0, 0.4, 0, 0.1)], True))
    payload = joint("load", "3", shift(0, 0.3), "fixed")
    spec = replace(arm, joints=(*arm.joints, payload), transmission=arm.transmission)
    weighed = dict.fromkeys(payload.link, 0.0) | {"mload": 2.5, "mxload": 0.1, "Izzload": 0.02}
    rng, truth, stacked = np.random.default_rng(6), {}, []
    for load in (weighed, dict.fromkeys(payload.link, 0.0)):
        plain = executed(arm_base_model(arm_rows(replace(spec, known=load))))
        truth = truth or {name: rng.uniform(0.5, 2.0) for name in plain["PARAMETERS"]}
        bare = replace(spec, joints=tuple(replace(j, gain=None) for j in spec.joints))
        rows = arm_rows(bare)
        signals = random_signals(plain, 60)
        torque = regressor_at(rows, motion_of(bare, signals), {}) @ [
            {**truth, **load}[c] for c in rows.columns
        ]
        for k, moved in enumerate(spec.moving):
            signals[f"tau_{moved.name}"] = torque[:, k] / truth[f"gain_{moved.name}"]
        stacked.append((plain["regressor"](signals), plain["measurement"](signals), plain))
    columns = len(stacked[0][2]["BASE_PARAMETERS"])
    assert [one["BASE_PARAMETERS"] for *_, one in stacked] == [stacked[0][2]["BASE_PARAMETERS"]] * 2
    assert not stacked[1][1].any()
    left = np.concatenate([y.ravel() for _, y, _ in stacked])
    regressor = np.concatenate([D.reshape(-1, columns) for D, *_ in stacked])
    found, _, rank, _ = np.linalg.lstsq(regressor, left, rcond=1e-10)
    assert rank == columns
    np.testing.assert_allclose(found, stacked[0][2]["base_from_physical"](truth), rtol=1e-8)


def test_a_named_length_needs_a_value() -> None:
    model = arm_base_model(arm_rows(replace(SYMBOLIC, lengths={**LENGTHS, "d3": None})))
    with pytest.raises(RenderError, match="d3 has no value"):
        arm_module(model)
    names = executed(arm_base_model(arm_rows(SYMBOLIC)))["BASE_PARAMETERS"]
    assert any("d3**2*m3" in name for name in names)


@pytest.mark.slow
@pytest.mark.parametrize("spec", ARMS[:5])
def test_module_is_readable_sealed_and_needs_numpy_only(spec: ArmSpec) -> None:
    text = arm_module(arm_base_model(arm_rows(spec)))
    assert text == arm_module(arm_base_model(arm_rows(spec)))
    assert has_header(text) and seal(text) == text
    imports = [node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Import | ast.ImportFrom)]
    assert [ast.unparse(node) for node in imports] == ["import numpy as np"]
    headings = [line.strip() for line in text.splitlines() if line.strip().startswith("# joint ")]
    assert headings == [f"# joint {n}" for n in range(1, len(spec.joints) + 1)]
    assert "    w2y = np." in text
    long = [line for line in text.splitlines() if len(line) > 20_000]
    assert not long


def test_mistakes_of_a_caller_are_told() -> None:
    module = executed(arm_base_model(arm_rows(tx40())))
    signals = random_signals(module, 5)
    with pytest.raises(ValueError, match="out is float64 of shape"):
        module["entries"](signals, np.empty((3, 5)))
    with pytest.raises(ValueError, match="same length"):
        module["regressor"]({**signals, "q_2": np.zeros(4)})


def test_a_module_of_an_arm_is_loaded(tmp_path: Path) -> None:
    path = tmp_path / "arm.py"
    path.write_text(arm_module(arm_base_model(arm_rows(tx40()))))
    model = load_model(path)
    assert model.is_arm and len(model.base_parameters) == 61


@pytest.mark.parametrize("place", [0, 1])
def test_what_stands_behind_all_joints_is_computed_there(place: int) -> None:
    """Columns of payloads and of mountings on inner links follow those of the joints behind them."""
    arm = serial([(0, 0, 0, 0.3), (-90, 0, 0, 0.1), (0, 0.4, 0, 0.05)], True)
    on = arm.joints[place].name
    carried = replace(arm, payloads=(Payload("disc", on, link_names("disc")),))
    model = arm_base_model(arm_rows(carried))
    module = executed(model)
    signals = random_signals(module, 50)
    load = {"load disc": signals["load_disc"]}
    wanted = regressor_at(model.rows, motion_of(carried, signals), load)[:, :, list(model.columns)]
    np.testing.assert_allclose(module["regressor"](signals), wanted, rtol=1e-12, atol=1e-12)

    joints = [ArmSensor(f"q_{one.name}", one.name, "link", "position") for one in arm.moving]
    felt = ArmSensor("a", on, "link", "accelerometer", estimated=True)
    model = arm_base_model(arm_rows(replace(arm, sensor_sets={"s": (*joints, felt)}), sensor_set="s"))
    module = executed(model)
    signals = random_signals(module, 50)
    wanted = regressor_at(model.rows, motion_of(arm, signals), {})[:, :, list(model.columns)]
    np.testing.assert_allclose(module["regressor"](signals), wanted, rtol=1e-12, atol=1e-12)
