"""Arms in C99 and as MATLAB classes: compiled and run, and compared with the NumPy module to 1e-12."""

from __future__ import annotations

import random
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from modelgen.errors import RenderError
from modelgen.render.arms.arm_target import arm_target_files
from modelgen.render.arms.arm_writer import arm_module
from modelgen.render.target_writer import check_target, write_target
from modelgen.spec.arms.arm import ArmSpec, Payload
from modelgen.spec.arms.parameters import link_names
from modelgen.symbolic.arms.arm_rows import arm_rows
from modelgen.symbolic.arms.base_parameters import arm_base_model
from tests.symbolic.arms.made_arms import random_arm, serial, tx40
from tests.symbolic.arms.test_gains import coupled, with_gains

N = 9
LENGTHS = {"r2": 0.2435, "d3": 0.4318}
SYMBOLIC = serial([(0, 0, 0, 0), (-90, 0, 0, "r2"), (0, "d3", 0, 0.1)], True, lengths=LENGTHS)
ASYMMETRIC = replace(
    SYMBOLIC, joints=tuple(replace(one, friction="asymmetric") for one in SYMBOLIC.joints), name="asymmetric"
)
ARMS = [
    tx40(),
    replace(with_gains(tx40(), ("2", "6")), known={"m6": 2.5, "mz4": -0.3, "gain_2": 1.5}, name="cos"),
    ASYMMETRIC,
    replace(SYMBOLIC, name="double"),
    # columns behind those of all joints
    replace(SYMBOLIC, name="carrying", payloads=(Payload("disc", "2", link_names("disc")),)),
    *(replace(coupled(random_arm(random.Random(k)), random.Random(k)), name=f"made{k}") for k in (3, 6, 9)),
]
ARMS = [replace(spec, name=spec.name if spec.name != "arm" else f"arm{k}") for k, spec in enumerate(ARMS)]


def case(spec: ArmSpec) -> tuple[dict[str, Any], dict[str, Any], dict[str, float]]:
    module: dict[str, Any] = {}
    exec(compile(arm_module(arm_base_model(arm_rows(spec))), "module", "exec"), module)
    rng = np.random.default_rng(7)
    signals = {key: rng.normal(size=N) for key in module["SIGNALS"]}
    signals[module["SIGNALS"][0]][2] = 0.0
    return module, signals, {name: float(rng.uniform(0.5, 2.0)) for name in module["PARAMETERS"]}


def expected(module: dict[str, Any], signals: Any, parameters: Any) -> list[np.ndarray]:
    base = module["base_from_physical"](parameters)
    D = module["regressor"](signals)
    return [module["measurement"](signals), D, module["entries"](signals).T, D @ base, base]


MAIN = """
#include <stdio.h>
#include "{name}.h"
static void put(const void *data, size_t count) {{ fwrite(data, sizeof(double), count, stdout); }}
int main(void) {{
  {name}_signals s;
  double y[{name}_ROWS], D[{name}_ROWS][{name}_COLUMNS], e[{name}_ENTRIES], x[{name}_COLUMNS];
  {name}_parameters p;
  if (fread(&p, sizeof p, 1, stdin) != 1) return 1;
  {name}_base(&p, x);
  for (int k = 0; k < {n}; k++) {{
    if (fread(&s, sizeof s, 1, stdin) != 1) return 1;
    {name}_measurement(&s, y);
    put(y, {name}_ROWS);
    {name}_regressor(&s, D);
    put(D, {name}_ROWS * {name}_COLUMNS);
    {name}_entries(&s, e);
    put(e, {name}_ENTRIES);
    {name}_predicted(&s, x, y);
    put(y, {name}_ROWS);
  }}
  put(x, {name}_COLUMNS);
  return 0;
}}
"""


