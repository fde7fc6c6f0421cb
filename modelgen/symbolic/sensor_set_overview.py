"""Comparison of sensor sets: derivatives needed, parameters identified, parameters lost."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import combinations

from modelgen.errors import ModelError
from modelgen.spec.chain import ChainSpec, Sensor
from modelgen.spec.units import Measures
from modelgen.symbolic.base_parameters import BaseModel
from modelgen.symbolic.pipeline import build

FULL = "every position"
#: Subsets of two sensors a body double with every sensor; more bodies than this would fill many pages.
MOST_BODIES = 4


KINDS: tuple[tuple[str, Measures], ...] = (("q", "position"), ("a", "acceleration"))


@dataclass(frozen=True)
class SetSummary:
    """One sensor set in the table: its model, or the reason why there is none."""

    name: str
    model: BaseModel | None
    reason: str
    lost: tuple[str, ...]


def overview(spec: ChainSpec, names: Iterable[str]) -> tuple[SetSummary, ...]:
    """Build every named sensor set and compare it with a position sensor on every body."""
    full = _full(spec)
    summaries = []
    for name in names:
        try:
            summaries.append(_summary(build(spec, name), full))
        except ModelError as error:
            summaries.append(SetSummary(name, None, error.problems[0].what, full))
    return tuple(summaries)


def single(spec: ChainSpec, name: str) -> SetSummary:
    """Build one sensor set and compare it likewise; a set that cannot be built is an error here.

    Raises
    ------
    SpecError, ModelError
        As `modelgen.symbolic.pipeline.build`.
    """
    model = build(spec, name)
    return _summary(model, _full(spec))


def _summary(model: BaseModel, full: tuple[str, ...]) -> SetSummary:
    lost = tuple(parameter for parameter in full if parameter not in model.identifiable)
    return SetSummary(model.rows.sensor_set, model, "", lost)


def every_subset(spec: ChainSpec) -> ChainSpec:
    """Return the chain with all subsets of position and acceleration sensors as its sensor sets.

    Raises
    ------
    ModelError
        If the chain has more than MOST_BODIES bodies.
    """
    if len(spec.bodies) > MOST_BODIES:
        raise ModelError.at(
            f"{spec.source}: --sensors all",
            f"{len(spec.bodies)} bodies have {4 ** len(spec.bodies) - 1} subsets of sensors; "
            f"at most {MOST_BODIES} bodies are enumerated",
            "write the sensor sets in question into the spec",
        )
    sensors = [
        Sensor(f"{letter}_{body.name}", body.name, None, measures)
        for body in spec.bodies
        for letter, measures in KINDS
    ]
    subsets = [chosen for size in range(1, len(sensors) + 1) for chosen in combinations(sensors, size)]
    return replace(spec, sensor_sets={" ".join(s.key for s in chosen): chosen for chosen in subsets})


def _full(spec: ChainSpec) -> tuple[str, ...]:
    sensors = tuple(Sensor(f"q_{body.name}", body.name, None, "position") for body in spec.bodies)
    return build(replace(spec, sensor_sets={FULL: sensors}), FULL).identifiable
