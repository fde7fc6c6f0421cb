"""An attribute whose class lives in a package above, loaded when it is first used.

A value does not import what draws it: `record.plot` finds the drawing by its name, so that packages import
downward only and matplotlib is loaded by those who draw.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any


class LazyAccessor:
    """A class attribute that gives each instance `NAME(instance)`, with NAME of a module loaded on demand."""

    def __init__(self, module: str, name: str) -> None:
        self._module, self._name = module, name

    def __get__(self, instance: object, owner: type[Any]) -> Any:
        home = getattr(import_module(self._module), self._name)
        # asked of the class, it is what help() and completion should show
        return home if instance is None else home(instance)
