"""A link that creeps, as rubber and belts do: a damper in series with a spring, beside spring and damper.

Its force is k s / (s + w) times the deflection (Maxwell's element; with the link's own spring that of Zener):
slow motion feels the spring that the spec names, fast motion one that is k stiffer, and what lies between a
damping that is no D. k is the size, w = 2 pi f the shape. Most materials have such elements of all
frequencies, and lose about the same share of their energy in every cycle, fast or slow (structural damping).
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace

import numpy as np

from modelgen.array_types import ComplexArray, FloatArray
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.iv.chain_errors import deflection
from modelgen.runtime.iv.companion_simulation import Simulated
from modelgen.runtime.iv.effect import CREEP, STRUCTURAL, Changes, Effect
from modelgen.runtime.iv.pushed_chain import pushed_link
from modelgen.runtime.iv.shapes.further_mass import Response, through
from modelgen.runtime.iv.shapes.shape_search import ShapeRows, grid_hz, slowest_in
from modelgen.runtime.iv.thresholds import (
    CREEPS_FROM,
    CREEPS_GRID,
    CREEPS_TESTED,
    CREEPS_UP_TO,
    LONGEST_STEPS,
    LONGEST_TILT,
    STEEPEST,
)
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record

# The frequency.
NUMBERS = 1


def creeping_links(rows: ShapeRows, names: Collection[str]) -> Iterator[Effect]:
    """Yield for each link the creep with which clearly less is left, if there is one.

    Parameters
    ----------
    rows : ShapeRows
    names : collection of str
        Those of effects that are estimated already.
    """
    model, setting = rows.simulated[0].plant.model, rows.setting
    for _, grid in _creeps(model, setting.records, setting.choice, CREEPS_GRID):
        if grid[0].name not in names:
            yield from rows.best_of(grid, NUMBERS)


def creep(stiffness: str, hz: float, slowest_hz: float = 0.0) -> Effect:
    """Return that a link creeps, about a frequency in Hz; a size is how much stiffer it is in fast motion.

    Steps lead to no frequency below `slowest_hz`: what creeps that slowly is a stiffer link with a zero.
    """

    def passed(f: ComplexArray) -> ComplexArray:
        return f / (f + hz)

    def by_frequency(f: ComplexArray) -> ComplexArray:
        return -f * hz / (f + hz) ** 2  # per logarithm of the frequency

    def shape(records: int) -> tuple[Effect, ...]:
        return (_part(f"frequency of creep of {stiffness}", stiffness, by_frequency),)

    def moved(size: float, steps: Sequence[float]) -> Effect:
        if not size:
            return creep(stiffness, hz, slowest_hz)
        least, most = LONGEST_STEPS[0][1], LONGEST_STEPS[1][1]
        moved_hz = hz * float(np.exp(np.clip(steps[0] / size, least, most)))
        return creep(stiffness, max(moved_hz, slowest_hz), slowest_hz)

    words = (
        f"the link of {stiffness} creeps, as rubber and belts do: {stiffness} is that of slow motion, and "
        f"it is stiffer and damped more from some {hz:.2g} Hz on"
    )
    remedy = f"take {stiffness} for slow motion only, or excite the band that matters"
    effect = _part(f"creep of {stiffness}", stiffness, passed)
    return replace(effect, words=words, remedy=remedy, shape=shape, moved=moved)


def spread_creep(stiffness: str, low_hz: float, high_hz: float, tilt: float = 0.0) -> Effect:
    """Return that a link creeps at all frequencies of a band, and is damped by about as much at each.

    By Maxwell's elements, two a decade, those of a frequency f (f / f0)^tilt times as stiff as those of f0 in
    the middle of the band. A size is by how much stiffer the link is a decade further on, there.
    """
    count = 1 + max(1, round(2.0 * float(np.log10(high_hz / low_hz))))
    elements, middle = np.geomspace(low_hz, high_hz, count), float(np.sqrt(low_hz * high_hz))
    share = 0.5 * (elements / middle) ** tilt
    bend = share * np.log(elements / middle)

    def response(weights: FloatArray) -> Response:
        return lambda f: np.asarray(sum(w * f / (f + hz) for w, hz in zip(weights, elements, strict=True)))

    def shape(records: int) -> tuple[Effect, ...]:
        return (_part(f"tilt of creep of {stiffness}", stiffness, response(bend)),)

    def moved(size: float, steps: Sequence[float]) -> Effect:
        step = float(np.clip(steps[0] / size, -LONGEST_TILT, LONGEST_TILT)) if size else 0.0
        return spread_creep(stiffness, low_hz, high_hz, float(np.clip(tilt + step, -STEEPEST, STEEPEST)))

    words = (
        f"the link of {stiffness} is damped by about as much at all frequencies, as rubber, belts and gears "
        f"are: {stiffness} is that of motion below some {low_hz:.2g} Hz, and the link is stiffer the faster "
        "it moves"
    )
    remedy = f"take {stiffness} for slow motion only, or excite the band that matters"
    effect = _part(f"damping of {stiffness} at all frequencies", stiffness, response(share))
    # where it begins is known to a decade
    return replace(effect, kind=STRUCTURAL, words=words, remedy=remedy, shape=shape, moved=moved,
                   varies=((stiffness, float(2.0 * share[0])),))  # fmt: skip


def creep_effects(model: Model, records: Sequence[Record], choice: FilterChoice) -> Iterator[Effect]:
    """Yield that links creep, each at several settings of a frequency, or at all frequencies.

    Either is told from the other, and from what else explains the residual, by fits with its shape estimated.
    """
    slowest, (low, high) = slowest_in(records), _band_hz(choice)
    for name, grid in _creeps(model, records, choice, CREEPS_TESTED):
        spread = spread_creep(name, slowest, CREEPS_UP_TO * high)
        yield replace(spread, forms=(creep(name, float(np.sqrt(low * high)), slowest),))
        yield from (replace(one, forms=(spread,)) for one in grid)


def _creeps(
    model: Model, records: Sequence[Record], choice: FilterChoice, ratio: float
) -> Iterator[tuple[str, list[Effect]]]:
    """Yield each stiffness, and the creep of its link at frequencies so many times the one before."""
    slowest = slowest_in(records)
    for name, role in model.roles.items():
        if role.role == "stiffness":
            yield name, [creep(name, hz, slowest) for hz in grid_hz(*_band_hz(choice), ratio)]


def _band_hz(choice: FilterChoice) -> tuple[float, float]:
    return CREEPS_FROM * (choice.dynamics_hz or choice.cutoff_hz), choice.cutoff_hz


def _part(name: str, stiffness: str, response: Response) -> Effect:
    """Return an effect that is a force in a link: its deflection behind a response to i f in Hz."""

    def changes(simulated: Simulated) -> Changes:
        force = through(deflection(simulated, stiffness), simulated.record.dt, response)
        return pushed_link(simulated, stiffness, force)

    return Effect(name, CREEP, "", "", "", changes)
