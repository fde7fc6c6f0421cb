"""Modules of chains as text."""

from __future__ import annotations

from typing import Any

from modelgen.errors import Problem, RenderError
from modelgen.generated_module.allow_list import REMEDY
from modelgen.generated_module.module_check import module_problems, seal
from modelgen.render.environment import environment
from modelgen.render.view import model_view
from modelgen.spec.arms.arm import ArmSpec
from modelgen.spec.chain import ChainSpec
from modelgen.symbolic.pipeline import build


def render(view: dict[str, Any]) -> str:
    """Return the text of a module, with its digest in the header.

    Raises
    ------
    RenderError
        If the text is not one that modelgen would execute (`modelgen.generated_module.module_check`): it is
        never written.
    """
    text = environment().get_template("module.py.j2").render(view)
    return sealed_module(text, f"module {view['chain']}_{view['sensor_set']}")


def sealed_module(text: str, name: str) -> str:
    """Return the text of a module with its digest.

    Raises
    ------
    RenderError
        If it is not one that modelgen would execute; `name` says which it is.
    """
    text = seal(text)
    problems = module_problems(text)
    if problems:
        remedies = {REMEDY: "report what it was made from: modelgen must not write such a module"}
        raise RenderError(
            *(Problem(f"{name}, {p.where}", p.what, remedies.get(p.remedy, p.remedy)) for p in problems)
        )
    return text


def generate(spec: ChainSpec, sensor_set: str) -> str:
    """Return the text of the module for one sensor set of a chain.

    Parameters
    ----------
    spec : ChainSpec
        The chain, see `modelgen.load_spec`.
    sensor_set : str
        Name of a table ``[sensors.NAME]`` of the spec.

    Returns
    -------
    str
        Source of a NumPy-only module; the same spec gives the same bytes.

    Raises
    ------
    SpecError
        When `spec` is no chain, or has no such sensor set.
    """
    return render(model_view(build(spec, sensor_set)))


def module_name(spec: ChainSpec | ArmSpec, sensor_set: str) -> str:
    """Return the name of the module of a sensor set, without .py; "" stands for an arm without any."""
    return f"{spec.name}_{sensor_set}" if sensor_set else spec.name


def module_files(spec: ChainSpec, sensor_set: str) -> dict[str, str]:
    """Return the module of a sensor set by the name of its file."""
    return {f"{module_name(spec, sensor_set)}.py": generate(spec, sensor_set)}
