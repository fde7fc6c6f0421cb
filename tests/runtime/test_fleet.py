"""Fleets on a local cluster: the estimates of one record after the other, and what a lost record costs."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from generated import emps300_qm_qc
from modelgen.errors import DataError
from modelgen.runtime.contract import model_from_module
from modelgen.runtime.fleet import FleetRecord, fleet_client, identify_fleet
from modelgen.runtime.mapped import NpyChannels, open_npy
from modelgen.runtime.simulate import simulate
from modelgen.runtime.stream import identify_stream

MODEL = model_from_module(emps300_qm_qc)
TEXT = Path(str(emps300_qm_qc.__file__)).read_text()
NOISE = {"q_m": 2e-5, "q_c": 2e-5, "Gamma_m": 1e-4}
SETTINGS: dict[str, Any] = {"cutoff_hz": 300.0, "filter_order": 4, "decimation": 6}


@dataclass(frozen=True, eq=False)
class Deadly(NpyChannels):
    """A record that takes its worker with it."""

    def read(self, channel: str, start: int, stop: int) -> np.ndarray:
        os._exit(1)


# distributed leaves sockets and loops to the garbage collector
pytestmark = [
    pytest.mark.filterwarnings("ignore::ResourceWarning"),
    pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning"),
    pytest.mark.filterwarnings("ignore:Port .* is already in use:UserWarning"),
]


@pytest.fixture(scope="module")
def client() -> Iterator[Any]:
    pytest.importorskip("distributed")
    with fleet_client(workers=2) as found:
        yield found


@pytest.fixture(scope="module")
def sources(tmp_path_factory: pytest.TempPathFactory) -> list[NpyChannels]:
    found = []
    for seed, kind in enumerate(("chirp", "trapezoid", "chirp")):
        folder = tmp_path_factory.mktemp(f"run{seed}")
        truth = MODEL.parameter_sets["table_2"]
        record = simulate(MODEL, truth, kind, duration_s=2.0, noise=NOISE, oversample=8, seed=seed).record
        for channel, samples in record.signals.items():
            np.save(folder / f"{channel}.npy", samples)
        paths = {channel: folder / f"{channel}.npy" for channel in record.signals}
        found.append(open_npy(paths, record.fs, name=f"run {seed}"))
    return found


def test_a_fleet_gives_each_machine_what_it_would_get_alone(client: Any, sources: list[NpyChannels]) -> None:
    fleet = [FleetRecord("a", sources[0]), FleetRecord("b", sources[1]), FleetRecord("a", sources[2])]
    said: list[str] = []
    found = identify_fleet(client, TEXT, fleet, task_samples=3000, progress=said.append, **SETTINGS)
    assert (found.failed, found.refused) == ({}, {})
    alone = {
        "a": identify_stream(MODEL, [sources[0], sources[2]], **SETTINGS),
        "b": identify_stream(MODEL, [sources[1]], **SETTINGS),
    }
    pooled = identify_stream(MODEL, sources, **SETTINGS)
    assert list(found.machines) == ["a", "b"]
    for got, expected in (
        (found.machines["a"], alone["a"]),
        (found.machines["b"], alone["b"]),
        (found.pooled, pooled),
    ):
        assert got.nobs == expected.nobs
        for name, value in expected.params.items():
            assert abs(got.params[name] - value) < 1e-8 * expected.bse[name]
            assert got.bse[name] == pytest.approx(expected.bse[name], rel=1e-8)
    assert said[2] == "filtering: 3 of 3 records"


def test_a_corrupt_file_costs_its_record_only(
    client: Any, sources: list[NpyChannels], tmp_path: Path
) -> None:
    paths = dict(sources[0].paths)
    broken = tmp_path / "q_c.npy"
    broken.write_bytes(Path(paths["q_c"]).read_bytes())
    corrupt = open_npy({**paths, "q_c": broken}, sources[0].fs, name="corrupt")
    broken.write_bytes(b"nothing")
    fleet = [FleetRecord("a", sources[0]), FleetRecord("a", corrupt), FleetRecord("c", sources[2])]
    found = identify_fleet(client, TEXT, fleet, **SETTINGS)
    assert list(found.failed) == ["corrupt"]
    assert "q_c.npy: is no readable .npy file" in found.failed["corrupt"]
    expected = identify_stream(MODEL, [sources[0]], **SETTINGS)
    for name, value in expected.params.items():
        assert found.machines["a"].params[name] == pytest.approx(value, rel=1e-10)
    assert list(found.machines) == ["a", "c"]


def test_a_record_that_kills_its_workers_is_named(client: Any, sources: list[NpyChannels]) -> None:
    deadly = Deadly(sources[0].paths, sources[0].fs, "deadly", sources[0].n)
    fleet = [FleetRecord("a", deadly), FleetRecord("b", sources[1]), FleetRecord("c", sources[2])]
    found = identify_fleet(client, TEXT, fleet, **SETTINGS)
    assert list(found.failed) == ["deadly"]
    assert "was lost" in found.failed["deadly"]
    assert list(found.machines) == ["b", "c"]


def test_names_must_differ_and_a_scheduler_must_answer(sources: list[NpyChannels]) -> None:
    with pytest.raises(DataError, match="names two records"):
        identify_fleet(None, TEXT, [FleetRecord("a", sources[0])] * 2, **SETTINGS)
