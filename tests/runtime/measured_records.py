"""The measured records of ../shared/data, as the tests of this room use them."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from generated import emps_rigid_qm, two_mass_bench_qm_qc
from modelgen.cli.candidates import spec_model
from modelgen.runtime.model.model import Model, model_from_module
from modelgen.runtime.records.record import Record
from modelgen.spec.load import parse_spec

AXIS = """
[chain]
name = "axis"
motion = "rotation"

[[bodies]]
name = "a"
inertia = "J"
viscous = "F_v"
coulomb = "F_s"
offset = "O"
actuator = "T"

[sensors.q]
q_a = { body = "a", measures = "position" }
"""
GEAR_OF_AXIS = (32.0, 32.0, 45.0, -48.0, 45.0, 32.0)


def emps(shared_data: Path) -> tuple[Model, Record]:
    """The one-axis positioning bench, 24841 samples at 1 kHz, in m and N."""
    from scipy.io import loadmat

    data = loadmat(shared_data / "emps" / "DATA_EMPS.mat")
    force = float(data["gtau"].item()) * data["vir"].ravel()
    record = Record({"q_m": data["qm"].ravel(), "F": force}, 1000.0, "emps")
    return model_from_module(emps_rigid_qm), record


def bench(shared_data: Path) -> tuple[Model, Record]:
    """The two-mass bench, 20 periods of 1 s at 2.5 kHz, in rad and A."""
    from scipy.io import loadmat

    data = loadmat(shared_data / "two_mass_bench" / "MultisineTypeA.mat")
    signals = {"q_m": data["theta_mx"].ravel(), "q_c": -data["theta_my"].ravel(), "i": data["iq_adx"].ravel()}
    return model_from_module(two_mass_bench_qm_qc), Record(signals, 2500.0, "bench")


def robot_axis(shared_data: Path, axis: int) -> tuple[Model, Record]:
    """An axis (1 to 6) of the TX40 as one rigid body: 45,000 samples at 5 kHz, in rad and N m of the link."""
    tables = [
        np.loadtxt(shared_data / "tx40" / name, delimiter=",", skiprows=1, usecols=axis - 1)
        for name in ("pos_read_data.csv", "curr_data.csv")
    ]
    gear = GEAR_OF_AXIS[axis - 1]
    record = Record({"q_a": tables[0] / gear, "T": tables[1] * gear}, 5000.0, f"axis {axis}")
    return spec_model(parse_spec(AXIS, "axis.toml"), "q"), record
