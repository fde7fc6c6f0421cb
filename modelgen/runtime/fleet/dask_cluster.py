"""The cluster of a fleet: a client of dask.distributed, and results that may never come."""

from __future__ import annotations

import logging
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from importlib import import_module
from multiprocessing import active_children
from tempfile import TemporaryDirectory
from typing import Any

from modelgen.errors import DataError, ModelgenError
from modelgen.progress import counted
from modelgen.runtime.fleet.certificates import Certificates as Certificates
from modelgen.runtime.fleet.certificates import check_certificates, security_of
from modelgen.runtime.numerics.threads import usable_threads

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
# A scheduler that runs answers at once, from far away in tenths of a second.
CONNECTING_S = 3.0
# More processes than this only take each other's memory.
WORKERS_A_CORE = 8


class GivenUpError(DataError):
    """Nobody is left to do the work, or nobody does it."""


@contextmanager
def fleet_client(
    scheduler: str | None = None,
    workers: int | None = None,
    timeout_s: float = CONNECTING_S,
    certificates: Certificates | None = None,
) -> Iterator[Any]:
    """Yield a client of the scheduler at an address, or of a local cluster with one process a core.

    A local cluster listens on this machine only, encrypts what it says, and talks to nobody who does not hold
    the key that was made for it.

    Parameters
    ----------
    scheduler : str, optional
        ``tls://HOST:PORT``, or ``tcp://HOST:PORT``: then whoever reaches it can run code on its workers.
    workers : int, optional
        Processes of the local cluster.
    timeout_s : float
        How long the scheduler may take to answer.
    certificates : Certificates, optional
        For ``tls://``; without, those of dask's own configuration.

    Raises
    ------
    DataError
        When dask.distributed is not installed, an option is wrong, or no scheduler answers.
    """
    check_cluster(scheduler, workers, certificates)
    try:
        distributed: Any = import_module("distributed")
        import_module("cryptography")
    except ImportError as error:
        remedy = "get it with: pip install 'modelgen[fleet]'"
        what = f"needs dask.distributed and cryptography; {error.name} is not installed"
        raise DataError.at("fleet", what, remedy) from error
    if scheduler is not None:
        with _connected(distributed, scheduler, timeout_s, certificates) as client:
            yield client
        return
    with _local_cluster(usable_threads() if workers is None else workers) as cluster:
        client = distributed.Client(cluster, timeout=STARTING_S)
        try:
            yield client
        finally:
            with suppress(TimeoutError):
                client.close(timeout=CLOSING_S)


def check_cluster(
    scheduler: str | None, workers: int | None, certificates: Certificates | None = None
) -> None:
    """Check where the work is to be done, before anything is read or started.

    Raises
    ------
    DataError
    """
    most = WORKERS_A_CORE * usable_threads()
    if workers is not None and not (isinstance(workers, int) and 1 <= workers <= most):
        remedy = f"give a number from 1 to {most}, which is {WORKERS_A_CORE} a core"
        raise DataError.at(f"--workers {workers}", "is no number of processes to be started here", remedy)
    if scheduler is None:
        if certificates is not None:
            what = "are for a scheduler that runs; a local cluster makes its own"
            raise DataError.at("--tls-ca-file", what, "give the --scheduler as well, or leave them out")
        return
    if workers is not None:
        what = "is for a local cluster; the scheduler has the workers that were started for it"
        raise DataError.at(f"--workers {workers}", what, "leave it out, or leave out --scheduler")
    address = re.fullmatch(r"(?:(tcp|tls)://)?(?:[A-Za-z0-9._-]+|\[[0-9A-Fa-f:.]+\]):([0-9]{1,5})", scheduler)
    if address is None or not 1 <= int(address[2]) <= 65535:
        remedy = "write it as dask scheduler prints it: tls://HOST:8786 or tcp://HOST:8786"
        raise DataError.at(f"--scheduler {scheduler[:100]}", "is no address of a scheduler", remedy)
    if certificates is not None:
        if address[1] != "tls":
            what = "is asked without encryption, so certificates are of no use"
            raise DataError.at(f"--scheduler {scheduler}", what, "write tls:// before the host")
        check_certificates(certificates)


