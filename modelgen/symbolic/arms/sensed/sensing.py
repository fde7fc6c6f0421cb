"""What the sensors of an arm say of its coordinates: sums of readings, exact."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from fractions import Fraction
from typing import NamedTuple

from modelgen.spec.arms.arm import ArmSensor, ArmSpec
from modelgen.symbolic.arms.drives import motor_coordinate
from modelgen.symbolic.arms.kinematics import mounting_of
from modelgen.symbolic.arms.placements import Matrix, placement

#: What is added up: how often each name counts.
Sum = Mapping[str, Fraction]
#: Angular speeds of a link along x, y, z of its frame, each a sum of channels.
Turning = tuple[Sum, Sum, Sum]
STILL: Turning = ({}, {}, {})
#: How often that which a sensor of one side, or of both, measures is a position differentiated.
ORDERS = {"position": 0, "velocity": 1, "acceleration": 2}


class SensedSum(NamedTuple):
    """A sum of channels that is a sum of coordinates, all differentiated `order` times."""

    order: int
    coordinates: Sum
    channels: Sum


class ArmSensing:
    """Which coordinates, how often differentiated, the sensors of a set give, and by which channels."""

    def __init__(self, spec: ArmSpec, sensors: tuple[ArmSensor, ...]) -> None:
        self.readings = [reading_of(spec, sensor) for sensor in sensors if sensor.measures in ORDERS]
        self.readings += _gyro_readings(spec, sensors)
        self.torques = measured_torques(sensors)
        self._solved: dict[int, dict[str, list[tuple[Fraction, int]]]] = {}

    def channels(self, coordinate: str, order: int) -> tuple[tuple[str, int, Fraction], ...] | None:
        """Return (channel, how often it is differentiated, how often it counts); None if none give it."""
        level = min(order, 2)
        if level not in self._solved:
            self._solved[level] = self._solve(level)
        solution = self._solved[level].get(coordinate)
        if solution is None:
            return None
        total: dict[tuple[str, int], Fraction] = {}
        for factor, number in solution:
            reading = self.readings[number]
            for key, share in reading.channels.items():
                place = (key, order - reading.order)
                total[place] = total.get(place, Fraction(0)) + factor * share
        return tuple((key, times, factor) for (key, times), factor in total.items() if factor)

    def _solve(self, level: int) -> dict[str, list[tuple[Fraction, int]]]:
        """Return the sum of readings that every coordinate is; high orders, then the first, are preferred."""
        usable = [k for k, reading in enumerate(self.readings) if reading.order <= level]
        usable.sort(key=lambda k: -self.readings[k].order)
        pivots: dict[str, tuple[dict[str, Fraction], dict[int, Fraction]]] = {}
        for number in usable:
            left = dict(self.readings[number].coordinates)
            made = {number: Fraction(1)}
            for name, pivot in pivots.items():
                _subtract(left, made, pivot, left.get(name, Fraction(0)))
            if not left:
                continue
            lead = next(iter(left))
            scale = left[lead]
            new = {n: v / scale for n, v in left.items()}, {k: v / scale for k, v in made.items()}
            for other in pivots.values():
                _subtract(*other, new, other[0].get(lead, Fraction(0)))
            pivots[lead] = new
        return {
            name: [(factor, number) for number, factor in sorted(made.items())]
            for name, (left, made) in pivots.items()
            if len(left) == 1
        }


def measured_torques(sensors: tuple[ArmSensor, ...]) -> dict[str, str]:
    """Return the key of the first sensor of each joint's torque, by the joint."""
    torques = [sensor for sensor in sensors if sensor.measures == "torque"]
    return {sensor.joint: sensor.key for sensor in reversed(torques)}


