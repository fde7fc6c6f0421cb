"""Messages of a reading library, kept off the screen: the user gets one message, from modelgen."""

from __future__ import annotations

import logging
import sys
from collections.abc import Iterator
from contextlib import contextmanager


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
