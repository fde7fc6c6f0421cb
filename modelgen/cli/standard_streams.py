"""Standard input, output and error of a process, which may be closed, full, or in an odd encoding."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress


@contextmanager
def usable_streams() -> Iterator[None]:
    """Have three open streams that take every character; at the end, drop what they could not write.

    A file that is opened while descriptor 1 or 2 is closed would get its number, and what a library prints.
    """
    _fill_closed()
    try:
        yield
    finally:
        # the interpreter would report what is left in the buffers where it cannot be caught
        for stream, number in ((sys.stdout, 1), (sys.stderr, 2)):
            if stream is not None and not _flushed(stream):
                _divert(number)
                _flushed(stream)


def _flushed(stream: object) -> bool:
    """Return whether everything in the buffer of a stream could be written."""
    try:
        stream.flush()  # type: ignore[attr-defined]
    except (OSError, ValueError):
        return False
    return True


def _fill_closed() -> None:
    for number, name, mode in ((0, "stdin", "r"), (1, "stdout", "w"), (2, "stderr", "w")):
        try:
            os.fstat(number)
        except OSError:
            _divert(number)
        if getattr(sys, name) is None:
            # it is to stay open for as long as the process runs
            setattr(sys, name, open(number, mode, encoding="utf-8", closefd=False))  # noqa: SIM115
        with suppress(AttributeError, OSError, ValueError):
            getattr(sys, name).reconfigure(errors="backslashreplace")


def _divert(number: int) -> None:
    """Redirect a descriptor to the null device."""
    null = os.open(os.devnull, os.O_RDWR)
    if null != number:
        os.dup2(null, number)
        os.close(null)
