"""Units of what a module reads and estimates: parameters, composites, signals."""

from __future__ import annotations

from collections.abc import Iterable

from modelgen.spec.chain import ChainSpec, Sensor
from modelgen.spec.units import Motion, force_unit, signal_unit
from modelgen.symbolic.equations.row import IdentificationRows, NeededSignal


def column_units(rows: IdentificationRows) -> dict[str, str]:
    """Return the unit of every physical parameter and composite; a composite's is row over signal."""
    units = {parameter.name: parameter.unit for parameter in rows.spec.parameters}
    by_key = {signal.key: unit_of_signal(signal, rows) for signal in rows.signals}
    for row in rows.rows:
        for term in row.terms:
            if term.parameter in rows.composites:
                signal = by_key.get(term.key, "1")
                units.setdefault(
                    term.parameter or "", row.unit if signal == "1" else f"({row.unit})/({signal})"
                )
    return units


def unit_of_signal(signal: NeededSignal, rows: IdentificationRows) -> str:
    """Return the unit of a sensor's or actuator's derivative; "1" for a feature."""
    spec = rows.spec
    if signal.sensor is not None:
        measures = next(s.measures for s in rows.sensors if s.key == signal.sensor)
        return signal_unit(motion_of(signal.sensor, spec, rows.sensors), measures, signal.derivative)
    if signal.actuator is not None:
        motion = next(body.motion for body in spec.bodies if body.actuator == signal.actuator)
        return force_unit(motion, signal.derivative)
    return "1"


def motion_of(key: str, spec: ChainSpec, sensors: Iterable[Sensor]) -> Motion:
    """Return the kind of motion a sensor reads; a deflection is counted on its second body."""
    sensor = next(s for s in sensors if s.key == key)
    body = sensor.deflection[1] if sensor.deflection else sensor.body
    return next(b.motion for b in spec.bodies if b.name == body)
