"""Coulomb friction whose derivatives a row drops, and how they enter it: as a force on the body does."""

from __future__ import annotations

from dataclasses import dataclass

from modelgen.runtime.model.model import Model


@dataclass(frozen=True)
class DroppedFriction:
    """Coulomb friction of one body in one row.

    With s the sign of the body's velocity and F its friction, the row is

        Y = W X + F sum of coefficient d^order s / dt^order (X_column, or 1)

    where the first sum lacks F's own column.

    Attributes
    ----------
    body : str
    key : str
        Signal of its velocity.
    column : int
        Base parameter F.
    terms : tuple of (float, int, int or None)
        Coefficient, order, and base parameter that the term is multiplied with.
    """

    body: str
    key: str
    column: int
    terms: tuple[tuple[float, int, int | None], ...]

    @property
    def orders(self) -> tuple[int, ...]:
        """Derivatives of the sign in the terms."""
        return tuple(dict.fromkeys(order for _, order, _ in self.terms))


def dropped_friction(model: Model, row: int) -> tuple[DroppedFriction, ...]:
    """Return the frictions that a row drops where it is differentiated; none if one of them is not known.

    A friction is known where the body has an actuator: its force is in the row, and friction acts as it does.
    """
    sensors = {sensor.key: sensor for sensor in model.sensors}
    signals = {signal.key: signal for signal in model.signals}
    found = []
    for key in model.rows[row].reversals:
        sensor = sensors.get(signals[key].sensor or "")
        one = _of_body(model, row, key, sensor.body) if sensor is not None and sensor.body else None
        if one is None:
            return ()
        found.append(one)
    return tuple(found)


def _of_body(model: Model, row: int, key: str, body: str) -> DroppedFriction | None:
    name = next((one.coulomb_plus for one in model.friction if one.body == body and not one.asymmetric), None)
    if name not in model.base_parameters or model.is_arm:
        return None
    for actuator in (one.key for one in model.actuators if one.body == body):
        orders = {one.key: one.derivative for one in model.signals if one.actuator == actuator}
        measured = [(c, orders[k]) for c, k in model.measurement_columns[row] if k in orders]
        terms: list[tuple[float, int, int | None]] = [(c, order, None) for c, order in measured]
        for column, entries in model.regressor_columns[row].items():
            terms += [(-c, orders[k], column) for c, k in entries if k in orders]
        if terms:
            return DroppedFriction(body, key, model.base_parameters.index(name), tuple(terms))
    return None
