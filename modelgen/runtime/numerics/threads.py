"""How many threads a process may use."""

from __future__ import annotations

import os
from multiprocessing import parent_process


def usable_threads() -> int:
    """Return how many cores this process may use; 1 in a worker process, one of several."""
    if parent_process() is not None:
        return 1
    if hasattr(os, "sched_getaffinity"):  # not on Windows and macOS
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
