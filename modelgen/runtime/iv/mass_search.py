"""Which further mass leaves least of the rows: from a grid of frequencies on, by Gauss and Newton's steps.

By least squares: a simulation without the mass is far off about its resonance, and so are instruments.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.iv.companion_simulation import Simulated
from modelgen.runtime.iv.effect import Effect
from modelgen.runtime.iv.effect_rows import effect_rows
from modelgen.runtime.iv.further_mass import further_mass
from modelgen.runtime.iv.instrumental_variables import Setting
from modelgen.runtime.iv.thresholds import (
    CLEARLY_LEFT,
    FIRST_DAMPING,
    RESONANCE_GRID,
    RESONANCE_STEPS,
    RESONANCES_FROM,
    RESONANCES_TO,
    RESONANCES_TRIED,
    SAME_SHAPE,
    SEEN_AT_ALL,
    WEIGHTING_ROUNDS,
)
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.further_columns import joined_blocks
from modelgen.runtime.least_squares.wls import weighed_by_residuals
from modelgen.runtime.numerics.block_column import BlockColumn


def further_masses(
    fit: Fit,
    setting: Setting,
    simulated: Sequence[Simulated],
    known: Sequence[Effect],
    others: Sequence[Sequence[FloatArray]],
) -> Iterator[Effect]:
    """Yield for each body the further mass with which clearly less is left, if there is one.

    Parameters
    ----------
    fit : Fit
    setting : Setting
    simulated : sequence of Simulated
        With the fit's parameters.
    known : sequence of Effect
        Those that are estimated already.
    others : sequence of sequence of array
        How Y - W X grows with these and with delays, in SI, shape (n,) a block each.
    """
    rows = _Rows(fit, setting, simulated, others)
    names = {effect.name for effect in known}
    whole = rows.left(()).misfit
    seen, limit = (whole + fit.count * float(np.log(share)) for share in (SEEN_AT_ALL, CLEARLY_LEFT))
    for body in simulated[0].plant.bodies:
        grid = [further_mass(body, hz, FIRST_DAMPING) for hz in _frequencies(setting)]
        if grid[0].name in names:
            continue
        misfits = [rows.left(rows.columns((one,))).misfit for one in grid]
        at_grid = sorted(zip(grid, misfits, strict=True), key=lambda pair: pair[1])
        begun = [one for one, misfit in at_grid[:RESONANCES_TRIED] if misfit < seen]
        tried = [_sharpened(one, rows) for one in begun]
        best = min(tried, key=lambda one: one.left.misfit, default=None)
        if best is not None and best.left.misfit < limit:
            yield best.mass


def _frequencies(setting: Setting) -> list[float]:
    """Return the frequencies in Hz at which a further mass is looked for."""
    choice, fs = setting.choice, min(record.fs for record in setting.records)
    low = RESONANCES_FROM * (choice.dynamics_hz or choice.cutoff_hz)
    high = min(RESONANCES_TO * choice.cutoff_hz, 0.5 * fs)
    count = max(2, round(float(np.log(high / low) / np.log(RESONANCE_GRID))))
    return [float(hz) for hz in np.geomspace(low, high, count)]


def _sharpened(mass: Effect, rows: _Rows) -> _Begun:
    """Return a further mass with the frequency and the damping that leave least."""
    best = rows.begun(mass)
    for _ in range(RESONANCE_STEPS):
        free, moved = rows.freed(best), best.mass.moved
        if moved is None or not free.sizes[0] > 0.0:
            break
        # a shorter step where a long one leads too far
        tried = [moved(free.sizes[0], [by * step for step in free.sizes[1:]]) for by in (1.0, 0.3)]
        now = min((rows.begun(one) for one in tried), key=lambda one: one.left.misfit)
        if now.left.misfit > best.left.misfit - SAME_SHAPE:
            break
        best = now
    return best


@dataclass(frozen=True, eq=False)
class _Left:
    """Minus the logarithm of the likelihood that is left, infinite without a mass, and sizes of effects."""

    misfit: float
    sizes: tuple[float, ...]


@dataclass(frozen=True, eq=False)
class _Begun:
    """A further mass that moves as it likes when the records begin, its shape, columns, and what is left.

    `columns` are those of the mass and of how it begins, (n,) a block each: its shape without the first two.
    """

    mass: Effect
    shape: tuple[Effect, ...]
    columns: tuple[BlockColumn, ...]
    left: _Left


@dataclass(frozen=True, eq=False)
class _Rows:
    """Rows of a fit whose effects are estimated by least squares; parameters as `further_masses` takes."""

    fit: Fit
    setting: Setting
    simulated: Sequence[Simulated]
    others: Sequence[Sequence[FloatArray]]

    @property
    def records(self) -> int:
        return len(self.setting.records)

    def begun(self, mass: Effect) -> _Begun:
        """Return a mass that moves as it likes when the records begin, with what is left."""
        shape = mass.shape(self.records)
        columns = self.columns((mass, *shape[2:]))
        return _Begun(mass, shape, columns, self.left(columns))

    def freed(self, begun: _Begun) -> _Left:
        """Return what is left where frequency and damping are free as well."""
        mass, *starts = begun.columns
        return self.left((mass, *self.columns(begun.shape[:2]), *starts))

    def columns(self, effects: Sequence[Effect]) -> tuple[BlockColumn, ...]:
        """Return the columns of effects, (n,) a block each."""
        return effect_rows(self.fit, self.setting, self.simulated, effects)

    def left(self, columns: Sequence[BlockColumn]) -> _Left:
        """Return what is left with further columns, each block weighted by what it leaves."""
        grown = (*self.others, *columns)
        rows = [block.summary for block in joined_blocks(self.fit, grown)]
        c, tiny = len(self.fit.columns), float(np.finfo(float).tiny)
        begun = [1.0 / weight for weight in self.fit.weights]
        x, rms = weighed_by_residuals(rows, begun, [tiny] * len(rows), WEIGHTING_ROUNDS, c + len(grown))
        misfit = sum(
            block.count * float(np.log(np.sqrt(block.count) * max(left, tiny) / (block.size(x[:c]) or 1.0)))
            for block, left in zip(self.fit.blocks, rms, strict=True)
        )
        sizes = tuple(x[len(x) - len(columns) :].tolist())
        return _Left(misfit if all(size > 0.0 for size in sizes[:1]) else np.inf, sizes)
