"""`modelgen design` of an arm: a trajectory within its limits that distinguishes the base parameters."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import typer

from modelgen.array_types import FloatArray
from modelgen.cli.arguments import given_options, load_chain_or_arm
from modelgen.cli.arms.design_elastic import (
    given_references,
    prediction_tables,
    predictions,
    reference_of,
    second_stage,
)
from modelgen.cli.arms.trajectory_tables import fast_described, trajectory_described, trajectory_tables
from modelgen.cli.output import deliver, note
from modelgen.cli.output_files import check_output
from modelgen.cli.tables import console
from modelgen.errors import DataError, Problem
from modelgen.spec.arms.arm import ArmSpec

if TYPE_CHECKING:
    from modelgen.cli.arms.trajectory_options import TrajectoryFlags
    from modelgen.cli.options import ResultOptions
    from modelgen.runtime.planning.arms.workspace import Box, PlannedJoint
    from modelgen.runtime.simulation.arms.fourier_trajectory import FourierTrajectory
    from modelgen.spec.chain import ChainSpec

_OF_ELASTIC = ("--sensors", "--noise", "--parameters", "--excitation", "--wanted-percent")
_OF_ARMS = ("--inside", "--outside", "--harmonics", "--seeds")
_OF_BOTH = (
    "--optimise",
    "--criterion",
    "--rounds",
    "--fs",
    "--duration-s",
    "--output",
    "-o",
    "--overwrite",
    "--json",
)
FS_HZ, DURATION_S, MOST_SAMPLES = 1000.0, 10.0, 10_000_000


def chain_unless_arm(
    context: typer.Context, spec: str, trajectory: TrajectoryFlags, result: ResultOptions
) -> ChainSpec | None:
    """Return the chain that a spec describes; of an arm, for which a trajectory is designed, None."""
    found = load_chain_or_arm(spec)
    refuse_options(context, found)
    if not isinstance(found, ArmSpec):
        return found
    design_arm(found, trajectory, context.params, result)
    return None


def refuse_options(context: typer.Context, spec: ChainSpec | ArmSpec) -> None:
    """Refuse options that do nothing for what is designed.

    Raises
    ------
    DataError
        Naming every one.
    """
    given = [option for option in given_options(context) if option.startswith("-")]
    if isinstance(spec, ArmSpec):
        known = _OF_ARMS + _OF_BOTH + (_OF_ELASTIC if spec.elastic else ())
        wrong, what = [o for o in given if o not in known], "is of chains"
    else:
        wrong, what = [o for o in given if o in _OF_ARMS], "is of arms"
    if wrong:
        said = f"{what}, and {spec.source} describes {'an arm' if isinstance(spec, ArmSpec) else 'a chain'}"
        raise DataError(*(Problem(option, said, "leave it out") for option in wrong))


def design_arm(
    arm: ArmSpec, trajectory: TrajectoryFlags, given: Mapping[str, Any], result: ResultOptions
) -> None:
    """Search for a trajectory with the options of the command, print it, and write it where asked for."""
    from modelgen.render.arms.arm_writer import arm_module
    from modelgen.runtime.model.module_file import execute_text
    from modelgen.runtime.planning.arms.exciting_trajectory import exciting_trajectory
    from modelgen.spec.arms.sensors import without_springs
    from modelgen.symbolic.arms.arm_rows import arm_rows
    from modelgen.symbolic.arms.base_parameters import arm_base_model

    if given["excitation"]:
        predict_along(arm, given, result)
        return
    fs, path = given["fs"] or FS_HZ, given["optimise"]
    duration_s = DURATION_S if given["duration_s"] is None else given["duration_s"]
    samples = _samples(fs, duration_s, trajectory.harmonics)
    staged = arm.elastic and bool(arm.parameter_sets)
    fast = path.with_stem(f"{path.stem}_fast") if path is not None and staged else None
    for written in (path, fast):
        if written is not None:
            check_output(written, (".csv", ".npz"), result.overwrite)
    boxes = (*_boxes("--inside", trajectory.inside), *_boxes("--outside", trajectory.outside))
    if arm.elastic:
        what = (
            "a fast one about the modes follows" if staged else "K and D need fast motion, which needs values"
        )
        note([f"springs are left out of the slow motion, which is for links, drives and gravity; {what}"])
    rigid = without_springs(arm) if arm.elastic else arm
    module = execute_text(arm_module(arm_base_model(arm_rows(rigid))), arm.name)
    joints = planned_joints(arm)
    found = exciting_trajectory(
        module,
        joints,
        criterion=given["criterion"] or "condition",
        boxes=boxes,
        period_s=samples / fs,
        harmonics=trajectory.harmonics,
        seeds=trajectory.seeds,
        rounds=given["rounds"],
    )
    described = trajectory_described(arm, found, given["criterion"] or "condition")
    if path is not None:
        _write(path, found.joints, found.trajectory, fs, result.overwrite)
        described |= {"written": str(path), "fs_hz": fs}
    if staged:
        start = found.trajectory.at(np.zeros(1))[0][:, 0]
        second = second_stage(arm, given, joints, start, samples / fs, boxes)
        if fast is not None:
            _write(fast, found.joints, second.trajectory, fs, result.overwrite)
        described["fast"] = fast_described(second, fast)
        stages = ((found.trajectory, "slow"), (second.trajectory, "fast"))
        references = [reference_of(motion, fs, name) for motion, name in stages]
        described["predicted"] = predictions(arm, given, references)
    deliver(described, lambda: console().print(trajectory_tables(described)), result)


def predict_along(arm: ArmSpec, given: Mapping[str, Any], result: ResultOptions) -> None:
    """Print what each sensor set of an elastic arm would find along the motions of files."""
    references = given_references(arm, given["excitation"])
    predicted = predictions(arm, given, references)
    described = {"arm": arm.name, "predicted": predicted}
    deliver(described, lambda: console().print(prediction_tables(predicted)), result)


def _samples(fs: float, duration_s: float, harmonics: int) -> int:
    """Return the samples of one period, a whole number.

    Raises
    ------
    DataError
        If the duration is no positive number, or the samples are too few for the highest frequency, or more
        than a file should hold.
    """
    if not duration_s > 0.0:
        raise DataError.at("--duration-s", f"is {duration_s:g} s", "give a positive number")
    samples = round(min(fs * duration_s, 1e12))
    if not 10 * harmonics <= samples <= MOST_SAMPLES:
        what = f"gives {samples:,} samples of {harmonics} harmonics in {duration_s:g} s"
        least = 10 * harmonics / duration_s
        remedy = f"give {least:g} to {MOST_SAMPLES / duration_s:g} Hz"
        raise DataError.at("--fs", what, remedy)
    return samples


def planned_joints(arm: ArmSpec) -> list[PlannedJoint]:
    """Return the joints of an arm with their placements and limits."""
    from modelgen.runtime.planning.arms.workspace import PlannedJoint
    from modelgen.spec.arms.poses import zero_ways

    ways = zero_ways(arm)
    placements: dict[str, FloatArray] = {
        name: np.asarray(np.linalg.solve(way[0], way[-1]), dtype=float) for name, way in ways.items()
    }
    return [
        PlannedJoint(
            joint.name,
            joint.parent,
            joint.kind,
            placements[joint.name],
            joint.position_limits,
            joint.speed_limit,
            joint.acceleration_limit,
        )
        for joint in arm.joints
    ]


def _boxes(option: str, items: Iterable[str] | None) -> list[Box]:
    from modelgen.runtime.planning.arms.workspace import Box

    boxes, problems = [], []
    for item in items or ():
        frame, _, text = item.partition("=")
        try:
            sides = [_side(part) for part in text.split(",")]
            (x0, x1), (y0, y1), (z0, z1) = sides
        except ValueError:
            remedy = "write FRAME=X0:X1,Y0:Y1,Z0:Z1 in m, such as 6=-0.5:0.5,:,0.1: (open ends are left out)"
            problems.append(Problem(f"{option} {item}", "cannot be read", remedy))
            continue
        boxes.append(Box(frame, (x0, y0, z0), (x1, y1, z1), option == "--inside"))
    DataError.raise_any(problems)
    return boxes


def _side(text: str) -> tuple[float, float]:
    lower, colon, upper = text.partition(":")
    ends = float(lower) if lower.strip() else -inf, float(upper) if upper.strip() else inf
    if not colon or any(np.isnan(end) for end in ends):
        raise ValueError(text)
    return ends


def _write(path: Path, joints: Sequence[str], motion: FourierTrajectory, fs: float, overwrite: bool) -> None:
    """Write one period: t, then position, speed and acceleration of every joint (rad or m, s)."""
    from modelgen.runtime.records.record import Record
    from modelgen.runtime.records.write_record import write_record

    times = np.arange(round(motion.period_s * fs) + 1) / fs
    moved = motion.at(times)
    columns = {
        f"{order}_{name}": values[k]
        for k, name in enumerate(joints)
        for order, values in zip(("q", "d1_q", "d2_q"), moved, strict=True)
    }
    write_record(path, Record(columns, fs, path.stem), overwrite=overwrite)
