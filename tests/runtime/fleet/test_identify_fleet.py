"""Fleets on a local cluster: the estimates of one record after the other, and what a lost record costs."""

from __future__ import annotations

import json
import os
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from multiprocessing import active_children
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from generated import emps300_qm_qc
from modelgen.__main__ import terminated
from modelgen.errors import DataError
from modelgen.runtime.files.npy_channels import NpyChannels, open_npy
from modelgen.runtime.fleet import checkpoint
from modelgen.runtime.fleet.dask_cluster import GivenUpError, Watch, fleet_client
from modelgen.runtime.fleet.identify_fleet import FleetRecord, identify_fleet
from modelgen.runtime.fleet.servers import interrupted_afterwards
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.identification.methods import IV
from modelgen.runtime.identification.options import values_of
from modelgen.runtime.model.model import model_from_module
from modelgen.runtime.records.record import Record
from modelgen.runtime.simulation.simulate import simulate

MODEL = model_from_module(emps300_qm_qc)
TEXT = Path(str(emps300_qm_qc.__file__)).read_text()
NOISE = {"q_m": 2e-5, "q_c": 2e-5, "Gamma_m": 1e-4}
SETTINGS = values_of(cutoff_hz=300.0, filter_order=4, decimation=6, drift_check=False)


@dataclass(frozen=True, eq=False)
class Deadly(NpyChannels):
    """A record that takes its worker with it."""

    def read(self, channel: str, start: int, stop: int) -> np.ndarray:
        os._exit(1)


@dataclass(frozen=True, eq=False)
class Hungry(NpyChannels):
    """A record for which memory does not suffice."""

    def read(self, channel: str, start: int, stop: int) -> np.ndarray:
        return np.empty(1 << 50)


@dataclass(frozen=True, eq=False)
class Asleep(NpyChannels):
    """A record on a disk that does not answer."""

    def read(self, channel: str, start: int, stop: int) -> np.ndarray:
        time.sleep(3600.0)
        raise OSError


@dataclass(frozen=True, eq=False)
class DeadlyOnce(NpyChannels):
    """A record whose first reader dies: a machine that is switched off, say."""

    def read(self, channel: str, start: int, stop: int) -> np.ndarray:
        marker = self.columns[channel].path.parent / "read"
        if not marker.exists():
            marker.touch()
            os._exit(1)
        return super().read(channel, start, stop)


# distributed leaves sockets and loops to the garbage collector
pytestmark = [
    pytest.mark.filterwarnings("ignore::ResourceWarning"),
    pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning"),
    pytest.mark.filterwarnings("ignore:Port .* is already in use:UserWarning"),
]


@contextmanager
def impatient_client(workers: int) -> Iterator[Any]:
    """A cluster that gives up what two of its workers did not survive, where dask would spend four."""
    dask = pytest.importorskip("dask")
    pytest.importorskip("distributed")
    with (
        dask.config.set({"distributed.scheduler.allowed-failures": 1}),
        fleet_client(workers=workers) as found,
    ):
        yield found


@pytest.fixture(scope="module")
def client() -> Iterator[Any]:
    with impatient_client(2) as found:
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


def fleet_of(sources: list[NpyChannels]) -> list[FleetRecord]:
    return [FleetRecord("a", sources[0]), FleetRecord("b", sources[1]), FleetRecord("a", sources[2])]


def alone(sources: list[NpyChannels], **options: Any) -> dict[str, Any]:
    """What `identify` says here, as it would be written to a file."""
    found: dict[str, Any] = json.loads(identify(MODEL, sources, **options).to_json())
    return found


@pytest.mark.slow
def test_a_machine_gets_what_identify_says(client: Any, sources: list[NpyChannels]) -> None:
    """Everything: values, intervals, what is refused and why, warnings, drift, filters."""
    options = values_of("wls")
    found = identify_fleet(client, TEXT, fleet_of(sources), options)
    assert (found.failed, found.refused) == ({}, {})
    assert list(found.machines) == ["a", "b"]
    assert found.machines["a"] == alone([sources[0], sources[2]], **options)
    assert found.machines["b"] == alone([sources[1]], **options)


