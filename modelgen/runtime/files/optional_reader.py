"""A file format whose library is not installed: one error with the command that installs it."""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec
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
        raise _missing(name, path) from error


def require_library(name: str, path: Path) -> None:
    """Raise the same DataError without importing the library: another process will."""
    if find_spec(name) is None:
        raise _missing(name, path)


def _missing(name: str, path: Path) -> DataError:
    what = f"needs {name.partition('.')[0]}, which is not installed"
    return DataError.at(str(path), what, "get it with: pip install 'modelgen[io]'")


def unreadable(path: Path, kind: str, error: Exception) -> DataError:
    """Return the error for a file that its library refuses."""
    reason = str(error).strip().splitlines()[0] if str(error).strip() else type(error).__name__
    return DataError.at(str(path), f"is no readable {kind} ({reason})", "check the file, or export it again")
