"""Phases of frequency responses, as they are drawn."""

from __future__ import annotations

import numpy as np

from modelgen.array_types import BoolArray, ComplexArray, FloatArray


def wrapped_phase(H: ComplexArray, shown: BoolArray | None = None) -> FloatArray:
    """Return the phase in degrees, -270 to 90, with gaps where it wraps or is not to be shown.

    All have shape (frequencies,).
    """
    phase = np.mod(np.degrees(np.angle(H)) + 270.0, 360.0) - 270.0
    phase[1:][np.abs(np.diff(phase)) > 180.0] = np.nan
    if shown is not None:
        phase[~shown] = np.nan
    return np.asarray(phase)
