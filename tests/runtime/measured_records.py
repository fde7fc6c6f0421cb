"""The measured records of ../shared/data, as the tests of this room use them."""

from __future__ import annotations

from pathlib import Path

from generated import emps_rigid_qm, two_mass_bench_qm_qc
from modelgen.runtime.model.model import Model, model_from_module
from modelgen.runtime.records.record import Record


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
