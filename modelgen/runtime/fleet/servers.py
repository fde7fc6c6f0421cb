"""The scheduler and the workers of a local cluster: dask's own, without the HTTP servers that they open.

dask starts these whether or not it shows a dashboard, and they ask for no certificate. This is the only
module that needs dask.distributed to be imported.
"""

from __future__ import annotations

import logging
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from typing import Any

distributed: Any = import_module("distributed")

#: A cluster of dask gives up a worker that is not back after 15 s, and starts no other. On a busy machine
#: it may take longer, and die again in between. Whether to wait is decided by who waits for the results.
KEPT = {"distributed.deploy.lost-worker-timeout": "24h"}
#: what the cluster's processes log: warnings, as those of a cluster of dask's own
LOGGED = logging.WARNING


class _WithoutHttp:
    """What dask calls to start an HTTP server does nothing."""

    def start_http_server(self, *_: Any, **__: Any) -> None:
        """Open no port."""


class QuietScheduler(_WithoutHttp, distributed.Scheduler):  # type: ignore[misc]
    """A scheduler that answers its clients and workers only."""


class QuietWorker(_WithoutHttp, distributed.Worker):  # type: ignore[misc]
    """A worker that answers its scheduler and the other workers only, and ends when these say so.

    A terminal sends an interruption to all processes: who waits for the results ends the workers then. What
    they would log of work that is given up, and of a scheduler that is gone, is no news to anyone.
    """

    def __init__(self, *arguments: Any, **options: Any) -> None:
        logging.getLogger("distributed.worker").setLevel(logging.CRITICAL)
        if threading.current_thread() is threading.main_thread():
            signal.signal(signal.SIGINT, signal.SIG_IGN)
        super().__init__(*arguments, **options)


def local_cluster(workers: int, folder: str, environment: dict[str, str], starting_s: float) -> Any:
    """Start a cluster that only this process and its own workers can talk to.

    Every connection is encrypted, and both of its ends must show a certificate made for this cluster alone:
    its key is in the memory of this process, and goes to the workers through the pipes that start them.
    """
    security = distributed.Security.temporary()
    shared = {"host": "127.0.0.1", "protocol": "tls://", "security": security}
    worker = {
        "cls": distributed.Nanny,
        "options": {
            **shared,
            "worker_class": QuietWorker,
            "nthreads": 1,
            "dashboard": False,
            "local_directory": folder,
            "env": environment,
            "death_timeout": starting_s,
            "silence_logs": LOGGED,
        },
    }
    return distributed.SpecCluster(
        workers=dict.fromkeys(range(workers), worker),
        scheduler={
            "cls": QuietScheduler,
            "options": {**shared, "port": 0, "dashboard": False, "dashboard_address": None},
        },
        security=security,
        silence_logs=LOGGED,
        name="modelgen",
    )


@contextmanager
def interrupted_afterwards() -> Iterator[None]:
    """Keep what interrupts or ends this process until a cluster has started: dask cannot end what has started
    in part.
    """
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    heard = {number: handler for number, handler in before.items() if callable(handler)}
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    came: list[int] = []
    for number in heard:
        signal.signal(number, lambda one, _: came.append(one))
    try:
        yield
    finally:
        for number, handler in heard.items():
            signal.signal(number, handler)
        for one in came[:1]:
            signal.raise_signal(one)
