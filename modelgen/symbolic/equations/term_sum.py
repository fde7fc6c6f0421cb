"""Pausing Python's cyclic garbage collector while a derivation builds its terms.

A long chain makes hundreds of thousands of small tuples, none of them in a cycle. The collector would visit
all of them again and again while they are made, so that the cost would grow faster than the chain.
"""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def paused_collector() -> Iterator[None]:
    """Pause the cyclic collector, unless it is off already; memory is still freed by reference counts."""
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()
