"""The cluster of a fleet: a client of dask.distributed, and results that may never come."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from importlib import import_module
from typing import Any

from modelgen.errors import DataError, ModelgenError
from modelgen.progress import counted
from modelgen.runtime.record_factors import RecordFactors

# A fleet without any worker for so long is given up, after so many looks.
PATIENCE_S, LOOKS = 60.0, 6
# A local cluster that does not end within this time is left to the end of the program.
CLOSING_S = 30.0


class NoWorkerError(DataError):
    """Nobody is left to do the work."""


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
    # one BLAS thread a worker: the workers are the threads
    environment = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}
    cluster = distributed.LocalCluster(
        n_workers=workers, threads_per_worker=1, processes=True, dashboard_address=None, env=environment
    )
    try:
        with distributed.Client(cluster) as client:
            yield client
    finally:
        with suppress(TimeoutError):  # on a busy machine a worker may never say that it is gone
            cluster.close(timeout=CLOSING_S)


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
    for name, future in counted(list(futures.items()), what):
        try:
            results[name] = _result(future)
        except NoWorkerError:
            raise
        except ModelgenError as error:
            failed[name] = str(error)
        except Exception as error:  # whatever a worker died of
            failed[name] = f"{name}: was lost ({type(error).__name__}: {error}); run it again by itself"
    return results, failed


def _result(future: Any) -> Any:
    """Return a result once it is there.

    Raises
    ------
    NoWorkerError
        When there has been no worker for `PATIENCE_S`: without this, one would wait for ever.
    """
    without = 0
    while True:
        try:
            return future.result(timeout=PATIENCE_S / LOOKS)
        except TimeoutError:
            if future.done():  # the task itself ran out of time
                raise
            without = 0 if future.client.scheduler_info()["workers"] else without + 1
            if without >= LOOKS:
                what = f"has had no worker for {PATIENCE_S:g} s"
                raise NoWorkerError.at("scheduler", what, "start workers, with more memory each") from None
