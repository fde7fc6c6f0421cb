"""Formats whose library crashes on damaged files are read in a separate process.

Some files make libhdf5 and asammdf end with a segmentation fault or loop without end. Their process is then
started again for the next file, and this process continues. See `reader_child`.
"""

from __future__ import annotations

import atexit
import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from math import prod
from pathlib import Path
from threading import Lock
from typing import IO, Any

import numpy as np
import numpy.typing as npt

from modelgen.errors import DataError
from modelgen.read_file import DATA, check_file
from modelgen.runtime.files.child_process.reader_child import BUFFER, PLAIN
from modelgen.runtime.files.optional_reader import require_library, unreadable

# the path of imports is given, so that neither the environment nor the working directory decides on it
START = (
    "import json, sys; sys.path[:] = json.loads(sys.argv[1]); "
    "from modelgen.runtime.files.child_process.reader_child import serve; serve()"
)
KINDS = {
    "hdf5": ("HDF5 file", "h5py"),
    "mdf": ("MDF file", "asammdf"),
    "mcap": ("MCAP file", "mcap_ros2"),
    "rosbag": ("ROS bag", "numpy"),
}
MORE_ARGUMENTS: tuple[str, ...] = ()


class DeadlyFileError(DataError):
    """A file whose reading process ended; reading it again in parts would end it again."""


class _Gone(Exception):
    """The process ended instead of answering; `too_long` says that the system stopped it."""

    def __init__(self, why: str, too_long: bool = False) -> None:
        super().__init__(why)
        self.too_long = too_long


@dataclass(eq=False)
class _Reader:
    """A process that reads files of one kind; `owner` is the process that started it."""

    owner: int = 0
    process: subprocess.Popen[bytes] | None = None
    lock: Lock = field(default_factory=Lock)

    def answers(self, line: bytes) -> list[Any]:
        """Return what a call yields; a process that has ended is started again once."""
        with self.lock:
            alive = self.process is not None and self.owner == os.getpid() and self.process.poll() is None
            if not alive:
                self._start()
            try:
                return self._all_of(line)
            except _Gone as error:
                if not alive or error.too_long:
                    raise
            self._start()
            return self._all_of(line)

    def _all_of(self, line: bytes) -> list[Any]:
        """Return all answers; an interruption ends the process, or the next call would read on."""
        try:
            return list(self._asked(line))
        except BaseException:
            self.end()
            raise

    def _start(self) -> None:
        self.end()
        paths = json.dumps([path for path in sys.path if path])
        self.process = subprocess.Popen(
            [sys.executable, "-I", "-c", START, paths, *MORE_ARGUMENTS],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            bufsize=BUFFER,
        )
        self.owner = os.getpid()

    def _asked(self, line: bytes) -> Iterator[Any]:
        process = self.process
        assert process is not None and process.stdin is not None and process.stdout is not None
        try:
            process.stdin.write(line)
            process.stdin.flush()
            while answer := process.stdout.readline():
                found = json.loads(answer)
                if "array" in found:
                    yield _array(found, process.stdout)
                elif "part" in found:
                    yield found["part"]
                else:
                    yield found
                    return
        except (OSError, ValueError, TypeError, KeyError, MemoryError) as error:
            raise self._death() from error
        raise self._death()

    def _death(self) -> _Gone:
        """Return why the process ended; one that answers with anything but answers is ended now."""
        assert self.process is not None
        try:
            code = self.process.wait(timeout=1.0)
        except subprocess.TimeoutExpired:
            code = 0
        self.end()
        name = next((known.name for known in signal.Signals if known == -code), f"code {code}")
        if name == "SIGXCPU":
            return _Gone("reading it takes far longer than a file of its size should", too_long=True)
        return _Gone(f"the library that reads it ended with {name}")

    def end(self) -> None:
        """End the process, if this one started it."""
        process, self.process = self.process, None
        if process is None or self.owner != os.getpid():
            return
        with suppress(OSError):
            process.kill()
        process.wait()
        for stream in (process.stdin, process.stdout):
            _close(stream)


_READERS = {kind: _Reader() for kind in KINDS}


@atexit.register
def end_all() -> None:
    """End the reading processes; they are started again when they are needed."""
    for reader in _READERS.values():
        reader.end()


def ask(call: str, path: Path, **arguments: Any) -> list[Any]:
    """Return everything that a call ("hdf5.listing") yields for a file: plain values and arrays.

    Raises
    ------
    OSError
        When the file cannot be opened.
    DataError
        When the library is missing or the file is none of its kind.
    DeadlyFileError
        When the process that read it ended.
    """
    what, library = KINDS[call.partition(".")[0]]
    require_library(library, path)
    check_file(path, DATA)
    asked = {"call": call, "path": str(path.absolute()), "arguments": arguments}
    try:
        *parts, last = _READERS[call.partition(".")[0]].answers(json.dumps(asked).encode() + b"\n")
    except _Gone as error:
        raise DeadlyFileError(*unreadable(path, what, error).problems) from error
    if "failed" in last:
        raise unreadable(path, what, ValueError(last["failed"]))
    return parts


def _array(stated: dict[str, Any], stream: IO[bytes]) -> npt.NDArray[Any]:
    dtype = np.dtype(str(stated["array"]))
    size = prod(stated["shape"]) * dtype.itemsize
    data = stream.read(size)
    if dtype.kind not in PLAIN or len(data) != size:
        raise ValueError("an array ends too early")
    return np.frombuffer(data, dtype).reshape(stated["shape"])


def _close(stream: IO[bytes] | None) -> None:
    if stream is not None:
        with suppress(OSError):
            stream.close()
