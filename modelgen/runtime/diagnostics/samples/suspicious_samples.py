"""What looks wrong in a record's samples: warnings that name record, channel and samples; changes nothing.

Every rule compares a channel with itself or with its neighbours on the chain. None raises an error: a machine
may stand at a limit, and a sensor may be coarse, with its owner's knowledge.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from itertools import combinations

import numpy as np

from modelgen.array_types import BoolArray, FloatArray
from modelgen.errors import IdentifiabilityError, ModelgenError, Problem
from modelgen.runtime.advice import Advice
from modelgen.runtime.diagnostics.samples.frozen_readings import stretches_of
from modelgen.runtime.diagnostics.samples.leaps import leaps_of, told_leaps
from modelgen.runtime.diagnostics.samples.stuck_readings import equal_runs, faulty_runs, moving_samples
from modelgen.runtime.diagnostics.samples.unit_errors import unlike_units
from modelgen.runtime.diagnostics.thresholds import FEWEST_STEPS, LISTED, OVERLAP, WIDEST
from modelgen.runtime.filters.thresholds import NEARLY
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.faults import POSITIONS, reading_problems
from modelgen.runtime.records.record import Record
from modelgen.runtime.records.record_facts import Extent

Run = tuple[int, int, float]  # first and last sample, reading


def suspicions(model: Model, records: Iterable[Record]) -> tuple[Advice, ...]:
    """Return what looks wrong in the channels that a model uses, record by record.

    Parameters
    ----------
    model : Model
    records : iterable of Record
        With all of ``model.channels``, in SI.

    Returns
    -------
    tuple of Advice
        `where` is "RECORD, channel KEY, samples FIRST to LAST", samples counted from 0.
    """
    return tuple(problem for record in records for problem in _suspicions(model, record))


def misread(model: Model, record: Record, held: Sequence[str]) -> list[Problem]:
    """Return the readings of sensors and forces that no estimate stands; of a long record, where it moves.

    `held` are forces that are commands behind a zero-order hold.
    """
    units = {key: unit for key, unit in model.channel_units.items() if key in record.signals}
    found: dict[str, Problem] = {}
    for number in range(len(record.facts.parts)):
        part = {key: record.facts.stretches(key)[number] for key in units}
        for problem in reading_problems(record.name, part, units, held):
            found.setdefault(problem.remedy, problem)
    return list(found.values())


def _suspicions(model: Model, record: Record) -> Iterator[Advice]:
    measures = {sensor.key: sensor.measures for sensor in model.sensors}
    units = model.channel_units
    used = [key for key in units if key in record.signals]
    extents = {key: record.facts.extent(key) for key in used}
    acts = any(extents[key].span > 0.0 for key in used if key not in measures)
    found = {key: _Faults() for key in used}
    same = (
        [] if model.is_arm else [pair for pair in combinations(measures, 2) if _may_be_same(extents, *pair)]
    )
    for start, stop in stretches_of(record, OVERLAP):
        part = {key: record.read(key, start, stop) for key in used if extents[key].span > 0.0}
        moving = moving_samples(stop - start, {key: part[key] for key in measures if key in part}, measures)
        for key, samples in part.items():
            _look(found[key], samples, start, measures.get(key, ""), moving, extents[key])
        same = [pair for pair in same if np.array_equal(part[pair[0]], part[pair[1]])]
    leaps = leaps_of(model, record)
    for leap in leaps:  # is told, and not that the sensor rested before it
        for key in set(leap.keys) & found.keys():
            found[key].stuck = [run for run in found[key].stuck if not leap.first <= run[1] + 1 <= leap.last]
    for first, second in same:
        place = f"{record.name}, channel {second}, samples 0 to {record.n - 1}"
        remedy = "check which column is which channel: two sensors do not have the same noise"
        yield Advice("copied", place, f"holds the readings of {first}", remedy)
    for key in used:
        where = f"{record.name}, channel {key}"
        if extents[key].span == 0.0:
            if key in measures or not acts:  # one of several actuators may well rest
                what = f"reads {extents[key].least + 0.0:.6g} in every sample"
                remedy = "check its cable and its scale; it is right only if nothing moves or acts there"
                yield Advice("constant", f"{where}, samples 0 to {record.n - 1}", what, remedy)
            continue
        yield from _told_clipped(where, extents[key], found[key])
        yield from _told_stuck(where, found[key].stuck)
        resolution = min(found[key].resolutions, default=0.0) if key in measures else 0.0
        place = f"{where}, samples 0 to {record.n - 1}"
        yield from _told_range(place, extents[key].span, units[key], resolution)
    yield from told_leaps(model, record)
    leaping = {key for leap in leaps for key in leap.keys}
    sound = [key for key in used if not (found[key].clipped or found[key].stuck or key in leaping)]
    yield from unlike_units(model, record, sound)


@dataclass
class _Faults:
    """What was found of a channel: runs as (first, last, reading), and resolutions."""

    clipped: list[Run] = field(default_factory=list)
    stuck: list[Run] = field(default_factory=list)
    resolutions: list[float] = field(default_factory=list)


def _look(
    found: _Faults, samples: FloatArray, start: int, measures: str, moving: BoolArray, extent: Extent
) -> None:
    """Add what looks wrong in a stretch of a channel that begins at a sample of the record."""
    if np.ptp(samples) == 0.0:
        return  # at rest meanwhile
    runs = equal_runs(samples)
    clipped, stuck = faulty_runs(samples, runs, measures, moving, (extent.least, extent.greatest))
    found.resolutions.append(runs.resolution)
    for into, which in ((found.clipped, clipped), (found.stuck, stuck)):
        into += [
            (start + int(runs.first[run]), start + int(runs.last[run]), float(samples[runs.first[run]]))
            for run in which
        ]


def _may_be_same(extents: Mapping[str, Extent], first: str, second: str) -> bool:
    return first in extents and extents[first].span > 0.0 and extents[first] == extents.get(second)


def _told_clipped(where: str, extent: Extent, found: _Faults) -> Iterator[Advice]:
    for limit, side in ((extent.greatest, "largest"), (extent.least, "smallest")):
        there = [run for run in found.clipped if run[2] == limit]
        if there:
            count = sum(last - first + 1 for first, last, _ in there)
            what = f"stays at its {side} reading {limit:.6g} for {count} samples: clipped, or at a limit"
            remedy = "choose a larger range and record again, or cut the record there"
            yield Advice("clipped", f"{where}, {_places(there)}", what, remedy)


def _told_stuck(where: str, found: Sequence[Run]) -> Iterator[Advice]:
    if found:
        value = found[0][2]
        what = f"stays at one reading ({value:.6g}) while it should change: the sensor was stuck or cut off"
        remedy = "check its cable, or cut the record there"
        yield Advice("stuck", f"{where}, {_places(found)}", what, remedy)


def _told_range(place: str, span: float, unit: str, resolution: float) -> Iterator[Advice]:
    """Report a channel that is coarse (`resolution` 0 for one that may be), or that spans too much."""
    if span < FEWEST_STEPS * resolution:
        what = f"spans {span / resolution:.0f} steps of its resolution {resolution:.4g} {unit} only"
        yield Advice("coarse", place, what, "record a larger motion, or use a finer sensor")
    if unit in POSITIONS and np.isclose(resolution, 1.0, rtol=NEARLY):
        what = f"reads whole numbers of {unit} only: it may be in counts"
        yield Advice("unit", place, what, "give the factor from counts to SI (--scale)")
    elif span > WIDEST.get(unit, np.inf):
        what = f"spans {span:.4g} {unit}, more than machines do ({WIDEST[unit]:g} {unit})"
        yield Advice("unit", place, what, "check its unit (mm for m?), and scale it to SI")


def _places(found: Sequence[Run]) -> str:
    spans = [f"samples {first} to {last}" for first, last, _ in found[:LISTED]]
    more = [f"{len(found) - LISTED} more stretches"] if len(found) > LISTED else []
    return ", ".join(spans + more)


@contextmanager
def told_on_failure(doubts: Callable[[], Sequence[Advice]]) -> Iterator[None]:
    """Add what is suspicious about the data to an error within that the data may be the reason of.

    That is not the case where an option is out of its range: such an error does not name a record.
    """
    try:
        yield
    except ModelgenError as error:
        places = [problem.where for problem in error.problems]
        found = [
            Problem(advice.where, advice.what, advice.remedy)
            for advice in doubts()
            if isinstance(error, IdentifiabilityError)
            or any(advice.where.split(", channel ")[0] in where for where in places)
        ]
        # an estimate that fails on wrong data says little: what is wrong with them comes first
        first = found if isinstance(error, IdentifiabilityError) else []
        last = [] if first else found
        raise type(error)(*first, *error.problems, *last) from None
