"""The power model (Gautier 1996): one row a record, power in place of forces, made of a model's own rows.

Every balance of force times the speed of its coordinate is a balance of power, and the acceleration in it is
the rate of a kinetic energy:

    sum of Gamma q' = d/dt(sum of J q'^2 / 2) + sum of (friction, springs, weight) q'

The filter takes the derivative of the energies: no accelerations. The columns are nonlinear in
the signals, formed at the full rate and filtered as the kernel's of an arm are. Friction is |q'|, which needs
no direction of motion, so that no sample near a reversal has to be left out.
"""

from __future__ import annotations

from dataclasses import replace

from modelgen.runtime.model.mechanical_parts import RowInfo
from modelgen.runtime.model.model import Feature, Model
from modelgen.runtime.model.power.arm_power import ArmPower, arm_power
from modelgen.runtime.model.power.chain_power import ChainPower, chain_power

PowerKernel = ArmPower | ChainPower


def power_model(model: Model) -> Model:
    """Return a model whose only row is the balance of power; parameters and channels stay.

    Raises
    ------
    DataError
        When the sensors do not give the positions and speeds that it needs.
    """
    kernel: PowerKernel = arm_power(model) if model.is_arm else chain_power(model)
    columns = {
        column: tuple((1.0, key) for key in keys)
        for column in range(len(model.base_parameters))
        if (keys := [key for key in (f"energy {column}", f"work {column}") if key in kernel.keys])
    }
    left = tuple((1.0, key) for key in kernel.keys if key.endswith("measured"))
    bodies = tuple(dict.fromkeys(body for row in model.rows for body in row.bodies))
    row = RowInfo("power", "power of all forces", bodies, 0, 1, (), "W", 1.0)
    signals = [signal for signal in (*model.signals, *kernel.further) if signal.key in kernel.inputs]
    reads_of = {signal.key: (signal.channel, signal.derivative) for signal in signals}
    return replace(
        model,
        signals=tuple(signals),
        features=tuple(Feature(key, "kernel", (), None) for key in kernel.keys),
        rows=(row,),
        measurement_columns=(left,),
        regressor_columns=(columns,),
        derived={},
        kernel=replace(kernel, reads_of=reads_of),
    )
