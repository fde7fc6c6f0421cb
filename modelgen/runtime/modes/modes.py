"""Modes of an identified chain: frozen values, their table, and their plain types."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any, NamedTuple

from modelgen.errors import aligned
from modelgen.runtime.modes.mode_values import ModalValue, PairValues
from modelgen.runtime.parameters.rounded import with_interval


@dataclass(frozen=True)
class Peak:
    """The peak of a measured frequency response at `frequency_hz`, with lines `resolution_hz` apart.

    `rise` is its height over the higher valley next to it, as an acceleration over the force `input`.
    """

    frequency_hz: float
    resolution_hz: float
    rise: float
    record: str
    output: str
    input: str


@dataclass(frozen=True)
class Mode(PairValues):
    """A motion that the chain makes by itself, linear about rest.

    Attributes
    ----------
    frequency_hz : ModalValue or None
        Undamped natural frequency in Hz, the magnitude of the poles over 2 pi; None where the chain moves
        freely as a whole, which is a mode of 0 Hz.
    damping_ratio : ModalValue or None
        Above 1 for an overdamped motion; None where the records leave damping open.
    time_constants_s : tuple of ModalValue
        In s, of real poles, slowest first: of a free motion how its speed decays, of one with a damping ratio
        above 1 those of the overdamped return; none where the motion oscillates.
    shape : mapping of str to float
        How far each body moves, in its own unit (rad or m), in the undamped mode; 1 for the body that has
        most of the energy.
    measured : Peak or None
        The peak nearest to it in the measured frequency responses of the records, which knows nothing of the
        model; None where they show none.
    """

    shape: Mapping[str, float] = field(default_factory=dict)
    measured: Peak | None = None

    @property
    def name(self) -> str:
        """Word for it: "free" as a whole, or against the springs "swings" or "creeps"."""
        if self.frequency_hz is None:
            return "free"
        return "creeps" if self.damping_ratio and abs(self.damping_ratio.value) >= 1.0 else "swings"


@dataclass(frozen=True)
class Antiresonance(PairValues):
    """A transmission zero from an actuator to its own body: the rest of the chain swings, this body rests."""

    actuator: str = ""
    body: str = ""


@dataclass(frozen=True)
class PostureModes:
    """The modes of an elastic arm at a posture, lowest first, without those in which it moves freely.

    Attributes
    ----------
    record, time_s : str, float or None
        Where the posture was taken from.
    positions : mapping of str to float
        Of the joints, rad or m.
    free, held : tuple of PairValues
        With motors that are free, and with motors that are held.
    """

    record: str = ""
    time_s: float | None = None
    positions: Mapping[str, float] = field(default_factory=dict)
    free: tuple[PairValues, ...] = ()
    held: tuple[PairValues, ...] = ()


@dataclass(frozen=True)
class Modes(Sequence[Mode]):
    """The modes of a chain, lowest first, its antiresonances, and what is to be said of them.

    A sequence of `Mode`; `print` shows them as a table. Those of an elastic arm are in `postures`.
    """

    modes: tuple[Mode, ...] = ()
    antiresonances: tuple[Antiresonance, ...] = ()
    notes: tuple[str, ...] = ()
    postures: tuple[PostureModes, ...] = ()

    def __getitem__(self, index: Any) -> Any:
        return self.modes[index]

    def __len__(self) -> int:
        return len(self.modes)

    def __iter__(self) -> Iterator[Mode]:
        return iter(self.modes)

    def to_dict(self) -> dict[str, Any]:
        """Return them in plain types; what is open is None."""
        return asdict(self)

    def __str__(self) -> str:
        """Return a table of the modes, with 95 % intervals, their shapes, antiresonances and notes."""
        rows = [("mode", "Hz (95 %)", "rad/s", "damping ratio", "time constants s", "peak Hz")]
        rows += [(str(k + 1), *cells(mode), peak_hz(mode)) for k, mode in enumerate(self.modes)]
        lines = _ruled(rows) if self.modes else []
        if any(len(mode.shape) > 1 for mode in self.modes):
            bodies = list(self.modes[0].shape)
            shapes = [("shape", *bodies)]
            shapes += [
                (str(k + 1), *(f"{v:.3g}" for v in m.shape.values())) for k, m in enumerate(self.modes)
            ]
            lines += ["", *_ruled(shapes)]
        if self.antiresonances:
            zeros = [("antiresonance", "Hz (95 %)", "rad/s", "damping ratio", "time constants s")]
            zeros += [(f"{one.actuator} to {one.body}", *cells(one)) for one in self.antiresonances]
            lines += ["", *_ruled(zeros)]
        for posture in self.postures:
            lines += [*([""] if lines else []), *_posture_lines(posture)]
        return "\n".join([*lines, *([""] if lines and self.notes else []), *self.notes])


def _posture_lines(posture: PostureModes) -> list[str]:
    """Return a table of the modes at a posture."""
    taken = f" ({posture.record}, {posture.time_s:.4g} s)" if posture.time_s is not None else ""
    rows = [("motors", "Hz (95 %)", "rad/s", "damping ratio", "time constants s")]
    rows += [(word, *cells(one)) for word in ("free", "held") for one in getattr(posture, word)]
    return [f"at {positions(posture)}{taken}", *_ruled(rows)]


class PostureRange(NamedTuple):
    """A mode, motors "free" or "held", in the postures in which it is lowest and highest."""

    motors: str
    low: PairValues
    low_at: str
    high: PairValues
    high_at: str


def posture_ranges(modes: Modes) -> list[PostureRange]:
    """Return every mode of an arm in its lowest and in its highest posture."""
    found = []
    for word in ("free", "held"):
        for k in range(min((len(getattr(one, word)) for one in modes.postures), default=0)):
            ones = [(getattr(posture, word)[k], positions(posture)) for posture in modes.postures]
            ranked = sorted(ones, key=lambda one: one[0].frequency_hz.value if one[0].frequency_hz else 0.0)
            found.append(PostureRange(word, *ranked[0], *ranked[-1]))
    return found


def positions(posture: PostureModes) -> str:
    """Return the positions of the joints as a text."""
    return ", ".join(f"q_{name} = {value:.4g}" for name, value in posture.positions.items())


def cells(one: PairValues) -> tuple[str, str, str, str]:
    """Return frequency in Hz, in rad/s, damping ratio and time constants as texts with 95 % intervals."""
    constants = ", ".join(shown(value) for value in one.time_constants_s) or "-"
    if one.frequency_hz is None:
        return "0 (free)", "0", "-", constants
    radians = 2.0 * math.pi * one.frequency_hz.value
    damping = "-" if one.damping_ratio is None else shown(one.damping_ratio)
    return shown(one.frequency_hz), f"{radians:.4g}", damping, constants


def peak_hz(mode: Mode) -> str:
    """Return the measured peak in Hz with half a line either way."""
    one = mode.measured
    if one is None:
        return "-"
    half = 0.5 * one.resolution_hz
    return with_interval(one.frequency_hz, one.frequency_hz - half, one.frequency_hz + half)


def shown(value: ModalValue) -> str:
    """Return a number with its interval."""
    low = -math.inf if value.low is None else value.low
    return with_interval(value.value, low, math.inf if value.high is None else value.high)


def _ruled(rows: Sequence[Sequence[str]]) -> list[str]:
    lines = aligned(rows)
    return [lines[0], "-" * max(map(len, lines)), *lines[1:]]
