"""Effect: something that a model or its sensors may lack, in words and as what it adds to the channels."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from modelgen.array_types import ComplexArray, FloatArray
from modelgen.runtime.iv.companion_simulation import Simulated
from modelgen.runtime.iv.thresholds import (
    LARGEST_CLOCK,
    LARGEST_GAIN,
    LARGEST_LAG,
    LATE_SHARE,
    LATE_TOLERANCE,
)
from modelgen.runtime.records.channels import Edit
from modelgen.runtime.records.record import Record

Changes = Mapping[str, FloatArray]
# takes a column, (n,) a block in SI, to what it moves X by, (c,)
Moved = Callable[[Sequence[FloatArray]], FloatArray]
Response = Callable[[FloatArray], ComplexArray]
# Kinds of what happens about reversals where rows use samples there: a late change of direction, and another
# form of friction. Rows know directions from a low-passed velocity only, and are no more exact than that.
DIRECTION, REVERSAL = "direction", "reversal"
AT_REVERSALS = (DIRECTION, REVERSAL)
# Kinds of forces on bodies.
FORCES = ("constant", "force")
# Kind of a force that is periodic in a position.
RIPPLE = "ripple"
# Kinds of a link that is stiffer in fast motion: from one frequency on, or the faster it moves.
CREEP, STRUCTURAL = "creep", "structural damping"
# Kinds of low-passes that a channel has gone through and the others have not; one of two poles has its delay
# in it, which the others leave to an effect of its own.
TWO_POLES = "two poles"
LOW_PASSES = frozenset({"lag", "average", TWO_POLES})
# Kind of a high-pass that a sensor is behind: of accelerometers, mostly.
HIGH_PASS = "high-pass"
# Kinds of what is elsewhere than a file says: by so many m, or so many rad.
LENGTH, TILT = "length", "tilt"
# Kinds that say when a channel is read.
LATE = frozenset({"delay", TWO_POLES})


@dataclass(frozen=True, eq=False)
class Effect:
    """Something that may be wrong, in words, and what it does to the channels of a simulated record.

    Attributes
    ----------
    name : str
        "delay of q_c", unique.
    kind : str
        "delay", "direction", "reversal" (friction there), "lag", "average", "two poles", "high-pass",
        "clock", "gain", "zero", "constant", "force", "form" (one of many, of friction or of a link), "drift",
        "mass", "resonance", "creep", "structural damping" or "ripple":
        how its size is said, and how exactly it is known.
    words, negative : str
        What is said of it where its size is positive, and negative; empty where that cannot be.
    remedy : str
    changes : callable
        Simulated -> what is added to each channel per unit of size, shape (n,) each; empty for a record that
        does not have it.
    edit : callable, optional
        (channel, size, record) -> what sets a measured channel `channel` right; where it is linear in the
        size only for small sizes, rows are made of channels set right.
    record : int, optional
        Which record has it; None for what all of them have.
    forms : tuple of Effect
        Others that small sizes cannot tell from it.
    alike : tuple of Effect
        Others that are the same in first order: tried with it, and not looked for.
    response : callable, optional
        (size, fs in Hz) -> the response, at frequencies in cycles a sample, that sets the channel right; of
        low-passes, which change its noise.
    at : callable, optional
        (Simulated, size) -> what is added per unit of further size where the effect is set right up to that
        size; by default what `changes` gives.
    quiet : callable, optional
        As `changes`, without noise of the sensors, where that has it: its instrument.
    acting : callable, optional
        (Simulated, size) -> the simulation with the effect, where first order is not enough for that.
    shape : callable
        Number of records -> what a change of what is not linear in the size adds (a frequency, a damping),
        estimated with it.
    moved : callable, optional
        (size, sizes of `shape`) -> the effect with its shape changed by so much.
    elsewhere : callable
        Number of records -> what stands for it in so many others, where phases are others: to be found anew.
    varies : tuple of (str, float)
        Physical parameters that are no one number then, and the rms of what they vary by per unit of size.
    relative : bool
        Whether they vary together, by shares of their values.
    turns : str
        Body about whose reversals it is not known, as Coulomb friction holds there what would move.
    """

    name: str
    kind: str
    words: str
    negative: str
    remedy: str
    changes: Callable[[Simulated], Changes]
    channel: str = ""
    edit: Callable[[str, float, Record], Edit] | None = None
    record: int | None = None
    forms: tuple[Effect, ...] = ()
    alike: tuple[Effect, ...] = ()
    response: Callable[[float, float], Response] | None = None
    at: Callable[[Simulated, float], Changes] | None = None
    quiet: Callable[[Simulated], Changes] | None = None
    acting: Callable[[Simulated, float], Simulated] | None = None
    shape: Callable[[int], tuple[Effect, ...]] = lambda records: ()
    moved: Callable[[float, Sequence[float]], Effect] | None = None
    elsewhere: Callable[[int], tuple[Effect, ...]] = lambda records: ()
    varies: tuple[tuple[str, float], ...] = ()
    relative: bool = False
    turns: str = ""

    def added(self, simulated: Simulated, size: float) -> Changes:
        """Return what is added to each channel per unit of further size, shape (n,) each."""
        return self.changes(simulated) if self.at is None or not size else self.at(simulated, size)

    def corrected(self, record: Record, index: int, size: float) -> Record:
        """Return a measured record without the effect, as far as its channels can be set right.

        `index` is its place among the records.
        """
        if self.edit is None or not size or self.record not in (None, index):
            return record
        return record.edited({self.channel: self.edit(self.channel, size, record)})

    def varied(self, names: Sequence[str], values: FloatArray, size: float) -> FloatArray:
        """Return by how much parameters of some values vary that are no one number, SI, shape (c,).

        A record that has another load may have lost its weight, and move no estimate.
        """
        rms = dict(self.varies)
        by = abs(size) * np.array([rms.get(name, 0.0) for name in names])
        return np.asarray(by * np.abs(values) if self.relative else by)

    def possible(self, size: float) -> bool:
        """Tell whether physics allows the sign."""
        return bool(self.words if size > 0.0 else self.negative)

    def samples(self, size: float, fs: float) -> float:
        """Return the size of a delay or lag in samples at fs, in Hz; 0 for other effects."""
        if self.edit is None or self.kind in ("clock", "zero", "gain"):
            return 0.0
        return fs * (abs(size) if self.kind in LATE else self._width(size))

    def runs_away(self, size: float, fs: float) -> bool:
        """Tell whether a size is no small misalignment any more; fs in Hz."""
        largest = {"clock": LARGEST_CLOCK, "gain": LARGEST_GAIN}.get(self.kind, np.inf)
        return self.samples(size, fs) > LARGEST_LAG or abs(size) > largest

    def follows(self, size: float, late: Mapping[str, float], fs: float) -> bool:
        """Tell whether a force can act behind a low-pass of this size: that much later than commanded.

        Cascades of lags are late by no less than one lag with their bend, averages by half their length;
        sensors that are late themselves make a force seem earlier. `late` says by how many s forces are
        recorded late, where that is known, `fs` is in Hz.
        """
        if self.kind not in LOW_PASSES or size > 0.0 or self.channel not in late:
            return True
        least = self.samples(size, fs) * (0.5 if self.kind == "average" else 1.0)
        return -late[self.channel] * fs > LATE_SHARE * least - LATE_TOLERANCE

    def _width(self, size: float) -> float:
        """Return the time constant of a lag, or the length of an average, in s."""
        return float(np.sqrt((24.0 if self.kind == "average" else 2.0) * abs(size)))

    def said(self, size: float) -> str:
        """Return the effect with its size in words."""
        words, shown = self.words if size > 0.0 else self.negative, abs(size)
        if self.kind in ("delay", DIRECTION):
            return f"{words} by {1e6 * shown:.3g} us"
        if self.kind == TWO_POLES:
            return f"{words} (late by {1e6 * shown:.3g} us)"
        if self.kind == "lag":
            return f"{words} (time constant about {1e6 * self._width(size):.2g} us)"
        if self.kind == HIGH_PASS:
            return f"{words} (corner about {shown / (2.0 * np.pi):.2g} Hz)"
        if self.kind == "average":
            return f"{words} (over about {1e6 * self._width(size):.2g} us)"
        if self.kind == "clock":
            return f"{words} ({1e6 * size:+.4g} ppm)"
        if self.kind == "gain":
            return f"{words} ({100.0 * size:+.2g} %)"
        if self.kind == "zero":
            return f"{words} ({size:+.3g})"
        if self.kind == LENGTH:
            return f"{words} by {1e3 * size:+.3g} mm"
        if self.kind == TILT:
            return f"{words}, by {np.degrees(shown):.2g} deg"
        if self.kind == RIPPLE:
            return f"{words} (amplitude {shown:.3g})"
        if self.kind == CREEP:
            return f"{words} (by {shown:.3g})"
        if self.kind == STRUCTURAL:
            return f"{words} (by {shown:.3g} a decade)"
        if self.kind == "drift":
            by = f"{100.0 * shown:.2g} %" if self.relative else f"{shown:.3g}"
            what, *meaning = words.split(": ", 1)
            return ": ".join([f"{what} (by {by})", *meaning])
        return words


def unlike(effects: Iterable[Effect], known: Sequence[Effect]) -> tuple[Effect, ...]:
    """Return the effects to be looked for besides those that are known: other forms only of what is known."""
    every, names, found = tuple(effects), {effect.name for effect in known}, list[Effect]()
    listed = names | {effect.name for effect in every}
    for effect in every:
        if effect.name not in names:
            found.append(effect)
        if not names.isdisjoint(one.name for one in (effect, *effect.forms)):
            found += [one for one in effect.forms if one.name not in listed]
    return tuple(found)


def curvature(samples: FloatArray, dt: float) -> FloatArray:
    """Return the second derivative of samples dt s apart, in their unit per s^2, shape (n,)."""
    return np.asarray(np.gradient(np.gradient(samples, dt), dt))