@contextmanager
def _connected(
    distributed: Any, scheduler: str, timeout_s: float, certificates: Certificates | None
) -> Iterator[Any]:
    """Yield a client of a scheduler that runs."""
    where, security = f"--scheduler {scheduler}", None
    if scheduler.startswith("tls://"):
        security = security_of(distributed, certificates, where)
    remedy = "start one with: dask scheduler"
    if security is not None:
        remedy = "check that it runs with --protocol tls, and that one authority signed all certificates"
    try:
        with _quiet_logs():
            client = distributed.Client(scheduler, timeout=timeout_s, security=security)
    except (OSError, TimeoutError, ValueError, RuntimeError) as error:
        said = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise DataError.at(where, f"does not answer within {timeout_s:g} s ({said})", remedy) from error
    with client:
        yield client


@contextmanager
def _quiet_logs() -> Iterator[None]:
    """Keep dask from logging attempts that are answered for by one message."""
    logger = logging.getLogger("distributed")
    before = logger.level
    logger.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        logger.setLevel(before)


@contextmanager
def _local_cluster(workers: int) -> Iterator[Any]:
    """Yield a cluster on this machine; none of its processes and files outlives it."""
    dask: Any = import_module("dask")
    servers: Any = import_module("modelgen.runtime.fleet.servers")
    others = active_children()
    cluster = None
    with (
        TemporaryDirectory(prefix="modelgen-fleet-", ignore_cleanup_errors=True) as folder,
        dask.config.set(servers.KEPT),  # asked for whenever a worker is lost
    ):
        try:
            with servers.interrupted_afterwards():
                cluster = _started(dask, servers, workers, folder)
            yield cluster
        finally:
            # on a busy machine a worker may never say that it is gone, and is killed
            with suppress(TimeoutError), _quiet_logs():
                if cluster is not None:
                    cluster.close(timeout=CLOSING_S)
            released = getattr(getattr(cluster, "scheduler", None), "_workdir", None)
            if released is not None:  # it would look for its folder when this process ends
                released.release()
            for process in active_children():
                if process not in others and process.name.startswith("Dask Worker"):
                    process.kill()
                    process.join(CLOSING_S)


def _started(dask: Any, servers: Any, workers: int, folder: str) -> Any:
    """Return a cluster on this machine; one BLAS thread a worker, because the workers are the threads."""
    threads = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}
    memory = {f"distributed.nanny.pre-spawn-environ.{name}": value for name, value in KEPT_MEMORY.items()}
    try:
        with dask.config.set({**memory, "temporary-directory": folder}):
            return servers.local_cluster(workers, folder, threads, STARTING_S)
    except Exception as error:  # whatever kept a process from starting
        what = f"do not start ({type(error).__name__}: {error})"
        remedy = "ask for fewer, or give the --scheduler of a cluster that runs"
        raise DataError.at("workers", what, remedy) from error


def gathered(
    futures: Mapping[str, Any], what: str, each: Callable[[str, Any], None] | None = None
) -> tuple[dict[str, Any], dict[str, str]]:
    """Return the results in the order given, and the reasons of those that have none.

    `each` is called with every result as soon as its turn comes.
    """
    results, failed = {}, {}
    watch = Watch(list(futures.values()))
    for name, future in counted(list(futures.items()), what):
        result, reason = _waited_for(name, future, watch)
        if reason is not None:
            failed[name] = reason
            continue
        results[name] = result
        if each is not None:
            each(name, result)
    return results, failed


def lost_alone(submissions: Mapping[str, Callable[[], Any]], what: str) -> dict[str, str]:
    """Return the reasons of those that have no result, each submitted when the one before has ended.

    A worker that dies takes along what waits there; what ran alone has itself to blame.
    """
    failed = {}
    for name, submit in counted(list(submissions.items()), what):
        future = submit()
        _, reason = _waited_for(name, future, Watch([future]))
        if reason is not None:
            failed[name] = reason
    return failed


def _waited_for(name: str, future: Any, watch: Watch) -> tuple[Any, str | None]:
    """Return the result, or None and why there is none.

    Raises
    ------
    GivenUpError
    """
    try:
        return _result(future, watch), None
    except GivenUpError:
        raise
    except ModelgenError as error:
        return None, str(error)
    except Exception as error:  # whatever a worker died of
        return None, f"{name}: was lost ({type(error).__name__}: {error}); run it again by itself"


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
            if future.done():  # just now; or the task itself ran out of time, which is told again
                return future.result()
            watch.look(future.client)