@pytest.mark.slow
def test_options_and_the_number_of_workers_change_nothing(client: Any, sources: list[NpyChannels]) -> None:
    options = {**SETTINGS, "method": IV(robust="huber")}
    expected = identify_fleet(client, TEXT, fleet_of(sources), options)
    assert expected.machines["b"] == alone([sources[1]], **options)
    with fleet_client(workers=1) as one:
        assert identify_fleet(one, TEXT, fleet_of(sources), options) == expected


@pytest.mark.slow
def test_machines_that_differ_are_told_from_those_that_agree(client: Any) -> None:
    truth = MODEL.parameter_sets["table_2"]
    records = []
    for index, stiffer in enumerate((1.0, 1.0, 1.0, 1.1)):
        values = {**truth, "K": stiffer * truth["K"]}
        record = simulate(
            MODEL, values, "chirp", duration_s=2.0, noise=NOISE, oversample=8, seed=index
        ).record
        records.append(FleetRecord(f"machine {index}", record, f"run {index}"))
    same = {one.name: one for one in identify_fleet(client, TEXT, records[:3], SETTINGS).pooled}
    assert not any(one.differs for one in same.values())
    for name, one in same.items():
        assert abs(one.value - truth[name]) < 5.0 * one.std
    unlike = {one.name: one for one in identify_fleet(client, TEXT, records, SETTINGS).pooled}
    assert [name for name, one in unlike.items() if one.differs] == ["K"]
    assert unlike["K"].between_std == pytest.approx(0.05 * truth["K"], rel=0.2)
    assert unlike["K"].std > 5.0 * same["K"].std


def reader(source: NpyChannels, folder: Path) -> Record:
    (folder / f"{len(list(folder.iterdir()))}").touch()
    return Record.over(source)


@pytest.mark.slow
def test_a_run_that_was_stopped_goes_on(client: Any, sources: list[NpyChannels], tmp_path: Path) -> None:
    folders = [tmp_path / f"opened {index}" for index in range(3)]
    for folder in folders:
        folder.mkdir()
    fleet = [
        FleetRecord(machine, partial(reader, source, folder), source.name, stamp="as recorded")
        for machine, source, folder in zip("aba", sources, folders, strict=True)
    ]
    kept = tmp_path / "kept"
    identify_fleet(client, TEXT, [fleet[0], fleet[2]], SETTINGS, kept)  # machine a is finished, b is not
    found = identify_fleet(client, TEXT, fleet, SETTINGS, kept)
    assert found == identify_fleet(client, TEXT, fleet, SETTINGS, kept)
    assert [len(list(folder.iterdir())) for folder in folders] == [1, 1, 1]
    assert found == identify_fleet(client, TEXT, fleet, SETTINGS)
    # other data, options or models are no longer those that were finished
    changed = [replace(fleet[0], stamp="another"), fleet[1], fleet[2]]
    before = [len(list(folder.iterdir())) for folder in folders]
    identify_fleet(client, TEXT, changed, SETTINGS, kept)
    assert [len(list(folder.iterdir())) for folder in folders] == [before[0] + 1, before[1], before[2] + 1]
    # a damaged file is no reason to stop
    whole = {file: file.read_text() for file in kept.iterdir()}
    for damage in (
        lambda text: text[: len(text) // 2],
        lambda text: text.replace('"params"', '"param"'),
        lambda text: json.dumps({**json.loads(text), "looks": {"run 0": [[1.0]], "run 1": []}}),
        lambda text: json.dumps({**json.loads(text), "looks": [1], "failed": 3}),
        lambda text: json.dumps({**json.loads(text), "machine": "c"}),
        lambda _: "[" * 50_000,
    ):
        for file, text in whole.items():
            file.write_text(damage(text))
        assert identify_fleet(client, TEXT, fleet, SETTINGS, kept) == found


def test_a_copy_of_a_record_is_refused_with_both_names(
    client: Any, sources: list[NpyChannels], tmp_path: Path
) -> None:
    copied = {}
    for channel, column in sources[1].columns.items():
        copied[channel] = tmp_path / f"{channel}.npy"
        copied[channel].write_bytes(column.path.read_bytes())
    copy = open_npy(copied, sources[1].fs, name="a copy")
    with pytest.raises(DataError, match="a copy: holds the same data as run 1; leave one of them out"):
        identify_fleet(client, TEXT, [*fleet_of(sources), FleetRecord("c", copy)], SETTINGS)


def test_workers_use_one_thread_and_keep_their_memory(client: Any) -> None:
    found = client.submit(_environment, pure=False).result(timeout=60.0)
    assert found["OPENBLAS_NUM_THREADS"] == "1"
    # dask's own setting gives memory back above 64 kB
    wanted = {"MALLOC_TRIM_THRESHOLD_": "268435456", "MALLOC_MMAP_THRESHOLD_": "33554432"}
    assert {name: found[name] for name in wanted} == {n: os.environ.get(n, v) for n, v in wanted.items()}


@pytest.mark.parametrize(
    ("number", "handler", "error"),
    [
        (signal.SIGINT, signal.default_int_handler, KeyboardInterrupt),
        (signal.SIGTERM, terminated, SystemExit),
    ],
)
def test_what_ends_a_command_waits_until_a_cluster_has_started(
    number: signal.Signals, handler: Callable[..., None], error: type[BaseException]
) -> None:
    """dask's own exit ends in a traceback where a cluster has started in part."""
    before, started = signal.signal(number, handler), False
    try:
        with pytest.raises(error), interrupted_afterwards():
            os.kill(os.getpid(), number)
            started = True
        assert started
        assert signal.getsignal(number) is handler
    finally:
        signal.signal(number, before)


def test_an_interruption_is_for_who_waits_alone(client: Any) -> None:
    # a terminal sends it to every process; dask's would each end with a traceback
    assert client.submit(signal.getsignal, signal.SIGINT, pure=False).result(timeout=60.0) == signal.SIG_IGN


@pytest.mark.slow
def test_a_scheduler_that_runs_is_used(sources: list[NpyChannels]) -> None:
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, dashboard_address=None, host="127.0.0.1"
    ) as cluster:
        with fleet_client(cluster.scheduler_address) as client:
            found = identify_fleet(client, TEXT, [FleetRecord("a", sources[0])], SETTINGS)
        assert cluster.scheduler_address.startswith("tcp://127.0.0.1")
        assert len(cluster.scheduler.workers) == 1  # it goes on without us
    assert list(found.machines) == ["a"]


