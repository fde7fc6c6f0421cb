"""Elastic arms by default: channels set right, and rows about the estimate of those."""

from __future__ import annotations

from dataclasses import dataclass, replace

from modelgen.array_types import FloatArray
from modelgen.errors import DataError, IdentifiabilityError
from modelgen.runtime.identification.elastic.channel_errors import SetRight, told_holds
from modelgen.runtime.identification.elastic.channels_set_right import with_channels_set_right
from modelgen.runtime.identification.elastic.rest import Drifting
from modelgen.runtime.identification.elastic.row_forces import summed_friction
from modelgen.runtime.identification.elastic.speeds_at_changes import with_speeds_of_positions
from modelgen.runtime.identification.explanation.explained import Begun, with_note
from modelgen.runtime.identification.given_positions import about_from_near_by, near_by
from modelgen.runtime.identification.task import Task
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.model.model import Model


@dataclass(frozen=True, eq=False)
class RestWithChannels:
    """Where steps of springs came to rest, if they give positions, and what was set right in channels."""

    rest: Drifting | None
    right: SetRight

    @property
    def held(self) -> tuple[str, ...]:
        """Commands that drives hold over every sample, which no one had said."""
        return (*(self.rest.held if self.rest is not None else ()), *self.right.held)

    @property
    def late(self) -> tuple[tuple[str, float, float], ...]:
        """Channels that were late, by how many s, and the deviations of that."""
        return self.right.late

    def drift(self, fit: Fit, model: Model) -> FloatArray:
        """Return what noise moves the estimate by through both, as a mean square in SI, shape (c, c)."""
        own = self.right.drift(fit)
        return own if self.rest is None else own + self.rest.drift(fit, model)


def with_aligned_channels(task: Task, rest: Drifting | None) -> tuple[Task, Drifting | None]:
    """Return the task of an elastic arm with its channels set right, and where its steps then rest.

    Both as they are where nothing is to be set right.
    """
    if not task.sets_channels_right:
        return task, rest
    held = rest.held if rest is not None else ()
    if held:
        plain = task.doubts
        task = replace(task, doubts=lambda: (*plain(), told_holds(held)))
    # what tachometers read of holds would be told as something else
    task = with_speeds_of_positions(task, held, "velocity")
    changed, found = with_channels_set_right(task, near_by, held)
    if found is None:
        return with_speeds_of_positions(task, held, "torque"), rest
    if found.changes_records:
        try:
            task, rest = about_from_near_by(changed)
        except (DataError, IdentifiabilityError):
            return task, rest
    task = replace(task, doubts=lambda: (*changed.doubts(), *found.advice))
    both = RestWithChannels(rest, found)
    task = with_speeds_of_positions(task, found.held, "velocity")
    return with_speeds_of_positions(task, both.held, "torque"), both


def with_notes_of_springs(begun: Begun) -> Begun:
    """Return least squares of an elastic arm, and what is said of it."""
    for note in summed_friction(begun.task.model):
        begun = with_note(begun, note)
    why = "instruments take arms with rigid joints; delays are those that rows show"
    return with_note(begun, f"method wls: {why}")
