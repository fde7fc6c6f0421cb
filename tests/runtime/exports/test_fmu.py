"""An FMU runs in fmpy as our own simulation does: to 1e-6 of the motion, sticking included."""

from __future__ import annotations

import shutil
import zipfile
from io import BytesIO
from pathlib import Path
from random import Random
from typing import Any

import fmpy
import numpy as np
import pytest
from fmpy.fmi2 import FMU2Slave
from fmpy.validation import validate_fmu

from generated import emps_rigid_asymmetric_qm, tree_mixed
from modelgen.array_types import FloatArray
from modelgen.errors import ModelError
from modelgen.runtime.exports.export import export
from modelgen.runtime.model.model import Model, model_from_module
from modelgen.runtime.simulation.excitation import Excitation
from tests.runtime.exports.open_loop import FS, GEARED, error, force, model_of, motion
from tests.symbolic.random_chains import random_spec

pytestmark = pytest.mark.skipif(shutil.which("cc") is None, reason="needs a C compiler")

GEAR = model_of(GEARED)
HARDENING = model_of(
    GEARED.replace("D = 800.0", "D = 800.0\nK3 = 1e12").replace('"D", l', '"D", stiffness3 = "K3", l')
)
CASES: dict[str, tuple[Model, float]] = {
    "gear": (GEAR, 0.6),
    "hardening": (HARDENING, 0.6),
    "tree": (model_from_module(tree_mixed), 0.5),
    "asymmetric": (model_from_module(emps_rigid_asymmetric_qm), 60.0),
}


def opened(content: bytes, folder: Path) -> tuple[Any, dict[str, int]]:
    """Return an FMU ready for its first step, and the references of its variables."""
    (folder / "chain.fmu").write_bytes(content)
    described = fmpy.read_model_description(str(folder / "chain.fmu"))
    unpacked = fmpy.extract(str(folder / "chain.fmu"), str(folder / "unpacked"))
    fmu = FMU2Slave(
        guid=described.guid,
        unzipDirectory=unpacked,
        modelIdentifier=described.coSimulation.modelIdentifier,
        instanceName="chain",
    )
    fmu.instantiate()
    fmu.setupExperiment(startTime=0.0)
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    return fmu, {variable.name: variable.valueReference for variable in described.modelVariables}


def driven(fmu: Any, references: dict[str, int], model: Model, push: Excitation) -> FloatArray:
    """Return what the sensors read, one row a sample, the forces linear in between."""
    inputs = [references[actuator.key] for actuator in model.actuators]
    outputs = [references[sensor.key] for sensor in model.sensors]
    forces = np.array([push.feedforward, *(push.forces[a.key] for a in model.actuators[1:])]).T
    rows = []
    for k in range(len(forces)):
        fmu.setReal(inputs, forces[k].tolist())
        rows.append(fmu.getReal(outputs))
        if k + 1 < len(forces):
            slopes = (forces[k + 1] - forces[k]) * FS
            fmu.setRealInputDerivatives(inputs, [1] * len(inputs), slopes.tolist())
            fmu.doStep(k / FS, 1.0 / FS)
    fmu.terminate()
    fmu.freeInstance()
    return np.array(rows)


@pytest.mark.parametrize("name", CASES)
def test_it_moves_as_our_own_simulation(name: str, tmp_path: Path) -> None:
    model, size = CASES[name]
    values = dict(next(iter(model.parameter_sets.values())))
    push = force(model, 0.5, size)
    expected = motion(model, values, push)
    made = export(model, values, "fmu")
    fmu, references = opened(made.files[""], tmp_path)
    assert validate_fmu(str(tmp_path / "chain.fmu")) == []
    rows = driven(fmu, references, model, push)
    for column, sensor in enumerate(model.sensors):
        assert error(rows[:, column], expected[sensor.key]) < 1e-6, sensor.key


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(8))
def test_random_chains_move_as_our_own_simulation(seed: int, tmp_path: Path) -> None:
    random = Random(seed)
    try:
        model = model_of(random_spec(random, 4), "set")
    except ModelError:
        return
    sizes = {"inertia": 1e-3, "stiffness": 50.0, "damping": 0.02, "viscous": 0.01, "coulomb": 0.05}
    names = [name for name in (*model.parameters, *model.known) if name in model.roles]
    values = {name: sizes.get(model.roles[name].role, 0.02) * random.uniform(0.5, 2.0) for name in names}
    push = force(model, 0.4, 0.4)
    expected = motion(model, values, push)
    fmu, references = opened(export(model, values, "fmu").files[""], tmp_path)
    rows = driven(fmu, references, model, push)
    for column, sensor in enumerate(model.sensors):
        if np.abs(expected[sensor.key]).max() > 1e-9 and sensor.measures != "acceleration":
            assert error(rows[:, column], expected[sensor.key]) < 1e-5, sensor.key


def test_parameters_can_be_set(tmp_path: Path) -> None:
    values = dict(GEAR.parameter_sets["nominal"])
    heavier = {**values, "M_t": 15.0, "F_t": 2.0}
    push = force(GEAR, 0.2, 0.6)
    fmu, references = opened(export(GEAR, values, "fmu").files[""], tmp_path)
    fmu.setReal([references["M_t"], references["F_t"]], [15.0, 2.0])
    rows = driven(fmu, references, GEAR, push)
    assert error(rows[:, 0], motion(GEAR, heavier, push)["q_m"]) < 1e-6


@pytest.mark.slow
def test_the_bytes_depend_on_the_model_alone(tmp_path: Path) -> None:
    first, second = (export(GEAR, "nominal", "fmu").files[""] for _ in range(2))
    assert first == second
    other = export(GEAR, "nominal", "fmu", values={"K": 5e6}).files[""]
    guids = [fmpy.read_model_description(BytesIO(content)).guid for content in (first, other)]
    assert guids[0] != guids[1]
    with zipfile.ZipFile(BytesIO(first)) as archive:
        assert archive.namelist()[:3] == [
            "modelDescription.xml",
            "sources/chain_data.h",
            "sources/chain_fmu.c",
        ]
        # nothing of a user's text is in what is compiled
        assert b"gear" not in archive.read("sources/chain_data.h")


def test_without_a_compiler_the_source_is_there(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shutil, "which", lambda name: None)
    made = export(GEAR, "nominal", "fmu")
    assert "no C compiler" in made.notes[0]
    with zipfile.ZipFile(BytesIO(made.files[""])) as archive:
        assert not [name for name in archive.namelist() if name.startswith("binaries")]
