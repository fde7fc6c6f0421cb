"""All passes of the derivation, on one page.

ChainSpec           modelgen.spec.load.load_spec(path)          the user's TOML, validated
MotionEquations     newton.motion_equations(spec)          one balance of forces a body
IdentificationRows  rows.identification_rows(motion, set)  sums, differentiation, readings of sensors
BaseModel           base_parameters.base_model(rows)       the columns that can be distinguished
fields of template  modelgen.render.view.model_view(model) plain strings
module text         modelgen.render.writer.render(view)    one NumPy file
"""

from __future__ import annotations

from modelgen.errors import SpecError
from modelgen.spec.chain import ChainSpec
from modelgen.symbolic.base_parameters import BaseModel, base_model
from modelgen.symbolic.equations.newton import motion_equations
from modelgen.symbolic.rows import identification_rows


def build(spec: ChainSpec, sensor_set: str) -> BaseModel:
    """Derive the identification model of a chain for one of its sensor sets.

    Parameters
    ----------
    spec : ChainSpec
        The chain, see `modelgen.load_spec`.
    sensor_set : str
        Name of a table ``[sensors.NAME]`` of the spec.

    Raises
    ------
    SpecError
        If `spec` is no chain, or has no such sensor set.
    ModelError
        If the sensors do not determine rows for the chain.
    """
    if not isinstance(spec, ChainSpec):
        what = f"is of the type {type(spec).__name__}, not a chain"
        raise SpecError.at("spec", what, "load it first: modelgen.load_spec(path)")
    choose = f"choose one of {', '.join(spec.sensor_sets)}"
    if not isinstance(sensor_set, str):
        what = f"is of the type {type(sensor_set).__name__}, not a name"
        raise SpecError.at("sensor_set", what, choose)
    if sensor_set not in spec.sensor_sets:
        raise SpecError.at(f"{spec.source}: sensors.{sensor_set}", "there is no such sensor set", choose)
    motion = motion_equations(spec)
    rows = identification_rows(motion, sensor_set)
    return base_model(rows)
