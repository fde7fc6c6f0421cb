"""Weights across rows: what acts on two rows with opposite sign does not disturb their sum."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from generated import emps300_qm_qc
from modelgen.runtime.filter_choice.filter_choice import choose_filter
from modelgen.runtime.identification.explanation.unrelated_regressions import across_rows
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.wls import fit_matched
from modelgen.runtime.model.model import model_from_module
from modelgen.runtime.rows.observation import observe
from tests.runtime.two_mass_records import TRUTH, two_mass_records

MODEL = model_from_module(emps300_qm_qc)


def fitted(link_error: float, seed: int) -> Fit:
    """Rows of two bodies with a coloured force in the link that the model lacks, as a share of each row."""
    records = two_mass_records(seed=seed)
    observation = observe(MODEL, records, choose_filter(MODEL, records), turns=False).dense()
    rng = np.random.default_rng(seed)
    blocks = []
    for record in (0, 1):
        m, c = (block for block in observation.blocks if block.record == record)
        grid = np.convolve(rng.standard_normal(m.grid), np.ones(50) / 7.0, "same")
        size = link_error * float(np.std(m.Y))
        blocks += [replace(m, Y=m.Y + size * grid[m.place]), replace(c, Y=c.Y - size * grid[c.place])]
    return fit_matched(replace(observation, blocks=tuple(blocks)))


@pytest.mark.parametrize("seed", range(4))
def test_a_force_between_two_bodies_does_not_disturb_what_their_sum_holds(seed: int) -> None:
    plain = fitted(0.3, seed)
    across = across_rows(plain)
    for name in ("J_m", "J_c"):
        place = plain.columns.index(name)
        error = abs(across.solution.x[place] - TRUTH[name])
        assert error < 0.003 * TRUTH[name]
        assert error < 0.3 * abs(plain.solution.x[place] - TRUTH[name])


def test_its_residuals_are_uncorrelated_with_variance_one() -> None:
    fit = fitted(0.3, 0)
    across = across_rows(fit)
    first, second = (b.residual(fit.solution.x) for b in across.blocks if b.record == 0)
    together = np.cov(np.stack([first, second]), bias=True) + np.outer(
        [first.mean(), second.mean()], [first.mean(), second.mean()]
    )
    # the other record has other samples; in this one both rows use the same
    if len(fit.blocks[0].place) == len(fit.blocks[1].place) == len(first):
        assert np.allclose(together, np.eye(2), atol=1e-6)
    assert abs(together[0, 1]) < 0.05
