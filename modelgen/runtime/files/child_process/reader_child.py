"""The reading process: it answers calls of `reader_process` until its input is closed.

A call is a line of JSON: {"call": "hdf5.listing", "path": ..., "arguments": {...}}. The answer is a line of
JSON for everything that the call yields, {"part": ...} or {"array": type, "shape": ...} followed by the
array's bytes, and a last line: {"done": true}, or {"failed": ...} for what went wrong. Nothing is pickled.
"""

from __future__ import annotations

import gc
import json
import os
import sys
import warnings
from collections.abc import Callable, Iterator
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from modelgen.read_file import ALWAYS_FINE, LARGEST_RATIO
from modelgen.runtime.files.optional_reader import reader_library

PLAIN = "biufcSUmM"  # kinds of arrays whose bytes are all there is
Call = Callable[..., Iterator[Any]]
BUFFER = 1 << 20  # bytes of a pipe
PATIENCE_S, BYTES_PER_S = 2, 2_000_000  # of processor time for a file, and more for a large one
SLOW = {
    "mcap": 50_000,
    "rosbag": 50_000,
}  # bytes/s where the library decodes message by message, from packed files
# the module that answers a kind of call, and the library that it needs
MODULES = {
    "hdf5": ("modelgen.runtime.files.child_process.hdf5_calls", "h5py"),
    "mdf": ("modelgen.runtime.files.child_process.mdf_calls", "asammdf"),
    "mcap": ("modelgen.runtime.files.child_process.mcap_calls", "mcap_ros2"),
    "rosbag": ("modelgen.runtime.files.child_process.rosbag_calls", "numpy"),
}


def serve() -> None:
    """Answer calls from standard input on standard output."""
    answers = os.fdopen(os.dup(1), "wb", BUFFER)
    nothing = os.open(os.devnull, os.O_WRONLY)
    for stream in (1, 2):  # what a library prints must not come between the answers, nor onto a screen
        os.dup2(nothing, stream)
    warnings.simplefilter("ignore")
    for line in sys.stdin.buffer:
        _answer(json.loads(line), answers)
        answers.flush()


def _answer(asked: dict[str, Any], answers: BinaryIO) -> None:
    kind, _, name = asked["call"].partition(".")
    path = Path(asked["path"])
    module, library = MODULES[kind]
    try:
        reader_library(library, path)  # how long that takes is not the file's fault
        call: Call = getattr(import_module(module), name)
        _limit(path.stat().st_size, SLOW.get(kind, BYTES_PER_S))
        for part in call(path, **asked["arguments"]):
            if isinstance(part, np.ndarray):
                if part.dtype.kind not in PLAIN:
                    raise TypeError(f"a column is of type {part.dtype}")
                _say(answers, {"array": part.dtype.str, "shape": part.shape})
                answers.write(np.ascontiguousarray(part).data.cast("B") if part.size else b"")
            else:
                _say(answers, {"part": part})
        last: dict[str, Any] = {"done": True}
    except Exception as error:  # a damaged file breaks the libraries in many ways
        last = {"failed": str(error) or type(error).__name__}
        error.__traceback__ = None  # it holds a file half opened
        gc.collect()
    _say(answers, last)


def _say(answers: BinaryIO, what: dict[str, Any]) -> None:
    answers.write(json.dumps(what).encode() + b"\n")


def _limit(size: int, bytes_per_s: int) -> None:
    """Let the system end this process when a file of this size takes too long or too much memory."""
    with suppress(ImportError, OSError, ValueError):  # where the system has such limits
        import resource

        _, hard = resource.getrlimit(resource.RLIMIT_CPU)
        used = resource.getrusage(resource.RUSAGE_SELF)
        allowed = int(used.ru_utime + used.ru_stime) + PATIENCE_S + size // bytes_per_s
        resource.setrlimit(resource.RLIMIT_CPU, (allowed, hard))
        _, hard = resource.getrlimit(resource.RLIMIT_AS)
        pages = int(Path("/proc/self/statm").read_text().split()[0])
        memory = pages * resource.getpagesize() + ALWAYS_FINE + LARGEST_RATIO * size
        resource.setrlimit(resource.RLIMIT_AS, (memory, hard))
