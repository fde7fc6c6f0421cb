"""What a record cannot answer although the equations could: friction in vibration alone, encoder zeros.

A number comes out of least squares in any case, with a small standard deviation even. These checks look at
the record instead, and give the reason for which a parameter is not to be believed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.filters.power_spectrum import share_below
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.hac_covariance import hac_covariance
from modelgen.runtime.model.mechanical_parts import Sensor
from modelgen.runtime.model.model import Model
from modelgen.runtime.parameters.bounds import parameters_of
from modelgen.runtime.parameters.known_sums import known_sum
from modelgen.runtime.parameters.thresholds import STEADY_BAND, STEADY_SHARE
from modelgen.runtime.records.record import Record


def not_identifiable(
    model: Model, records: Sequence[Record], choice: FilterChoice, fit: Fit
) -> dict[str, str]:
    """Return the base columns that the records cannot answer, with the reason; in the order of the columns.

    Columns of the fit among them stay in it as nuisances: without them their share would fall to others.
    """
    reasons = {name: _why_zero(model, name) for name in fit.absent}
    for name, lost in zip(fit.columns, fit.solution.undetermined, strict=True):
        if lost:
            reasons[name] = (
                "cannot be distinguished from other parameters in these records (W is short of rank)"
            )
    for name, reason in {**offsets_of_encoder_zeros(model, records, fit), **like_delays(model, fit)}.items():
        reasons.setdefault(name, reason)
    return {name: reasons[name] for name in model.base_parameters if name in reasons}


def like_delays(model: Model, fit: Fit) -> dict[str, str]:
    """Return the base parameters of what cannot be distinguished from delays of forces, with that reason.

    Dry friction of such a body without a sensor has none either: its direction is that of a simulation. Nor
    has viscous friction then, which takes what that has wrong. The reason names the sum of inertias where
    that is known all the same.
    """
    unknown = [name for name in fit.unknown if name in model.parameters]
    if not unknown:
        return {}
    seen = {sensor.body for sensor in model.sensors}
    lost = {body for name in unknown if name in model.roles for body in model.roles[name].bodies} - seen
    friction = {
        name: model.roles[name].role
        for name in parameters_of(model, "viscous", "coulomb")
        if lost & {*model.roles[name].bodies}
    }
    if "coulomb" in friction.values():
        unknown += friction
    _, slopes = _anywhere(model)
    places = [model.parameters.index(name) for name in unknown]
    delays = ", ".join(channel for channel, _, _ in fit.delays)
    why = f"cannot be distinguished from the delay of {delays} in these records{_beside(model, fit)}"
    return {name: why for name, row in zip(model.base_parameters, slopes, strict=True) if np.any(row[places])}


def _beside(model: Model, fit: Fit) -> str:
    """Return what is known of the inertias of a chain that is not, to be said behind a reason."""
    carried = fit.carried
    names = parameters_of(model, "inertia")
    if carried is None or carried.at is None or len(names) < 2:
        return ""
    columns, covariance = carried.linear.columns, hac_covariance(carried.linear)
    values = dict(zip(model.parameters, carried.at.tolist(), strict=True))

    def spread(shares: FloatArray) -> float:
        sums = np.zeros(len(columns))
        sums[[columns.index(name) for name in names]] = shares
        if carried.linear.solution.unseen(sums[None])[0]:
            return np.inf
        return float(np.sqrt(max(float(sums @ covariance @ sums), 0.0)))

    # how bodies of a chain move together is no matter of their sizes
    text = known_sum(
        model, dict.fromkeys(model.parameters, 1.0), {name: values[name] for name in names}, spread
    )
    return f"; {text}" if text else ""


def _anywhere(model: Model) -> tuple[dict[str, float], FloatArray]:
    """Return physical parameters at random, and the base parameters' slopes there, shape (base, physical)."""
    rng = np.random.default_rng(0)
    values = rng.uniform(1.0, 2.0, len(model.parameters)).tolist()
    point = dict(zip(model.parameters, values, strict=True))
    return point, model.base_jacobian(point)


def _why_zero(model: Model, name: str) -> str:
    role = model.roles.get(model.groupings.get(name, name).partition(" ")[0])
    kind, _, payload = (role.bodies[0] if role else "").partition(" ")
    if kind == "payload":
        return f"no record carries payload {payload}: say which one does (--payload RECORD={payload})"
    if not any(model.base_parameters.index(name) in row for row in model.regressor_columns):
        return (
            "needs how far the springs deflect, which the records do not show: move faster, towards the "
            "modes of the arm, or measure both sides of the springs"
        )
    return "its column is zero in every sample used"


