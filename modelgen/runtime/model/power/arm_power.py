"""Energies and work of an arm's columns, from the kernel of its module at other speeds and accelerations.

Of an entry w(q, q', q'') of an inertia, w(q, 0, q') - w(q, 0, 0) is the momentum that goes with it, half of
which times q' is the kinetic energy; w(q, 0, 0) q' is the power of its weight. What has no such energy
(friction, offsets, gains) works with w(q, q', 0) q'.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import DataError
from modelgen.runtime.model.arm_channels import arm_channels, moving_joints
from modelgen.runtime.model.arm_kernel import Sum
from modelgen.runtime.model.model import Model
from modelgen.runtime.model.power.balance_lines import BalanceLines

#: Relative to the largest: what is smaller at random samples is nothing but rounding.
NOTHING = 1e-10
SAMPLES = 40


@dataclass(frozen=True, eq=False, kw_only=True)
class ArmPower(BalanceLines):
    """Lines of the balance of power of an arm.

    Attributes
    ----------
    module
        The generated module.
    fast : tuple of str
        Signals of the module that are speeds.
    speeds : tuple of sums
        Speed of every row as a sum of signals; empty where the row has none.
    kinetic : tuple of bool
        Whether a column has a kinetic energy.
    """

    module: Any
    fast: tuple[str, ...]
    speeds: tuple[Sum, ...]
    kinetic: tuple[bool, ...]

    def lines(self, signals: Mapping[str, FloatArray]) -> Mapping[str, FloatArray]:
        """Return every line, shape (N,) each, from signals of that shape, in SI."""
        found = self.all_lines(signals)
        return {key: found[key] for key in self.keys}

    def all_lines(self, signals: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
        """Return the lines of all columns, those that are always zero, too.

        Signals and lines, in SI, have shape (n,).
        """
        rest = np.zeros(len(signals[self.inputs[0]]))
        still = {**signals, **dict.fromkeys(self.risen, rest)}
        at_rest = {**still, **dict.fromkeys(self.fast, rest)}
        moved = {**at_rest, **{key: signals[speed] for key, speed in self.risen.items()}}
        rates = [sum((f * signals[key] for f, key in terms), rest) for terms in self.speeds]
        w, weight, momentum = (self.module.entries(one) for one in (still, at_rest, moved))
        found: dict[str, FloatArray] = {}

        def add(key: str, line: FloatArray) -> None:
            found[key] = found[key] + line if key in found else line

        for line, (row, column) in enumerate(self.module.ENTRIES):
            if not self.speeds[row]:
                continue
            acting = weight[line] if self.kinetic[column] else w[line]
            add(f"work {column}", rates[row] * acting)
            add(f"energy {column}", 0.5 * rates[row] * (momentum[line] - weight[line]))
        # of what is known on the left all that is quadratic in speeds moves with its inertia
        double, triple = (
            self.module.measurement({**still, **{key: times * signals[key] for key in self.fast}})
            for times in (2.0, 3.0)
        )
        y, pulled, carried = (self.module.measurement(one) for one in (still, at_rest, moved))
        quadratic = 0.5 * (triple - 2.0 * double + y)
        for row, rate in enumerate(rates):
            if self.speeds[row]:
                add("work measured", rate * (y - quadratic)[:, row])
                add("energy measured", 0.5 * rate * (carried - pulled)[:, row])
        return found


def arm_power(model: Model) -> ArmPower:
    """Return the lines of an arm's balance of power.

    Raises
    ------
    DataError
        For an arm with springs in its joints, or with gains to be found.
    """
    module, channels = model.module, arm_channels(model.module)
    joints = {joint["name"] for joint in module.JOINTS}
    if any(row not in joints and not row.startswith("base_") for row in module.ROWS):
        what = "has springs or measured torques in its joints, and rows of power take rigid ones"
        raise DataError.at(model.chain, what, "leave rows = power out")
    if any(role.role == "gain" for name, role in model.roles.items() if name in model.base_parameters):
        what = "has drives whose gains are to be found, and one row of power cannot tell their noises apart"
        raise DataError.at(model.chain, what, "find the gains from rows of force, and give them in [known]")
    orders = {one.key: one.order for one in model.sensors}
    read = {s.key: orders[s.sensor] + s.derivative for s in model.signals if s.sensor is not None}
    places = {(s.sensor, s.derivative): s.key for s in model.signals}
    own = [key for key in module.SIGNALS if key in read]
    by_key = {signal.key: signal for signal in model.signals}
    risen = {k: places[by_key[k].sensor, by_key[k].derivative - 1] for k in own if read[k] == 2}
    speeds = _speeds(model, {one.name: one.terms for one in channels.speeds})
    used = dict.fromkeys(key for terms in speeds for _, key in terms)
    inputs = [key for key in module.SIGNALS if key not in risen]
    every = tuple(dict.fromkeys((*used, *risen.values(), *inputs)))
    fast = tuple(key for key in every if read.get(key) == 1)
    width = len(model.base_parameters)
    kernel = ArmPower(
        module=module, inputs=every, risen=risen, fast=fast, speeds=speeds, kinetic=(True,) * width
    )
    return _without_zeros(kernel)


def _speeds(model: Model, named: Mapping[str, Sum]) -> tuple[Sum, ...]:
    """Return the speed of every row of joints or motors, none of the base's rows."""
    module = model.module
    moving = moving_joints(module)
    found: list[Sum] = []
    for row in module.ROWS:
        if row not in moving:
            found.append(())
            continue
        ratios = module.TRANSMISSION[moving.index(row)]
        alone = tuple(1.0 if name == row else 0.0 for name in moving)
        levers = zip(alone if module.ROW_KIND == "joint" else ratios, moving, strict=True)
        terms = [(float(ratio) * f, key) for ratio, name in levers if ratio for f, key in named[name]]
        found.append(tuple(terms))
    return tuple(found)


def _without_zeros(kernel: ArmPower) -> ArmPower:
    """Return the same with the lines that are not always zero, found at random samples (seeded)."""
    rng = np.random.default_rng(0)
    signals = {key: rng.uniform(-1.0, 1.0, SAMPLES) for key in kernel.inputs}
    tried = kernel.all_lines(signals)
    columns = range(len(kernel.kinetic))
    largest = max((float(np.abs(line).max()) for line in tried.values()), default=0.0)
    held = {key for key, line in tried.items() if np.abs(line).max() > NOTHING * largest}
    kinetic = tuple(f"energy {column}" in held for column in columns)
    exact = replace(kernel, kinetic=kinetic)
    lines = exact.all_lines(signals)
    keys = tuple(key for key, line in lines.items() if np.abs(line).max() > NOTHING * largest)
    return replace(exact, keys=keys)
