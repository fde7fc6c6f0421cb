"""Which further mass leaves least of the rows: from a grid of frequencies on."""

from __future__ import annotations

from collections.abc import Collection, Iterator

from modelgen.runtime.iv.effect import Effect
from modelgen.runtime.iv.instrumental_variables import Setting
from modelgen.runtime.iv.shapes.further_mass import further_mass
from modelgen.runtime.iv.shapes.shape_search import ShapeRows, grid_hz
from modelgen.runtime.iv.thresholds import (
    FIRST_DAMPING,
    RESONANCE_GRID,
    RESONANCES_FROM,
    RESONANCES_TO,
)

# Frequency and damping; how the mass moves when a record begins is linear.
NUMBERS = 2


def further_masses(rows: ShapeRows, names: Collection[str]) -> Iterator[Effect]:
    """Yield for each body the further mass with which clearly less is left, if there is one.

    Parameters
    ----------
    rows : ShapeRows
    names : collection of str
        Those of effects that are estimated already.
    """
    for body in rows.simulated[0].plant.bodies:
        tried_hz = _frequencies(rows.setting)
        grid = [further_mass(body, hz, FIRST_DAMPING, rows.slowest_hz) for hz in tried_hz]
        if grid[0].name not in names:
            yield from rows.best_of(grid, NUMBERS)


def _frequencies(setting: Setting) -> list[float]:
    """Return the frequencies in Hz at which a further mass is looked for."""
    choice, fs = setting.choice, min(record.fs for record in setting.records)
    low = RESONANCES_FROM * (choice.dynamics_hz or choice.cutoff_hz)
    high = min(RESONANCES_TO * choice.cutoff_hz, 0.5 * fs)
    return grid_hz(low, high, RESONANCE_GRID)