def test_a_scheduler_that_does_not_answer_is_named() -> None:
    pytest.importorskip("distributed")
    with (
        pytest.raises(DataError, match=r"--scheduler tcp://127.0.0.1:9: does not answer"),
        fleet_client("tcp://127.0.0.1:9", timeout_s=0.5),
    ):
        pass


def test_a_corrupt_file_costs_its_record_only(
    client: Any, sources: list[NpyChannels], tmp_path: Path
) -> None:
    paths = {channel: column.path for channel, column in sources[0].columns.items()}
    broken = tmp_path / "q_c.npy"
    broken.write_bytes(Path(paths["q_c"]).read_bytes())
    corrupt = open_npy({**paths, "q_c": broken}, sources[0].fs, name="corrupt")
    broken.write_bytes(b"nothing")
    fleet = [FleetRecord("a", sources[0]), FleetRecord("a", corrupt), FleetRecord("c", sources[2])]
    found = identify_fleet(client, TEXT, fleet, SETTINGS)
    assert list(found.failed) == ["corrupt"]
    assert "q_c.npy: is no readable .npy file" in found.failed["corrupt"]
    assert found.machines["a"] == alone([sources[0]], **SETTINGS)
    assert list(found.machines) == ["a", "c"]


@pytest.mark.slow
def test_a_record_that_takes_all_memory_is_named(client: Any, sources: list[NpyChannels]) -> None:
    bad = Hungry(sources[0].columns, sources[0].fs, "bad", sources[0].n)
    fleet = [FleetRecord("a", bad), FleetRecord("a", sources[1]), FleetRecord("c", sources[2])]
    found = identify_fleet(client, TEXT, fleet, SETTINGS)
    assert list(found.failed) == ["bad"]
    assert "was lost (MemoryError" in found.failed["bad"]
    assert list(found.machines) == ["a", "c"]
    assert found.machines["a"] == alone([sources[1]], **SETTINGS)


