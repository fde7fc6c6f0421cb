"""What may be off in channels of an elastic arm, and records without it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import combinations
from typing import NamedTuple

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.advice import Advice
from modelgen.runtime.identification.elastic.encoder_zeros import deflecting, encoder_zeros
from modelgen.runtime.identification.elastic.force_lags import force_lags, is_lag
from modelgen.runtime.identification.elastic.row_forces import RowForce, nothing
from modelgen.runtime.identification.thresholds import (
    HALF_SAMPLE,
    LEAST_ALIGNED_GAIN,
    LEAST_ALIGNED_SAMPLES,
    MOST_ALIGNED_GAIN,
    MOST_ALIGNED_SAMPLES,
    TRIED_GAIN,
    TRIED_SAMPLES,
    TRIED_ZERO,
)
from modelgen.runtime.iv.effect import TILT, Effect
from modelgen.runtime.iv.model_errors import delay_effect, zero_effect
from modelgen.runtime.iv.told_effects import below_noise, estimated, left
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.hac_covariance import hac_covariance
from modelgen.runtime.model.arm_channels import DRIVE
from modelgen.runtime.model.model import Model
from modelgen.runtime.numerics.decorrelation import square_root
from modelgen.runtime.records.channels import Edit
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.derived_channels import with_derived


def forces_of_drives(model: Model) -> tuple[str, ...]:
    """Return the forces of motors, by their channels."""
    return tuple(one.key for one in model.actuators if one.key.startswith(DRIVE))


def told_holds(keys: Sequence[str]) -> Advice:
    """Return what is said of commands that are held."""
    commands = f"{keys[0]} is a command" if len(keys) == 1 else f"{', '.join(keys)} are commands"
    what = f"shows that {commands} which the drive holds over every sample; taken as that"
    options = " ".join(f"--held {key}" for key in keys)
    return Advice("more than the model", "the residual", what, f"say so ({options})")


class Instead(NamedTuple):
    """What explains rows as well as what was found: its size, and by how much X would be another, by name."""

    effect: Effect
    size: float
    move: Mapping[str, float]


@dataclass(frozen=True, eq=False)
class SetRight:
    """What was set right in the channels of some records.

    Attributes
    ----------
    columns : tuple of str
        Base parameters of the fit.
    effects, sizes : tuple
    moves : array, shape (columns, effects)
        What X changes by per unit of each size.
    covariance : array, shape (effects, effects)
        Of the sizes.
    held : tuple of str
        Forces that are commands which a drive holds from sample to sample.
    others : tuple of tuple of Instead
        What explains the rows as well as each effect.
    unsaid : tuple of Effect
        Zeros that are always estimated, and that rows do not show.
    beyond : tuple of mapping of str to float
        By what X may be off besides, in SI, by column.
    shared : array, shape (columns, effects), optional
        Covariance of the sizes with X where they are given: weights are not those of the noise.
    samples : int
        Lines of rows that the sizes are found from.
    """

    columns: tuple[str, ...]
    effects: tuple[Effect, ...]
    sizes: tuple[float, ...]
    moves: FloatArray
    covariance: FloatArray
    held: tuple[str, ...] = ()
    others: tuple[tuple[Instead, ...], ...] = ()
    unsaid: tuple[Effect, ...] = ()
    beyond: tuple[Mapping[str, float], ...] = ()
    shared: FloatArray | None = None
    samples: int = 0

    @classmethod
    def only(cls, beyond: tuple[Mapping[str, float], ...]) -> SetRight:
        """Return that nothing was set right, and what X may be off by."""
        columns = tuple(dict.fromkeys(name for one in beyond for name in one))
        return cls(columns, (), (), np.zeros((len(columns), 0)), np.zeros((0, 0)), beyond=beyond)

    @property
    def changes_records(self) -> bool:
        """Whether channels are others now: what rows lack changes none."""
        return bool(self.held) or not all(isinstance(effect, RowForce) for effect in self.effects)

    @property
    def late(self) -> tuple[tuple[str, float, float], ...]:
        """Channels that were late, by how many s, and the deviations of that."""
        spread = np.sqrt(np.maximum(np.diag(self.covariance), 0.0)).tolist()
        every = zip(self.effects, self.sizes, spread, strict=True)
        return tuple((one.channel, size, std) for one, size, std in every if one.kind == "delay")

    @property
    def advice(self) -> tuple[Advice, ...]:
        """What is said of the channels."""
        told = tuple(
            (left if isinstance(effect, RowForce) else estimated)(effect, size, self._instead_of(effect))
            for effect, size in _one_a_cause(self.effects, self.sizes)
            if effect not in self.unsaid
        )
        return (told_holds(self.held), *told) if self.held else told

    def _instead_of(self, effect: Effect) -> list[tuple[Effect, float]]:
        every = dict(zip(self.effects, self.others, strict=False)).get(effect, ())
        return [(one.effect, one.size) for one in every]

    def drift(self, fit: Fit) -> FloatArray:
        """Return what the uncertainty of the sizes moves, as a mean square in SI, shape (c, c).

        Forces that rows lack are not estimated with the parameters: all that they move is in it.
        """
        known = [place for place, name in enumerate(fit.columns) if name in self.columns]
        own = [self.columns.index(fit.columns[place]) for place in known]
        moves, along = np.zeros((2, len(fit.columns), len(self.effects)))
        moves[known] = self.moves[own]
        remain = np.array([isinstance(one, RowForce) for one in self.effects], dtype=bool)
        sizes = self.covariance + np.outer(remain * self.sizes, remain * self.sizes)
        other = (*(one.move for every in self.others for one in every), *self.beyond)
        instead = [move.get(name, 0.0) for move in other for name in fit.columns]
        moved, beyond = moves @ sizes @ moves.T, np.reshape(instead, (len(other), len(fit.columns)))
        if self.shared is not None:
            along[known] = ~remain * min(1.0, self.samples / fit.count) * self.shared[own]
            both, noise = along @ moves.T, np.sqrt(np.maximum(np.diag(hac_covariance(fit)), 0.0))
            moved = (root := square_root(moved + both + both.T, noise)) @ root.T
        return np.asarray(moved + beyond.T @ beyond)


def _one_a_cause(effects: Sequence[Effect], sizes: Sequence[float]) -> Iterator[tuple[Effect, float]]:
    """Yield effects and sizes; of several with the same words one, with the size of all that have a unit."""
    causes: dict[str, list[tuple[Effect, float]]] = {}
    for effect, size in zip(effects, sizes, strict=True):
        causes.setdefault(effect.words if effect.words == effect.negative else effect.name, []).append(
            (effect, size)
        )
    for found in causes.values():
        tilts = [one for one in found if one[0].kind == TILT]
        effect, size = (tilts or found)[0]
        yield (effect, float(np.hypot.reduce([one for _, one in tilts]))) if tilts else (effect, size)


def channel_errors(model: Model, records: int = 1) -> tuple[Effect, ...]:
    """Return what may be off: when channels are read, zeros of levels, those of some records, and gears."""
    read, geared = model.channels, gears(model)
    bodies = {one.key: one.body for one in model.sensors if one.measures == "position" and one.key in read}
    levels = {signal.channel for signal in model.signals if signal.derivative == 0}
    between = deflecting(model)
    # where encoders read a joint on both sides the zero of the link's is that of the arm
    own = [
        key for key, body in bodies.items() if f"{body} motor" not in bodies.values() and key not in between
    ]
    found = [delay_effect(key) for key in read]
    found += [zero_effect(key, None, 1) for key in (*own, *forces_of_drives(model)) if key in levels]
    found += [*force_lags(forces_of_drives(model)), *mountings(model)]
    return (*encoder_zeros(model, records), *found, *(_gear_effect(key) for key in geared))


def mountings(model: Model) -> Iterator[Effect]:
    """Yield that a gyro or an accelerometer is turned in its mounting, where that is the file's.

    Of one axis that is read alone less is read then: it is off scale.
    """
    for one in model.module.SENSORS:
        key, read = one["key"], [name for name in one.get("channels", ()) if name in model.channels]
        estimated_turn = any(name.startswith(f"R_{key}_") for name in model.parameters)
        if one["measures"] not in ("gyro", "accelerometer") or estimated_turn:
            continue
        said = (f"{key} is not mounted as the file says",) * 2
        remedy = 'put its rpy right in the file, or let it have mounting = "estimated"'
        for first, second in combinations(read, 2):
            yield Turned(f"turn of {first} to {second}", TILT, *said, remedy, nothing, first, second=second)
        if len(read) == 1:
            said, remedy = (f"the gain of {read[0]} is off",) * 2, "calibrate it, or mount it along the axis"
            yield Effect(f"gain of {read[0]}", "gain", *said, remedy, nothing, read[0], _scaled)


@dataclass(frozen=True, eq=False)
class Turned(Effect):
    """By how many rad two axes of a sensor are turned against those that the file says."""

    second: str = ""

    def corrected(self, record: Record, index: int, size: float) -> Record:
        """Return a record whose axes are along those of the file."""
        first, second = self.channel, self.second
        by = {first: partial(_turned, record, second, size), second: partial(_turned, record, first, -size)}
        return record.edited({key: Edit(key, turned) for key, turned in by.items()})


def _turned(record: Record, other: str, size: float, samples: FloatArray, start: int) -> FloatArray:
    along = record.read(other, start, start + len(samples))
    return np.asarray(np.cos(size) * samples + np.sin(size) * along)


def _scaled(key: str, size: float, record: Record) -> Edit:
    return _times(key, 1.0 / (1.0 + size))


def gears(model: Model) -> dict[str, str]:
    """Return the force of the motor that each encoder in front of a gear is of, by their channels."""
    forces = {actuator.key for actuator in model.actuators}
    found = {}
    for name, terms in model.derived.items():
        force = name.replace("motor_", DRIVE, 1)
        if len(terms) == 1 and force in forces and abs(terms[0][0]) != 1.0:
            found[terms[0][1]] = force
    return found


def _gear_effect(key: str) -> Effect:
    """Return that the gear behind an encoder has so many more turns than the file says."""
    words = f"the gear behind {key} is not that of the file"
    remedy = "put the gear ratio right in the file, or the scale of the encoder"
    return Effect(f"gear of {key}", "gain", words, words, remedy, lambda simulated: {}, key)


def _times(key: str, factor: float) -> Edit:
    return Edit(key, lambda samples, start: factor * samples)


def set_right(model: Model, record: Record, index: int, sizes: Mapping[Effect, float]) -> Record:
    """Return a record, the `index`-th, with channels as they would be without effects of these sizes."""
    force = gears(model)
    for effect, size in sizes.items():
        if effect.channel in force and effect.kind == "gain" and size:
            drive = force[effect.channel]
            turned = {
                effect.channel: _times(effect.channel, 1.0 / (1.0 + size)),
                drive: _times(drive, 1.0 + size),
            }
            record = record.edited(turned)
        else:
            record = effect.corrected(record, index, size)
    (record,) = with_derived(model, [record])
    return record


def runs_away(effect: Effect, size: float, records: Sequence[Record]) -> bool:
    """Tell whether a delay is too long for the channels of one record, or a gear is another machine's."""
    if isinstance(effect, RowForce):
        return abs(size) > effect.most
    if effect.kind in ("gain", TILT):
        return abs(size) > MOST_ALIGNED_GAIN
    return effect.samples(size, max(record.fs for record in records)) > MOST_ALIGNED_SAMPLES