@pytest.mark.slow
@pytest.mark.parametrize("spec", ARMS)
def test_c99_gives_the_same_numbers(tmp_path: Path, spec: ArmSpec) -> None:
    compiler = shutil.which("cc")
    if compiler is None:
        pytest.skip("no C compiler: apt-get install gcc")
    module, signals, parameters = case(spec)
    files = arm_target_files(spec, "", "c")
    name = next(iter(files)).partition(".")[0]
    for file, text in files.items():
        (tmp_path / file).write_text(text, encoding="utf-8")
    (tmp_path / "main.c").write_text(MAIN.format(name=name, n=N), encoding="utf-8")
    flags = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-O1", "-o", "main"]
    subprocess.run([compiler, *flags, "main.c", f"{name}.c", "-lm"], cwd=tmp_path, check=True, timeout=120)
    table = np.array([signals[key] for key in module["SIGNALS"]]).T
    given = np.array(list(parameters.values())).tobytes() + table.tobytes()
    done = subprocess.run([tmp_path / "main"], input=given, capture_output=True, check=True, timeout=60)
    numbers = np.frombuffer(done.stdout)
    *arrays, base = expected(module, signals, parameters)
    rows = np.concatenate([array.reshape(N, -1) for array in arrays], axis=1)
    np.testing.assert_allclose(numbers[: rows.size].reshape(rows.shape), rows, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(numbers[rows.size :], base, rtol=1e-12, atol=1e-12)


@pytest.mark.slow
def test_octave_gives_the_same_numbers(tmp_path: Path) -> None:
    """All arms in one run: Octave takes a second to start."""
    from scipy.io import loadmat, savemat

    octave = shutil.which("octave-cli") or shutil.which("octave")
    if octave is None:
        pytest.skip("octave is not installed: apt-get install octave")
    script, wanted = [], {}
    for spec in ARMS:
        module, signals, parameters = case(spec)
        ((file, text),) = arm_target_files(spec, "", "matlab").items()
        (tmp_path / file).write_text(text, encoding="utf-8")
        name = file.removesuffix(".m")
        columns = {key: values[:, None] for key, values in signals.items()}
        savemat(tmp_path / f"{name}_in.mat", {"s": columns, "p": parameters})
        script += [
            f"load('{name}_in.mat');",
            f"y = {name}.measurement(s); R = {name}.regressor(s); e = {name}.entries(s);",
            f"x = {name}.base_from_physical(p); t = {name}.predicted(s, x);",
            f"names = {name}.base_parameters();",
            f"save('-v7', '{name}_out.mat', 'y', 'R', 'e', 't', 'x', 'names'); clear all;",
        ]
        wanted[name] = (module, expected(module, signals, parameters))
    (tmp_path / "run.m").write_text("\n".join(script), encoding="utf-8")
    command = [octave, "--no-gui", "--norc", "--quiet", "run.m"]
    subprocess.run(command, cwd=tmp_path, check=True, timeout=120, capture_output=True)
    for name, (module, arrays) in wanted.items():
        found = loadmat(tmp_path / f"{name}_out.mat")
        assert [str(entry[0]) for entry in found["names"].ravel()] == list(module["BASE_PARAMETERS"])
        for key, array in zip(("y", "R", "e", "t", "x"), arrays, strict=True):
            np.testing.assert_allclose(found[key].reshape(array.shape), array, rtol=1e-12, atol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("target", ["c", "matlab"])
def test_a_block_a_joint_and_names_that_are_none_of_the_language(target: str, tmp_path: Path) -> None:
    spec = replace(tx40(), name="cos", title="a */ int evil; /* \\\n#include <x>")
    first = arm_target_files(spec, "", target)
    assert first == arm_target_files(spec, "", target)
    assert {name.partition(".")[0] for name in first} == {{"c": "cos", "matlab": "cos_"}[target]}
    text = list(first.values())[-1]
    assert "*/ int evil" not in text and "\n#include <x>" not in text
    marks = {line.strip(" /*%") for line in text.splitlines() if line.strip(" /*%").startswith("joint ")}
    assert {f"joint {n}" for n in range(1, 7)} <= marks
    assert "w2y = " in text
    write_target(spec, [""], tmp_path, target, None)
    assert check_target(spec, [""], tmp_path, target, None) == []
    (tmp_path / next(iter(first))).write_text("Generated by modelgen from elsewhere")
    assert [drift.state for drift in check_target(spec, [""], tmp_path, target, None)] == ["different"]


def test_templates_of_ones_own_are_for_chains(tmp_path: Path) -> None:
    with pytest.raises(RenderError, match="filled with chains only"):
        write_target(tx40(), [""], tmp_path, "c", tmp_path)
