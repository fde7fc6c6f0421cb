"""`modelgen design` of an arm: a trajectory within its limits that tells the base parameters apart."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from math import exp, inf
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import typer

from modelgen.array_types import FloatArray
from modelgen.cli.arguments import given_options, load_chain_or_arm
from modelgen.cli.output import deliver, note
from modelgen.cli.output_files import check_output
from modelgen.cli.tables import Description, Justify, console, table
from modelgen.errors import DataError, Problem
from modelgen.spec.arms.arm import ArmSpec

if TYPE_CHECKING:
    from rich.console import Group

    from modelgen.cli.arms.trajectory_options import TrajectoryOptions
    from modelgen.cli.options import ResultOptions
    from modelgen.runtime.planning.arms.exciting_trajectory import ExcitingTrajectory
    from modelgen.runtime.planning.arms.workspace import Box, PlannedJoint
    from modelgen.spec.chain import ChainSpec

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
    context: typer.Context, spec: str, trajectory: TrajectoryOptions, result: ResultOptions
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
        wrong, what = [o for o in given if o not in _OF_ARMS + _OF_BOTH], "is of chains"
    else:
        wrong, what = [o for o in given if o in _OF_ARMS], "is of arms"
    if wrong:
        said = f"{what}, and {spec.source} describes {'an arm' if isinstance(spec, ArmSpec) else 'a chain'}"
        raise DataError(*(Problem(option, said, "leave it out") for option in wrong))


def design_arm(
    arm: ArmSpec, trajectory: TrajectoryOptions, given: Mapping[str, Any], result: ResultOptions
) -> None:
    """Search for a trajectory with the options of the command, tell it, and write it where asked for."""
    from modelgen.render.arms.arm_writer import arm_module
    from modelgen.runtime.model.module_file import execute_text
    from modelgen.runtime.planning.arms.exciting_trajectory import exciting_trajectory
    from modelgen.spec.arms.sensors import without_springs
    from modelgen.symbolic.arms.arm_rows import arm_rows
    from modelgen.symbolic.arms.base_parameters import arm_base_model

    fs, path = given["fs"] or FS_HZ, given["optimise"]
    duration_s = DURATION_S if given["duration_s"] is None else given["duration_s"]
    samples = _samples(fs, duration_s, trajectory.harmonics)
    if path is not None:
        check_output(path, (".csv", ".npz"), result.overwrite)
    boxes = (*_boxes("--inside", trajectory.inside), *_boxes("--outside", trajectory.outside))
    if arm.elastic:
        note(["springs are left out: this is for links, drives and gravity; K and D need fast motion"])
        arm = without_springs(arm)
    module = execute_text(arm_module(arm_base_model(arm_rows(arm))), arm.name)
    found = exciting_trajectory(
        module,
        planned_joints(arm),
        criterion=given["criterion"] or "condition",
        boxes=boxes,
        period_s=samples / fs,
        harmonics=trajectory.harmonics,
        seeds=trajectory.seeds,
        rounds=given["rounds"],
    )
    described = _described(arm, found, given["criterion"] or "condition")
    if path is not None:
        _write(path, found, fs, result.overwrite)
        described |= {"written": str(path), "fs_hz": fs}
    deliver(described, lambda: console().print(_tables(described)), result)


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
    if problems:
        raise DataError(*problems)
    return boxes


def _side(text: str) -> tuple[float, float]:
    lower, colon, upper = text.partition(":")
    ends = float(lower) if lower.strip() else -inf, float(upper) if upper.strip() else inf
    if not colon or any(np.isnan(end) for end in ends):
        raise ValueError(text)
    return ends


def _write(path: Path, found: ExcitingTrajectory, fs: float, overwrite: bool) -> None:
    """Write one period: t, then position, speed and acceleration of every joint (rad or m, s)."""
    from modelgen.runtime.records.record import Record
    from modelgen.runtime.records.write_record import write_record

    times = np.arange(round(found.trajectory.period_s * fs) + 1) / fs
    motion = found.trajectory.at(times)
    columns = {
        f"{order}_{name}": values[k]
        for k, name in enumerate(found.joints)
        for order, values in zip(("q", "d1_q", "d2_q"), motion, strict=True)
    }
    write_record(path, Record(columns, fs, path.stem), overwrite=overwrite)


def _described(arm: ArmSpec, found: ExcitingTrajectory, criterion: str) -> Description:
    bounds, moving = found.bounds, {joint.name: joint for joint in arm.moving}
    return {
        "arm": arm.name,
        "criterion": criterion,
        "period_s": found.trajectory.period_s,
        "harmonics": found.trajectory.harmonics,
        "condition_number": found.condition,
        "information": found.information,
        "searches": [{"start": a, "end": b} for a, b in found.costs],
        "joints": [
            {
                "name": name,
                "unit": "rad" if moving[name].kind == "revolute" else "m",
                "position": [float(bounds.lower[k]), float(bounds.upper[k])],
                "position_limits": list(moving[name].position_limits or ()),
                "speed": float(bounds.speed[k]),
                "speed_limit": moving[name].speed_limit,
                "acceleration": float(bounds.acceleration[k]),
                "acceleration_limit": moving[name].acceleration_limit,
                "offset": float(found.trajectory.offsets[k]),
                "sines": found.trajectory.sines[k].tolist(),
                "cosines": found.trajectory.cosines[k].tolist(),
            }
            for k, name in enumerate(found.joints)
        ],
        "boxes": [{"box": box.text, "clearance_m": room} for box, room in found.boxes],
    }


def _tables(described: Description) -> Group:
    from rich.console import Group
    from rich.text import Text

    period, count = described["period_s"], described["harmonics"]
    head = (
        f"Exciting trajectory of {described['arm']}: {period:g} s, {count} harmonics of {1 / period:.4g} Hz "
        f"(up to {count / period:.4g} Hz), beginning and ending at rest"
    )
    rows = []
    for joint in described["joints"]:
        (low, high), (least, most), unit = joint["position"], joint["position_limits"], joint["unit"]
        rows.append(
            (
                joint["name"],
                f"{low:.3f} to {high:.3f} {unit} (of {least:.3f} to {most:.3f})",
                _of(joint["speed"], joint["speed_limit"], f"{unit}/s"),
                _of(joint["acceleration"], joint["acceleration_limit"], f"{unit}/s^2"),
            )
        )
    columns: list[tuple[str, Justify]] = [
        (heading, "left") for heading in ("joint", "position", "speed", "acceleration")
    ]
    ends = sorted(search["end"] for search in described["searches"] if search["end"] is not None)
    tried, sign = len(described["searches"]), 1 if described["criterion"] == "condition" else -1
    what = "condition numbers" if sign > 0 else "mean singular values"
    lines = [
        f"condition number of the base regressor {described['condition_number']:.3g}",
        f"{len(ends)} of {tried} searches found one, with {what} of "
        f"{exp(sign * ends[0]):.3g} to {exp(sign * ends[-1]):.3g}",
        "none of these bounds is exceeded at any time, between samples neither",
    ]
    lines += [f"{one['box']}: kept, by {one['clearance_m']:.3g} m at least" for one in described["boxes"]]
    if "written" in described:
        written, fs = described["written"], described["fs_hz"]
        lines.append(
            f"wrote {written}: t, q, d1_q, d2_q of one period at {fs:g} Hz; bring the arm to its first row"
        )
    else:
        lines.append("--optimise FILE.csv writes it")
    title = "What the joints never exceed (and their limits)"
    return Group(Text(head), Text(""), table(title, columns, rows), Text(""), *map(Text, lines))


def _of(value: float, limit: float | None, unit: str) -> str:
    return f"{value:.3g} {unit}" + ("" if limit is None else f" (of {limit:.3g})")