@pytest.mark.slow
def test_a_record_that_shares_a_worker_with_a_deadly_one_is_not_blamed(sources: list[NpyChannels]) -> None:
    """With one process, whatever waits there is lost as often as what kills it."""
    bad = [Deadly(sources[0].columns, sources[0].fs, f"bad {k}", sources[0].n) for k in range(2)]
    fleet = [FleetRecord("a", one) for one in (bad[0], sources[0], bad[1], *sources[1:])]
    with impatient_client(1) as only:
        found = identify_fleet(only, TEXT, fleet, SETTINGS)
    assert (list(found.failed), found.refused) == (["bad 0", "bad 1"], {})
    assert found.machines["a"] == alone(sources, **SETTINGS)


@pytest.mark.slow
def test_what_no_worker_survived_is_named_and_not_tried_again_from_a_checkpoint(
    client: Any, sources: list[NpyChannels], tmp_path: Path
) -> None:
    opened, kept = tmp_path / "opened", tmp_path / "kept"
    opened.mkdir()
    bad = [Deadly(sources[0].columns, sources[0].fs, f"bad {k}", sources[0].n) for k in range(2)]
    fleet = [
        FleetRecord(machine, partial(reader, source, opened), source.name, stamp="as recorded")
        for machine, source in (("a", bad[0]), ("a", sources[1]), ("b", bad[1]), ("c", sources[2]))
    ]
    found = identify_fleet(client, TEXT, fleet, SETTINGS, kept)
    assert list(found.failed) == ["bad 0", "bad 1"]
    assert all("was lost (KilledWorker" in reason for reason in found.failed.values())
    assert list(found.machines) == ["a", "c"]
    assert found.machines["a"] == alone([sources[1]], **SETTINGS)
    assert found.refused == {"b": "none of its records can be read"}
    before = len(list(opened.iterdir()))
    assert identify_fleet(client, TEXT, fleet, SETTINGS, kept) == found
    assert len(list(opened.iterdir())) == before


