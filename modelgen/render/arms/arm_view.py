"""The variables of the template of an arm's module: plain strings and tuples, nothing symbolic."""

from __future__ import annotations

import re
from collections.abc import Mapping
from fractions import Fraction
from typing import Any

from modelgen.render.arms.arm_lines import ArmLines, arm_lines, signal_key
from modelgen.render.arms.kernel_names import legend
from modelgen.render.arms.sensor_readings import drive_speeds
from modelgen.render.arms.straight_line import Operation, StraightLine
from modelgen.render.printer import literal, weighted_sum
from modelgen.spec.arms.arm import LINK_PARAMETERS, ArmSensor
from modelgen.spec.arms.parameters import COUPLED, ArmParameter, arm_parameters, mounting_values
from modelgen.spec.arms.poses import pose_of
from modelgen.symbolic.arms.base_parameters import ArmBaseModel

ARM_CONTRACT_VERSION = 2
#: samples of a block: its buffers stay in the processor's cache
BLOCK = 4096
SAFE_FILE_NAME = re.compile(r"[A-Za-z0-9_.-]{1,100}\Z")


def arm_view(model: ArmBaseModel) -> dict[str, Any]:
    """Return all that the template prints: constants as (name, source), functions as lines of source.

    Raises
    ------
    RenderError
        If a named length has no value.
    """
    rows, spec, lines = model.rows, model.rows.spec, arm_lines(model)
    local = tuple(lines.local.values())
    return dict(
        name=spec.name,
        source=spec.source if SAFE_FILE_NAME.match(spec.source) else f"{spec.name}.toml",
        sha256=spec.sha256,
        sensor_set=rows.sensor_set,
        rows=rows.names,
        base=tuple(b.name for b in model.base),
        absent=tuple(f"{name}: {reason}" for name, reason in model.absent.items()),
        legend=legend(rows),
        constants=_constants(lines),
        block=BLOCK,
        row_count=len(rows.names),
        column_count=len(model.base),
        entries=_kernel(local, lines.entries, len(lines.places)),
        measurement=_kernel(local, lines.measurement, len(rows.names)),
        base_lines=tuple(_base_source(b.factors(lines.lengths)) for b in model.base),
    )


def _base_source(factors: Mapping[str, float]) -> str:
    return weighted_sum((Fraction(factor), f'p["{name}"]') for name, factor in factors.items())


def _kernel(signals: tuple[str, ...], line: StraightLine, outputs: int) -> dict[str, Any]:
    """Return one function of straight lines: (comment, lines) of each section."""
    named = tuple((section, tuple(map(_source, operations))) for section, operations in line.sections())
    return {"signals": signals, "sections": named, "buffers": line.buffers, "outputs": outputs}


def _source(operation: Operation) -> str:
    operands = [repr(float(x)) if isinstance(x, float) else x for x in operation.operands]
    return f"{operation.name} = np.{operation.function}({', '.join([*operands, operation.target])})"


def _constants(lines: ArmLines) -> tuple[tuple[str, str], ...]:
    model = lines.model
    rows, spec = model.rows, model.rows.spec
    parameters = arm_parameters(spec, rows.sensors)
    mounted = mounting_values(spec, rows.sensors)
    values: dict[str, object] = {
        "CONTRACT_VERSION": ARM_CONTRACT_VERSION,
        "ARM": spec.name,
        "TITLE": spec.title,
        "SPEC_SHA256": spec.sha256,
        "JOINTS": tuple(
            {"name": joint.name, "kind": joint.kind, "parent": joint.parent} for joint in spec.joints
        ),
        "TRANSMISSION": spec.transmission,
        "LENGTHS": dict(spec.lengths),
        "PARAMETERS": tuple(name for name in rows.columns if name not in spec.known),
        "KNOWN": dict(spec.known),
        "BASE_PARAMETERS": tuple(b.name for b in model.base),
        "IDENTIFIABLE": model.identifiable,
        "ABSENT": dict(model.absent),
        "UNITS": {one.name: one.unit for one in parameters},
        "ROLES": {one.name: {"role": _role(one), "bodies": (_body(one),)} for one in parameters},
        "PARAMETER_SETS": {name: {**table, **mounted} for name, table in spec.parameter_sets.items()},
        "SIGNALS": tuple(signal_key(symbol) for symbol in lines.signals),
        "ROW_KIND": rows.kind,
        "ROWS": rows.names,
        "ENTRIES": lines.places,
    }
    if rows.sensor_set:
        values["SENSOR_SET"] = rows.sensor_set
        values["SENSORS"] = tuple(_sensor(sensor) for sensor in rows.sensors)
        values["DIFFERENTIATED"] = rows.differentiated
        values["REVERSALS"] = rows.reversals
        values["SPEEDS"] = drive_speeds(rows)
    if rows.estimated:
        values["ESTIMATED"] = dict(rows.estimated)
    if rows.sensor_set and any(one.role == "stiffness" for one in parameters):
        # what is asked of rows without a simulation: whether links, or gravity, are elsewhere
        poses = [pose_of(joint.placement, spec.lengths) for joint in spec.joints]
        values["PLACEMENTS"] = tuple(tuple(tuple(map(float, row)) for row in pose[:3]) for pose in poses)
        values["GRAVITY"] = tuple(map(float, spec.gravity))
    return tuple((name, literal(value)) for name, value in values.items())


def _sensor(sensor: ArmSensor) -> dict[str, object]:
    """Return a sensor as a literal: what it measures, and the channels that it has in a record."""
    return {name: getattr(sensor, name) for name in ("key", "joint", "side", "measures", "channels")}


def _role(parameter: ArmParameter) -> str:
    """Return what a parameter is, in the words of chains: of a link, or of the drive at a joint."""
    if parameter.role in LINK_PARAMETERS:
        return "link"
    return "inertia" if parameter.role == "rotor_inertia" else parameter.role


def _body(parameter: ArmParameter) -> str:
    """Return what a parameter acts on: the coordinate of a drive, or a link, which others move as well."""
    if parameter.payload is not None:
        return f"payload {parameter.payload}"
    if parameter.role in (*LINK_PARAMETERS, "mounting"):
        return f"link {parameter.joint}"
    return parameter.joint + COUPLED if parameter.of_motor else parameter.joint
