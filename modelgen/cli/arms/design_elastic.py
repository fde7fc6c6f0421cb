"""`modelgen design` of an elastic arm: a fast second stage, and what each sensor set would find in both."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from modelgen.cli.tables import Description, table
from modelgen.errors import DataError, ModelgenError

if TYPE_CHECKING:
    from rich.console import Group

    from modelgen.array_types import FloatArray
    from modelgen.runtime.model.model import Model
    from modelgen.runtime.planning.arms.fast_excitation import FastExcitation
    from modelgen.runtime.planning.arms.predicted_sets import PlannedSet
    from modelgen.runtime.planning.arms.workspace import Box, PlannedJoint
    from modelgen.runtime.simulation.arms.fourier_trajectory import FourierTrajectory
    from modelgen.runtime.simulation.arms.joint_reference import JointReference
    from modelgen.spec.arms.arm import ArmSpec

#: Parameters of drives that are printed for every joint.
TOLD = ("stiffness", "damping", "stiffness3")


def second_stage(
    arm: ArmSpec,
    given: Mapping[str, Any],
    joints: Sequence[PlannedJoint],
    posture: FloatArray,
    period_s: float,
    boxes: Sequence[Box],
) -> FastExcitation:
    """Return the small, fast motion about the modes at the posture where the slow one begins.

    `posture` has shape (joints,), in rad or m.
    """
    from modelgen.cli.arms.simulate_arm import arm_model
    from modelgen.runtime.planning.arms.fast_excitation import fast_excitation

    model = arm_model(arm)
    return fast_excitation(model, _values(arm, model, given), joints, posture, period_s, boxes)


def reference_of(motion: FourierTrajectory, fs: float, name: str) -> JointReference:
    """Return one period of a trajectory as a reference."""
    from modelgen.runtime.simulation.arms.joint_motion import JointMotion
    from modelgen.runtime.simulation.arms.joint_reference import JointReference

    q, v, a = motion.at(np.arange(round(motion.period_s * fs) + 1) / fs)
    return JointReference(JointMotion(q, v, a, fs), name)


def given_references(arm: ArmSpec, files: Sequence[str]) -> list[JointReference]:
    """Return the references in files with columns q_NAME.

    Raises
    ------
    DataError
        When one is no data file, or lacks a joint.
    """
    from modelgen.cli.arms.simulate_arm import arm_model
    from modelgen.runtime.records.read_record import read_record
    from modelgen.runtime.simulation.arms.joint_reference import reference_from_record

    kinds = [text for text in files if not Path(text).suffix]
    if kinds:
        remedy = "give data files with columns q_NAME of the joints"
        raise DataError.at("--excitation", f"{kinds[0]!r} is none of an arm", remedy)
    model = arm_model(arm)
    return [reference_from_record(model, read_record(text)) for text in files]


def predictions(arm: ArmSpec, given: Mapping[str, Any], references: Sequence[JointReference]) -> Description:
    """Return half of the 95 % interval of every parameter, in % of its value, for each sensor set."""
    from modelgen.cli.arguments import amounts
    from modelgen.cli.arms.simulate_arm import arm_model
    from modelgen.runtime.planning.arms.predicted_sets import predicted_sets

    model = arm_model(arm)
    values = _values(arm, model, given)
    sets, refused = _sets(arm, given["sensors"])
    noise = amounts("--noise", given["noise"] or ())
    found = predicted_sets(model, values, sets, references, noise)
    base = model.base_from_physical({name: values[name] for name in model.parameters})
    truth = dict(zip(model.base_parameters, base.tolist(), strict=True))
    springs = [name for name, role in model.roles.items() if role.role in TOLD and name in truth]
    told: dict[str, dict[str, float]] = {}
    for name, promised in found.items():
        if isinstance(promised, ModelgenError):
            refused[name] = promised.problems[0].what
            continue
        told[name] = {
            one: 196.0 * std / abs(truth[one]) if truth.get(one) else float("inf")
            for one, std in promised.deviations.items()
        }
    stiff = [name for name in springs if model.roles[name].role == "stiffness"]

    def worst(name: str) -> float:
        return max(told[name].get(one, float("inf")) for one in stiff)

    ranked = sorted(told, key=lambda name: (worst(name), name))
    wanted = given["wanted_percent"]
    return {
        "springs": springs,
        "wanted_percent": wanted,
        "sets": [
            {
                "sensor_set": name,
                "half_interval_percent": {k: (v if np.isfinite(v) else None) for k, v in told[name].items()},
                "within": worst(name) <= wanted,
            }
            for name in ranked
        ],
        "refused": refused,
    }


def prediction_tables(described: Description) -> Group:
    """Lay out what was predicted."""
    from rich.console import Group
    from rich.text import Text

    springs = described["springs"]
    rows = []
    for entry in described["sets"]:
        found = entry["half_interval_percent"]
        shown = ("-" if found.get(name) is None else f"{found[name]:.2g}" for name in springs)
        rows.append((entry["sensor_set"], *shown))
    within = [entry["sensor_set"] for entry in described["sets"] if entry["within"]]
    wanted = f"stiffness within {described['wanted_percent']:g} %"
    lines = [f"{wanted}: {', '.join(within)}" if within else f"no set gives {wanted}"]
    lines += ["simulated in closed loop (PD of 10 Hz at the motors), with noise, and identified"]
    lines += [f"{name}: {reason}" for name, reason in described["refused"].items()]
    title = "Predicted half widths of 95 % intervals"
    return Group(
        table(title, ("sensors", *(f">{name} %" for name in springs)), rows), Text(""), *map(Text, lines)
    )


def _values(arm: ArmSpec, model: Model, given: Mapping[str, Any]) -> Mapping[str, float]:
    from modelgen.cli.arguments import parameter_values
    from modelgen.cli.arms.simulate_arm import with_zeros

    return with_zeros(arm, model, parameter_values(arm, given["parameters"]))[0]


def _sets(arm: ArmSpec, asked: str | None) -> tuple[dict[str, PlannedSet], dict[str, str]]:
    """Return the sets to compare and why others give no rows: of the file, one of them, or all usual ones."""
    from modelgen.cli.arms.simulate_arm import mounted, recorded_set
    from modelgen.cli.candidates import spec_model
    from modelgen.runtime.planning.arms.predicted_sets import PlannedSet
    from modelgen.symbolic.arms.arm_sensor_sets import with_usual_sets

    names = {name: name for name in arm.sensor_sets}
    if asked == "all":
        arm = with_usual_sets(arm)
        names = {name: name.replace(",", "").replace(" ", "_") for name in arm.sensor_sets}
        arm = replace(arm, sensor_sets={names[name]: sensors for name, sensors in arm.sensor_sets.items()})
    elif asked is not None:
        names = {asked: str(recorded_set(arm, asked))}
    sets, refused = {}, {}
    for title, name in names.items():
        try:
            sets[title] = PlannedSet(spec_model(arm, name), mounted(arm, name))
        except ModelgenError as error:
            refused[title] = error.problems[0].what
    return sets, refused
