"""A library that only some users need: one error with the command that installs it."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from modelgen.errors import DataError


def optional_library(name: str, extra: str, where: str) -> Any:
    """Return a library, or a module of one, that comes with an extra of modelgen.

    Raises
    ------
    DataError
        When it is not installed; `where` is what needs it.
    """
    try:
        return import_module(name)
    except ImportError as error:
        raise missing_library(name, extra, where) from error


def missing_library(name: str, extra: str, where: str) -> DataError:
    """Return the error for a library that is not installed."""
    what = f"needs {name.partition('.')[0]}, which is not installed"
    return DataError.at(where, what, f"get it with: pip install 'modelgen[{extra}]'")
