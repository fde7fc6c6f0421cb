"""Record: what the sensors and actuators of one experiment read, checked once and then immutable."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import DataError, Problem, listed, nearest, shortened
from modelgen.lazy_accessor import LazyAccessor
from modelgen.runtime.records.channel_checks import (
    checked_channel,
    frequency_problems,
    label_problems,
    length_problems,
    other_units,
    unit_text_problems,
)
from modelgen.runtime.records.channels import Channels, ChannelSignals, Edit, EditedChannels
from modelgen.runtime.records.record_facts import RecordFacts

if TYPE_CHECKING:
    from modelgen.runtime.records.frequency_response import FrequencyResponse


@dataclass(frozen=True, eq=False)
class Record:
    """One experiment: the sensors' own readings, sampled together and uniformly.

    Parameters
    ----------
    signals : mapping of str to array_like, shape (n,)
        Channel key (``"q_m"``, ``"Gamma_m"``) to readings in the unit of that sensor or actuator (SI). The
        arrays are copied: the record never changes with what it was made from, nor can it be changed.
    fs : float
        Sampling frequency in Hz.
    name : str
        Names the record in messages and reports.
    tag : str, optional
        What kind of experiment this is ("chirp", "trapezoid"); chooses among rows where a user asks for it.
    units : mapping of str to str, optional
        What the numbers of channels are in ("A"), as far as it is known. Nothing is converted:
        `modelgen.identify` refuses a channel that is in another unit than its model needs.

    Raises
    ------
    DataError
        With one problem per mistake: a channel that is not real, one-dimensional, finite and as long as the
        others, fewer than two samples, or a sampling frequency that is not finite and positive.

    Examples
    --------
    >>> record = Record(signals={"q_m": [0.0, 1.0, 2.0]}, fs=1000.0, name="chirp")
    >>> record.n, record.dt
    (3, 0.001)
    """

    signals: Mapping[str, FloatArray]
    fs: float
    name: str = "record"
    tag: str | None = None
    units: Mapping[str, str] = field(default_factory=dict)
    n: int = field(init=False)

    def __post_init__(self) -> None:
        problems = label_problems(self.name, self.tag)
        where = self.name if isinstance(self.name, str) and self.name else "record"
        problems += frequency_problems(where, self.fs)
        channels: dict[str, FloatArray] = {}
        if not isinstance(self.signals, Mapping) or not self.signals:
            problems.append(Problem(where, "has no channels", "give signals as a mapping of key to samples"))
        else:
            for key, values in self.signals.items():
                array, found = checked_channel(f"{where}: channel {key}", key, values)
                problems += found
                if array is not None:
                    channels[key] = array
        problems += length_problems(where, channels) + unit_text_problems(where, self.units, channels)
        DataError.raise_any(problems)
        object.__setattr__(self, "signals", MappingProxyType(channels))
        object.__setattr__(self, "units", MappingProxyType(dict(self.units)))
        object.__setattr__(self, "fs", float(self.fs))
        object.__setattr__(self, "n", len(next(iter(channels.values()))))

    @classmethod
    def over(cls, source: Channels, tag: str | None = None) -> Record:
        """Return a record whose samples stay where they are, and are read in stretches; for any length.

        Parameters
        ----------
        source : Channels
            For example `modelgen.runtime.files.npy_channels.open_npy`.
        tag : str, optional

        Raises
        ------
        DataError
            When its name, sampling frequency, number of samples or tag cannot be used.
        """
        problems = label_problems(source.name, tag) + frequency_problems(source.name, source.fs)
        if source.n < 2:
            problems.append(Problem(source.name, f"has {source.n} sample(s)", "give at least two samples"))
        DataError.raise_any(problems)
        return cls._of(ChannelSignals(source), float(source.fs), source.name, tag, {}, int(source.n))

    @classmethod
    def _of(
        cls,
        signals: Mapping[str, FloatArray],
        fs: float,
        name: str,
        tag: str | None,
        units: Mapping[str, str],
        n: int,
    ) -> Record:
        """Return the record of what has been checked before."""
        record = object.__new__(cls)
        entries = {"signals": signals, "fs": fs, "name": name, "tag": tag, "units": units, "n": n}
        for key, value in entries.items():
            object.__setattr__(record, key, value)
        return record

    @property
    def keys(self) -> tuple[str, ...]:
        """Names of the channels."""
        return tuple(self.signals)

    @property
    def source(self) -> Channels:
        """Where the samples are: the record itself, or what it was made over."""
        return self.signals.source if isinstance(self.signals, ChannelSignals) else self

    @property
    def in_memory(self) -> bool:
        """Whether its samples are in memory, not read in stretches from elsewhere."""
        return self.source is self

    def read(self, channel: str, start: int, stop: int) -> FloatArray:
        """Return samples start to stop of a channel, shape (stop - start,)."""
        if isinstance(self.signals, ChannelSignals):
            return self.signals.source.read(channel, start, stop)
        return self.signals[channel][start:stop]

    def edited(self, edits: Mapping[str, Edit | FloatArray]) -> Record:
        """Return the record with channels made of others, or new, shape (n,); in memory where this one is."""
        if not edits:
            return self
        if isinstance(self.signals, ChannelSignals):
            return Record.over(EditedChannels(self.source, self.name, self.n, edits), self.tag)
        made = {
            key: edit.whole(self.signals[edit.channel]) if isinstance(edit, Edit) else edit
            for key, edit in edits.items()
        }
        new = Record(made, self.fs, self.name, self.tag)
        joined = {**self.signals, **new.signals}
        if new.n != self.n:
            raise DataError(*length_problems(self.name, joined))
        # the other channels are checked, and nobody can change them
        edited = Record._of(MappingProxyType(joined), self.fs, self.name, self.tag, self.units, self.n)
        same = {key: found for key, found in self.facts.channels.items() if key not in made}
        vars(edited)["facts"] = RecordFacts(edited, same, self.facts)
        return edited

    def carrying(self, *payloads: str) -> Record:
        """Return the record of an arm that carried these payloads all the time: ``load_NAME`` are ones.

        Where it took them up in between, give such a channel yourself: 1 while it carries, else 0.
        """
        made = {f"load_{name}": Edit(self.keys[0], _ones) for name in payloads}
        return self.edited(made)

    def part(self, start: int, stop: int, name: str) -> Record:
        """Return samples start to stop of all channels; in memory where this record is."""
        if isinstance(self.signals, ChannelSignals):
            return Record.over(EditedChannels(self.source, name, stop - start, {}, start), self.tag)
        cut = {key: samples[start:stop] for key, samples in self.signals.items()}
        return Record(cut, self.fs, name, self.tag, self.units)

    @property
    def dt(self) -> float:
        """Sampling period in s."""
        return 1.0 / self.fs

    @property
    def duration_s(self) -> float:
        """Time covered in s: n samples of 1/fs each."""
        return self.n / self.fs

    @cached_property
    def facts(self) -> RecordFacts:
        """Spectra and extents of the channels, each computed when first asked for."""
        return RecordFacts(self)

    # record.plot() draws the channels, record.plot.spectra() their spectra
    plot = LazyAccessor("modelgen.runtime.plots.record_plots", "RecordPlots")

    def frequency_response(
        self,
        output: str,
        input: str,
        resolution_hz: float | None = None,
        period_s: float | str | None = None,
    ) -> FrequencyResponse:
        """Return the measured frequency response of one channel over another, with its coherence.

        Parameters
        ----------
        output, input : str
            Channels; the input is usually a force.
        resolution_hz : float, optional
            Distance of the frequencies in Hz: segments of 1 / resolution_hz, half overlapping, under Hann's
            window. By default eight segments.
        period_s : float or "none", optional
            Period in s of a periodic excitation, of which whole periods are then taken, without a window.
            By default a period is looked for; "none" looks for none.

        Raises
        ------
        DataError
            When a channel is absent, the input rests, or the record is too short.
        """
        from modelgen.runtime.records.frequency_response import frequency_response

        refuse_lacking([self], (output, input))
        return frequency_response(self, output, input, resolution_hz, period_s)

    def select(self, keys: Iterable[str]) -> Record:
        """Return the record with these channels only, in this order.

        Raises
        ------
        DataError
            With one problem per channel that is absent.
        """
        wanted = tuple(keys)
        refuse_lacking([self], wanted)
        units = {key: unit for key, unit in self.units.items() if key in wanted}
        return Record({key: self.signals[key] for key in wanted}, self.fs, self.name, self.tag, units)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Record):
            return NotImplemented
        return (
            (self.fs, self.name, self.tag) == (other.fs, other.name, other.tag)
            and tuple(self.signals) == tuple(other.signals)
            and all(np.array_equal(self.signals[key], other.signals[key]) for key in self.signals)
        )

    def __repr__(self) -> str:
        label = f"name={self.name!r}" + (f", tag={self.tag!r}" if self.tag is not None else "")
        return f"Record({label}, fs={self.fs!r}, n={self.n}, channels={list(self.signals)})"

    def __reduce__(self) -> tuple[Any, ...]:
        if isinstance(self.signals, ChannelSignals):
            return Record.over, (self.source, self.tag)
        # a mapping proxy cannot be sent to another process, a dict can
        return Record, (dict(self.signals), self.fs, self.name, self.tag, dict(self.units))


def _ones(samples: FloatArray, _: int) -> FloatArray:
    return np.ones(len(samples))


def missing_name(where: str, kind: str, name: str, available: Iterable[str]) -> Problem:
    """Return the problem "has no <kind> <name>", with the closest name and those that there are."""
    names = list(available)
    close = nearest(name, names)
    hint = f"did you mean {close}? " if close is not None else ""
    return Problem(where, f"has no {kind} {shortened(name)}", f"{hint}available: {listed(names)}")


def refuse_lacking(
    records: Sequence[Record], needed: Iterable[str], units: Mapping[str, str] = MappingProxyType({})
) -> None:
    """Raise DataError with one problem per channel that a record lacks or has in another unit than `units`,
    or where there are no records.
    """
    if not records:
        raise DataError.at("records", "there are none", "give at least one Record")
    wanted = tuple(needed)
    lacking = [
        missing_name(one.name, "channel", key, one.keys)
        for one in records
        for key in wanted
        if key not in one.keys
    ]
    DataError.raise_any(
        lacking + [one for record in records for one in other_units(record.name, record.units, units)]
    )
