"""Sensor sets of an arm side by side: which rows each gives, what they distinguish, what is lost and why."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import NamedTuple

from modelgen.errors import ModelError
from modelgen.spec.arms.arm import ArmMeasures, ArmSensor, ArmSpec, Joint, Length, Shift, Side, Step
from modelgen.symbolic.arms.arm_rows import arm_rows
from modelgen.symbolic.arms.base_parameters import ArmBaseModel, ArmBaseParameter, arm_base_model


class _Kind(NamedTuple):
    """A sensor that every joint may have, whether only elastic ones need it, and where on the link it is."""

    key: str
    side: Side
    measures: ArmMeasures
    elastic_only: bool = False
    mounting: tuple[Step, ...] = ()


_MOTOR, _LINK = _Kind("qm", "motor", "position", True), _Kind("q", "link", "position")
_RATE, _TORQUE = _Kind("dq", "link", "velocity", True), _Kind("t", "between", "torque")
#: Off the axis of its joint, so that it senses its rotation.
_FELT = _Kind("a", "link", "accelerometer", True, (Shift(0, Length(Fraction(1, 10))),))
#: What robots have: by name, the sensors of every joint. A rigid joint has one encoder.
USUAL_SETS: dict[str, tuple[_Kind, ...]] = {
    "motor and link encoders": (_MOTOR, _LINK),
    "motor and link encoders, joint torques": (_MOTOR, _LINK, _TORQUE),
    "motor encoders, link speeds": (_MOTOR, _RATE),
    "motor encoders, link accelerometers": (_MOTOR, _FELT),
    "motor encoders, joint torques": (_MOTOR, _TORQUE),
    "motor encoders": (_MOTOR,),
    "link encoders, joint torques": (_LINK, _TORQUE),
    "link encoders": (_LINK,),
}


@dataclass(frozen=True)
class ArmSetSummary:
    """One sensor set: its model, or why there is none; parameters that a full set finds and it does not."""

    name: str
    model: ArmBaseModel | None
    reason: str
    lost: tuple[str, ...]


def arm_overview(spec: ArmSpec, names: Iterable[str]) -> tuple[ArmSetSummary, ...]:
    """Build every named sensor set and compare it with encoders at every motor and on every link.

    A sum of parameters is lost where it is no sum of those that the set finds.
    """
    full = arm_base_model(arm_rows(spec)).base
    found = []
    for name in names:
        try:
            model = arm_base_model(arm_rows(spec, sensor_set=name))
        except ModelError as error:
            found.append(ArmSetSummary(name, None, error.problems[0].what, tuple(b.name for b in full)))
            continue
        lost = tuple(base.name for base in full if not _is_found(base, model))
        found.append(ArmSetSummary(name, model, "", lost))
    return tuple(found)


def _is_found(wanted: ArmBaseParameter, model: ArmBaseModel) -> bool:
    """Return whether a sum of parameters is one of a model's: each of those alone has its first parameter."""
    left = dict(wanted.combination)
    for base in model.base:
        share = left.get(base.combination[0][0], 0)
        for name, factor in base.combination if share else ():
            left[name] = left.get(name, 0) - share * factor
    return not any(left.values())


def with_usual_sets(spec: ArmSpec) -> ArmSpec:
    """Return the arm with `USUAL_SETS` as its sensor sets."""
    sets = {
        name: tuple(sensor for joint in spec.moving for sensor in _sensors(joint, kinds))
        for name, kinds in USUAL_SETS.items()
    }
    return replace(spec, sensor_sets=sets)


def _sensors(joint: Joint, kinds: Iterable[_Kind]) -> Iterable[ArmSensor]:
    for kind in kinds:
        if joint.elastic or not kind.elastic_only:
            key = f"{kind.key}_{joint.name}"
            yield ArmSensor(key, joint.name, kind.side, kind.measures, kind.mounting)
        elif kind is _MOTOR and _LINK not in kinds:  # the encoder of a rigid joint says where both are
            yield ArmSensor(f"q_{joint.name}", joint.name, "link", "position")
