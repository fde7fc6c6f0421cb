"""Options of `modelgen.identify` as values, filters and checks; and flat options turned into them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from numbers import Integral
from typing import Any

from modelgen.errors import DataError, Problem
from modelgen.keyword_options import refuse_other, texts_of
from modelgen.runtime.identification.memory_limit import limit_problems
from modelgen.runtime.identification.methods import METHODS, Method
from modelgen.runtime.identification.robust_and_bounded import treatment_problems
from modelgen.runtime.rows.rows_by_tag import PAPER

RESIDUAL_DOFS = ("r-c", "r-1")
ROWS = ("force", "power")


@dataclass(frozen=True)
class Filters:
    """How the records are filtered; what is not given is chosen from them.

    Parameters
    ----------
    cutoff_hz : float, optional
        Cut-off of the low-pass in Hz, see `modelgen.runtime.filter_choice`.
    filter_order, decimation : int, optional
        Its order; every `decimation`-th sample is kept.
    direction_cutoff_hz : float, optional
        Cut-off in Hz of the velocities whose signs are directions of motion.
    signal_cutoff_hz : float, optional
        Cut-off in Hz of the wide low-pass in front of rows that are nonlinear in their signals (arms).
    slow_speeds : mapping of str to float
        Sensor of a position or velocity -> speed in SI; rows of its body leave slower samples out.
    filtered_forces : bool
        For method "pham2002" alone: forces go through the low-pass of the sensors, as in what was published
        with such rows later (of the TX40, say). The paper leaves them as they are; other methods filter all.
    drop : int, optional
        Samples left out at the beginning of every record; with matched filters at least the filter's reach.
    directions : mapping of str to str
        Where the direction of a body comes from that has no position or velocity sensor: ``sign_BODY`` -> a
        channel that moves with it, see `modelgen.runtime.records.directions`.
    memory_limit_mb : float, optional
        MB (10^6 bytes) that the filtered rows may take, in addition to some tens of MB for the stretch at
        work. `WLS` does not keep rows that take more: it makes them again whenever it asks for them. So does
        `Auto`, which is least squares then; other methods say what they need.
    """

    cutoff_hz: float | None = None
    filter_order: int | None = None
    decimation: int | None = None
    direction_cutoff_hz: float | None = None
    signal_cutoff_hz: float | None = None
    slow_speeds: Mapping[str, float] = field(default_factory=dict)
    filtered_forces: bool = False
    drop: int | None = None
    directions: Mapping[str, str] = field(default_factory=dict)
    memory_limit_mb: float | None = None


@dataclass(frozen=True)
class CheckOptions:
    """What is checked besides the fit itself, and what is compared with it.

    Parameters
    ----------
    drift_check : bool
        With matched filters, fit again at 0.7 and 1.4 times the cut-off, with twice the cut-off of
        directions, and with half and twice the weight of rows without a force; add to the covariance how far
        the estimate drifts, and the bias by noise of the sensors: no residual shows what noise in the
        columns and missing dynamics do. With `IV` only what noise does not explain counts: it is model error.
    tests : bool
        Look at the samples (stuck, clipped, leaping, another unit), at periods, at friction by direction and
        at the residual; leave out what leaps. Without, `drift_check` is off as well, the estimate says that
        it is not checked, and the verdict is never "trust": for records that another run has checked.
    keep : sequence of str
        Base parameters that pruning spares, and that get a number in spite of a doubt.
    period_s : float, mapping of str to float or "none", optional
        Period of the excitation in s, of all records or by name; found in the forces if not given. Where all
        records are periodic, the spread over periods gives a third covariance.
    hold_out : str, sequence of str or float, optional
        Records (by name), or the share at the end of every record, that the estimate must explain unseen.
    scan_cutoffs : sequence of float or "auto", optional
        Cut-offs in Hz to estimate with as well; "auto" tries some cut-offs and orders around the chosen ones.
    prune_percent : float
        Relative standard deviation in % from which parameters are removed in the list after the estimate.
    other_solutions : bool
        Where physical parameters follow from composites, look for other values that fit these as well.
    """

    drift_check: bool = True
    tests: bool = True
    keep: Sequence[str] = ()
    period_s: float | Mapping[str, float] | str | None = None
    hold_out: Sequence[str] | str | float | None = None
    scan_cutoffs: Sequence[float] | str | None = None
    prune_percent: float = 10.0
    other_solutions: bool = True

    def __post_init__(self) -> None:
        if not self.tests:
            object.__setattr__(self, "drift_check", False)
        object.__setattr__(self, "keep", texts_of(self.keep))


def values_of(method: str = "auto", **options: Any) -> dict[str, Any]:
    """Return flat options, as the command line has them, as the values that `modelgen.identify` takes.

    Parameters
    ----------
    method : str
        "auto", "wls", "iv", "tls" or "pham2002".
    **options
        Options of that method, of `Filters` and of `CheckOptions`, by their names; others are handed on.

    Raises
    ------
    DataError
        For a method that is none.
    """
    values: dict[str, Any] = {"method": _named(method), "filters": Filters(), "checks": CheckOptions()}
    left = dict(options)
    for argument, value in values.items():
        own = {one.name: left.pop(one.name) for one in fields(value) if one.name in left}
        values[argument] = replace(value, **own)
    return values | left


def chosen_method(method: str | Method) -> Method:
    """Return a method given by its name, or as it is.

    Raises
    ------
    DataError
        When it is neither.
    """
    return method if isinstance(method, Method) else _named(method)


def _named(method: Any) -> Method:
    if not isinstance(method, str) or method not in METHODS:
        raise DataError.at("method", f"is {method!r}", f"choose one of {', '.join(METHODS)}")
    return METHODS[method]()


def with_short_forms(filters: Filters | None, cutoff_hz: float | None, decimation: int | None) -> Filters:
    """Return the filters with the two options that most users give by themselves.

    Raises
    ------
    DataError
        When one of them is given twice, or `filters` are none.
    """
    refuse_other("filters", filters, Filters)
    given: dict[str, Any] = {"cutoff_hz": cutoff_hz, "decimation": decimation}
    short = {name: value for name, value in given.items() if value is not None}
    if filters is not None:
        twice = [name for name in short if getattr(filters, name) is not None]
        if twice:
            what = "is given in filters as well"
            raise DataError(*(Problem(name, what, "give it once") for name in twice))
    return replace(filters or Filters(), **short)


def option_problems(method: Method, filters: Filters, checks: CheckOptions) -> list[Problem]:
    """Return what is wrong with options that can be judged without the records."""
    problems = treatment_problems(method.name, method.robust, method.bounds)
    if method.residual_dof not in RESIDUAL_DOFS:
        remedy = f"choose one of {', '.join(RESIDUAL_DOFS)}"
        problems.append(Problem("residual_dof", f"is {method.residual_dof!r}", remedy))
    if method.rows not in ROWS:
        problems.append(Problem("rows", f"are {method.rows!r}", f"choose one of {', '.join(ROWS)}"))
    drop, pairing = filters.drop, method.rows_for_tag
    if drop is not None and (isinstance(drop, bool) or not isinstance(drop, Integral) or drop < 0):
        problems.append(Problem("drop", f"is {drop!r}", "give a number of samples, 0 or more"))
    problems += limit_problems(filters.memory_limit_mb)
    if filters.filtered_forces and method.matched:
        what = f"are asked for, and method {method.name} filters forces in any case"
        problems.append(Problem("filtered_forces", what, "leave it out"))
    if isinstance(pairing, str) and pairing != PAPER:
        problems.append(Problem("rows_for_tag", f"is {pairing!r}", f'give a mapping, or "{PAPER}"'))
    if not checks.prune_percent > 0.0:
        problems.append(Problem("prune_percent", f"is {checks.prune_percent!r}", "give a percentage above 0"))
    return problems
