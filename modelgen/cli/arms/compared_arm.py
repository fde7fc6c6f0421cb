"""`modelgen validate` of an arm: its closed loop, or the forces that its motion needs."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from modelgen.cli.data_arguments import FURTHER_INPUTS, REFERENCE
from modelgen.errors import DataError, Problem

if TYPE_CHECKING:
    from modelgen.runtime.model.model import Model
    from modelgen.runtime.simulation.validation import Validation


def inputs_of_loop(model: Model) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return channels of a record that a closed loop needs, and those that it uses where they are mapped."""
    if not model.is_arm:
        return REFERENCE, FURTHER_INPUTS
    from modelgen.runtime.simulation.arms.arm_coordinates import joint_units
    from modelgen.runtime.simulation.arms.validate_arm import REFERENCES

    needed, *further = (tuple(f"{word}_{name}" for name in joint_units(model)) for word in REFERENCES)
    return needed, tuple(key for keys in further for key in keys)


def arm_comparison(
    model: Model, controller: Path | None, options: Mapping[str, Any]
) -> Callable[..., tuple[Validation, ...]]:
    """Return what compares records with parameters, in the controller's loop or by inverse dynamics.

    Raises
    ------
    DataError
        For options that do nothing for an arm, and mistakes of the controller's file.
    """
    from modelgen.runtime.comparison.arm_forces import compare_forces
    from modelgen.runtime.simulation.arms.joint_controller import load_joint_controller
    from modelgen.runtime.simulation.arms.validate_arm import validate_arm

    given = [name for name, value in options.items() if value is not None]
    if given:
        flags = [name if name.startswith("--") else f"--{name.replace('_', '-')}" for name in given]
        raise DataError(*(Problem(flag, "is of chains", "leave it out") for flag in flags))
    if controller is None:
        return partial(compare_forces, model)
    law = load_joint_controller(controller)
    return lambda values, records, used=(): validate_arm(model, values, records, law, used=used)
