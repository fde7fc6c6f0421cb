"""Fixtures that every room uses."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import suppress
from importlib import import_module

# before NumPy is imported: each process of pytest-xdist has a core of its own
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")
# where this is set, every process that a test starts would compile the whole package anew
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False

from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

from modelgen.runtime.identification.identify import identify
from modelgen.runtime.records.record import Record
from modelgen.runtime.results.estimate import Estimate
from tests.order_of_tests import in_order
from tests.runtime import measured_records

# The same examples in every run (others with MODELGEN_FUZZ=nightly), and no test is timed: on a busy machine
# each takes as long as it likes.
settings.register_profile(
    "steady",
    deadline=None,
    derandomize=os.environ.get("MODELGEN_FUZZ") != "nightly",
    suppress_health_check=[HealthCheck.too_slow],
)
settings.load_profile("steady")


def pytest_sessionstart(session: pytest.Session) -> None:
    """Let the second process import all tests from the last to the first, before it collects them.

    On a new checkout pytest compiles every file for its assertions, which takes one process a minute: so each
    of two compiles a half.
    """
    config = session.config
    second = getattr(config, "workerinput", {}).get("workerid") == "gw1"
    if second and config.args == config.getini("testpaths"):
        for path in sorted((config.rootpath / "tests").rglob("test_*.py"), reverse=True):
            # what is wrong with a file is told where it is collected
            with suppress(Exception, pytest.skip.Exception):
                import_module(".".join(path.relative_to(config.rootpath).with_suffix("").parts))


@pytest.hookimpl(trylast=True)  # after what is left out
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Put the tests into the order in which processes share them."""
    count = getattr(config, "workerinput", {}).get("workercount", 1)
    if count > 1:
        items[:] = in_order(items, count)


@pytest.fixture(scope="session")
def repo_root() -> Path:
    """The checkout's root folder."""
    return Path(__file__).resolve().parents[1]


@pytest.fixture(scope="session")
def shared_data(repo_root: Path) -> Path:
    """Folder of the measured records, next to the checkout; skips where it is absent."""
    folder = repo_root.parent / "shared" / "data"
    if not folder.is_dir():
        pytest.skip("measured records not found at ../shared/data: tests on real records need them there")
    return folder


@pytest.fixture(scope="session")
def emps(shared_data: Path) -> Record:
    """The EMPS bench: motor position in m, force in N, 1 kHz."""
    return measured_records.emps(shared_data)[1]


@pytest.fixture(scope="session")
def bench(shared_data: Path) -> Record:
    """The two-mass bench: both angles in rad, the current in A, 2.5 kHz."""
    return measured_records.bench(shared_data)[1]


@pytest.fixture(scope="session")
def emps_estimate(shared_data: Path) -> Estimate:
    """What the EMPS bench gives by default: it takes seconds, and several tests look at it."""
    return identify(*measured_records.emps(shared_data))


@pytest.fixture(scope="session")
def bench_estimate(shared_data: Path) -> Estimate:
    """What the two-mass bench gives by default."""
    return identify(*measured_records.bench(shared_data))


@pytest.fixture(autouse=True)
def no_figures_left() -> Iterator[None]:
    """Close what a test has drawn: matplotlib warns of many open figures, of whichever test comes next."""
    yield
    pyplot = sys.modules.get("matplotlib.pyplot")
    if pyplot is not None:
        pyplot.close("all")
