"""Directions of speeds that no sensor reads but that rows give: of motors in front of springs."""

from __future__ import annotations

from collections.abc import Callable, Container, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.model.arm_channels import Speed

#: How much of the sign there is in what is 1 while a body moves this way, and else 0.
WAYS = {"forward": 0.5, "backward": -0.5}
#: By (name of a direction in sums, signal that is given): the derivative of the one by the other.
Turning = Mapping[tuple[str, str], FloatArray]
#: Takes samples at the full rate, shape (N,), and returns as many.
LowPass = Callable[[FloatArray], FloatArray]


class Succession(NamedTuple):
    """How samples of what rows give follow each other: at fs in Hz, without gaps.

    `low_pass` is what speeds go through before their directions are taken.
    """

    fs: float
    low_pass: LowPass | None


def given_directions(
    speeds: Sequence[Speed],
    signals: Mapping[str, FloatArray],
    given: Container[str],
    sampled: bool,
    low_pass: LowPass | None = None,
) -> tuple[dict[str, FloatArray], Turning]:
    """Return speeds, their directions and the speeds in each, by their names in sums, and their slopes.

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
    low_pass : callable, optional
        What a speed goes through before its direction is taken. Speeds that rows give are made of derivatives
        that hold much noise behind the wide low-pass of the signals: false reversals take friction down in
        proportion to the noise.
    """
    found: dict[str, FloatArray] = {}
    slopes: dict[tuple[str, str], FloatArray] = {}
    for one in speeds:
        speed = np.sum([weight * signals[key] for weight, key in one.terms], axis=0)
        turning = speed if low_pass is None else low_pass(speed)
        sign, rate = (np.sign(turning), np.zeros(len(speed))) if sampled else mean_sign(turning)
        ways = {f"sign {one.name}": (sign, rate)}
        for way, factor in WAYS.items():
            moves = 0.5 + factor * sign
            ways[f"{way} {one.name}"] = moves, factor * rate
            ways[f"{way} {one.key}"] = moves * speed, moves + factor * rate * speed
        found |= {one.key: speed} | {key: value for key, (value, _) in ways.items()}
        slopes |= {(k, of): w * by for k, (_, by) in ways.items() for w, of in one.terms if of in given}
    return found, slopes


def sign_between(speed: FloatArray) -> FloatArray:
    """Return the sign of a speed that reverses between samples, as a low-pass is to see it, shape (N,).

    Means over sampling periods lack (omega / fs)^2 / 24 of what is at omega; that is added, to this order.
    """
    mean, _ = mean_sign(speed)
    around = np.pad(mean, 1, mode="edge")
    return np.asarray(mean - (around[2:] - 2.0 * mean + around[:-2]) / 24.0)


def mean_sign(speed: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the mean of the sign of a speed over each sampling period, and its derivative by the speed.

    All are of shape (N,); the speed is in SI, a straight line about each sample.
    """
    half = 0.5 * np.abs(np.gradient(speed))
    turns = np.abs(speed) < half
    rate = np.where(turns, 1.0 / np.where(turns, half, 1.0), 0.0)
    return np.where(turns, speed * rate, np.sign(speed)), rate
