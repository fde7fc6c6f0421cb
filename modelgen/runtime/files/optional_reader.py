"""Libraries that read formats: one error where one is not installed or fails, its messages kept apart."""

from __future__ import annotations

import logging
import sys
from collections.abc import Iterator
from contextlib import contextmanager
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


class _Kept(logging.Handler):
    """Keeps messages, each once."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.messages: dict[str, None] = {}

    def emit(self, record: logging.LogRecord) -> None:
        """Keep one message, on one line."""
        self.messages[" ".join(record.getMessage().split())] = None


def _ignored(_: object) -> None:
    """Ignore an exception in a destructor."""


@contextmanager
def kept_log(library: str) -> Iterator[dict[str, None]]:
    """Collect the messages of a library's loggers while the block runs: the keys of what is yielded.

    What its objects raise as they are deleted is not printed either.
    """
    loggers = [logging.getLogger(library)]
    loggers += [
        logging.getLogger(name)
        for name in sorted(logging.Logger.manager.loggerDict)
        if name.startswith(f"{library}.")
    ]
    before = [(logger, logger.handlers, logger.propagate) for logger in loggers]
    kept, hook = _Kept(), sys.unraisablehook
    try:
        sys.unraisablehook = _ignored
        for logger in loggers:
            logger.handlers, logger.propagate = [kept], False
        yield kept.messages
    finally:
        sys.unraisablehook = hook
        for logger, handlers, propagate in before:
            logger.handlers, logger.propagate = handlers, propagate
