"""Files -> Record: which column is which channel, in which unit, sampled how fast."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypedDict, Unpack

import numpy as np
import numpy.typing as npt

from modelgen.array_types import FloatArray
from modelgen.errors import DataError, Problem
from modelgen.keyword_options import with_defaults
from modelgen.runtime.files.child_process.reader_process import DeadlyFileError
from modelgen.runtime.files.joined.joined_source import open_record
from modelgen.runtime.files.source import Columns, Source
from modelgen.runtime.files.timestamps import counter_said, gone_on
from modelgen.runtime.records.channel_checks import (
    CUT_OR_FILL,
    FILL,
    magnitude_problem,
    mending_remedy,
    missing_problem,
    restart_problems,
    zero_faults,
)
from modelgen.runtime.records.faults import (
    Finding,
    clock_faults,
    common_samples,
    reading_problems,
    same_clock,
    time_faults,
)
from modelgen.runtime.records.picked_columns import (
    Pick,
    pick_columns,
    shared_problems,
    taken_for,
    unit_problems,
    units_of_numbers,
)
from modelgen.runtime.records.record import Record, missing_name
from modelgen.runtime.records.repair import (
    OF_READINGS,
    Track,
    check_mends,
    join_clocks,
    mend_offsets,
    mend_readings,
    mend_repeats,
    mend_times,
    mend_turns,
)
from modelgen.runtime.records.sampling_frequency import sampling_frequency, slow_times, unit_of_times


@dataclass(frozen=True, eq=False)
class Reading:
    """A record with what its file was taken for, what was found wrong with it, and what was mended."""

    record: Record
    took: tuple[str, ...]
    findings: tuple[Finding, ...]
    mended: tuple[str, ...]


class ReadOptions(TypedDict, total=False):
    """Further options of `read_record`, which describes them."""

    needed: Sequence[str] | None
    welcome: Sequence[str]
    time_unit: str | None
    mend: Sequence[str]
    units: Mapping[str, str] | None
    stated_units: Mapping[str, str]


def read_record(
    path: str | Path,
    mapping: Mapping[str, str] | None = None,
    scales: Mapping[str, float | str] | None = None,
    fs: float | None = None,
    time: str | None = None,
    name: str | None = None,
    tag: str | None = None,
    **options: Unpack[ReadOptions],
) -> Record:
    """Read one record from a file.

    Parameters
    ----------
    path : str or Path
        A text table (``.csv``, ``.txt``, ``.tsv``) as people or instruments write it, ``.npz``, ``.mat``, and
        with the extra `io` ``.parquet``, ``.h5``, ``.mf4`` and ``.tdms``.
    mapping : mapping of str to str, optional
        Channel key to the file's column, a leading minus negates:
        ``{"q_m": "theta_mx", "q_c": "-theta_my"}``. A channel that is not mapped keeps its own key.
    scales : mapping of str to (float or str), optional
        Factor a channel is multiplied by, to bring it to SI units: a number, or the name of a scalar that the
        file holds. Without one, a unit that the file states is converted.
    fs : float, optional
        Sampling frequency in Hz. Otherwise what the file states (a scalar ``fs``), or the column of times.
    time : str, optional
        Column of times; by default the one named so (``t``, ``time``, ``Zeit``). It must agree with the
        sampling frequency that is given or stated, see `modelgen.runtime.records.sampling_frequency`.
    name, tag : str, optional
        Of the record; by default those the file states, else the file's name without suffix.
    needed : sequence of str, optional
        Keys to put into the record, usually ``model.channels``; by default the keys of `mapping`, and without
        a mapping every column but that of the times.
    welcome : sequence of str, optional
        Further keys, of which those are read that name a column.
    time_unit : str, optional
        Unit of the times; by default what the file states, else s.
    mend : sequence of str, optional
        What to mend, see `modelgen.runtime.records.repair`; nothing is mended that is not named here.
    units : mapping of str to str, optional
        SI unit of the channels, where the caller knows it (the model does).
    stated_units : mapping of str to str, optional
        Unit of the columns by channel, in place of what the file states.

    Raises
    ------
    DataError
        With one problem per mistake: the file, an absent column, a cell that is no number, non-uniform times,
        a sampling frequency that is missing or contradicted.
    """
    given = with_defaults(
        "read_record", options, ReadOptions, ReadOptions(welcome=(), mend=(), stated_units={})
    )
    return read(path, mapping, scales, fs, time, name, tag, **given).record


def read(
    path: str | Path | Source,
    mapping: Mapping[str, str] | None = None,
    scales: Mapping[str, float | str] | None = None,
    fs: float | None = None,
    time: str | None = None,
    name: str | None = None,
    tag: str | None = None,
    **options: Unpack[ReadOptions],
) -> Reading:
    """Read one record and report how the file was interpreted; the parameters are those of `read_record`.

    A `Source` that is open already may stand for its file.
    """
    given = with_defaults("read", options, ReadOptions, ReadOptions(welcome=(), mend=(), stated_units={}))
    needed, mend, units = given["needed"], given["mend"], given["units"] or {}
    time_unit = given["time_unit"]
    source = path if isinstance(path, Source) else open_record(Path(path), time, time_unit)
    path = source.path
    if source.joined:  # the times of its files are known by now
        time = time_unit = None
    time = source.column(time) if time else time
    if needed is None:
        others = {time or source.clock, *source.clocks.values(), *source.of_matrices}
        needed = tuple(mapping or (column for column in source.names if column not in others))
    there = (key for key in given["welcome"] if key in source.names)
    needed = tuple(dict.fromkeys((*needed, *there)))
    picks, problems = pick_columns(source, needed, mapping or {}, scales or {}, given["stated_units"])
    problems += [*shared_problems(source, picks, units), *unit_problems(source, picks, units)]
    clock = time or source.clock_apart_from({pick.column for pick in picks})
    if time is not None and time not in source.known:
        problems.append(missing_name(f"{path}: times", "column", time, source.names))
    DataError.raise_any(problems)
    check_mends(mend, [pick.key for pick in picks])
    stated = source.fs if fs is None else fs
    clocks = {pick.key: clock if time else source.clocks.get(pick.column, clock) for pick in picks}
    loaded = _load(source, picks, [c for c in clocks.values() if c], time is None and stated is not None)
    _check_magnitudes(path, loaded)
    _check_missing(path, loaded, picks, mend)
    signals = {pick.key: _in_si(loaded[pick.column], pick.factor) for pick in picks}
    turned = mend_turns(signals, mend)
    unit = unit_of_times(time_unit, source.units.get(next(iter(clocks.values()), None) or "", ""))
    as_float: Columns = {}  # once a column of times, however many channels have it
    times = {
        key: _times(source, loaded, as_float, c, signals[key], time is not None) for key, c in clocks.items()
    }
    track, findings = _together(source, clocks, times, unit.factor if unit else 1.0, turned.signals, mend)
    track = mend_repeats(replace(track, said=(*turned.said, *track.said)), mend)
    if problems := reading_problems(str(path), track.signals, units):
        raise DataError(*problems)
    si_units = {pick.key: pick.unit.si for pick in picks if pick.unit} | dict(units)
    findings += zero_faults(track.signals, si_units)
    track = mend_offsets(track, si_units, mend)
    label = next((c for c in clocks.values() if c), None)
    where = f"{path}: column {label}" if track.times.size else str(path)
    known = source.joined or unit is not None
    rate = sampling_frequency(where, stated, track.times if track.times.size else None, known)
    name = name or source.name or source.path.stem
    record = Record(track.signals, rate, name, source.tag if tag is None else tag, units_of_numbers(picks))
    slow = slow_times(label, rate) if stated is None and not known else ()
    full = [said for name, on in as_float.items() for said in counter_said(name, loaded[name], on)]
    return Reading(record, (*taken_for(source, picks), *full, *slow), findings, track.said)


def _load(source: Source, picks: Sequence[Pick], clocks: Sequence[str], optional: bool) -> Columns:
    """Load the picked columns and the times; times that were not asked for may be unreadable."""
    columns = dict.fromkeys(pick.column for pick in picks)
    wanted = dict.fromkeys((*columns, *(clock for clock in clocks if clock in source.known)))
    try:
        return source.load(tuple(wanted))
    except DeadlyFileError:
        raise
    except DataError:
        if not clocks or not optional or any(clock in columns for clock in clocks):
            raise
        return source.load(tuple(columns))


def _check_magnitudes(path: Path, loaded: Columns) -> None:
    numbers = {column: values.ravel() for column, values in loaded.items() if values.dtype.kind in "iuf"}
    found = [magnitude_problem(f"{path}: column {column}", values) for column, values in numbers.items()]
    if any(found):
        raise DataError(*(problem for problem in found if problem is not None))


def _check_missing(path: Path, loaded: Columns, picks: Sequence[Pick], mend: Sequence[str]) -> None:
    """Raise one DataError for every column that holds no number, or misses some that are not to be mended."""
    columns = {pick.column: loaded[pick.column] for pick in picks}
    found = [
        missing_problem(f"{path}: column {column}", values, mending_remedy(values))
        for column, values in columns.items()
        if values.dtype.kind in "iuf" and values.ndim == 1
    ]
    mended = (FILL, CUT_OR_FILL) if any(one in OF_READINGS for one in mend) else ()
    DataError.raise_any([one for one in found if one is not None and one.remedy not in mended])


def _in_si(values: npt.NDArray[Any], factor: float) -> npt.NDArray[Any]:
    # what is no real number (a flag, a complex value) is left for the record to refuse
    return values * np.float64(factor) if factor != 1.0 and values.dtype.kind in "iuf" else values


def _times(
    source: Source,
    loaded: Columns,
    as_float: Columns,
    clock: str | None,
    samples: npt.NDArray[Any],
    given: bool,
) -> FloatArray | None:
    """Return the times as the file has them, or None where it has none of the channel's length."""
    if clock is None or clock not in loaded:
        return None
    if loaded[clock].size == samples.size and loaded[clock].dtype.kind in "iuf":
        if clock not in as_float:
            as_float[clock] = gone_on(loaded[clock].astype(float))
        return as_float[clock]
    if not given:
        return None
    what = f"has {loaded[clock].size} samples of type {loaded[clock].dtype}, the channels have {samples.size}"
    raise DataError.at(f"{source.path}: column {clock}", what, "name the column of times of these channels")


