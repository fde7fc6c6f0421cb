"""The direct model in closed loop: parameters and an excitation -> a record, as the sensors would read it.

Equations (17)-(19) of Pham 2002, corrected, with true Coulomb friction: the motion between stick and slip
events is exact (`stick_slip`), and so are torques, accelerations and friction at the sample instants.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import TypedDict, Unpack

import numpy as np
import numpy.typing as npt

from modelgen.array_types import FloatArray
from modelgen.errors import DataError
from modelgen.keyword_options import refuse_other, with_defaults
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record
from modelgen.runtime.simulation.closed_loop import PositionVelocityController, default_controller
from modelgen.runtime.simulation.default_excitation import default_excitation
from modelgen.runtime.simulation.drive import Drive
from modelgen.runtime.simulation.excitation import Excitation, check_fs
from modelgen.runtime.simulation.motion import move, true_signals
from modelgen.runtime.simulation.plant import Plant, make_plant
from modelgen.runtime.simulation.sensor_readings import checked_levels, instrument_keys, readings
from modelgen.runtime.stick_slip.hybrid_system import Event


@dataclass(frozen=True)
class Settings:
    """What a simulation was made with: every parameter's value, and the options in use."""

    parameters: Mapping[str, float]
    controller: PositionVelocityController
    actuator: str
    fs: float
    oversample: int
    noise: Mapping[str, float]
    resolution: Mapping[str, float]
    seed: int
    bias: Mapping[str, float]
    drive: Drive


@dataclass(frozen=True)
class ModeChange:
    """At `time_s` the body starts to slip forward (+1), backward (-1), or sticks (0)."""

    time_s: float
    body: str
    mode: int


@dataclass(frozen=True, eq=False)
class Simulation:
    """A simulated experiment.

    Attributes
    ----------
    record : Record
        What sensors and actuators read, with noise and resolution; and the signals ``sign_BODY`` that the
        model needs.
    true : mapping of str to ndarray, shape (N,)
        The same channels without noise; ``command_ACTUATOR``, what the controller asks for; of every body
        ``q_BODY``, ``v_BODY``, ``a_BODY``, ``sign_BODY``; of bodies with friction or offset
        ``friction_BODY``, the force; of those that can stick ``mode_BODY`` (+1, -1, 0). Where a channel has
        one of these names, it comes first.
    reference : Excitation
    changes : tuple of ModeChange
        Every change between slip and stick, at its exact time.
    settings : Settings
    """

    record: Record
    true: Mapping[str, FloatArray]
    reference: Excitation
    changes: tuple[ModeChange, ...]
    settings: Settings


class SimulationOptions(TypedDict, total=False):
    """The keyword options of `simulate`, which describes them."""

    fs: float
    duration_s: float | None
    noise: Mapping[str, float] | None
    resolution: Mapping[str, float] | None
    bias: Mapping[str, float] | None
    seed: int
    oversample: int
    controller: PositionVelocityController | None
    drive: Drive | None
    actuator: str | None
    initial_state: npt.ArrayLike | None