def by_half(effect: Effect, size: float, records: Sequence[Record]) -> bool:
    """Tell whether a force is early by half a sample and whole ones, as a command that a drive holds."""
    samples = size * records[0].fs + 0.5
    same = len({record.fs for record in records}) == 1
    drive = effect.channel.startswith(DRIVE)
    return effect.kind == "delay" and drive and same and abs(samples - round(samples)) < HALF_SAMPLE


def resolved(effect: Effect, size: float, records: Sequence[Record]) -> bool:
    """Tell whether a size is more than channels and rows resolve."""
    if effect.kind == "delay" or is_lag(effect):
        return effect.samples(size, max(record.fs for record in records)) > LEAST_ALIGNED_SAMPLES
    if effect.kind in ("gain", TILT):
        return abs(size) > LEAST_ALIGNED_GAIN
    return not below_noise(effect, size, records)


def tried_size(effect: Effect, record: Record) -> float:
    """Return a size, in its unit, that is small against what bends rows, and large against rounding."""
    if effect.kind == "delay":
        return TRIED_SAMPLES / record.fs
    if effect.kind in ("gain", TILT):
        return TRIED_GAIN
    if is_lag(effect):
        return 0.5 * (TRIED_SAMPLES / record.fs) ** 2
    return TRIED_ZERO * (record.facts.extent(effect.channel).span or 1.0)
