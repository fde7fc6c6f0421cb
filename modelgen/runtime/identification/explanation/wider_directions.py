"""Directions of motion from a band twice as wide, where rows leave clearly less with those.

Speeds are low-passed at the dynamics, so that noise turns nothing: what moves there is halved, and such a
speed turns at other instants than the body. A wider band has a hundredth of that error, and more noise.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from modelgen.runtime.diagnostics.settings_drift import other_direction
from modelgen.runtime.filter_choice.explain import direction_sentence
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.identification.explanation.explained import Begun, run_method
from modelgen.runtime.identification.thresholds import CLEARLY_LESS
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.model.model import Model
from modelgen.runtime.rows.given_directions import signs_of_rows


def with_wider_directions(begun: Begun) -> Begun:
    """Return instruments with directions of a band twice as wide, where rows leave less with those.

    As they are otherwise, where the user gave a cut-off for directions, and where every sample feels a
    reversal: a simulation knows better there.
    """
    task, fit = begun.task, begun.found.fit
    given = task.filters.direction_cutoff_hz is not None or task.filters.directions
    if given or fit.carried is not None or not any(signs_of_rows(task.model)) or _turning(fit):
        return begun

    def again(choice: FilterChoice) -> Begun:
        job = replace(task.job, choice=choice, start=fit, surveys=())
        return run_method(replace(task, choice=choice, job=job), task.method)

    lowest_fs = min(record.fs for record in task.records)
    for choice, found in other_direction(task.choice, lowest_fs, again):
        other = found.found.fit
        alike = not _turning(other) and other.columns == fit.columns
        if not alike or _left(other, fit, task.model) > CLEARLY_LESS:
            continue
        before, after = (direction_sentence(one.direction_cutoff_hz, False) for one in (task.choice, choice))
        after = f"{after[:-1]}: rows leave more with a narrower band."
        told = tuple(after if one == before else one for one in choice.sentences)
        choice = replace(choice, sentences=told)
        job = replace(found.task.job, choice=choice, start=task.job.start)
        return replace(found, task=replace(found.task, choice=choice, job=job))
    return begun


def _turning(fit: Fit) -> bool:
    return any(block.turning for block in fit.blocks)


def _left(other: Fit, fit: Fit, model: Model) -> float:
    """Return the mean of what rows that hold directions leave with another fit, as a share of before."""
    signs = signs_of_rows(model)
    shares = [
        after / before if before > 0.0 else 1.0
        for block, before, after in zip(fit.blocks, fit.left_shares, other.left_shares, strict=True)
        if signs[block.row]
    ]
    return float(np.exp(np.mean(np.log(shares)))) if min(shares, default=0.0) > 0.0 else 1.0
