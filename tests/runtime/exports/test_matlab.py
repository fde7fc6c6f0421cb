"""The script of `export --to matlab`, run by Octave: the matrices, names and samples of the model."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from generated import emps_rigid_asymmetric_qm, tree_mixed
from modelgen.runtime.exports.export import export
from modelgen.runtime.exports.matlab import WORDS
from modelgen.runtime.exports.mechanics import mechanics
from modelgen.runtime.model.model import Model, model_from_module
from tests.runtime.exports.open_loop import GEARED, model_of
from tests.runtime.exports.test_export import PLAIN, estimated

RESERVED = GEARED.replace('"K"', '"end"').replace("\nK = ", "\nend = ")
MODELS: dict[str, Model] = {
    "geared": model_of(GEARED),
    "reserved word": model_of(RESERVED),
    "asymmetric": model_from_module(emps_rigid_asymmetric_qm),
    "tree": model_from_module(tree_mixed),
}
NAMES = ("state_names", "input_names", "output_names", "friction_inputs")


@pytest.fixture(scope="module")
def octave() -> str:
    found = shutil.which("octave-cli") or shutil.which("octave")
    if found is None:
        pytest.skip("octave is not installed: apt-get install octave")
    return found


def run(octave: str, folder: Path, scripts: dict[str, bytes]) -> list[dict[str, Any]]:
    """Run scripts one by one in one Octave, and return the variables that each leaves."""
    from scipy.io import loadmat

    lines = []
    for name, text in scripts.items():
        (folder / f"{name}.m").write_bytes(text)
        lines += ["clear all;", f"{name};", f"save('-v7', '{name}.mat');"]
    (folder / "run_all.m").write_text("\n".join(lines), encoding="utf-8")
    command = [octave, "--no-gui", "--norc", "--quiet", "run_all.m"]
    done = subprocess.run(command, cwd=folder, timeout=120, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "warning" not in done.stderr, done.stderr
    return [loadmat(folder / f"{name}.mat") for name in scripts]


def test_octave_has_the_matrices_and_names_of_the_model(octave: str, tmp_path: Path) -> None:
    values = {key: {n: 0.5 + 0.1 * k for k, n in enumerate(m.parameters)} for key, m in MODELS.items()}
    for key, model in MODELS.items():
        values[key] |= dict.fromkeys(model.known, 2.0)
    scripts = {
        f"script_{k}": export(model, values[key], "matlab").files[""]
        for k, (key, model) in enumerate(MODELS.items())
    }
    for found, (key, model) in zip(run(octave, tmp_path, scripts), MODELS.items(), strict=True):
        space = model.state_space(values[key])
        for name in "ABCDEF":
            expected = np.asarray(getattr(space, name), dtype=float)
            np.testing.assert_array_equal(found[name].reshape(expected.shape), expected)
        if any(entry.asymmetric for entry in model.friction):
            back = model.state_space(values[key], {e.body: -1 for e in model.friction})
            np.testing.assert_array_equal(found["backward"]["A"][0, 0], back.A)
        names = [[str(entry[0]) for entry in found[name].ravel()] for name in NAMES]
        bodies = [body.name for body in mechanics(model).bodies]
        assert names[0] == [f"q_{body}" for body in bodies] + [f"v_{body}" for body in bodies]
        assert names[1:3] == [[a.key for a in model.actuators], [s.key for s in model.sensors]]
        assert names[3] == [entry.body for entry in model.friction]
        for name, value in values[key].items():
            field = f"{name}_" if name in WORDS else name
            assert float(found["p"][field][0, 0][0, 0]) == value


def test_octave_has_the_samples_of_an_estimate(octave: str, tmp_path: Path) -> None:
    made = export(PLAIN, estimated(), "matlab", samples=3, seed=4)
    (found,) = run(octave, tmp_path, {"axis_model": made.files[""]})
    assert found["sampled"].shape == found["samples"].shape == (1, 3)
    for k, sample in enumerate(made.values.samples):
        A = found["sampled"][0, k]["A"][0, 0]
        np.testing.assert_array_equal(A, PLAIN.state_space(sample).A)
        assert float(found["samples"][0, k]["K"][0, 0]) == sample["K"]
