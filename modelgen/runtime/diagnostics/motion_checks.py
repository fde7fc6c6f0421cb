"""What a record lacks as an experiment: bodies that never move, never reverse, records that are too short.

Least squares returns numbers in each of these cases. Some of them can be refused (what acts on a body that
rests, the split of friction and offset without a reversal); of the others the user should know.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from modelgen.errors import Problem
from modelgen.runtime.advice import Advice
from modelgen.runtime.diagnostics.thresholds import (
    CLIPPED_RUN,
    CLIPPED_SHARE,
    FEWEST_STRETCHES,
    FEWEST_SWINGS,
    LARGEST_LOSS,
    LEAST_CHANGE,
    LEAST_SPEED,
    LEFT_AT_LIMIT,
    OFTEN,
)
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.filters.thresholds import LEAST_TREND
from modelgen.runtime.filters.zero_phase import DECIMATE_CUTOFF
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.hac_covariance import hac_bandwidth, hac_covariance, influence_parts
from modelgen.runtime.model.mechanical_parts import Sensor
from modelgen.runtime.model.model import Model
from modelgen.runtime.numerics.bandwidth import in_parts
from modelgen.runtime.parameters.unanswered_columns import columns_that_vanish
from modelgen.runtime.records.channels import in_stretches
from modelgen.runtime.records.record import Record
from modelgen.runtime.records.thresholds import WHOLE


def resting_bodies(model: Model, records: Sequence[Record]) -> dict[str, str]:
    """Return the parameters of bodies that no record moves, with the reason."""
    reasons: dict[str, str] = {}
    for body, sensors in _sensors_of_bodies(model).items():
        if any(_moves(record, sensor) for record in records for sensor in sensors):
            continue
        keys = [sensor.key for sensor in sensors]
        names = ", ".join(record.name for record in records)
        reason = f"{body} never moves: {', '.join(keys)} shows no more than noise in record {names}"
        for name, role in model.roles.items():
            if role.bodies == (body,) and role.role != "offset":
                reasons[name] = reason
    return columns_that_vanish(model, reasons) if reasons else {}


def clipped_forces(
    model: Model, records: Sequence[Record], choice: FilterChoice, fit: Fit
) -> tuple[Problem, ...]:
    """Return the forces at the limit of their reading where most of what their rows leave stands.

    A drive at its limit gives the force that it reads: rows then leave no more there than elsewhere.
    """
    found: dict[str, Problem] = {}
    for index, block in enumerate(fit.blocks):
        record = records[block.record]
        for key in (actuator.key for actuator in model.actuators) if block.has_force else ():
            where = f"{record.name}, channel {key}"
            count = _at_limit(record, key)
            if where in found or count < CLIPPED_RUN * OFTEN:
                continue  # few readings stand there by chance, and rows of long records cost a pass
            share = _left_at_limit(record, key, choice.decimation[block.record], fit, index)
            if share > LEFT_AT_LIMIT:
                what = f"reads its limit in {count} samples, where {100.0 * share:.0f} % of what row"
                what = f"{what} {block.row_name} leaves stands: the reading is clipped, and the force is not"
                remedy = "choose a larger range and record again, or cut the record there"
                found[where] = Problem(where, what, remedy)
    return tuple(found.values())


def _at_limit(record: Record, key: str) -> int:
    """Return how many readings of a channel are its greatest or its least."""

    def count() -> int:
        extent = record.facts.extent(key)
        parts = in_stretches(record, key)
        return sum(int(np.sum((part == extent.greatest) | (part == extent.least))) for part in parts)

    return record.facts.kept(("at limit", key), count)


def _left_at_limit(record: Record, key: str, factor: int, fit: Fit, index: int) -> float:
    """Return the share of a block's squared residuals at a channel's limits; 0 where it is often there."""
    extent, block = record.facts.extent(key), fit.blocks[index]
    sums, counts, step = np.zeros(2), np.zeros(2), max(WHOLE // factor, 1)
    for start in range(0, block.grid, step):
        stretch = fit.between(index, start, start + step)
        first = block.start + factor * start
        readings = record.read(key, first, min(first + factor * step, record.n))
        limit = (readings == extent.greatest) | (readings == extent.least)
        there = limit[np.minimum(factor * (stretch.part.place - start), len(limit) - 1)].astype(int)
        counts += np.bincount(there, minlength=2)
        sums += np.bincount(there, stretch.residual**2, minlength=2)
    often = counts[1] > CLIPPED_SHARE * counts.sum()
    return 0.0 if often or not sums.any() else float(sums[1] / sums.sum())


def resting_records(model: Model, records: Sequence[Record]) -> tuple[Advice, ...]:
    """Return one advice for every record in which no sensor shows any motion, though others do."""
    every = [sensor for sensors in _sensors_of_bodies(model).values() for sensor in sensors]
    still = [record for record in records if every and not any(_moves(record, one) for one in every)]
    if len(still) == len(records):
        return ()
    return tuple(
        Advice("never moving", record.name, "shows no motion above the noise of its sensors", "leave it out")
        for record in still
    )


def one_way_friction(model: Model, fit: Fit) -> dict[str, str]:
    """Return the Coulomb frictions (columns of the fit) whose body never reverses, with what that means."""
    features = {feature.key: feature for feature in model.features}
    unused = {key for name in fit.absent for key in _keys(model, name)}
    found: dict[str, str] = {}
    asked: list[int] = []
    for index, name in enumerate(fit.columns):
        role = model.roles.get(name)
        if role is None or role.role != "coulomb":
            continue
        used = [features[key] for key in _keys(model, name) if key in features]
        opposite = [
            feature
            for feature in model.features
            if feature.key in unused
            and any(feature.of == one.of and feature.function != one.function for one in used)
        ]
        if opposite:
            found[name] = f"the velocity of {role.bodies[0]} never reverses"
        elif used and used[0].function == "sign":
            asked.append(index)
    for name in _one_sided(model, fit, asked):
        found[name] = f"the velocity of {model.roles[name].bodies[0]} never reverses"
    return {name: found[name] for name in fit.columns if name in found}


def one_way_columns(model: Model, absent: Sequence[str]) -> dict[str, str]:
    """Return the absent columns that need a motion in the direction that no record has, with the reason."""
    features = {feature.key: feature for feature in model.features}
    found: dict[str, str] = {}
    for name in absent:
        functions = [features[key].function for key in _keys(model, name) if key in features]
        for way in ("forward", "backward"):
            if way in functions:
                found[name] = f"no sample used moves {way}"
    return found


def friction_and_offset(model: Model, one_way: Mapping[str, str], columns: Sequence[str]) -> dict[str, str]:
    """Return frictions and offsets that only a reversal distinguishes, with the reason."""
    reasons: dict[str, str] = {}
    for name, what in one_way.items():
        body = model.roles[name].bodies
        for other in columns:
            role = model.roles.get(other)
            if role is not None and role.role == "offset" and role.bodies == body:
                for one in (name, other):
                    reasons[one] = f"{what}, so {name} and {other} cannot be distinguished"
    return reasons


def one_way_advice(
    model: Model, one_way: Mapping[str, str], reasons: Mapping[str, str]
) -> tuple[Advice, ...]:
    """Return one advice for every friction that no reversal distinguishes from a constant force."""
    return tuple(
        Advice(
            "never reversing",
            name,
            f"holds every constant force as well: {what}",
            "record a motion in both directions",
        )
        for name, what in one_way.items()
        if name not in reasons
    )


def short_records(
    records: Sequence[Record], choice: FilterChoice, fit: Fit, slowest_hz: float | None
) -> tuple[Advice, ...]:
    """Return what makes records too short: the filter's reach, the residual's memory, the slowest mode.

    `slowest_hz` is the frequency of the slowest mode of vibration, None where there is none.
    """
    found = []
    grids = {block.record: block.grid for block in fit.blocks}
    used_s = {index: grid * choice.decimation[index] / records[index].fs for index, grid in grids.items()}
    for index, seconds in used_s.items():
        record = records[index]
        if seconds < (1.0 - LARGEST_LOSS) * record.duration_s:
            what = f"is {record.duration_s:.3g} s long, of which the filter's reach leaves {seconds:.2g} s"
            found.append(Advice("too short", record.name, what, "record for longer"))
    total_s = sum(used_s.values())
    if slowest_hz and total_s * slowest_hz < FEWEST_SWINGS:
        what = f"hold {total_s:.2g} s, {total_s * slowest_hz:.1f} periods of the mode at {slowest_hz:.3g} Hz"
        found.append(Advice("too short", "the records", what, f"record {FEWEST_SWINGS:g} periods and more"))
    found += _long_memory(fit, total_s)
    return tuple(found)


def band_above_filter(records: Sequence[Record], choice: FilterChoice) -> tuple[Advice, ...]:
    """Return the records whose decimation passes more than the sensors' filter (method pham2002 only).

    What the sensors have lost above their cut-off then stays in the forces, and no parameter explains it;
    unless forces are filtered as sensors are.
    """
    found: list[Advice] = []
    if choice.filtered_forces:
        return ()
    for record, factor in zip(records, choice.decimation, strict=True):
        band_hz = DECIMATE_CUTOFF * record.fs / (2.0 * factor) if factor > 1 else 0.5 * record.fs
        if band_hz > choice.cutoff_hz * (1.0 + 1e-9):
            least = int(np.ceil(DECIMATE_CUTOFF * record.fs / (2.0 * choice.cutoff_hz)))
            found.append(
                Advice(
                    "decimation band above the filter band",
                    record.name,
                    f"keeps forces up to {band_hz:.4g} Hz and motion up to {choice.cutoff_hz:.4g} Hz",
                    f"give a decimation of {least} or more, or use method wls, which filters both alike",
                )
            )
    return tuple(found)


def _long_memory(fit: Fit, total_s: float) -> list[Advice]:
    """Return that records are short for how long their residuals stay correlated; a wide window alone is not.

    So long as a covariance is that of so many instants in place of one: the window behind which it is taken
    is wider in any case, and of few instants is most of the record.
    """
    parts = influence_parts(fit)
    samples = sum({block.record: block.grid for block in fit.blocks}.values())
    if samples >= FEWEST_STRETCHES * hac_bandwidth(fit):
        return []
    alone = sum(np.einsum("nc,nc->c", psi, psi) for part in parts for psi in in_parts(part))
    told = alone > 0.0
    stretches = samples * float(np.min(alone[told] / np.diag(hac_covariance(fit))[told], initial=np.inf))
    if stretches >= FEWEST_STRETCHES:
        return []
    what = (
        f"hold {total_s:.2g} s, only {stretches:.1f} times the stretch over which their residuals stay "
        "correlated: the standard deviations are themselves uncertain"
    )
    return [Advice("too short", "the records", what, "record for longer, or repeat the experiment")]


def _keys(model: Model, column: str) -> dict[str, None]:
    """Return the signals and features that a base parameter multiplies in any row, as keys."""
    index = model.base_parameters.index(column)
    rows = range(len(model.rows))
    return {key: None for row in rows for _, key in model.column_terms(row, index)}


def _one_sided(model: Model, fit: Fit, columns: Sequence[int]) -> list[str]:
    """Return which columns have one sign only, up to what a filter adds, coefficients set aside."""
    least, most = np.full(len(columns), np.inf), np.full(len(columns), -np.inf)
    of_model = [model.base_parameters.index(fit.columns[index]) for index in columns]
    for block in fit.blocks:
        terms = [model.column_terms(block.row, column) for column in of_model]
        places = [block.column_at(index) for index in columns]
        held = [k for k, place in enumerate(places) if place is not None and terms[k]]
        signs = [np.sign(terms[k][0][0]) for k in held]
        # rows of one block are made once for all of its columns
        for part in block.stretches() if held else ():
            for k, sign in zip(held, signs, strict=True) if part.Y.size else ():
                values = sign * part.W[:, places[k]]
                least[k], most[k] = min(least[k], values.min()), max(most[k], values.max())
    one_way = np.minimum(-least, most) < LEAST_CHANGE * np.maximum(-least, most)
    return [fit.columns[index] for index, found in zip(columns, one_way.tolist(), strict=True) if found]


def _sensors_of_bodies(model: Model) -> dict[str, list[Sensor]]:
    """Return for every body the sensors that read its motion alone."""
    found: dict[str, list[Sensor]] = {}
    for sensor in model.sensors:
        if sensor.body is not None and sensor.key in model.channels:
            found.setdefault(sensor.body, []).append(sensor)
    return found


def _moves(record: Record, sensor: Sensor) -> bool:
    """Return whether a sensor shows more than noise; a velocity need not change for that."""
    if sensor.key not in record.signals:
        return False
    spectrum = record.facts.spectrum(sensor.key)
    if spectrum.moves:
        return True
    extent, noise = record.facts.extent(sensor.key), spectrum.spread(record.fs)
    if record.n > WHOLE and extent.span > LEAST_TREND * noise:
        return True  # it moves between the stretches that its spectrum was taken of
    return sensor.measures == "velocity" and abs(extent.mean) > LEAST_SPEED * noise
