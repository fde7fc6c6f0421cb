"""Progress of long work over many things: how many are done, how fast, and the time left; terminals only."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    from rich.console import Console

T = TypeVar("T")


def counted(items: Sequence[T], what: str, console: Console | None = None) -> Iterator[T]:
    """Yield the items, with a line on stderr that is gone at the end: "reading 3/12, 1.4/s, 0:00:06".

    Nothing is shown for a single item, nor where stderr goes to a file or another program. `console` takes
    the place of stderr.
    """
    if len(items) < 2 or (console is None and not sys.stderr.isatty()):
        yield from items
        return
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
    with Progress(*columns, console=console or Console(stderr=True), transient=True) as shown:
        task = shown.add_task(what, total=len(items))
        for item in items:
            yield item
            shown.advance(task)
