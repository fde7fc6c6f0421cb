"""MuJoCo moves an MJCF model as our own simulation does: to 1 % without Coulomb friction, to 5 % with it."""

from __future__ import annotations

from xml.etree import ElementTree

import mujoco
import numpy as np
import pytest

from generated import emps300_qm_qc, tree_mixed
from modelgen.array_types import FloatArray
from modelgen.errors import DataError
from modelgen.runtime.exports.export import export
from modelgen.runtime.model.model import Model, model_from_module
from modelgen.runtime.simulation.excitation import Excitation
from tests.runtime.exports.open_loop import FS, GEARED, error, force, model_of, motion

GEAR = model_of(GEARED)
CASES: dict[str, tuple[Model, float]] = {
    "gear": (GEAR, 0.6),
    "emps300": (model_from_module(emps300_qm_qc), 0.02),
    "tree": (model_from_module(tree_mixed), 0.5),
}


def driven(text: str, model: Model, push: Excitation) -> dict[str, FloatArray]:
    """Return what MuJoCo's sensors read at every sample, the forces linear in between."""
    machine = mujoco.MjModel.from_xml_string(text)
    steps = int(np.ceil(1.0 / FS / machine.opt.timestep))
    machine.opt.timestep = 1.0 / FS / steps
    data = mujoco.MjData(machine)
    forces = np.array([push.feedforward, *(push.forces[a.key] for a in model.actuators[1:])]).T
    rows = []
    for k in range(len(forces)):
        following = forces[min(k + 1, len(forces) - 1)]
        data.ctrl[: forces.shape[1]] = forces[k]
        mujoco.mj_forward(machine, data)
        rows.append(data.sensordata.copy())
        for step in range(steps):
            share = (step + 0.5) / steps
            data.ctrl[: forces.shape[1]] = (1.0 - share) * forces[k] + share * following
            mujoco.mj_step(machine, data)
    table = np.array(rows)
    angular = mujoco.mjtSensor.mjSENS_FRAMEANGACC
    return {
        machine.sensor(i).name: table[
            :, machine.sensor_adr[i] + (2 if machine.sensor_type[i] == angular else 0)
        ]
        for i in range(machine.nsensor)
    }


@pytest.mark.parametrize("friction", [False, True])
@pytest.mark.parametrize("name", CASES)
def test_mujoco_moves_as_our_own_simulation(name: str, friction: bool) -> None:
    model, size = CASES[name]
    values = dict(next(iter(model.parameter_sets.values())))
    if not friction:
        values |= {n: 0.0 for n, role in model.roles.items() if role.role == "coulomb"}
    push = force(model, 0.3, size)
    expected = motion(model, values, push)
    found = driven(export(model, values, "mjcf").files[""].decode(), model, push)
    for sensor in model.sensors:
        if sensor.key in found and sensor.measures == "position":
            assert error(found[sensor.key], expected[sensor.key]) < (0.05 if friction else 0.01), sensor.key


def test_joints_hold_the_numbers() -> None:
    values = dict(GEAR.parameter_sets["nominal"])
    machine = mujoco.MjModel.from_xml_string(export(GEAR, values, "mjcf").files[""].decode())
    assert machine.joint("m").frictionloss[0] == values["F_m"]
    assert machine.joint("t").damping[0] == values["B_t"]
    assert machine.joint("t").stiffness[0] == values["K_g"]
    mass = machine.joint("t").armature[0] + machine.body("t").mass[0]
    assert mass == pytest.approx(values["M_t"], rel=1e-14)


def test_mujoco_reads_the_urdf() -> None:
    values = dict(GEAR.parameter_sets["nominal"])
    made = export(GEAR, values, "urdf")
    machine = mujoco.MjModel.from_xml_string(made.files[""].decode())
    assert machine.joint("m").damping[0] == values["B_m"]
    assert machine.joint("t").frictionloss[0] == values["F_t"]
    assert machine.body("t_link").mass[0] == values["M_t"]
    assert "O_t" in " ".join(made.notes)


@pytest.mark.parametrize("to", ["mjcf", "urdf"])
def test_texts_of_users_are_escaped(to: str) -> None:
    root = ElementTree.fromstring(export(GEAR, "nominal", to).files[""])
    assert root.get("model") or root.get("name")
    for title in ("--><evil/><!--", "---", "a-", "]]>", "&amp;"):
        text = GEARED.replace('<b>\\"A -- gear\\"</b>', title)
        ElementTree.fromstring(export(model_of(text), "nominal", to).files[""])


def test_a_cubic_spring_is_refused_unless_it_is_zero() -> None:
    cubic = GEARED.replace("D = 800.0", "D = 800.0\nK3 = 1e12").replace('"D", l', '"D", stiffness3 = "K3", l')
    with pytest.raises(DataError, match="--set K3=0"):
        export(model_of(cubic), "nominal", "mjcf")
    assert export(model_of(cubic), "nominal", "mjcf", values={"K3": 0.0}).files
