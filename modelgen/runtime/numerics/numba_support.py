"""Loops made machine code by numba, where the extra "fast" is installed: never needed, the same answer."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from functools import lru_cache
from typing import Any

from modelgen.errors import DataError

# sums may be taken in any order and products be fused with them; NaN and infinity keep their meaning
ORDER_FREE = {"contract": True, "reassoc": True}


@lru_cache(maxsize=8)
def compiled(function: Callable[..., Any], parts: tuple[Callable[..., Any], ...] = ()) -> Any:
    """Return a function compiled, with the functions that it calls; None where numba does not work.

    The machine code is cached next to the module where that folder can be written.
    """
    try:
        from numba import njit
        from numba.extending import register_jitable
    except Exception:  # absent, or incompatible with another installed package
        return None
    for part in parts:
        register_jitable(fastmath=ORDER_FREE)(part)
    return kept_code(njit, function, nogil=True, fastmath=ORDER_FREE)


def kept_code(njit: Callable[..., Any], function: Callable[..., Any], **options: Any) -> Callable[..., Any]:
    """Return a function compiled by `njit`; on a full disk its code is not kept, and it runs all the same."""
    running = _loaded_alone(njit(cache=True, **options)(function))

    def call(*arguments: Any) -> Any:
        nonlocal running
        try:
            return running(*arguments)
        except OSError:  # raised when the code is to be written, before it runs
            running = njit(**options)(function)
            return running(*arguments)

    return call


def _loaded_alone(function: Any) -> Any:
    """Return a compiled function whose kept code is loaded without numba's tables of what may be compiled.

    Reading these takes a third of a second, as long as a short record takes to be identified, and code that
    is compiled already has no use for them.
    """
    cache = getattr(function, "_cache", None)
    if cache is None:
        return function
    load = cache.load_overload

    def load_alone(signature: Any, context: Any) -> Any:
        with suppress(Exception):  # numba may do this otherwise one day, and then loads its own way
            from numba.core.runtime.nrt import rtsys

            rtsys.initialize(context)
            found = cache._load_overload(signature, context)
            if found is not None:
                return found
        return load(signature, context)

    cache.load_overload = load_alone
    return function


def wanted(fast: bool | None, loops: Any) -> Any:
    """Return the compiled loops, or None where NumPy alone is wanted.

    Parameters
    ----------
    fast : bool, optional
        Whether to use them; by default wherever there are any.
    loops : callable or None
        As returned by `compiled`.

    Raises
    ------
    DataError
        When they are asked for and numba is not there.
    """
    if fast and loops is None:
        what, remedy = "asks for compiled code, and numba cannot be imported", "install modelgen[fast]"
        raise DataError.at("fast", what, remedy)
    return None if fast is False else loops