def _together(
    source: Source,
    clocks: Mapping[str, str | None],
    times: Mapping[str, FloatArray | None],
    factor: float,
    signals: Mapping[str, npt.NDArray[Any]],
    mend: Sequence[str],
) -> tuple[Track, tuple[Finding, ...]]:
    """Return the channels on common times, mended as asked, and what was found wrong with the times."""
    keys = list(signals)
    first = times[keys[0]]
    scaled = {id(found): found * factor for found in times.values() if found is not None}
    known = {key: scaled[id(found)] for key, found in times.items() if found is not None}
    if first is None or len(known) < len(keys):
        return mend_readings(signals, mend), ()
    distinct = {str(clocks[key]): known[key] for key in keys}
    DataError.raise_any(restart_problems(str(source.path), distinct))
    findings = tuple(f for name, column in distinct.items() for f in time_faults(name, column))
    if all(same_clock(known[keys[0]], column) for column in distinct.values()):
        track = Track(known[keys[0]], signals)
    elif source.joined and (common := common_samples(known)) is not None:
        kept = known[keys[0]][common[keys[0]]]
        said = f"cut to the {kept.size} samples that all files have, {kept[0]:.6g} to {kept[-1]:.6g} s"
        track = Track(kept, {key: signals[key][part] for key, part in common.items()}, (said,))
    else:
        apart = clock_faults(known)
        findings = (*findings, *apart)
        if "clocks" not in mend:
            remedy = "bring them together with --mend clocks, or map channels of one column of times"
            raise DataError(*(Problem(str(source.path), finding.what, remedy) for finding in apart))
        alone = {
            key: mend_times(Track(known[key], {key: signals[key]}), mend, f"{source.path}: times of {key}")
            for key in keys
        }
        track = join_clocks({key: (part.times, part.signals[key]) for key, part in alone.items()})
        track = replace(track, said=(*(said for part in alone.values() for said in part.said), *track.said))
    return mend_times(track, mend, f"{source.path}: times") if mend else track, findings
