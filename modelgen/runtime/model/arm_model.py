"""The view of an arm's module that the runtime uses: signals, features and sums, as of a chain's.

What the record must bring, and whose directions the rows hold, is in `arm_channels`; here every entry becomes
a sum of signals and features, or a line of the kernel.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.model.arm_channels import ArmChannels, also_read, arm_channels
from modelgen.runtime.model.arm_functions import ArmFunctions
from modelgen.runtime.model.arm_kernel import SAMPLES_A_CANDIDATE, ArmKernel, CandidateSignals, Sum
from modelgen.runtime.model.deflected_kernel import DeflectedKernel
from modelgen.runtime.model.deflected_rows import deflected_rows


def arm_fields(module: Any) -> dict[str, Any]:
    """Return what a module of an arm holds in the form of a chain's: entries of the tables, and the columns.

    The keys are names of `modelgen.runtime.model.model.Model`, less those that both contracts share.
    """
    channels = arm_channels(module)
    kernel: ArmKernel | DeflectedKernel
    entries, left, kernel, features = _lines(module, channels)
    names, groupings = _short_names(module.BASE_PARAMETERS, {*module.PARAMETERS, *module.KNOWN})
    leading = [name.partition(" ")[0] for name in module.BASE_PARAMETERS]
    regressor: list[Mapping[int, Sum]] = [{} for _ in module.ROWS]
    for (row, column), terms in zip(module.ENTRIES, entries, strict=True):
        regressor[row] = {**regressor[row], column: terms}
    rows = _rows(module, channels)
    if hasattr(module, "ESTIMATED"):
        found = deflected_rows(module, channels, regressor, left, kernel)
        regressor, left = [*found.regressor], [*found.left]
        rows = tuple({**rows[k], "order": rows[k]["order"] + found.further[k]} for k in found.kept)
        channels = also_read(channels, found.kernel.reads)
        features = (
            *(one for one in features if one["function"] != "kernel"),
            *_kernel_features(found.kernel),
        )
        kernel = found.kernel
    joints = "joints" if module.ROW_KIND == "joint" else "motors"
    return {
        "module": ArmFunctions(module),
        "chain": module.ARM,
        "sensor_set": getattr(module, "SENSOR_SET", joints),
        "sensors": channels.sensors,
        "actuators": channels.actuators,
        "base_parameters": names,
        "composites": {},
        "groupings": groupings,
        "units": {**module.UNITS, **{n: module.UNITS[of] for n, of in zip(names, leading, strict=True)}},
        "signals": channels.signals,
        "features": features,
        "rows": rows,
        "friction": (),
        "measurement": tuple(left),
        "regressor": tuple(regressor),
        "derived": channels.derived,
        "kernel": kernel if kernel.keys else None,
        "loads": channels.loads,
    }


def _short_names(formulas: tuple[str, ...], taken: set[str]) -> tuple[tuple[str, ...], dict[str, str]]:
    """Return names for the columns and what those that are sums stand for: the first parameter and "_R"."""
    names, groupings = [], {}
    for formula in formulas:
        name, _, others = formula.partition(" ")
        if others:
            name += "_R"
            while name in taken:
                name += "R"
            groupings[name] = formula
        names.append(name)
    return tuple(names), groupings


def _lines(
    module: Any, channels: ArmChannels
) -> tuple[list[Sum], list[Sum], ArmKernel, tuple[dict[str, Any], ...]]:
    """Return terms of every entry and left side, the kernel for those that are no sums, and the features."""
    rng = np.random.default_rng(0)
    candidates, signals, features = _candidates(module, channels, rng)
    forces = channels.forces
    pushing = {key: signals[key] for key in forces}  # columns of gains hold what drives report
    found = candidates.also(pushing).sums(np.asarray(module.entries(signals)))
    still = {**signals, **dict.fromkeys(forces, np.zeros(len(signals[module.SIGNALS[0]])))}
    known = np.asarray(module.measurement(still)).T
    pushed = np.asarray(module.measurement(signals)).T - known
    of_forces = CandidateSignals(pushing, {}).sums(pushed)
    of_known = candidates.sums(known)
    entries = {f"entry {line}": line for line, terms in enumerate(found) if terms is None}
    left = {f"known {row}": row for row, terms in enumerate(of_known) if terms is None}
    inputs = tuple(key for key in module.SIGNALS if key not in forces)
    read = {
        str(one["key"]): (str(one["sensor"] or one["actuator"] or one["key"]), int(one["derivative"]))
        for one in channels.signals
    }
    reads_of = {key: read[key] for key in inputs if key in read}
    kernel = ArmKernel(module, inputs, forces, entries, left, reads_of)
    kept = [((1.0, f"entry {line}"),) if terms is None else terms for line, terms in enumerate(found)]
    sides = [
        (*(force or ()), *(((1.0, f"known {row}"),) if terms is None else terms))
        for row, (force, terms) in enumerate(zip(of_forces, of_known, strict=True))
    ]
    used = {key for terms in (*kept, *sides) for _, key in terms}
    return kept, sides, kernel, (*(one for one in features if one["key"] in used), *_kernel_features(kernel))


def _kernel_features(kernel: ArmKernel | DeflectedKernel) -> tuple[dict[str, Any], ...]:
    return tuple({"key": key, "function": "kernel", "of": (), "times": None} for key in kernel.keys)


def _candidates(
    module: Any, channels: ArmChannels, rng: np.random.Generator
) -> tuple[CandidateSignals, dict[str, FloatArray], tuple[dict[str, Any], ...]]:
    """Return what entries may be sums of at random samples, the module's signals there, and all features."""
    speeds = (*channels.speeds, *channels.given)
    count = SAMPLES_A_CANDIDATE * (len(module.SIGNALS) + 8 * len(speeds) + 1)
    signals = {key: rng.uniform(-1.0, 1.0, count) for key in module.SIGNALS}
    linear = [key for key in module.SIGNALS if key not in (*channels.forces, *channels.loads)]
    read = {key: signals[key] for key in linear}
    summed: dict[str, FloatArray] = {"1": np.ones(count), **read}
    alone: dict[str, FloatArray] = {}
    features: list[dict[str, Any]] = []
    for one in speeds:
        # zero where the module does not read it: all others' speeds are nowhere the first joint's
        speed = sum((w * signals[key] for w, key in one.terms if key in signals), np.zeros(count))
        summed[f"sign {one.name}"] = np.sign(speed)
        made = [_feature(f"sign {one.name}", "sign", one.key, None)]
        for way, moves in (("forward", speed > 0.0), ("backward", speed < 0.0)):
            alone |= {
                f"{way} {one.name}": np.asarray(moves, dtype=float),
                f"{way} {one.key}": moves * speed,
            }
            made.append(_feature(f"{way} {one.name}", way, one.key, None))
            made.append(_feature(f"{way} {one.key}", way, one.key, one.key))
        features += [] if one in channels.given else made  # no sensor reads those
    moving = {key: value for key, value in summed.items() if value.any()}
    still = {key: value for key, value in alone.items() if value.any()}
    return CandidateSignals(moving, still), signals, tuple(features)


