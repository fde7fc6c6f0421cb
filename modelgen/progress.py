"""Progress of long work: its steps, and of lists how many are done, how fast, and the time left.

Work reports its steps (`step`) and its loops over long lists (`counted`). They are shown, on terminals only,
where that was enabled (`shown`), and steps are handed to whoever listens (`heard`): a library stays silent.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TYPE_CHECKING, TextIO, TypeVar

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress, TaskID

T = TypeVar("T")


def is_terminal(stream: TextIO | None) -> bool:
    """Return whether a stream is a terminal; one that was closed is None, or fails."""
    try:
        return stream is not None and stream.isatty()
    except ValueError:
        return False


class _Display:
    """One line a list that is being worked through, the outermost first; nothing between two lists."""

    def __init__(self, console: Console | None) -> None:
        self._console = console
        self._progress: Progress | None = None

    def tell(self, what: str) -> None:
        # the steps of each item of a list would hide how many are done
        if self._progress is None:
            stream = sys.stderr if self._console is None else self._console.file
            stream.write(f"{what} ...\n")

    def begin(self, what: str, total: int) -> TaskID:
        if self._progress is None:
            self._progress = _progress(self._console)
            self._progress.start()
        return self._progress.add_task(what, total=total)

    def advance(self, task: TaskID) -> None:
        if self._progress is not None:
            self._progress.advance(task)

    def end(self, task: TaskID) -> None:
        if self._progress is None:
            return
        self._progress.refresh()
        self._progress.remove_task(task)
        if not self._progress.tasks:
            self._progress.stop()
            self._progress = None


_display: ContextVar[_Display | None] = ContextVar("display", default=None)
_listeners: ContextVar[tuple[Callable[[str], None], ...]] = ContextVar("listeners", default=())


@contextmanager
def heard(listener: Callable[[str], None]) -> Iterator[None]:
    """Call a listener with a few words before each step of what is done within."""
    token = _listeners.set((*_listeners.get(), listener))
    try:
        yield
    finally:
        _listeners.reset(token)


def step(what: str) -> None:
    """Report that a step of long work begins; a few words."""
    for listener in _listeners.get():
        listener(what)


@contextmanager
def shown(console: Console | None = None) -> Iterator[None]:
    """Show steps and what is counted within, on stderr: "reading 3/12, 1.4/s, 0:00:06".

    Nothing is shown where stderr goes to a file or another program. `console` takes the place of stderr.
    """
    if console is None and not is_terminal(sys.stderr):
        yield
        return
    display = _Display(console)
    token = _display.set(display)
    try:
        with heard(display.tell):
            yield
    finally:
        _display.reset(token)


def counted(items: Sequence[T], what: str) -> Iterator[T]:
    """Yield the items and count them where progress is shown (`shown`); a single item is not reported."""
    display = _display.get()
    if display is None or len(items) < 2:
        yield from items
        return
    task = display.begin(what, len(items))
    try:
        for item in items:
            yield item
            display.advance(task)
    finally:
        display.end(task)


def _progress(console: Console | None) -> Progress:
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        ProgressColumn,
        Task,
        TimeRemainingColumn,
    )
    from rich.text import Text

    class Rate(ProgressColumn):
        def render(self, task: Task) -> Text:
            return Text(f"{task.speed:.3g}/s" if task.speed else "")

    columns = ("{task.description}", BarColumn(), MofNCompleteColumn(), Rate(), TimeRemainingColumn())
    # what goes to stdout is the answer, and none of the display's business
    return Progress(
        *columns,
        console=console or Console(stderr=True),
        transient=True,
        redirect_stdout=False,
        redirect_stderr=False,
    )
