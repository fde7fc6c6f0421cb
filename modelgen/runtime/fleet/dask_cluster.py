"""The cluster of a fleet: a client of dask.distributed, and results that may never come."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from importlib import import_module
from multiprocessing import active_children
from typing import Any

from modelgen.errors import DataError, ModelgenError
from modelgen.progress import counted
from modelgen.runtime.rows.record_factors import RecordFactors

# A fleet without any worker for so long is given up, after so many looks. On a busy machine a worker that was
# lost takes its time to start again, and may be lost again before the next look.
PATIENCE_S, LOOKS = 120.0, 12
# So is one whose workers, with next to nothing to compute, finish nothing for so long.
STALLED_S, IDLE_PERCENT = 900.0, 20.0
# A worker that has not started within this time never will.
STARTING_S = 120.0
# Bytes that a worker keeps when it frees them (glibc): chunk after chunk asks for the same. By dask's setting
# they go back to the system each time, and to get them again takes as long as the work itself.
KEPT_MEMORY = {"MALLOC_TRIM_THRESHOLD_": 1 << 28, "MALLOC_MMAP_THRESHOLD_": 1 << 25}
# The processes of a local cluster that does not end within this time are ended.
CLOSING_S = 30.0


class GivenUpError(DataError):
    """Nobody is left to do the work, or nobody does it."""


@contextmanager
def fleet_client(
    scheduler: str | None = None, workers: int | None = None, timeout_s: float = 10.0
) -> Iterator[Any]:
    """Yield a client of the scheduler at an address, or of a local cluster with one process a core.

    `timeout_s` is how long the scheduler may take to answer.

    Raises
    ------
    DataError
        When dask.distributed is not installed, or no scheduler answers.
    """
    try:
        distributed: Any = import_module("distributed")
    except ImportError as error:
        remedy = "get it with: pip install 'modelgen[fleet]'"
        raise DataError.at("fleet", "needs dask.distributed, which is not installed", remedy) from error
    if scheduler is not None:
        try:
            client = distributed.Client(scheduler, timeout=timeout_s)
        except (OSError, TimeoutError, ValueError) as error:
            remedy = "start one with: dask scheduler"
            raise DataError.at(f"--scheduler {scheduler}", f"does not answer ({error})", remedy) from error
        with client:
            yield client
        return
    with _local_cluster(distributed, workers) as cluster:
        client = distributed.Client(cluster, timeout=STARTING_S)
        try:
            yield client
        finally:
            with suppress(TimeoutError):
                client.close(timeout=CLOSING_S)


@contextmanager
def _local_cluster(distributed: Any, workers: int | None) -> Iterator[Any]:
    """Yield a cluster on this machine; none of its processes outlives it."""
    others = active_children()
    cluster = None
    try:
        cluster = _started(distributed, workers)
        yield cluster
    finally:
        with suppress(TimeoutError):  # on a busy machine a worker may never say that it is gone
            if cluster is not None:
                cluster.close(timeout=CLOSING_S)
        for process in active_children():
            if process not in others and process.name.startswith("Dask Worker"):
                process.kill()


def _started(distributed: Any, workers: int | None) -> Any:
    """Return a cluster on this machine; one BLAS thread a worker, because the workers are the threads."""
    dask: Any = import_module("dask")
    threads = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}
    memory = {f"distributed.nanny.pre-spawn-environ.{name}": value for name, value in KEPT_MEMORY.items()}
    try:
        with dask.config.set(memory):
            return distributed.LocalCluster(
                n_workers=workers,
                threads_per_worker=1,
                processes=True,
                dashboard_address=None,
                env=threads,
                death_timeout=STARTING_S,
            )
    except Exception as error:  # whatever kept a process from starting
        what = f"do not start ({type(error).__name__}: {error})"
        remedy = "ask for fewer, or give the --scheduler of a cluster that runs"
        raise DataError.at("workers", what, remedy) from error


def joined_in_a_tree(client: Any, parts: list[Any]) -> Any:
    """Return the future of all parts joined, two by two."""
    while len(parts) > 1:
        joined = [
            client.submit(RecordFactors.joined, a, b, pure=False)
            for a, b in zip(parts[::2], parts[1::2], strict=False)
        ]
        parts = joined + parts[2 * len(joined) :]
    return parts[0]


def gathered(futures: Mapping[str, Any], what: str) -> tuple[dict[str, Any], dict[str, str]]:
    """Return the results in the order of the records, and the reasons of those that have none."""
    results, failed = {}, {}
    watch = Watch(list(futures.values()))
    for name, future in counted(list(futures.items()), what):
        try:
            results[name] = _result(future, watch)
        except GivenUpError:
            raise
        except ModelgenError as error:
            failed[name] = str(error)
        except Exception as error:  # whatever a worker died of
            failed[name] = f"{name}: was lost ({type(error).__name__}: {error}); run it again by itself"
    return results, failed


@dataclass
class Watch:
    """Looks at a cluster while its results do not come; without this, one would wait for ever.

    Attributes
    ----------
    futures : sequence of futures
        What is waited for.
    without, still : int
        Looks, one after the other, at which there was no worker, and at which nothing had moved.
    seen : object
        What was finished and what was going on at the last look.
    """

    futures: Sequence[Any]
    without: int = 0
    still: int = 0
    seen: object = None

    def look(self, client: Any) -> None:
        """Look at the workers.

        Raises
        ------
        GivenUpError
            When there has been no worker for `PATIENCE_S`, or none has done anything for `STALLED_S`.
        """
        metrics = [worker["metrics"] for worker in client.scheduler_info(n_workers=-1)["workers"].values()]
        self.without = 0 if metrics else self.without + 1
        if self.without >= LOOKS:
            what = f"has had no worker for {PATIENCE_S:g} s"
            raise GivenUpError.at("scheduler", what, "start workers, with more memory each")
        seen = sum(future.done() for future in self.futures), [one.get("task_counts") for one in metrics]
        works = any(one.get("cpu", 0.0) > IDLE_PERCENT for one in metrics)
        self.still = 0 if works or seen != self.seen else self.still + 1
        self.seen = seen
        if self.still >= LOOKS * STALLED_S / PATIENCE_S:
            what = f"{len(metrics)} worker(s) have finished nothing and computed nothing for {STALLED_S:g} s"
            raise GivenUpError.at("scheduler", what, "see whether they can read the files; start it again")


def _result(future: Any, watch: Watch) -> Any:
    """Return a result once it is there; raises what `Watch.look` does."""
    while True:
        try:
            return future.result(timeout=PATIENCE_S / LOOKS)
        except TimeoutError:
            if future.done():  # the task itself ran out of time
                raise
            watch.look(future.client)
