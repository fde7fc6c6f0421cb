"""What lies between the controller's law and the chain: sampling, delay, current loop, limit, encoder."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf

from modelgen.errors import DataError, Problem
from modelgen.magnitudes import LARGEST_COUNT, REMEDY, is_usable

# how a sampled controller gets the velocity; the numbers are those of step_kernel
VELOCITIES = {"true": 0, "backward": 1, "central": 2}


@dataclass(frozen=True)
class Drive:
    """How the controller's command becomes a force. By default at once, and without limit.

    Parameters
    ----------
    rate_hz : float, optional
        Rate at which the controller samples and acts, its command held in between. By default it is
        continuous; where something below needs samples, it has the record's sampling frequency.
    delay_s : float
        From a sample of the controller until its command acts: a whole number of internal steps.
    bandwidth_hz : float
        Of the current loop, a lag of first order: 1 / (2 pi bandwidth_hz) is its time constant.
    limit : float
        Largest command either way, in N m or N.
    encoder_step : float
        Resolution of the position that the controller sees, in rad or m.
    velocity : str
        "true"; or differences of the position seen: "backward", (q[k] - q[k-1]) / T, and "central",
        (q[k] - q[k-2]) / 2T.

    Raises
    ------
    DataError
        With one problem per value out of range.
    """

    rate_hz: float | None = None
    delay_s: float = 0.0
    bandwidth_hz: float = inf
    limit: float = inf
    encoder_step: float = 0.0
    velocity: str = "true"

    def __post_init__(self) -> None:
        demands = (
            (
                "rate_hz",
                self.rate_hz is None or 0.0 < self.rate_hz < inf,
                "give a finite positive rate in Hz",
            ),
            ("delay_s", 0.0 <= self.delay_s < inf, "give a time in s, 0 or more"),
            ("bandwidth_hz", self.bandwidth_hz > 0.0, "give a positive frequency in Hz"),
            ("limit", self.limit > 0.0, "give a positive force"),
            ("encoder_step", 0.0 <= self.encoder_step < inf, "give a step in rad or m, 0 or more"),
            ("velocity", self.velocity in VELOCITIES, f"choose one of {', '.join(VELOCITIES)}"),
        )
        problems = [
            Problem(f"drive: {name}", f"is {getattr(self, name)!r}", remedy)
            for name, holds, remedy in demands
            if not holds
        ]
        problems += [
            Problem(f"drive: {name}", f"is {getattr(self, name)!r}", REMEDY)
            for name in ("rate_hz", "delay_s", "bandwidth_hz", "limit", "encoder_step")
            if getattr(self, name) not in (None, inf) and not is_usable(getattr(self, name))
        ]
        DataError.raise_any(problems)

    @property
    def sampled(self) -> bool:
        """Whether the controller works on samples."""
        plain = self.delay_s == 0.0 and self.limit == inf and self.encoder_step == 0.0
        return self.rate_hz is not None or not plain or self.velocity != "true"

    @property
    def lags(self) -> bool:
        """Whether the force follows the command late."""
        return self.bandwidth_hz < inf


def whole_steps(what: str, seconds: float, rate_hz: float, least: int = 0) -> int:
    """Return a time in internal steps.

    Raises
    ------
    DataError
        When it is no whole number of them, fewer than `least`, or more than can be counted.
    """
    steps = seconds * rate_hz
    stated = f"is {steps:.6g} internal steps of {1.0 / rate_hz:.6g} s"
    if not least - 0.5 < steps <= LARGEST_COUNT:
        remedy = f"choose from {least} to {LARGEST_COUNT} of them"
        raise DataError.at(f"drive: {what}", stated, remedy)
    if abs(steps - round(steps)) > 1e-6 * max(1.0, steps):
        remedy = "choose an oversampling that divides it, or another time"
        raise DataError.at(f"drive: {what}", stated, remedy)
    return round(steps)