def _feature(key: str, function: str, of: str, times: str | None) -> dict[str, Any]:
    return {"key": key, "function": function, "of": of, "times": times}


#: Of one side of a joint, or of both: read by rows of their own where springs give positions.
_MOVED = ("velocity", "acceleration")
#: What a row's name ends with, and what it balances: of the motor, in front of a link or a spring.
_KINDS = {
    " spring": "torque of motor {0}, with its spring",
    " link": "torque that the link of joint {0} receives",
    " deflection": "measured torque of joint {0}, with its spring",
    " deflected": "torque of the spring of joint {0}, which gives the position of its link",
    " driven": "torque of the spring of joint {0}, which gives the position of its motor",
}


def _rows(module: Any, channels: ArmChannels) -> tuple[dict[str, Any], ...]:
    """Return the rows: balances of a joint, a motor, a spring or the base, and axes of mounted sensors."""
    speeds = {one.name: one.key for one in channels.speeds}
    often = getattr(module, "DIFFERENTIATED", (0,) * len(module.ROWS))
    reversals = getattr(module, "REVERSALS", ((),) * len(module.ROWS))
    axes = {
        f"{sensor['key']} {channel[-1]}": sensor
        for sensor in getattr(module, "SENSORS", ())
        for channel in sensor["channels"]
    }
    axes |= {
        f"{sensor['key']} motion": sensor
        for sensor in getattr(module, "SENSORS", ())
        if sensor["measures"] in _MOVED
    }
    found = []
    for name, times, reversed_by in zip(module.ROWS, often, reversals, strict=True):
        told = _felt(module, name, axes[name]) if name in axes else _balanced(module, name, times)
        turned = tuple(speeds[one] for one in reversed_by)
        found.append({"name": name, "differentiated": times, "reversals": turned, "lever": 1.0, **told})
    return tuple(found)


def _balanced(module: Any, name: str, times: int) -> dict[str, Any]:
    """Return what the row of a balance is of, the highest order of its motion, and its unit."""
    kinds = {joint["name"]: joint["kind"] for joint in module.JOINTS}
    ending = next((end for end in _KINDS if name not in kinds and name.endswith(end)), "")
    joint = name.removesuffix(ending)
    base = joint not in kinds
    turns = name.startswith("base_n") if base else kinds[joint] == "revolute"
    origin = _KINDS.get(ending, f"torque of {module.ROW_KIND} {{0}}").format(joint)
    origin = "torque on the base" if base else origin
    return {
        "origin": origin if turns else origin.replace("torque", "force"),
        "bodies": (joint,),
        "order": 2 + times,
        "unit": ("N m" if turns else "N") + ("/s" if times else ""),
    }


def _felt(module: Any, name: str, sensor: Mapping[str, Any]) -> dict[str, Any]:
    """Return the same of the row of an axis of a gyro or an accelerometer, or of a joint's motion."""
    measures = sensor["measures"]
    kinds = {joint["name"]: joint["kind"] for joint in module.JOINTS}
    turns = measures == "gyro" or (measures in _MOVED and kinds[sensor["joint"]] == "revolute")
    order = 1 if measures in ("gyro", "velocity") else 2
    return {
        "origin": f"motion of the link of joint {sensor['joint']}, as {sensor['measures']} {name} reads it",
        "bodies": (sensor["joint"],),
        "order": order,
        "unit": ("rad" if turns else "m") + ("/s" if order == 1 else "/s^2"),
    }