def simulate(
    model: Model,
    parameters: Mapping[str, float],
    excitation: str | Excitation = "chirp",
    **options: Unpack[SimulationOptions],
) -> Simulation:
    """Simulate a chain with true Coulomb friction under position and velocity control.

    Parameters
    ----------
    model : Model
        The generated module's view.
    parameters : mapping of str to float
        Physical parameters (SI); known ones may be left out.
    excitation : str or Excitation
        "chirp", "trapezoid" (levels as in `default_excitation`), or the user's own.
    fs : float
        Sampling frequency in Hz, by default 5000.
    duration_s : float, optional
        Of "chirp" and "trapezoid", by default 2 s; an Excitation has its own.
    noise : mapping of str to float, optional
        Standard deviation (SI) of white noise on a sensor's or actuator's channel, unseen by the controller.
    resolution : mapping of str to float, optional
        Step (SI) to which a channel is rounded after the noise.
    bias : mapping of str to float, optional
        Constant error (SI) of a channel, such as an accelerometer's.
    seed : int
        Of the noise, by default 0. Every channel draws from a stream of its own, and so does every
        excitation: by its name and its number of samples.
    oversample : int
        Internal steps per sample, by default 32. An Excitation has its own.
    controller : PositionVelocityController, optional
        By default slow against the lowest elastic mode.
    drive : Drive, optional
        Sampling, delay, current loop, limit and encoder of the controller; by default none of them.
    actuator : str, optional
        Key of the actuator that the controller drives, by default the first; the others follow the
        `forces` of an Excitation, or rest at 0.
    initial_state : array_like, shape (2 bodies,), optional
        All positions, then all velocities, in the order of the spec; by default at rest at 0.

    Raises
    ------
    DataError
        For parameters, channels or options that do not fit the model, for a chain without an
        actuator, and for a closed loop that is unstable.
    """
    given = with_defaults(
        "simulate", options, SimulationOptions, SimulationOptions(fs=5000.0, seed=0, oversample=32)
    )
    if model.is_arm:
        raise DataError.at(model.chain, "is an arm", "use modelgen.simulate_arm")
    _refuse_other_kinds(excitation, given)
    plant = make_plant(model, parameters, given["actuator"])
    settings = _settings(plant, given)
    if isinstance(excitation, str):
        excitation = default_excitation(
            excitation,
            model,
            parameters,
            settings.fs,
            duration_s=2.0 if given["duration_s"] is None else given["duration_s"],
            controller=settings.controller,
            actuator=given["actuator"],
            oversample=settings.oversample,
        )
    elif given["duration_s"] is not None:
        raise DataError.at("duration_s", "is given, but the Excitation has its own", "leave it out")
    settings = replace(settings, oversample=_oversample(excitation, settings.fs))
    start = given_state(given["initial_state"], plant.bodies, "velocities")
    start = np.zeros(2 * len(plant.bodies)) if start is None else start
    motion = move(plant, settings.controller, settings.drive, excitation, start, settings.oversample)
    true = true_signals(plant, motion)
    levels = (settings.noise, settings.resolution, settings.seed, settings.bias)
    measured = readings(model, true, *levels, excitation.name)
    record = Record(measured, settings.fs, excitation.name, excitation.name)
    changes = tuple(_mode_change(plant, event) for event in motion.path.events)
    return Simulation(record, MappingProxyType(true), excitation, changes, settings)


def _refuse_other_kinds(excitation: str | Excitation, given: SimulationOptions) -> None:
    own = None if isinstance(excitation, str) else excitation
    refuse_other("excitation", own, Excitation, Excitation.__module__)
    controller = PositionVelocityController
    refuse_other("controller", given["controller"], controller, controller.__module__)
    refuse_other("drive", given["drive"], Drive, Drive.__module__)


def _settings(plant: Plant, given: SimulationOptions) -> Settings:
    """Return the checked settings; `oversample` may still be replaced by that of an Excitation."""
    model = plant.model
    asked = given["noise"], given["resolution"], given["bias"]
    noise, resolution, bias = checked_levels(instrument_keys(model), *asked, given["seed"])
    return Settings(
        plant.parameters,
        given["controller"] or default_controller(plant),
        model.actuators[plant.actuator].key,
        given["fs"],
        given["oversample"],
        MappingProxyType(noise),
        MappingProxyType(resolution),
        given["seed"],
        MappingProxyType(bias),
        given["drive"] or Drive(),
    )


def record_with_reference(simulation: Simulation) -> Record:
    """Return the record with the inputs of the loop: ``reference``, ``reference_rate``, ``feedforward``."""
    record, inputs, step = simulation.record, simulation.reference, simulation.settings.oversample
    names = ("reference", "reference_rate", "feedforward")
    signals = {name: getattr(inputs, name)[::step][: record.n] for name in names}
    return replace(record, signals={**record.signals, **signals})


def _oversample(excitation: Excitation, fs: float) -> int:
    check_fs(fs)
    ratio = excitation.rate_hz / fs
    if ratio < 0.5 or abs(ratio - round(ratio)) > 1e-9 * ratio:
        what = f"has {excitation.rate_hz:g} Hz, no whole multiple of fs = {fs:g} Hz"
        raise DataError.at(f"excitation {excitation.name}", what, "make both fit")
    return round(ratio)


def given_state(given: npt.ArrayLike | None, names: Sequence[str], rates: str) -> FloatArray | None:
    """Return the initial state that is given, shape (2 coordinates,), in SI; raises DataError for no such."""
    if given is None:
        return None
    size, state = 2 * len(names), np.array(given, dtype=float)
    if state.shape != (size,) or not np.isfinite(state).all():
        remedy = f"give {size} finite numbers: positions, then {rates}, of {', '.join(names)}"
        raise DataError.at("initial_state", f"has shape {state.shape} or is not finite", remedy)
    return state


def _mode_change(plant: Plant, event: Event) -> ModeChange:
    column = plant.sticking[event.body]
    return ModeChange(event.time_s, plant.model.friction[column].body, event.mode)
