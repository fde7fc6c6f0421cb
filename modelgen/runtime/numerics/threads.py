"""How many threads a process may use, and the memory that the C library keeps for each of them."""

from __future__ import annotations

import os
import sys
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor, wait
from functools import lru_cache
from multiprocessing import parent_process
from threading import local
from typing import TypeVar

Item = TypeVar("Item")
Found = TypeVar("Found")

# So many results a thread, made or being made, are ahead of the one that is asked for.
WAITING = 2

_here = local()


def usable_threads() -> int:
    """Return how many cores this process may use; 1 in a worker process, one of several."""
    if parent_process() is not None:
        return 1
    if hasattr(os, "sched_getaffinity"):  # not on Windows and macOS
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def each(work: Callable[[Item], Found], items: Iterable[Item], count: int) -> Iterator[Found]:
    """Yield what a function makes of each of `count` items, in their order; several threads take one each.

    No item is kept once it has been worked on, and few results wait for who asks for them. What a thread
    calls in turn runs in that thread.
    """
    workers = min(usable_threads(), count)
    if workers <= 1 or getattr(_here, "is_worker", False):
        yield from map(work, items)
        return
    pool, waiting = _workers(usable_threads(), os.getpid()), deque[Future[Found]]()
    try:
        for item in items:
            waiting.append(pool.submit(work, item))
            if len(waiting) >= WAITING * workers:
                yield waiting.popleft().result()
        while waiting:
            yield waiting.popleft().result()
    finally:
        for one in waiting:
            one.cancel()
        wait(waiting)


@lru_cache(maxsize=1)  # threads that are begun anew for every pass cost as much as a short one
def _workers(count: int, process: int) -> ThreadPoolExecutor:
    """Return the threads of a process, by its number: one that is forked off has none."""
    return ThreadPoolExecutor(count, initializer=lambda: setattr(_here, "is_worker", True))


def give_back_freed() -> None:
    """Give memory that was freed back to the system; glibc keeps up to tens of MB of it for each thread."""
    if sys.platform != "linux":
        return
    from ctypes import CDLL

    trim = getattr(CDLL(None), "malloc_trim", None)  # other C libraries have none
    if trim is not None:
        trim(0)


def meanwhile(work: Callable[[], Found], here: bool = False) -> Callable[[], Found]:
    """Return what gives the result of a function, which another thread works on from now on if there is one.

    Without one, or `here`, it is worked out at once; what goes wrong is raised by who asks for the result.
    """
    if here or usable_threads() == 1:
        found: Future[Found] = Future()
        try:
            found.set_result(work())
        except Exception as error:
            found.set_exception(error)
        return found.result
    pool = ThreadPoolExecutor(1)
    result = pool.submit(work).result
    pool.shutdown(wait=False)
    return result
