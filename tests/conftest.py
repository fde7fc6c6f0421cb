"""Fixtures that every room uses."""

from __future__ import annotations

from pathlib import Path

import pytest

from modelgen.runtime.data import Record


@pytest.fixture(scope="session")
def repo_root() -> Path:
    """The checkout's root folder."""
    return Path(__file__).resolve().parents[1]


@pytest.fixture(scope="session")
def shared_data(repo_root: Path) -> Path:
    """Folder of the measured records, beside the checkout; skips where it is absent."""
    folder = repo_root.parent / "shared" / "data"
    if not folder.is_dir():
        pytest.skip("measured records not found at ../shared/data: tests on real records need them there")
    return folder


@pytest.fixture(scope="session")
def emps(shared_data: Path) -> Record:
    """The EMPS bench: motor position in m, force in N, 1 kHz."""
    from scipy.io import loadmat

    data = loadmat(shared_data / "emps" / "DATA_EMPS.mat")
    force = float(data["gtau"].item()) * data["vir"].ravel()
    return Record({"q_m": data["qm"].ravel(), "F": force}, 1000.0, "emps")


@pytest.fixture(scope="session")
def bench(shared_data: Path) -> Record:
    """The two-mass bench: both angles in rad, the current in A, 2.5 kHz."""
    from scipy.io import loadmat

    data = loadmat(shared_data / "two_mass_bench" / "MultisineTypeA.mat")
    signals = {"q_m": data["theta_mx"].ravel(), "q_c": -data["theta_my"].ravel(), "i": data["iq_adx"].ravel()}
    return Record(signals, 2500.0, "bench")
