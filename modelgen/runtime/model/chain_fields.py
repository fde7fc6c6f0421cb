"""What a chain's module holds, under the names that an arm's has, too."""

from __future__ import annotations

from typing import Any


def chain_fields(module: Any) -> dict[str, Any]:
    """Return what a chain's module holds, under the names of `arm_fields`."""
    names = ("chain", "sensor_set", "sensors", "actuators", "base_parameters", "composites", "units")
    given = {
        name: getattr(module, name.upper()) for name in (*names, "signals", "features", "rows", "friction")
    }
    springs = getattr(module, "CUBIC_SPRINGS", ())
    return {**given, **module.columns(), "module": module, "cubic_springs": springs}
