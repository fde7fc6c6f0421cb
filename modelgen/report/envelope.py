"""Long series -> the data of a zoomable plot: a limited number of lowest and highest values, two bytes each.

The lowest and highest value of every interval keep all peaks visible at any zoom; 65 534 levels between the
extremes are finer than a screen at a zoom of a hundred.
"""

from __future__ import annotations

import base64
from typing import Any

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.curves.buckets import buckets

LEVELS = 65534
GAP = -32768  # a sample that is missing


def encoded_series(name: str, kind: str, values: FloatArray, most: int) -> dict[str, Any]:
    """Return a series for the page's script.

    Parameters
    ----------
    name, kind : str
        For the legend, and "measured", "rebuilt" or "residual" for the colour.
    values : array, shape (n,)
        NaN marks a gap in the line.
    most : int
        Buckets to keep: a series of more samples becomes one lowest and highest value a bucket.

    Returns
    -------
    dict
        With "step" (samples a bucket) and base64 texts "low" and "high" of little-endian int16, "high" absent
        where a bucket is one sample; a level v stands for offset + v * scale.
    """
    finite = values[np.isfinite(values)]
    lowest, highest = (float(finite.min()), float(finite.max())) if finite.size else (0.0, 0.0)
    scale = (highest - lowest) / LEVELS or 1.0
    offset = 0.5 * (lowest + highest)
    step = max(1, -(-values.size // most))
    low, high = (values, None) if step == 1 else buckets(values, step)
    series: dict[str, Any] = {"name": name, "kind": kind, "step": step, "scale": scale, "offset": offset}
    series["low"] = _levels(low, offset, scale)
    if high is not None:
        series["high"] = _levels(high, offset, scale)
    return series


def _levels(values: FloatArray, offset: float, scale: float) -> str:
    levels = np.full(values.size, GAP, dtype="<i2")
    kept = np.isfinite(values)
    levels[kept] = np.clip(np.round((values[kept] - offset) / scale), -LEVELS // 2, LEVELS // 2)
    return base64.b64encode(levels.tobytes()).decode("ascii")