def friction_without_steady_motion(
    model: Model, records: Sequence[Record], choice: FilterChoice
) -> dict[str, str]:
    """Return the friction parameters to ground of bodies that only ever vibrate, with the reason.

    While a body vibrates, friction is small compared with inertial forces: if the model is not exact, what is
    fitted is mostly their error.
    """
    limit_hz = STEADY_BAND * (choice.dynamics_hz or choice.cutoff_hz)
    reasons: dict[str, str] = {}
    for body, sensor in _slowest_sensors(model).items():
        own = [
            name
            for name, role in model.roles.items()
            if role.role in ("viscous", "coulomb") and role.bodies == (body,)
        ]
        # a spectrum costs as much as a filter
        shares = [_steady_share(record, sensor, limit_hz) for record in records] if own else [1.0]
        if max(shares) >= STEADY_SHARE:
            continue
        names = ", ".join(record.name for record in records)
        reason = (
            f"no constant-velocity motion of {body} in record {names}: {100.0 * max(shares):.2g} % of its "
            f"velocity's power lies below {limit_hz:.3g} Hz"
        )
        reasons |= dict.fromkeys(own, reason)
    return reasons


def offsets_of_encoder_zeros(model: Model, records: Sequence[Record], fit: Fit) -> dict[str, str]:
    """Return the offsets that only take up unrelated zeros of encoders, with the reason.

    A constant in a link's deflection acts as stiffness times that constant. Where this exceeds, in a row that
    holds a measured force, every force in the record, it cannot be a load: it is a difference of encoder
    zeros, held by both bodies' offsets. (Rows without a force may see it multiplied by gear ratios.)
    """
    reasons: dict[str, str] = {}
    for block in fit.blocks:
        if block.differentiated or not block.has_force:
            continue
        record = records[block.record]
        forces = [actuator for actuator in model.actuators if actuator.key in record.signals]
        felt = (record.facts.extent(force.key).peak * force.lever for force in forces)
        largest = max(felt, default=0.0) / model.rows[block.row].lever
        touched = range(len(fit.columns)) if block.touched is None else block.touched.tolist()
        for index in touched:
            role = model.roles.get(fit.columns[index])
            if role is None or role.role != "stiffness":
                continue
            mean = abs(float(fit.solution.x[index]) * block.column_mean(index))
            if mean <= largest:
                continue
            reason = (
                f"the link {'-'.join(role.bodies)} would carry {mean:.3g} on average in record {record.name} "
                f"and no force there exceeds {largest:.3g}: the encoders' zeros are unrelated"
            )
            for offset, other in model.roles.items():
                if other.role == "offset" and other.bodies[0] in role.bodies:
                    reasons.setdefault(offset, reason)
    return reasons


def columns_that_vanish(model: Model, reasons: Mapping[str, str]) -> dict[str, str]:
    """Return the base parameters that are zero where these physical ones are, with the first one's reason.

    Parameters
    ----------
    model : Model
    reasons : mapping of str to str
        Physical parameter to the reason why it is not to be believed.
    """
    point, slopes_there = _anywhere(model)
    without = model.base_from_physical({**point, **dict.fromkeys(reasons, 0.0)})
    found: dict[str, str] = {}
    for name, rest, slopes in zip(model.base_parameters, without, slopes_there, strict=True):
        acting = [
            p for p, slope in zip(model.parameters, slopes, strict=True) if slope != 0.0 and p in reasons
        ]
        if rest == 0.0 and acting:
            found[name] = reasons[acting[0]]
    return found


def _slowest_sensors(model: Model) -> Mapping[str, Sensor]:
    """Return for every sensed body its sensor of the lowest order, which shows slow motion best."""
    best: dict[str, Sensor] = {}
    for sensor in model.sensors:
        body = sensor.body
        if body is None or sensor.key not in model.channels:
            continue
        if body not in best or sensor.order < best[body].order:
            best[body] = sensor
    return best


def _steady_share(record: Record, sensor: Sensor, limit_hz: float) -> float:
    derivative = 1 - sensor.order
    # an accelerometer does not show a constant velocity; its own constant is no motion
    spectrum = record.facts.power(sensor.key, derivative, keep_mean=derivative >= 0)
    return share_below(*spectrum, limit_hz)
