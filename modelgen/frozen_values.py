"""Dataclasses that nobody can change: read-only arrays and mappings, which survive pickling."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from types import MappingProxyType
from typing import Any

import numpy as np
import numpy.typing as npt


class FrozenValues:
    """Base of frozen dataclasses: arrays become read-only copies, mappings read-only views of copies.

    What is read-only already, and no view of anything else, stays as it is.
    """

    def __post_init__(self) -> None:
        for name, value in self._values().items():
            if isinstance(value, np.ndarray):
                object.__setattr__(self, name, read_only(value))
            elif isinstance(value, Mapping):
                object.__setattr__(self, name, MappingProxyType(dict(value)))

    def __reduce__(self) -> tuple[Any, ...]:
        # a mapping proxy cannot be sent to another process, a dict can
        plain = {k: dict(v) if isinstance(v, MappingProxyType) else v for k, v in self._values().items()}
        return _rebuild, (type(self), plain)

    def _values(self) -> dict[str, Any]:
        return {field.name: getattr(self, field.name) for field in fields(self)}  # type: ignore[arg-type]


def read_only(value: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Return numbers, of any shape and unit, that nobody can change: themselves if they are that already."""
    kind = complex if np.iscomplexobj(value) else float
    if value.flags.writeable or value.base is not None or value.dtype != kind:
        value = np.array(value, dtype=kind)
        value.flags.writeable = False
    return value


def _rebuild(kind: type[Any], values: dict[str, Any]) -> Any:
    return kind(**values)
