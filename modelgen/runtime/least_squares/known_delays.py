"""What is known of the timing of force channels before the fit, and which delays the fit is to find."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from modelgen.errors import DataError, Problem
from modelgen.runtime.least_squares.delays import advanced, with_holds
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record, missing_name

ESTIMATE, NONE = "estimate", "none"


def aligned(
    model: Model,
    records: Sequence[Record],
    delays: Mapping[str, float] | str | None,
    held: Sequence[str],
    by_default: bool,
) -> tuple[tuple[Record, ...], tuple[str, ...]]:
    """Return the records with holds and given delays compensated, and the forces whose delay is to be found.

    Parameters
    ----------
    delays : mapping of str to float, "estimate", "none" or None
        Delay in s of each force; None is "estimate" if `by_default`, else "none".
    held : sequence of str
        Forces that are commands behind a zero-order hold.

    Raises
    ------
    DataError
        For a channel that is no force, or a word that is none of the two.
    """
    forces = tuple(actuator.key for actuator in model.actuators if actuator.key in model.channels)
    problems = [missing_name("held", "force", key, forces) for key in held if key not in forces]
    if isinstance(delays, str) and delays not in (ESTIMATE, NONE):
        remedy = f'give seconds for every force, "{ESTIMATE}" or "{NONE}"'
        problems.append(Problem("delays", f"is {delays!r}", remedy))
    given = delays if isinstance(delays, Mapping) else {}
    problems += [missing_name("delays", "force", key, forces) for key in given if key not in forces]
    if problems:
        raise DataError(*problems)
    known = tuple(advanced(record, given) for record in with_holds(records, held))
    wanted = by_default if delays is None else delays == ESTIMATE
    if not wanted:
        return known, ()
    # nothing shows when a force that never changes acts
    return known, tuple(key for key in forces if any(one.facts.extent(key).span > 0.0 for one in known))
