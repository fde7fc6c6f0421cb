"""Templates of the user -> texts, in a process of their own with limits of time and memory.

The sandbox isolates a template; it does not stop recursion, a loop of 10**12 rounds or gigabytes of output.
Where the system cannot fork processes (Windows), there is the sandbox only.
"""

from __future__ import annotations

import json
import os
import select
import signal
import sys
import warnings
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from time import monotonic
from typing import Any

import jinja2
from jinja2.sandbox import ImmutableSandboxedEnvironment

from modelgen.errors import Problem, RenderError
from modelgen.read_file import TEMPLATE, read_text

SECONDS = 2  # of the processor for all templates of one model: a million expressions
LATEST_S = 30.0  # by the clock, where many processes share it
MEGABYTES = 256  # beyond what the process has already
LARGEST_OUTPUT = 50_000_000  # characters of all files of one model
REMEDY = "correct the template"
Files = dict[str, str]


def render_templates(folder: Path, names: Mapping[str, str], fields: Mapping[str, Any]) -> Files:
    """Return what templates make of the fields.

    Parameters
    ----------
    folder : Path
        Where they, and what they include, are.
    names : mapping of str to str
        Template to the name of the file it makes.
    fields : mapping
        What the templates see.

    Raises
    ------
    RenderError
        When one fails, takes too long or too much memory, or reads a file outside of its folder.
    """

    def work() -> Any:
        try:
            return {"files": _render(folder, names, fields)}
        except RenderError as error:
            return {"problems": [[p.where, p.what, p.remedy] for p in error.problems]}

    answer = _apart(work, str(folder)) if hasattr(os, "fork") else work()
    if "problems" in answer:
        raise RenderError(*(Problem(*problem) for problem in answer["problems"]))
    files: Files = answer["files"]
    return files


def _render(folder: Path, names: Mapping[str, str], fields: Mapping[str, Any]) -> Files:
    env = ImmutableSandboxedEnvironment(
        loader=jinja2.FunctionLoader(lambda name: _source(folder, name)),
        undefined=jinja2.StrictUndefined,
        autoescape=False,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    files = {}
    left = LARGEST_OUTPUT
    for template, name in names.items():
        try:
            pieces = []
            for piece in env.get_template(template).generate(fields):
                left -= len(piece)
                if left < 0:
                    raise ValueError(f"writes more than {LARGEST_OUTPUT / 1e6:g} MB")
                pieces.append(piece)
            files[name] = "".join(pieces)
            files[name].encode()
        except Exception as error:  # a template can raise any exception
            line = getattr(error, "lineno", None)
            where = f"{folder / template}" + (f": line {line}" if line else "")
            raise RenderError.at(where, f"fails ({_reason(error)})", REMEDY) from error
    return files


def _reason(error: Exception) -> str:
    if isinstance(error, RecursionError):
        return "it calls, includes or extends itself without end"
    if isinstance(error, MemoryError):
        return f"it needs more than {MEGABYTES} MB"
    if isinstance(error, RenderError):  # of what it includes
        return "; ".join(f"{problem.where} {problem.what}" for problem in error.problems)
    return str(error) or type(error).__name__


def _source(folder: Path, name: str) -> str | None:
    """Return the text of a template of the folder, None if it has none of the name."""
    place = folder / name
    if not os.path.lexists(place):
        return None
    try:
        real, root = place.resolve(strict=True), folder.resolve(strict=True)
    except (OSError, RuntimeError, ValueError) as error:  # a link to itself
        raise RenderError.at(str(place), f"cannot be read ({error})", TEMPLATE.remedy) from error
    if not real.is_relative_to(root):
        what = "leads out of the folder of templates"
        raise RenderError.at(str(place), what, "copy what it leads to into the folder")
    return read_text(real, TEMPLATE)


def _apart(work: Callable[[], Any], where: str) -> Any:
    """Return what `work` returns, in JSON's types, done by a child with limits."""
    reading, writing = os.pipe()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # of threads, none of which the child needs
        child = os.fork()
    if child == 0:
        _in_child(work, writing)
    try:
        os.close(writing)
        content = _all_of(reading)
    finally:
        os.close(reading)
        with suppress(ProcessLookupError):
            os.kill(child, signal.SIGKILL)  # one that has answered is at its end
        _, status = os.waitpid(child, 0)
    if content is not None and content.endswith(b"}"):
        return json.loads(content)
    slow = content is None or (os.WIFSIGNALED(status) and os.WTERMSIG(status) == signal.SIGXCPU)
    what = (
        f"take longer than {SECONDS} s"
        if slow
        else f"need more than {MEGABYTES} MB, or break the interpreter"
    )
    raise RenderError.at(where, f"its templates {what} for one model", REMEDY)


def _in_child(work: Callable[[], Any], writing: int) -> None:
    """Do the work under limits, write the answer, and end."""
    code = 1
    try:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
        _limit()
        content = json.dumps(work()).encode()
        with open(writing, "wb") as pipe:
            pipe.write(content)
        code = 0
    finally:
        os._exit(code)  # nothing of the parent is the child's to finish


def _limit() -> None:
    import resource

    used = resource.getrusage(resource.RUSAGE_SELF)
    seconds = round(used.ru_utime + used.ru_stime) + SECONDS
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds + 1))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    with suppress(OSError, ValueError):  # other systems than Linux do not report, and do not limit
        pages = int(Path("/proc/self/statm").read_text().split()[0])
        size = pages * resource.getpagesize() + MEGABYTES * 1_000_000
        resource.setrlimit(resource.RLIMIT_AS, (size, size))
    sys.setrecursionlimit(1000)


def _all_of(reading: int) -> bytes | None:
    """Return what comes out of a pipe until its end, None where that takes too long."""
    pieces: list[bytes] = []
    end = monotonic() + LATEST_S
    while select.select([reading], [], [], max(end - monotonic(), 0.0))[0]:
        piece = os.read(reading, 1_000_000)
        if not piece:
            return b"".join(pieces)
        pieces.append(piece)
    return None
