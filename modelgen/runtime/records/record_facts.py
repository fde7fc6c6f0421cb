"""RecordFacts: what many ask of one record, computed once and then kept with it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from modelgen.runtime.filters.noise_spectrum import ReadingSpectrum, reading_spectrum
from modelgen.runtime.filters.power_spectrum import power_spectrum

FloatArray = npt.NDArray[np.float64]


class RecordFacts:
    """The spectra of a record's channels; `fs` is in Hz. Reached as `Record.facts`."""

    def __init__(self, signals: Mapping[str, FloatArray], fs: float) -> None:
        self._signals = signals
        self._fs = fs
        self._spectra: dict[str, ReadingSpectrum] = {}
        self._powers: dict[tuple[str, int, bool], tuple[FloatArray, FloatArray]] = {}

    def spectrum(self, channel: str) -> ReadingSpectrum:
        """Return the density of a reading beside its own noise, see `reading_spectrum`."""
        if channel not in self._spectra:
            self._spectra[channel] = reading_spectrum(self._signals[channel], self._fs)
        return self._spectra[channel]

    def power(
        self, channel: str, derivative: int = 0, keep_mean: bool = False
    ) -> tuple[FloatArray, FloatArray]:
        """Return frequencies in Hz and the power of a derivative, see `power_spectrum`."""
        asked = channel, derivative, keep_mean
        if asked not in self._powers:
            self._powers[asked] = power_spectrum(self._signals[channel], self._fs, derivative, keep_mean)
        return self._powers[asked]
