"""Values of an export: where they come from, what is missing, what follows, and samples."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import modelgen
from generated import emps300_qm_ac, emps300_qm_qc, tree_mixed
from modelgen.errors import DataError
from modelgen.render.writer import generate
from modelgen.runtime.exports.export import TARGETS, export
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.model.model import Model, model_from_module, model_from_text
from modelgen.runtime.results.estimate import Estimate
from modelgen.runtime.simulation.simulate import simulate
from modelgen.spec.load import parse_spec
from tests.runtime.exports.open_loop import model_of

PLAIN = model_from_module(emps300_qm_qc)


@cache
def estimated(noise: float = 1e-5) -> Estimate:
    values = dict(PLAIN.parameter_sets["light"])
    records = [
        simulate(PLAIN, values, kind, duration_s=1.0, noise={"q_m": noise, "q_c": noise}).record
        for kind in ("chirp", "trapezoid")
    ]
    return identify(PLAIN, records, method="wls", cutoff_hz=300.0)


@pytest.mark.parametrize("to", TARGETS)
def test_every_format_from_an_estimate_twice_the_same(to: str, tmp_path: Path) -> None:
    first, second = (export(PLAIN, estimated(), to, samples=3, seed=1) for _ in range(2))
    assert first.files == second.files
    assert first.values.origin["K"] == "estimate"
    paths = first.save(tmp_path / f"chain{TARGETS[to].suffix}")
    assert all(path.read_bytes() for path in paths)
    with pytest.raises(DataError, match="exists already"):
        first.save(tmp_path / f"chain{TARGETS[to].suffix}")
    with pytest.raises(DataError, match="has the suffix"):
        first.save(tmp_path / "chain.wrong")


@pytest.mark.slow
def test_samples_have_the_covariance_of_the_estimate() -> None:
    estimate = estimated()
    made = export(PLAIN, estimate, "state-space", samples=4000, seed=2)
    names = list(estimate.physical)
    drawn = np.array([[sample[name] for name in names] for sample in made.values.samples])
    std = np.array([entry.std for entry in estimate.parameters.physical])
    center = np.array(list(estimate.physical.values()))
    scaled = (drawn - center) / std
    rows = [list(estimate.params).index(name) for name in names]
    cov = estimate.cov_params()[np.ix_(rows, rows)]
    wanted = cov / np.outer(std, std)
    np.testing.assert_allclose(np.cov(scaled.T), wanted, atol=0.12)
    other = export(PLAIN, estimate, "state-space", samples=4000, seed=3)
    assert other.values.samples != made.values.samples


def test_impossible_samples_are_drawn_again() -> None:
    estimate = estimated(3e-3)
    made = export(PLAIN, estimate, "state-space", samples=200, seed=0)
    positive = [
        n for n, role in PLAIN.roles.items() if role.role != "offset" and made.values.nominal[n] > 0.0
    ]
    assert all(sample[name] >= 0.0 for sample in made.values.samples for name in positive)
    if made.values.drawn_again:
        assert f"{made.values.drawn_again} samples" in made.notes[0]


def test_the_matrices_are_those_of_the_model() -> None:
    values = dict(PLAIN.parameter_sets["light"])
    document = json.loads(export(PLAIN, values, "state-space").files[""])
    space = PLAIN.state_space(values)
    for name in "ABCDEF":
        np.testing.assert_array_equal(np.array(document[name]), getattr(space, name))
    assert [state["name"] for state in document["states"]] == ["q_m", "q_c", "v_m", "v_c"]
    assert [state["unit"] for state in document["states"]] == ["rad", "rad", "rad/s", "rad/s"]


def test_what_is_missing_is_named_with_what_to_give() -> None:
    with pytest.raises(DataError) as found:
        export(PLAIN, {"J_m": 1e-5, "K": 0.4}, "mjcf")
    names = [problem.where for problem in found.value.problems]
    assert names == [f"parameters: {name}" for name in PLAIN.parameters if name not in ("J_m", "K")]
    assert all("--set" in problem.remedy for problem in found.value.problems)
    with pytest.raises(DataError, match="is no parameter of the model"):
        export(PLAIN, "light", "mjcf", values={"J": 1.0})
    with pytest.raises(DataError, match="must be positive"):
        export(PLAIN, "light", "fmu", values={"J_m": 0.0})
    # the linear model needs no friction
    assert export(
        PLAIN, {k: v for k, v in PLAIN.parameter_sets["light"].items() if k != "F_sm"}, "matlab"
    ).notes


def test_options_that_make_no_sense_are_refused() -> None:
    with pytest.raises(DataError, match="did you mean modelica"):
        export(PLAIN, "light", "modelika")
    with pytest.raises(DataError, match="is no parameter set"):
        export(PLAIN, "heavy", "fmu")
    with pytest.raises(DataError, match="need the covariance of an estimate"):
        export(PLAIN, "light", "fmu", samples=3)
    with pytest.raises(DataError, match="give 1 to"):
        export(PLAIN, estimated(), "fmu", samples=10**6)
    with pytest.raises(DataError, match="give the model that was identified"):
        export(model_from_module(emps300_qm_ac), estimated(), "fmu")


@pytest.mark.slow
def test_what_a_sum_leaves_over_follows_from_what_is_given() -> None:
    model = model_of(
        """