def test_a_checkpoint_that_cannot_be_written_costs_no_estimate(
    client: Any, sources: list[NpyChannels], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(path: Path, *_: Any, **__: Any) -> None:
        raise DataError.at(str(path), "cannot be written (No space left on device)", "make room")

    monkeypatch.setattr(checkpoint, "write_whole", full)
    fleet = [FleetRecord("a", sources[0], stamp="as recorded"), FleetRecord("b", sources[1], stamp="too")]
    found = identify_fleet(client, TEXT, fleet, SETTINGS, tmp_path / "kept")
    assert sorted(found.machines) == ["a", "b"]
    assert sorted(found.unkept) == ["a", "b"]
    assert "No space left" in found.unkept["a"]


def test_a_module_that_was_edited_is_executed_where_it_is_trusted(
    client: Any, sources: list[NpyChannels]
) -> None:
    edited = TEXT.replace("CHAIN = ", "CHAIN  = ", 1)
    assert edited != TEXT
    with pytest.raises(DataError, match="trust"):
        identify_fleet(client, edited, fleet_of(sources), SETTINGS)
    found = identify_fleet(client, edited, fleet_of(sources), SETTINGS, trust=True)
    assert found == identify_fleet(client, TEXT.replace("\n", "\r\n"), fleet_of(sources), SETTINGS)


@pytest.mark.slow
def test_a_worker_that_dies_costs_nothing_where_another_can_do_its_work(
    client: Any, sources: list[NpyChannels]
) -> None:
    once = DeadlyOnce(sources[0].columns, sources[0].fs, "once", sources[0].n)
    found = identify_fleet(client, TEXT, [FleetRecord("a", once), FleetRecord("a", sources[1])], SETTINGS)
    assert (once.columns["q_m"].path.parent / "read").exists()
    assert (found.failed, found.refused) == ({}, {})
    assert found.machines["a"] == alone([once, sources[1]], **SETTINGS)


@pytest.mark.slow
def test_a_worker_that_takes_long_to_start_again_is_kept(tmp_path: Path) -> None:
    dask = pytest.importorskip("dask")
    pytest.importorskip("distributed")
    # dask's patience with a worker that was lost: far less than a start takes
    with dask.config.set({"distributed.deploy.lost-worker-timeout": "1ms"}), fleet_client(workers=1) as only:
        assert only.submit(_dies_once, tmp_path / "dead", pure=False).result(timeout=100.0) == "survived"


def test_a_fleet_without_workers_gives_up(
    sources: list[NpyChannels], monkeypatch: pytest.MonkeyPatch
) -> None:
    distributed = pytest.importorskip("distributed")
    monkeypatch.setattr("modelgen.runtime.fleet.dask_cluster.PATIENCE_S", 0.6)
    with (
        distributed.LocalCluster(n_workers=0, dashboard_address=None, host="127.0.0.1") as cluster,
        fleet_client(cluster.scheduler_address) as client,
        pytest.raises(DataError, match=r"scheduler: has had no worker for 0.6 s"),
    ):
        identify_fleet(client, TEXT, [FleetRecord("a", sources[0])], SETTINGS)


@pytest.mark.slow
def test_workers_that_do_nothing_are_given_up_and_none_of_them_stays(
    sources: list[NpyChannels], monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("distributed")
    psutil = pytest.importorskip("psutil")  # comes with distributed
    monkeypatch.setattr("modelgen.runtime.fleet.dask_cluster.PATIENCE_S", 3.0)
    monkeypatch.setattr("modelgen.runtime.fleet.dask_cluster.STALLED_S", 4.0)
    monkeypatch.setattr("modelgen.runtime.fleet.dask_cluster.CLOSING_S", 1.0)
    asleep = Asleep(sources[0].columns, sources[0].fs, "asleep", sources[0].n)
    before = active_children()
    with (
        fleet_client(workers=1) as client,
        pytest.raises(DataError, match=r"scheduler: 1 worker\(s\) have finished nothing"),
    ):
        identify_fleet(client, TEXT, [FleetRecord("a", asleep)], SETTINGS)
    # asked of the system: dask's own thread may have waited for the process first, so that this one cannot
    left = {process.pid for process in active_children() if process not in before}
    _, alive = psutil.wait_procs([one for one in psutil.Process().children() if one.pid in left], 10.0)
    assert not alive


def test_workers_that_compute_are_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    class Client:
        def __init__(self, *metrics: dict[str, Any]) -> None:
            self.workers = {str(i): {"metrics": one} for i, one in enumerate(metrics)}

        def scheduler_info(self, n_workers: int) -> dict[str, Any]:
            assert n_workers == -1  # all of them
            return {"workers": self.workers}

    idle, busy = ({"cpu": cpu, "task_counts": {"executing": 1}} for cpu in (2.0, 97.0))
    monkeypatch.setattr("modelgen.runtime.fleet.dask_cluster.STALLED_S", 120.0)
    watch = Watch([])
    for _ in range(3):
        for _ in range(12):
            watch.look(Client(idle))
        watch.look(Client(idle, busy))
        watch.look(Client({**idle, "task_counts": {"executing": 1, "memory": 1}}))
    with pytest.raises(GivenUpError, match="for 120 s"):
        for _ in range(13):
            watch.look(Client(idle))


def test_workers_that_do_not_start_are_told(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("distributed")

    def broken(*_: Any) -> None:
        raise RuntimeError("Cluster failed to start: no memory")

    monkeypatch.setattr("modelgen.runtime.fleet.servers.local_cluster", broken)
    with (
        pytest.raises(DataError, match=r"workers: do not start \(RuntimeError: Cluster failed to start"),
        fleet_client(workers=1),
    ):
        pass


def _environment() -> dict[str, str]:
    return dict(os.environ)


def _dies_once(marker: Path) -> str:
    if not marker.exists():
        marker.touch()
        os._exit(1)
    return "survived"


@pytest.mark.slow
def test_names_must_differ_and_a_scheduler_must_answer(sources: list[NpyChannels]) -> None:
    with pytest.raises(DataError, match="names two records"):
        identify_fleet(None, TEXT, [FleetRecord("a", sources[0])] * 2, SETTINGS)
