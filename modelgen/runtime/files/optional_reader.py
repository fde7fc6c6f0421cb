"""A file format whose library is not installed: one error with the command that installs it."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from typing import Any

from modelgen.errors import DataError
from modelgen.optional_library import missing_library, optional_library

EXTRA = "io"


def reader_library(name: str, path: Path) -> Any:
    """Return a library of the extra `io`.

    Raises
    ------
    DataError
        When it is not installed; `path` is the file that needs it.
    """
    return optional_library(name, EXTRA, str(path))


def require_library(name: str, path: Path) -> None:
    """Raise the same DataError without importing the library: another process will."""
    if find_spec(name) is None:
        raise missing_library(name, EXTRA, str(path))


def unreadable(path: Path, kind: str, error: Exception) -> DataError:
    """Return the error for a file that its library refuses."""
    reason = str(error).strip().splitlines()[0] if str(error).strip() else type(error).__name__
    return DataError.at(str(path), f"is no readable {kind} ({reason})", "check the file, or export it again")
