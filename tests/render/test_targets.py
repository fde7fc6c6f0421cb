"""MATLAB/Octave and C99: run, and compared with the NumPy module to 1e-12."""

from __future__ import annotations

import re
import shutil
import subprocess
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from modelgen.errors import RenderError
from modelgen.render.languages import C99, MATLAB
from modelgen.render.target import target_files, user_files
from modelgen.render.writer import generate
from modelgen.runtime.model.model import Model, model_from_text
from modelgen.spec.chain import ChainSpec
from modelgen.spec.load import catalog_path, load_spec
from modelgen.template_folder import template_folder

N = 7
CASES = [
    ("emps300", "qm_ac"),
    ("emps_rigid_asymmetric", "qm"),
    ("three_mass", "qa_qb_ac"),
    ("tree", "mixed"),
    ("two_mass_bench", "qm_qc"),
]


def case(chain: str, sensors: str) -> tuple[ChainSpec, Model, dict[str, Any], dict[str, float]]:
    """The spec, its model, random signals, and random parameters."""
    spec = load_spec(catalog_path(chain))
    model = model_from_text(generate(spec, sensors), f"{chain}_{sensors}")
    rng = np.random.default_rng(7)
    signals = {signal.key: rng.normal(size=N) for signal in model.signals}
    signals[model.signals[0].key][2] = 0.0  # sign(0) is 0 everywhere
    return spec, model, signals, {name: float(rng.uniform(0.5, 2.0)) for name in model.parameters}


def expected(
    model: Model, signals: Mapping[str, Any], parameters: Mapping[str, float], sense: int
) -> list[Any]:
    directions = {entry.body: sense for entry in model.friction if entry.asymmetric}
    space = model.state_space(parameters, directions or None)
    return [model.measurement(signals), model.regressor(signals), *space]


@pytest.fixture(scope="module")
def octave() -> str:
    found = shutil.which("octave-cli") or shutil.which("octave")
    if found is None:
        pytest.skip("octave is not installed: apt-get install octave")
    return found


@pytest.fixture(scope="module")
def compiler() -> str:
    found = shutil.which("cc")
    if found is None:
        pytest.skip("no C compiler: apt-get install gcc")
    return found


def test_octave_gives_the_same_numbers(octave: str, tmp_path: Path) -> None:
    """All cases in one run: Octave takes a second to start."""
    from scipy.io import loadmat, savemat

    script, wanted = [], {}
    for chain, sensors in CASES:
        spec, model, signals, parameters = case(chain, sensors)
        for name, text in target_files(spec, sensors, "matlab").items():
            (tmp_path / name).write_text(text, encoding="utf-8")
        name = f"{chain}_{sensors}"
        columns = {key: values[:, None] for key, values in signals.items()}
        directions = {entry.body: -1.0 for entry in model.friction if entry.asymmetric}
        savemat(tmp_path / f"{name}.mat", {"s": columns, "p": parameters, "d": directions or 0.0})
        arguments = "p, d" if directions else "p"
        script += [
            f"load('{name}.mat');",
            f"y = {name}.measurement(s); R = {name}.regressor(s);",
            f"[A, B, C, D, E, F] = {name}.state_space({arguments});",
            f"names = {name}.base_parameters();",
            f"save('-v7', '{name}_out.mat', 'y', 'R', 'A', 'B', 'C', 'D', 'E', 'F', 'names'); clear all;",
        ]
        wanted[name] = (model, expected(model, signals, parameters, -1))
    (tmp_path / "run.m").write_text("\n".join(script), encoding="utf-8")
    command = [octave, "--no-gui", "--norc", "--quiet", "run.m"]
    subprocess.run(command, cwd=tmp_path, check=True, timeout=120, capture_output=True)
    for name, (model, arrays) in wanted.items():
        found = loadmat(tmp_path / f"{name}_out.mat")
        assert [str(entry[0]) for entry in found["names"].ravel()] == list(model.base_parameters)
        for key, array in zip(("y", "R", "A", "B", "C", "D", "E", "F"), arrays, strict=True):
            np.testing.assert_allclose(found[key].reshape(array.shape), array, rtol=1e-12, atol=1e-12)


