"""The error of instruments that lead nowhere: what of the record shows why, and what to record instead."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import DataError, IdentifiabilityError
from modelgen.magnitudes import is_usable
from modelgen.runtime.iv.thresholds import LEFT_OF_FORCE, ROUNDED_TERM
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.model.model import Model
from modelgen.runtime.parameters.bounds import negative_columns
from modelgen.runtime.rows.thresholds import SAMPLES_AN_UNKNOWN

CHANNELS = "check that every channel is what the model means (sign, unit, zero, one clock for all)"
# What a record lacks where a parameter comes out negative, by its role.
LACKING = {
    "inertia": "accelerate more",
    "stiffness": "excite up to the mode of the link and above",
    "damping": "excite about the mode of the link",
    "viscous": "record steady motion at several speeds",
    "coulomb": "record slow steady motion in both directions",
}
OTHERWISE = "record a richer motion, with less noise in the sensors, or sense more"


def diverged(what: str, fit: Fit | None = None, model: Model | None = None) -> IdentifiabilityError:
    """Return the error of an iteration of instruments that failed.

    Parameters
    ----------
    what : str
        What has failed.
    fit : Fit, optional
        The last one that there is; what it leaves, and what it finds impossible, is told.
    model : Model, optional
        For the roles of its columns.
    """
    seen = _unbalanced(fit) if fit is not None else ""
    negative = _negative(fit, model) if fit is not None and model is not None else {}
    signs = ", ".join(f"{name} = {value:.3g}" for name, value in negative.items())
    told = "; ".join(
        part for part in (what, seen, f"{signs}: no such thing is negative" if signs else "") if part
    )
    roles = dict.fromkeys(model.roles[name].role for name in negative) if model is not None else ()
    lacking = [LACKING[role] for role in roles] or [OTHERWISE]
    remedy = f"{CHANNELS}; if so, {', '.join(lacking)}"
    return IdentifiabilityError.at("method iv", f"does not converge: {told}", remedy)


def _negative(fit: Fit, model: Model) -> Mapping[str, float]:
    """Return the columns that are negative and cannot be, with their values, less what rounding made so."""
    found, columns = negative_columns(model, fit), range(len(fit.columns))
    size = np.linalg.norm([[block.column_norm(c) for c in columns] for block in fit.blocks], axis=0)
    terms = dict(zip(fit.columns, np.abs(size * fit.solution.x).tolist(), strict=True))
    least = ROUNDED_TERM * max(terms.values(), default=0.0)
    return {name: value for name, value in found.items() if terms[name] > least}


def simulation_failed(error: DataError, fit: Fit, model: Model) -> IdentifiabilityError:
    """Return the error of instruments whose simulation fails; of a chain that cannot be, that it is none."""
    if negative_columns(model, fit):
        return diverged("no chain that can be simulated belongs to its estimate", fit, model)
    problem = error.problems[0]
    where = "" if problem.where == "simulation" else f"{problem.where} "
    return diverged(f"its simulation fails ({where}{problem.what})", fit, model)


def refuse_few(fit: Fit, further: int, model: Model) -> None:
    """Raise the error of a fit with too few samples for its columns and so many further unknowns."""
    unknowns = len(fit.columns) + further
    if fit.count < SAMPLES_AN_UNKNOWN * unknowns:
        raise diverged(f"{fit.count} samples are left for {unknowns} unknowns", fit, model)


def refuse_runaway(names: Sequence[str], values: FloatArray, fit: Fit, model: Model) -> None:
    """Raise the error of an iteration that has left the numbers that can be calculated with.

    Parameters
    ----------
    names : sequence of str
    values : array, shape (names,)
        In SI.
    fit : Fit
        The one before.
    """
    if not np.all(np.isfinite(values)):
        raise diverged("its estimate is not finite", fit, model)
    far = [name for name, value in zip(names, values.tolist(), strict=True) if not is_usable(value)]
    if far:
        verb = "runs" if len(far) == 1 else "run"
        raise diverged(f"{', '.join(far)} {verb} away", fit, model)


def _unbalanced(fit: Fit) -> str:
    """Return what the row that leaves most of its force leaves of it, where that is much."""
    forced = {
        index: fit.unexplained(index) or 0.0 for index, block in enumerate(fit.blocks) if block.has_force
    }
    if not forced:
        return ""
    worst = max(forced, key=lambda index: forced[index])
    if not forced[worst] > LEFT_OF_FORCE:
        return ""
    block = fit.blocks[worst]
    share = f"{100.0 * forced[worst]:.3g} % of its force"
    return f"row {block.row_name} leaves {share} in {block.record_name} before that"
