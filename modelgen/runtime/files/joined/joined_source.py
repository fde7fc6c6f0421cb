"""Several files of one record, "motor.csv,load.csv", as one source: every column keeps the times of its file.

What brings the channels onto common times knows columns with times of their own; here the files' times are
only made comparable: in seconds, and, where they are dates, from one instant.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from modelgen.errors import DataError, Problem, listed
from modelgen.runtime.files.formats import open_source
from modelgen.runtime.files.source import Columns, Source
from modelgen.runtime.files.units import unit_from_text

SEPARATOR = ","


def paths_of(path: Path) -> tuple[Path, ...]:
    """Return the files that a path names: one, or several with commas between them.

    A file whose own name holds a comma is that file.
    """
    text = str(path)
    if SEPARATOR not in text or _is_there(path):
        return (path,)
    return tuple(Path(part.strip()) for part in text.split(SEPARATOR) if part.strip()) or (path,)


def _is_there(path: Path) -> bool:
    try:
        return path.exists()
    except OSError:  # a name too long
        return False


def open_record(path: Path, time: str | None = None, time_unit: str | None = None) -> Source:
    """Open the file, or the files, of one record.

    Parameters
    ----------
    path : Path
        A file, or several with commas between them.
    time, time_unit : str, optional
        Column of times and its unit, of several files only: in every file that has such a column, or that
        states no unit.

    Raises
    ------
    DataError
        As `open_source`, and when one of several files has no times, or has other times than the others.
    """
    paths = paths_of(path)
    if len(paths) == 1:
        return open_source(paths[0])
    parts = [_part(open_source(one), time, time_unit) for one in paths]
    _check(parts)
    return _joined(parts)


@dataclass(frozen=True)
class _Part:
    """A file: its column of times, their factor to s, and the instant they count from (ns), if that is known.

    `dated` says that they are dates, counted from the first.
    """

    source: Source
    clock: str | None
    factor: float
    dated: bool
    start: int | None


def _part(source: Source, time: str | None, time_unit: str | None) -> _Part:
    asked = source.column(time) if time else None
    clock = asked if asked in source.known else source.clock
    unit = unit_from_text(source.units.get(clock or "", "") or time_unit or "")
    dated = clock in source.starts
    return _Part(
        source,
        clock,
        unit.factor if unit and unit.si == "s" else 1.0,
        dated,
        source.starts.get(clock or ""),
    )


def _check(parts: Sequence[_Part]) -> None:
    remedy = "files of one record are brought together by their times: name their column with --time"
    problems = [
        Problem(str(part.source.path), "has no column of times", remedy) for part in parts if not part.clock
    ]
    dates = [part for part in parts if part.dated]
    if dates and (len(dates) < len(parts) or any(part.start is None for part in dates)):
        odd = next(part for part in parts if not part.dated or part.start is None)
        what = f"does not say when its times begin, as those of {listed(p.source.path.name for p in dates)}"
        problems.append(
            Problem(str(odd.source.path), what, "write the times of all files as dates, or all in seconds")
        )
    DataError.raise_any(problems)


def _joined(parts: Sequence[_Part]) -> Source:
    first = min((part.start for part in parts if part.start is not None), default=0)
    places: dict[str, tuple[int, str]] = {}
    units: dict[str, str] = {}
    clocks: dict[str, str] = {}
    shifts: dict[str, tuple[float, float]] = {}
    scalars: dict[str, float] = {}
    took = ["one record of several files, by their times"]
    for k, part in enumerate(parts):
        source, own = part.source, dict[str, str]()
        for name in source.names:
            own[name] = _name_in(name, source.path.stem, places)
            places[own[name]] = (k, name)
        units |= {own[name]: unit for name, unit in source.units.items() if name in own}
        times = {*source.clocks.values(), part.clock}
        for name in own.keys() - times:
            clocks[own[name]] = own[str(source.clocks.get(name, part.clock))]
        shift = 1e-9 * (part.start - first) if part.start is not None else 0.0
        for stamped in (own[clock] for clock in times if clock is not None):
            shifts[stamped], units[stamped] = (part.factor, shift), "s"
        for name, value in source.scalars.items():
            scalars.setdefault(name, value)
        took += [f"{source.path.name}: {text}" for text in source.took]
    load = _loader([part.source for part in parts], places, shifts)
    ordered = {name: clocks[name] for name in places if name in clocks}
    return Source(
        parts[0].source.path,
        tuple(places),
        load,
        scalars,
        name=parts[0].source.name,
        tag=parts[0].source.tag,
        units=units,
        clocks=ordered,
        took=tuple(took),
        of_matrices=frozenset(n for n, (k, name) in places.items() if name in parts[k].source.of_matrices),
        joined=True,
    )


def _name_in(name: str, stem: str, taken: dict[str, tuple[int, str]]) -> str:
    """Return the name of a column among all: what an earlier file has, too, says of which file it is."""
    if name not in taken:
        return name
    found, count = f"{name} ({stem})", 1
    while found in taken:
        count += 1
        found = f"{name} ({stem} {count})"
    return found


def _loader(
    sources: Sequence[Source], places: dict[str, tuple[int, str]], shifts: dict[str, tuple[float, float]]
) -> Callable[[Sequence[str]], Columns]:
    def load(names: Sequence[str]) -> Columns:
        found: Columns = {}
        for k, source in enumerate(sources):
            asked = {name: places[name][1] for name in names if places[name][0] == k}
            read = source.load(tuple(asked.values())) if asked else {}
            found |= {name: read[own] for name, own in asked.items()}
        for name in names:
            if name in shifts and found[name].dtype.kind in "iuf":
                factor, shift = shifts[name]
                found[name] = found[name] * factor + shift
        return {name: found[name] for name in names}

    return load