def follows(spec: ArmSpec, sensors: tuple[ArmSensor, ...], sensor: ArmSensor) -> bool:
    """Return whether the other sensors give the coordinates that what a sensor measures is made of."""
    others = ArmSensing(spec, tuple(one for one in sensors if one is not sensor))
    if sensor.measures in ORDERS:
        reading = reading_of(spec, sensor)
        return all(others.channels(name, reading.order) is not None for name in reading.coordinates)
    if sensor.measures == "torque":
        return False
    joints = {joint.name: joint for joint in spec.joints}
    at: str | None = sensor.joint
    while at is not None:
        if joints[at].kind != "fixed" and others.channels(at, 0) is None:
            return False
        at = joints[at].parent
    return True


def _subtract(
    left: dict[str, Fraction],
    made: dict[int, Fraction],
    pivot: tuple[dict[str, Fraction], dict[int, Fraction]],
    factor: Fraction,
) -> None:
    if not factor:
        return
    for name, value in pivot[0].items():
        left[name] = left.get(name, Fraction(0)) - factor * value
        if not left[name]:
            del left[name]
    for number, value in pivot[1].items():
        made[number] = made.get(number, Fraction(0)) - factor * value
        if not made[number]:
            del made[number]


def reading_of(spec: ArmSpec, sensor: ArmSensor) -> SensedSum:
    """Return what a sensor of a position, a speed or an acceleration reads."""
    joint = next(joint for joint in spec.moving if joint.name == sensor.joint)
    motor, one = motor_coordinate(joint), Fraction(1)
    coordinates: dict[str, Fraction] = {joint.name: one}
    if sensor.side == "deflection":
        coordinates = {motor: one, joint.name: -one}
    elif sensor.side == "motor":
        ratios = zip(spec.moving, spec.transmission[spec.moving.index(joint)], strict=True)
        coordinates = {motor_coordinate(other): Fraction(ratio) for other, ratio in ratios if ratio}
    return SensedSum(ORDERS[sensor.measures], coordinates, {sensor.key: one})


def _gyro_readings(spec: ArmSpec, sensors: tuple[ArmSensor, ...]) -> Iterator[SensedSum]:
    """Yield the speeds of joints that gyros in front of and behind them give.

    The component along a joint's axis is the same in both frames, so no angle of the arm is needed.
    """
    turning = _turning(spec, sensors)
    for joint in spec.moving:
        before = STILL if joint.parent is None else turning.get(joint.parent)
        if joint.kind == "revolute" and before is not None and joint.name in turning:
            rotation = placement(joint).rotation
            less = _total(
                (turning[joint.name][2], Fraction(1)), *((before[k], -rotation[k][2]) for k in range(3))
            )
            yield SensedSum(1, {joint.name: Fraction(1)}, less)


def _turning(spec: ArmSpec, sensors: tuple[ArmSensor, ...]) -> dict[str, Turning]:
    """Return the angular speeds of links that gyros on them, or on links that turn alike, give."""
    found: dict[str, Turning] = {}
    for sensor in reversed(sensors):
        if sensor.measures == "gyro" and not sensor.estimated:
            x, y, z = ({key: Fraction(1)} for key in sensor.channels)
            found[sensor.joint] = _rotated((x, y, z), placement(mounting_of(sensor)).rotation)
    alike = [joint for joint in spec.joints if joint.kind != "revolute"]
    for joint in reversed(alike):
        if joint.name in found and joint.parent is not None:
            found.setdefault(joint.parent, _rotated(found[joint.name], placement(joint).rotation))
    for joint in alike:
        before = STILL if joint.parent is None else found.get(joint.parent)
        if before is not None:
            found.setdefault(joint.name, _rotated(before, _transposed(placement(joint).rotation)))
    return found


def _transposed(matrix: Matrix) -> Matrix:
    first, second, third = zip(*matrix, strict=True)
    return first, second, third


def _rotated(turning: Turning, rotation: Matrix) -> Turning:
    x, y, z = (_total(*((turning[k], row[k]) for k in range(3))) for row in rotation)
    return x, y, z


def _total(*parts: tuple[Sum, Fraction]) -> Sum:
    total: dict[str, Fraction] = {}
    for part, factor in parts:
        for key, share in part.items():
            total[key] = total.get(key, Fraction(0)) + factor * share
    return {key: value for key, value in total.items() if value}
