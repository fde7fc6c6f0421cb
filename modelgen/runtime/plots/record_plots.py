"""`record.plot()`: the channels over time, and their spectra."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from modelgen.errors import DataError
from modelgen.runtime.curves.buckets import channel_buckets
from modelgen.runtime.plots.axes import VERBATIM, colours, drawn, panels
from modelgen.runtime.records.record import missing_name

if TYPE_CHECKING:
    from modelgen.runtime.model.model import Model
    from modelgen.runtime.records.record import Record

MOST = 4000  # intervals of a curve over time: more than a screen has pixels


class RecordPlots:
    """Plots of a record; calling it draws the channels over time. Each returns its axes."""

    def __init__(self, record: Record) -> None:
        self._record = record

    def __call__(
        self, channels: Sequence[str] | None = None, axes: Any = None, model: Model | None = None
    ) -> Any:
        """Draw channels over time in s, one panel each.

        Parameters
        ----------
        channels : sequence of str, optional
            By default all of the record.
        axes : Axes or sequence of Axes, optional
            Where to draw, one a channel; by default a new figure.
        model : Model, optional
            Says the units of its sensors and actuators.

        Returns
        -------
        Axes, or array of Axes

        Raises
        ------
        DataError
            When a channel is absent, or matplotlib is not installed.
        """
        record, keys, units = self._record, self._keys(channels), model.channel_units if model else {}
        axes = panels(axes, len(keys))
        for axis, key in zip(axes, keys, strict=True):
            time_s, low, high = channel_buckets(record, key, MOST)
            colour = colours(axis).modelled
            if record.n > MOST:
                axis.fill_between(time_s, low, high, color=colour, linewidth=0.6)
            else:
                axis.plot(time_s, low, color=colour, linewidth=1.0)
            axis.set_ylabel(f"{key} in {units.get(key, 'SI units')}", **VERBATIM)
            axis.margins(x=0.0)
        axes[0].set_title(record.name, loc="left", **VERBATIM)
        axes[-1].set_xlabel("time in s")
        return drawn(axes)

    def spectra(
        self, channels: Sequence[str] | None = None, axes: Any = None, model: Model | None = None
    ) -> Any:
        """Draw the spectral density of channels over the frequency in Hz, and the level of their white noise.

        Parameters, result and errors as those of the call.
        """
        record, keys, units = self._record, self._keys(channels), model.channel_units if model else {}
        axes = panels(axes, len(keys))
        for axis, key in zip(axes, keys, strict=True):
            found, colour = record.facts.spectrum(key), colours(axis)
            shown = (found.frequency_hz > 0.0) & (found.density > 0.0)
            axis.loglog(
                found.frequency_hz[shown], np.sqrt(found.density[shown]), color=colour.modelled, lw=0.8
            )
            if found.noise > 0.0:
                axis.axhline(np.sqrt(found.noise), color=colour.residual, linestyle="--", label="white noise")
                axis.legend(frameon=False)
            axis.set_ylabel(f"{key} in {units.get(key, 'SI units')} / √Hz", **VERBATIM)
        axes[0].set_title(f"{record.name}, root of the spectral density", loc="left", **VERBATIM)
        axes[-1].set_xlabel("frequency in Hz")
        return drawn(axes)

    def _keys(self, channels: Sequence[str] | None) -> tuple[str, ...]:
        record = self._record
        keys = (
            record.keys if channels is None else (channels,) if isinstance(channels, str) else tuple(channels)
        )
        absent = [
            missing_name(record.name, "channel", key, record.keys) for key in keys if key not in record.keys
        ]
        DataError.raise_any(absent)
        if not keys:
            raise DataError.at("channels", "are none", "name one at least")
        return keys
