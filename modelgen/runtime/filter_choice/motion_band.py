"""Band: up to which frequency a record's forces act, and its bodies move."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

from modelgen.runtime.filter_choice.thresholds import DYNAMICS_SHARE, FORCE_SHARE
from modelgen.runtime.filters.power_spectrum import band_limit_hz
from modelgen.runtime.model.mechanical_parts import Sensor
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record


@dataclass(frozen=True)
class Band:
    """What one record excites: `force_hz` of the forces, `dynamics_hz` common to its bodies, set by `body`.

    `dynamics_hz` and `body` are None where no sensor moves.
    """

    record: str
    force_hz: float
    dynamics_hz: float | None
    body: str | None


def record_band(model: Model, record: Record, noise_only: Collection[str] = ()) -> Band:
    """Return what one record excites: steps 1 and 2 of the rule.

    A body of which nothing but noise is read (`noise_only` names such channels) sets no dynamics, unless
    there is nothing else.
    """
    half = 0.5 * record.fs
    used = [actuator.key for actuator in model.actuators if actuator.key in record.signals]
    limits = [band_limit_hz(*record.facts.power(key), FORCE_SHARE, half) for key in used]
    force_hz = max((limit for limit in limits if limit is not None), default=half)
    best = _best_sensors(model)
    shown = {name: sensor for name, sensor in best.items() if sensor.key not in noise_only}
    found: list[tuple[float, str]] = []
    for name, sensor in (shown or best).items():
        # lines of an encoder are most of an acceleration at high frequencies, but little of a speed
        spectrum = record.facts.power(sensor.key, (1 if model.is_arm else 2) - sensor.order)
        limit = band_limit_hz(*spectrum, DYNAMICS_SHARE, force_hz)
        if limit:
            found.append((limit, name))
    # a chain's bodies move together; each joint of an arm moves by itself
    dynamics_hz, body = (max if model.is_arm else min)(found, default=(None, None))
    return Band(record.name, force_hz, dynamics_hz, body)


def _best_sensors(model: Model) -> dict[str, Sensor]:
    """Return for every sensed body its sensor of the highest order; deflections only if there is no other."""
    best: dict[str, Sensor] = {}
    used = [sensor for sensor in model.sensors if sensor.key in model.channels]
    for sensor in [sensor for sensor in used if sensor.body is not None] or used:
        name = sensor.body or "-".join(sensor.deflection or ())
        if name not in best or sensor.order > best[name].order:
            best[name] = sensor
    return best


def band_sentence(band: Band, motion: str) -> str:
    """Return what was seen of a record; `motion` is what its dynamics were read of."""
    start = f"{band.record}: 99.9 % of the force's power lies below {band.force_hz:.4g} Hz"
    if band.dynamics_hz is None:
        return f"{start}; no body moves."
    return f"{start}, and 99.8 % of {band.body}'s {motion} in it below {band.dynamics_hz:.4g} Hz."