chain = { name = "rigid", motion = "rotation" }
bodies = [
    { name = "m", inertia = "J_m", offset = "O_m", actuator = "T" },
    { name = "c", inertia = "J_c", offset = "O_c", viscous = "B_c" },
]
links = [{ bodies = ["m", "c"], stiffness = "K", damping = "D", ratio = 2 }]
[parameters.nominal]
J_m = 1e-3
J_c = 4e-3
O_m = 0.02
O_c = 0.05
B_c = 0.01
K = 400.0
D = 0.1
[sensors.all]
v_m = { body = "m", measures = "velocity" }
a_c = { body = "c", measures = "acceleration" }
"""
    )
    assert any("O_m" in name and "O_c" in name for name in model.base_parameters)
    values = dict(model.parameter_sets["nominal"])
    records = [simulate(model, values, kind, duration_s=1.0).record for kind in ("chirp", "trapezoid")]
    estimate = identify(model, records, method="wls", cutoff_hz=200.0)
    with pytest.raises(DataError) as found:
        export(model, estimate, "fmu")
    assert "so that what is left over follows" in str(found.value)
    made = export(model, estimate, "fmu", values={"O_c": 0.05})
    assert made.values.origin["O_m"].startswith("follows")
    assert made.values.nominal["O_m"] == pytest.approx(0.02, rel=1e-2)
    # in every sample the sum is that of the sample
    drawn = export(model, estimate, "state-space", values={"O_c": 0.05}, samples=2000)
    both = next(name for name in model.base_parameters if "O_m" in name and "O_c" in name)
    offsets = np.array([sample["O_m"] for sample in drawn.values.samples])
    assert all(sample["O_c"] == 0.05 for sample in drawn.values.samples)
    assert offsets.std() == pytest.approx(estimate.bse[both], rel=0.1)


@pytest.mark.parametrize("to", TARGETS)
@pytest.mark.parametrize("old", ["'q_c'", "'Gamma_m'", "'F_vmc'", "'c'"])
def test_a_strangers_names_reach_no_program(to: str, old: str) -> None:
    spec = (Path(modelgen.__file__).parent / "catalog" / "emps300.toml").read_text(encoding="utf-8")
    text = generate(parse_spec(spec, "emps300.toml"), "qm_qc")
    hostile = text.replace(old, "'x\"/><!--%-system(1)'").replace(
        old.replace("'", '"'), '"x\\"/><!--%-system(1)"'
    )
    model = model_from_text(hostile, "stranger", trust=True)
    values = {name: 1.0 for name in model.parameters}
    with pytest.raises(DataError, match="no name that a spec can have"):
        export(model, values, to)


def test_the_public_name() -> None:
    model: Model = model_from_module(tree_mixed)
    assert modelgen.export(model, "nominal", "urdf").suffix == ".urdf"
