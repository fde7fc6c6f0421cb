"""Elastic arms by default: channels set right, and rows about the estimate of those."""

from __future__ import annotations

from dataclasses import replace

from modelgen.errors import DataError, IdentifiabilityError
from modelgen.runtime.identification.elastic.channel_errors import SetRight
from modelgen.runtime.identification.elastic.channels_set_right import with_channels_set_right
from modelgen.runtime.identification.given_positions import Rest, about_the_estimate, near_by
from modelgen.runtime.identification.methods import Auto
from modelgen.runtime.identification.task import Task


def with_aligned_channels(task: Task, rest: Rest | None) -> tuple[Task, Rest | None, SetRight | None]:
    """Return the task of an arm with what elastic ones show of their channels set right, and what that is.

    The task, its place of rest, and None where nothing is.
    """
    if not task.checks.drift_check or not isinstance(task.method, Auto) or task.method.rows == "power":
        return task, rest, None
    changed, found = with_channels_set_right(task, near_by)
    if found is None:
        return task, rest, None
    try:
        task, rest = about_the_estimate(changed)
    except (DataError, IdentifiabilityError):
        return task, rest, None
    return replace(task, doubts=lambda: (*changed.doubts(), *found.advice)), rest, found
