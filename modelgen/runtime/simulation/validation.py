"""What a validation found: signals of a record, measured and modelled, with their fits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.lazy_accessor import LazyAccessor


@dataclass(frozen=True, eq=False)
class SignalCheck:
    """One signal, measured and simulated, shape (n,) each, in `unit`, from sample `start` on.

    `kind` is position, velocity, acceleration, force or tracking error; `derived` says that it was
    differentiated from a sensor's reading.
    """

    channel: str
    kind: str
    unit: str
    derived: bool
    start: int
    measured: FloatArray
    simulated: FloatArray

    @property
    def relative_error(self) -> float:
        """Norm of measured - simulated over norm of measured, in %."""
        size = float(np.linalg.norm(self.measured))
        return 100.0 * self._error / size if size else float("inf")

    @property
    def fit(self) -> float:
        """100 (1 - norm of the error over norm of the measured variation), in %; 100 is perfect."""
        size = float(np.linalg.norm(self.measured - self.measured.mean()))
        return 100.0 * (1.0 - self._error / size) if size else float("-inf")

    @property
    def rms_error(self) -> float:
        """Root mean square of measured - simulated, in `unit`."""
        return self._error / float(np.sqrt(self.measured.size))

    @property
    def _error(self) -> float:
        return float(np.linalg.norm(self.measured - self.simulated))


@dataclass(frozen=True, eq=False)
class Validation:
    """All signals of one record; `held_out` says that the parameters were not identified from it.

    `kind` is what the measured signals are compared with: "closed loop", "open loop", or "10 samples ahead".
    Derivatives are those below `cutoff_hz`; `notes` say what was taken for granted.
    """

    record: str
    held_out: bool
    fs: float
    cutoff_hz: float
    checks: tuple[SignalCheck, ...]
    kind: str = "closed loop"
    notes: tuple[str, ...] = ()

    # plot() draws every signal, measured and modelled
    plot = LazyAccessor("modelgen.runtime.plots.validation_plots", "ValidationPlot")

    def check(self, channel: str, kind: str) -> SignalCheck:
        """Return the check of a channel; `kind` distinguishes a sensor's reading from its derivatives."""
        return next(c for c in self.checks if (c.channel, c.kind) == (channel, kind))

    def __str__(self) -> str:
        head = f"{self.record}, {'held out' if self.held_out else 'used'}; {self.kind}"
        lines = [
            f"  {check.channel + ': ' + check.kind:<28} fit {check.fit:>9.6g} %   rms error "
            f"{check.rms_error:.3g} {check.unit}"
            for check in self.checks
        ]
        return "\n".join((head, *lines, *(f"  {note}" for note in self.notes)))
