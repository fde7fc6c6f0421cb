"""What is known of the timing of force channels before the fit, and which delays the fit is to find."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from modelgen.errors import DataError, Problem
from modelgen.runtime.least_squares.delays import advanced, with_holds
from modelgen.runtime.least_squares.thresholds import LARGEST_GIVEN_DELAY
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
        For a channel that is no force, a word that is none of the two, or a delay of more than a quarter of a
        record.
    """
    forces = tuple(actuator.key for actuator in model.actuators if actuator.key in model.channels)
    problems = [missing_name("held", "force", key, forces) for key in held if key not in forces]
    if isinstance(delays, str) and delays not in (ESTIMATE, NONE):
        remedy = f'give seconds for every force, "{ESTIMATE}" or "{NONE}"'
        problems.append(Problem("delays", f"is {delays!r}", remedy))
    given = delays if isinstance(delays, Mapping) else {}
    problems += [missing_name("delays", "force", key, forces) for key in given if key not in forces]
    problems += [
        _too_late(key, late, records) for key, late in given.items() if _leaves_little(late, records)
    ]
    if problems:
        raise DataError(*problems)
    known = tuple(advanced(record, given) for record in with_holds(records, held))
    wanted = by_default if delays is None else delays == ESTIMATE
    if not wanted:
        return known, ()
    # nothing shows when a force that never changes acts
    return known, tuple(key for key in forces if any(one.facts.extent(key).span > 0.0 for one in known))


def _leaves_little(late: float, records: Sequence[Record]) -> bool:
    return any(abs(late) * record.fs > LARGEST_GIVEN_DELAY * record.n for record in records)


def _too_late(key: str, late: float, records: Sequence[Record]) -> Problem:
    shortest = min(records, key=lambda record: record.n / record.fs)
    length_s = shortest.n / shortest.fs
    what = f"is {late:g} s late, and {shortest.name} is {length_s:.4g} s long"
    most = LARGEST_GIVEN_DELAY * length_s
    return Problem(
        f"delays: {key}", what, f"give s, not ms or samples, {most:.3g} at most (--delay {key}=0.001)"
    )
