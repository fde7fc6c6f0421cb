"""Directions of speeds that no sensor reads but that rows give: of motors in front of springs."""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.model.arm_channels import Speed

#: By (name of a direction in sums, signal that is given): the derivative of the one by the other.
Turning = Mapping[tuple[str, str], FloatArray]


def given_directions(
    speeds: Sequence[Speed], signals: Mapping[str, FloatArray], given: Container[str], sampled: bool
) -> tuple[dict[str, FloatArray], Turning]:
    """Return the directions of speeds, and the speeds in each, by their names in sums, and their slopes.

    Parameters
    ----------
    speeds : sequence of Speed
    signals : mapping of str to array, shape (N,) each
        What the speeds are sums of.
    given : container of str
        Those of the signals that rows give.
    sampled : bool
        Whether directions are those at the samples, as forces are; else they are means over each sampling
        period, which do not jump where parameters move the reversal by less than that.
    """
    found: dict[str, FloatArray] = {}
    slopes: dict[tuple[str, str], FloatArray] = {}
    for one in speeds:
        speed = np.sum([weight * signals[key] for weight, key in one.terms], axis=0)
        sign, rate = (np.sign(speed), np.zeros(len(speed))) if sampled else _mean_sign(speed)
        ways = {f"sign {one.name}": (sign, rate)}
        for way, factor in (("forward", 0.5), ("backward", -0.5)):
            moves = 0.5 + factor * sign
            ways[f"{way} {one.name}"] = moves, factor * rate
            ways[f"{way} {one.key}"] = moves * speed, moves + factor * rate * speed
        found |= {key: value for key, (value, _) in ways.items()}
        slopes |= {(k, of): w * by for k, (_, by) in ways.items() for w, of in one.terms if of in given}
    return found, slopes


def _mean_sign(speed: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the mean of the sign of a speed over each sampling period, and its derivative by the speed."""
    half = 0.5 * np.abs(np.gradient(speed))
    turns = np.abs(speed) < half
    rate = np.where(turns, 1.0 / np.where(turns, half, 1.0), 0.0)
    return np.where(turns, speed * rate, np.sign(speed)), rate
