"""An experiment that was only simulated: what it would record, and how the records would be evaluated."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from modelgen.errors import DataError, IdentifiabilityError
from modelgen.runtime.filter_choice.filter_choice import FilterChoice, choose_filter
from modelgen.runtime.identification.job import Job
from modelgen.runtime.identification.methods import METHODS
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record
from modelgen.runtime.simulation.excitation import Excitation
from modelgen.runtime.simulation.instrument import Instrument
from modelgen.runtime.simulation.sensor_readings import readings
from modelgen.runtime.simulation.simulate import Simulation, simulate

PAIR = ("chirp", "trapezoid")


@dataclass(frozen=True, eq=False)
class Experiment:
    """A simulated experiment with noisy instruments, and the filter and weights that an estimator takes."""

    model: Model
    parameters: Mapping[str, float]
    simulations: tuple[Simulation, ...]
    instruments: Mapping[str, Instrument]
    method: str
    choice: FilterChoice
    weights: Mapping[tuple[int, int], float]

    def records(self, seed: int | None) -> tuple[Record, ...]:
        """Return the records as the instruments read them; without noise if the seed is None."""
        return _records(self.model, self.simulations, self.instruments, seed)


def experiment(
    model: Model,
    parameters: Mapping[str, float],
    instruments: Mapping[str, Instrument],
    excitations: Sequence[str | Excitation] = PAIR,
    *,
    fs: float = 5000.0,
    duration_s: float = 2.0,
    method: str = "wls",
    choice: FilterChoice | None = None,
) -> Experiment:
    """Simulate an experiment, choose the filter on a noisy copy, and take the weights of one estimate.

    Parameters
    ----------
    model, parameters
        The candidate sensor set's module, and the values expected of the chain (SI).
    instruments : mapping of str to Instrument
        By channel; a channel without one is perfect.
    excitations : sequence of str or Excitation
        As in `modelgen.simulate`, one record each.
    fs, duration_s : float
        Sampling frequency in Hz; duration in s of an excitation that is given by its kind.
    method : str
        The estimator, by default "wls"; "iv" has no bias, and takes far longer; "auto" is the default of
        `identify`.
    choice : FilterChoice, optional
        Its filter, by default chosen as from measured records.
    """
    simulations = tuple(
        simulate(model, parameters, kind, fs=fs, duration_s=duration_s if isinstance(kind, str) else None)
        for kind in excitations
    )
    noisy = _records(model, simulations, instruments, 0)
    choice = choice or choose_filter(model, noisy)
    if method == "auto":
        return Experiment(model, parameters, simulations, dict(instruments), method, choice, {})
    try:
        fit = METHODS[method].run(Job(model, noisy, choice))[1]
    except DataError as error:  # the cut-off that this noise asks for takes more than the records have
        raise IdentifiabilityError(*error.problems) from error
    weights = {(b.record, b.row): w for b, w in zip(fit.blocks, fit.weights, strict=True)}
    return Experiment(model, parameters, simulations, dict(instruments), method, choice, weights)


def _records(
    model: Model,
    simulations: Sequence[Simulation],
    instruments: Mapping[str, Instrument],
    seed: int | None,
) -> tuple[Record, ...]:
    if seed is None:
        return tuple(found.record for found in simulations)
    noise = {key: instrument.noise for key, instrument in instruments.items()}
    resolution = {key: instrument.resolution for key, instrument in instruments.items()}
    return tuple(
        replace(
            found.record,
            signals=readings(model, found.true, noise, resolution, seed * len(simulations) + i),
        )
        for i, found in enumerate(simulations)
    )