MAIN = """
#include <stdio.h>
#include "{name}.h"
static void put(const void *data, size_t count) {{ fwrite(data, sizeof(double), count, stdout); }}
int main(void) {{
  {name}_signals s;
  double y[{name}_ROWS], D[{name}_ROWS][{name}_COLUMNS];
  {name}_parameters p;
  {name}_state_space_matrices m;
  for (int k = 0; k < {n}; k++) {{
    if (fread(&s, sizeof s, 1, stdin) != 1) return 1;
    {name}_measurement(&s, y);
    {name}_regressor(&s, D);
    put(y, {name}_ROWS);
    put(D, {name}_ROWS * {name}_COLUMNS);
  }}
  if (fread(&p, sizeof p, 1, stdin) != 1) return 1;
  {call}
  put(&m, sizeof m / sizeof(double));
  return 0;
}}
"""


@pytest.mark.parametrize(("chain", "sensors"), CASES)
def test_c99_gives_the_same_numbers(compiler: str, tmp_path: Path, chain: str, sensors: str) -> None:
    spec, model, signals, parameters = case(chain, sensors)
    name = f"{chain}_{sensors}"
    for file, text in target_files(spec, sensors, "c").items():
        (tmp_path / file).write_text(text, encoding="utf-8")
    directed = [entry.body for entry in model.friction if entry.asymmetric]
    call = f"{name}_state_space(&p, &m);"
    if directed:
        senses = ", ".join(["-1"] * len(directed))
        call = f"{name}_directions d = {{ {senses} }}; {name}_state_space(&p, &d, &m);"
    (tmp_path / "main.c").write_text(MAIN.format(name=name, n=N, call=call), encoding="utf-8")
    flags = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-O1", "-o", "main"]
    subprocess.run([compiler, *flags, "main.c", f"{name}.c"], cwd=tmp_path, check=True, timeout=120)
    table = np.array([signals[signal.key] for signal in model.signals]).T
    given = table.tobytes() + np.array(list(parameters.values())).tobytes()
    done = subprocess.run([tmp_path / "main"], input=given, capture_output=True, check=True, timeout=60)
    numbers = np.frombuffer(done.stdout)
    y, D, *space = expected(model, signals, parameters, -1)
    rows = np.concatenate([y, D.reshape(N, -1)], axis=1)
    np.testing.assert_allclose(numbers[: rows.size].reshape(rows.shape), rows, rtol=1e-12, atol=1e-12)
    # C has no arrays without columns: a matrix without any has one of zeros
    padded = [matrix if matrix.shape[1] else np.zeros((matrix.shape[0], 1)) for matrix in space]
    np.testing.assert_allclose(
        numbers[rows.size :], np.concatenate([matrix.ravel() for matrix in padded]), rtol=1e-12, atol=1e-12
    )


@pytest.mark.parametrize("target", ["matlab", "c"])
def test_the_same_spec_gives_the_same_bytes(target: str) -> None:
    spec = load_spec(catalog_path("emps300"))
    first = target_files(spec, "qm_ac", target)
    assert first == target_files(spec, "qm_ac", target)
    assert all("Generated by modelgen from emps300.toml" in text for text in first.values())


def test_words_of_a_language_are_no_names() -> None:
    assert (C99.name("double"), MATLAB.name("end"), C99.name("J_m")) == ("double_", "end_", "J_m")
    assert (C99.name("I"), C99.name("I_")) == ("I_", "I__")  # both may be in one structure
    assert MATLAB.file_name("state_space") == "state_space_"
    assert C99.file_name("math") == "math_"
    with pytest.raises(RenderError, match="has 64 letters, and a name in this language at most 63"):
        MATLAB.name("J" * 64)


HOSTILE = """
chain = { name = "words", motion = "rotation" }
bodies = [
    { name = "end", inertia = "NAN", viscous = "M_PI", coulomb = "this", actuator = "INFINITY" },
    { name = "new", inertia = "I_", viscous = "HUGE_VAL", coulomb = "errno", offset = "I" },
]
links = [{ bodies = ["end", "new"], stiffness = "end", damping = "template" }]
[sensors.parfor]
linux = { body = "end", measures = "position" }
NULL = { body = "new", measures = "position" }
"""


