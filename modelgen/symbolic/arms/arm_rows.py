"""The rows of an arm: force or torque of every joint, or every motor, linear in the parameters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from modelgen.errors import ModelError, listed
from modelgen.spec.arms.arm import ArmSensor, ArmSpec
from modelgen.symbolic.arms.balances import RowKind, balances
from modelgen.symbolic.arms.expressions.graph import Graph, Ref
from modelgen.symbolic.arms.kinematics import BASE_ROWS
from modelgen.symbolic.arms.row_parts import row_parts
from modelgen.symbolic.arms.sensed.deflected_rows import Estimated, sensed_rows
from modelgen.symbolic.arms.sensed.readable_rows import Channel, Channels, ReadRows, as_they_are
from modelgen.symbolic.arms.sensed.sensing import measured_torques

#: The regressor grows with the product of both: a minute for the derivation of the largest.
LARGEST_ARM, MOST_JOINTS = 50, 300


@dataclass(frozen=True)
class ArmRows:
    """Rows of an arm: measured = sum of entries times parameters.

    Attributes
    ----------
    spec, graph
        The arm, and where all references are.
    kind
        Rows of joints, or of motors.
    names
        Of the rows: joints in their order, behind them those of springs and measured torques
        (`balances.Balance`) and of `BASE_ROWS` if asked for.
    columns
        Parameters in the order in which they are kept: base to tip, of a link as `KEPT_FIRST` has them,
        behind them its drive, spring and gain; then payloads, and mountings of sensors.
    owners
        The joint whose link or drive each column is of.
    entries
        Nonzero entries of the regressor by (row, column), made of coordinates.
    measured
        The left side: sums of the forces or torques of the motors, and the wrench of the base. What a drive
        with a gain to be found measures is a column, of the gain.
    speeds
        Speeds whose directions the entries hold, by name.
    sensor_set, sensors
        The name of the set and its sensors; "" and none where the coordinates themselves are measured.
    differentiated
        How often each row is.
    reversals
        Speeds, as in `speeds`, at whose reversals a row that is differentiated does not hold: friction jumps.
    channels
        The sum of the sensors' channels that every coordinate or torque in the rows is, by the symbol.
    lost
        Why the sensors do not give what parameters in none of these rows need, by parameter.
    lacking
        What the sensors would have to give for them, in words.
    estimated
        Channels that no sensor has, each with the row that it is made of; their sensors are the last ones.
    """

    spec: ArmSpec
    graph: Graph
    kind: RowKind
    names: tuple[str, ...]
    columns: tuple[str, ...]
    owners: tuple[str, ...]
    entries: Mapping[tuple[int, int], Ref]
    measured: tuple[Ref, ...]
    speeds: Mapping[str, Ref]
    sensor_set: str = ""
    sensors: tuple[ArmSensor, ...] = ()
    differentiated: tuple[int, ...] = ()
    reversals: tuple[tuple[str, ...], ...] = ()
    channels: Mapping[Channel, Channels] = field(default_factory=dict)
    lost: Mapping[str, str] = field(default_factory=dict)
    lacking: str = ""
    estimated: tuple[Estimated, ...] = ()

    @property
    def has_base(self) -> bool:
        """Whether the base's wrench is measured."""
        return bool(self.base_names)

    @property
    def base_names(self) -> tuple[str, ...]:
        """Rows of the base's wrench."""
        return tuple(name for name in self.names if name in BASE_ROWS)

    @property
    def apart(self) -> frozenset[str]:
        """Joints whose motors have rows without links: behind a spring, or in front of a measured torque."""
        torques = {sensor.joint for sensor in self.sensors if sensor.measures == "torque"}
        return frozenset({*torques, *(joint.name for joint in self.spec.moving if joint.elastic)})

    @property
    def has_scale(self) -> bool:
        """Whether a force, torque or known parameter says how large the parameters are.

        Where every drive has a gain that is to be found, zeros alone stand on the left: only
        ratios can be found: twice all parameters, gains among them, do as well.
        """
        known = {column for column, name in enumerate(self.columns) if self.spec.known.get(name)}
        return any(self.measured) or any(column in known for _, column in self.entries)


def arm_rows(
    spec: ArmSpec, kind: RowKind = "joint", base_rows: bool = False, sensor_set: str = ""
) -> ArmRows:
    """Derive the rows of an arm.

    A fixed joint has a link like any other, which moves with its parent; its parameters are regrouped into
    the parent's when base parameters are found.

    Parameters
    ----------
    spec : ArmSpec
        The arm.
    kind : {"joint", "motor"}
        Torques of joints, transmission^T @ torques of motors; or torques of motors.
    base_rows : bool
        Whether the force and torque that the base exerts on the arm are measured too.
    sensor_set : str, optional
        The sensors that measure it; without, all coordinates are measured, of elastic joints those of the
        motors too.

    Raises
    ------
    ModelError
        If no joint moves, motors do not determine the joints, there is no such sensor set, or its sensors
        give no row.
    """
    _check_size(spec)
    if sensor_set and sensor_set not in spec.sensor_sets:
        remedy = f"its sensor sets are {listed(spec.sensor_sets)}" if spec.sensor_sets else "leave it out"
        raise ModelError.at(spec.source, f"has no sensor set {sensor_set!r}", remedy)
    graph = Graph()
    sensors = spec.sensor_sets[sensor_set] if sensor_set else ()
    parts = row_parts(graph, spec, base_rows, sensors)
    rows = list(balances(graph, spec, kind, parts, measured_torques(sensors)))
    found: ReadRows = as_they_are(rows)
    estimated: tuple[Estimated, ...] = ()
    if sensor_set:
        where = f"{spec.source}: sensors.{sensor_set}"
        found, sensors, estimated = sensed_rows(graph, spec, parts, rows, sensors, where)
    found = found.independent()
    return ArmRows(
        spec,
        graph,
        kind,
        tuple(row.name for row in found.rows),
        parts.columns,
        parts.owners,
        {(r, c): entry for r, row in enumerate(found.rows) for c, entry in sorted(row.entries.items())},
        tuple(row.measured for row in found.rows),
        parts.speeds,
        sensor_set,
        sensors,
        found.differentiated,
        found.reversals,
        found.channels,
        found.lost,
        found.lacking,
        estimated,
    )


def _check_size(spec: ArmSpec) -> None:
    moving = spec.moving
    if not moving:
        raise ModelError.at(
            spec.source,
            "no joint moves, so there is nothing to identify",
            "add a revolute or prismatic joint",
        )
    if len(moving) > LARGEST_ARM or len(spec.joints) > MOST_JOINTS:
        raise ModelError.at(
            spec.source,
            f"{len(moving):,} of {len(spec.joints):,} joints move; rows are derived for at most "
            f"{LARGEST_ARM} of {MOST_JOINTS}",
            "leave out what is measured apart, or lump links that are fixed to each other",
        )
