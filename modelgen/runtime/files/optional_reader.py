"""A file format whose library is not installed: one error that says how to get it."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import Any

from modelgen.errors import DataError


def reader_library(name: str, path: Path) -> Any:
    """Return a library of the extra `io`.

    Raises
    ------
    DataError
        When it is not installed; `path` is the file that needs it.
    """
    try:
        return import_module(name)
    except ImportError as error:
        what = f"needs {name.partition('.')[0]}, which is not installed"
        raise DataError.at(str(path), what, "get it with: pip install 'modelgen[io]'") from error


def unreadable(path: Path, kind: str, error: Exception) -> DataError:
    """Return the error for a file that its library refuses."""
    reason = str(error).strip().splitlines()[0] if str(error).strip() else type(error).__name__
    return DataError.at(str(path), f"is no readable {kind} ({reason})", "check the file, or export it again")
