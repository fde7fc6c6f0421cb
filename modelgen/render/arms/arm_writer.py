"""An arm's model as the text of a NumPy module (contract 2)."""

from __future__ import annotations

from modelgen.render.arms.arm_view import arm_view
from modelgen.render.environment import environment
from modelgen.render.writer import module_name, sealed_module
from modelgen.spec.arms.arm import ArmSpec
from modelgen.symbolic.arms.arm_rows import arm_rows
from modelgen.symbolic.arms.base_parameters import ArmBaseModel, arm_base_model


def arm_files(spec: ArmSpec, sensor_set: str) -> dict[str, str]:
    """Return the module of an arm by the name of its file; "" stands for an arm without sensor sets."""
    text = arm_module(arm_base_model(arm_rows(spec, sensor_set=sensor_set)))
    return {f"{module_name(spec, sensor_set)}.py": text}


def arm_module(model: ArmBaseModel) -> str:
    """Return the text of an arm's module, with its digest in the header; the same model gives the same bytes.

    Raises
    ------
    RenderError
        If a named length has no value, or the arm is so large that its module would not be executed.
    """
    view = arm_view(model)
    text = environment().get_template("arm_module.py.j2").render(view)
    return sealed_module(text, f"module {view['name']}")
