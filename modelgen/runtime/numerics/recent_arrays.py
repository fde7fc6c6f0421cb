"""RecentArrays: arrays made of one thing, each made once as long as there is room; the newest stay."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from threading import Lock
from typing import Any

import numpy.typing as npt


class RecentArrays:
    """Arrays by key, not to be changed; several threads may ask at a time.

    Parameters
    ----------
    room : int
        Bytes that are kept; what was asked for longest ago goes first.
    """

    def __init__(self, room: int) -> None:
        self._room, self._size = room, 0
        self._found: dict[Hashable, npt.NDArray[Any]] = {}
        self._lock = Lock()

    def of(self, key: Hashable, make: Callable[[], npt.NDArray[Any]]) -> npt.NDArray[Any]:
        """Return the array under a key, of any shape, made when there is none."""
        with self._lock:
            found = self._found.pop(key, None)
            if found is not None:
                self._found[key] = found
                return found
        made = make()
        made.flags.writeable = False
        with self._lock:
            other = self._found.pop(key, None)  # another thread may have made it meanwhile
            self._size += made.nbytes - (0 if other is None else other.nbytes)
            self._found[key] = made
            while self._size > self._room:
                self._size -= self._found.pop(next(iter(self._found))).nbytes
        return made

    def clear(self) -> None:
        """Let go of all of them."""
        with self._lock:
            self._found.clear()
            self._size = 0
