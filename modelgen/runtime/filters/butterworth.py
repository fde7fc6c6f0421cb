"""Butterworth low-passes as second-order sections, from their poles in closed form."""

from __future__ import annotations

from functools import lru_cache
from math import pi, tan

import numpy as np

from modelgen.errors import DataError
from modelgen.runtime.filters.two_sided_kernel import Sections


@lru_cache(maxsize=128)
def butterworth(order: int, cutoff_hz: float, fs: float) -> Sections:
    """Return the sections of one pass, the bilinear transform of the analogue filter; gain 1 at 0 Hz.

    Parameters
    ----------
    order : int
        An odd one has a first section of first order.
    cutoff_hz, fs : float
        Cut-off (-3 dB) and sampling frequency in Hz.

    Raises
    ------
    DataError
        When the cut-off is not between 0 and half the sampling frequency.
    """
    if not 0.0 < cutoff_hz < 0.5 * fs:
        what = f"of {cutoff_hz:g} Hz is not between 0 and {0.5 * fs:g} Hz, half the sampling frequency"
        raise DataError.at("cut-off", what, "give one between them")
    # poles of the upper half plane, the real one first, in units of twice the sampling frequency
    angles = 0.5 * pi * np.arange(1 - order % 2, order, 2) / order
    analogue = -tan(pi * cutoff_hz / fs) * np.exp(1j * angles)
    poles = (1.0 + analogue) / (1.0 - analogue)
    sections = []
    for at, far in zip(poles.tolist(), analogue.tolist(), strict=True):
        if far.imag == 0.0:
            gain = -far.real / (1.0 - far.real)
            sections.append((gain, gain, 0.0, 1.0, -at.real, 0.0))
        else:
            gain = abs(far / (1.0 - far)) ** 2
            sections.append((gain, 2.0 * gain, gain, 1.0, -2.0 * at.real, abs(at) ** 2))
    return tuple(sections)