@pytest.mark.parametrize("language", ["c", "c++"])
def test_names_that_compilers_know_compile(compiler: str, tmp_path: Path, language: str) -> None:
    """With GNU's extensions, and after the headers whose macros they are."""
    (tmp_path / "words.toml").write_text(HOSTILE, encoding="utf-8")
    for name, text in target_files(load_spec(tmp_path / "words.toml"), "parfor", "c").items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    headers = [word for name in ("math", "stdio", "stdlib", "errno") for word in ("-include", f"{name}.h")]
    command = [compiler, "-x", language, *headers, "-Wall", "-Werror", "-fsyntax-only", "words_parfor.c"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=60)
    if "cc1plus" in done.stderr:
        pytest.skip("no C++ compiler: apt-get install g++")
    assert done.returncode == 0, done.stderr


def test_a_name_that_is_changed_is_said(tmp_path: Path) -> None:
    (tmp_path / "words.toml").write_text(HOSTILE, encoding="utf-8")
    spec = load_spec(tmp_path / "words.toml")
    assert "  % p.end_: end, N m/rad\n" in target_files(spec, "parfor", "matlab")["words_parfor.m"]
    assert "  double this_; /* this, N m */\n" in target_files(spec, "parfor", "c")["words_parfor.h"]


def test_a_class_is_called_like_nothing_that_it_holds() -> None:
    """A method of the class's name would be its constructor, and a variable of that name hides the class."""
    text = "".join((template_folder() / f"{kind}.m.j2").read_text() for kind in ("arm", "model"))
    without_fields = re.sub(r"\{[{%].*?[%}]\}", "", text)
    code = re.sub(r"%.*|'[^']*'", "", without_fields)
    assert set(re.findall(r"(?<![.\w])[A-Za-z]\w*", code)) <= MATLAB.no_files | MATLAB.words | {"Static"}


def test_a_title_cannot_end_a_comment() -> None:
    spec = replace(load_spec(catalog_path("emps300")), title="a */ int evil; /* \\\n#include <x>")
    for target in ("matlab", "c"):
        for text in target_files(spec, "qm_ac", target).values():
            assert "*/ int evil" not in text
            assert "\n#include <x>" not in text


def folder_with(tmp_path: Path, text: str) -> Path:
    (tmp_path / "model.jl.j2").write_text(text, encoding="utf-8")
    return tmp_path


def test_templates_of_ones_own(tmp_path: Path) -> None:
    spec = load_spec(catalog_path("emps300"))
    text = "# {{ model.header }}\n"
    text += "{% for r, c, parts in model.regressor %}{{ r }},{{ c }}: {{ parts | length }}\n{% endfor %}"
    files = user_files(spec, "qm_ac", folder_with(tmp_path, text))
    assert list(files) == ["emps300_qm_ac.jl"]
    assert files["emps300_qm_ac.jl"].splitlines()[1:4] == ["0,0: 1", "0,1: 1", "0,4: 2"]


@pytest.mark.parametrize(
    "text",
    [
        "{{ model.__class__.__mro__ }}",
        "{{ ''.__class__ }}",
        "{{ model.known.clear() }}",
        "{% include '/etc/hostname' %}",
        "{{ model.nothing }}",
        "{% for %}",
        "{{ 1 / 0 }}",
    ],
)
def test_a_template_stays_in_its_box(tmp_path: Path, text: str) -> None:
    spec = load_spec(catalog_path("emps300"))
    with pytest.raises(RenderError, match=r"model\.jl\.j2.*fails"):
        user_files(spec, "qm_ac", folder_with(tmp_path, text))


def test_a_folder_without_templates(tmp_path: Path) -> None:
    with pytest.raises(RenderError, match="holds no template"):
        user_files(load_spec(catalog_path("emps300")), "qm_ac", tmp_path)
