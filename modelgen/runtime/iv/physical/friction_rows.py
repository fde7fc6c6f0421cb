"""Friction that differentiated rows drop, added to the rows of a fit: they hold at reversals, too.

A row that differentiates Coulomb friction F s, s the direction of motion, drops it: d s / dt is zero but at
reversals. Where a body reverses so often that every sample feels it, s is an ordinary signal behind the
filters of the rows, and so are its derivatives. It is known to a part of a sample: the velocity at which it
turns is the simulated one, moved to the record by what the low-passed difference of the two positions changes
by; a low-pass of the velocity itself would bend where friction jumps, and turn late. While the simulated body
sticks, s is what holds it, over F.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np

from modelgen.array_types import FloatArray, IntArray
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.filter_choice.turning_band import turning_band_hz
from modelgen.runtime.filters.derivatives import differentiate
from modelgen.runtime.filters.noise_spectrum import reading_spectrum
from modelgen.runtime.filters.zero_phase import zero_phase
from modelgen.runtime.iv.companion_simulation import Loop, Simulated, followed_closely
from modelgen.runtime.iv.instrumental_variables import Setting
from modelgen.runtime.iv.thresholds import DIFFERENCED, LED_ORDER, SHOWN, TURNING_ROUNDS
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.dropped_friction import DroppedFriction, dropped_friction, felt_forces
from modelgen.runtime.rows.given_directions import direction_channel
from modelgen.runtime.rows.record_rows import unmasked_rows
from modelgen.runtime.simulation.plant import body_order


def adds_friction(fit: Fit, setting: Setting) -> bool:
    """Tell whether rows of the fit need the friction of a simulation.

    They do where a block uses samples that feel reversals of a friction that its row drops, and where the
    direction of a body was guessed.
    """
    return any(_dropped(fit, setting))


def with_friction(
    fit: Fit,
    setting: Setting,
    simulated: Sequence[Simulated],
    values: Mapping[str, float],
) -> Fit:
    """Return the fit with that friction in its blocks, linear at its solution.

    Parameters
    ----------
    fit : Fit
        In base columns, all of them.
    setting : Setting
        With the records that the blocks were made of.
    simulated : sequence of Simulated
        Of each of these records, kept close to it: where bodies turn and stick.
    values : mapping of str to float
        The physical parameters (SI) of the solution.
    """
    bodies = sorted(_bodies(fit, setting))
    records = [
        setting.records[one.index].edited(other_directions(one, bodies, setting.choice, setting.loop))
        if setting.closer
        else _with_directions(setting.records, bodies, one)
        for one in simulated
    ]
    parts = [(block.W, block.Y) for block in fit.blocks]
    found = _added(parts, fit, setting, records, values)
    blocks = tuple(
        block if not dropped else replace(block.kept(), W=W, Y=Y)
        for block, dropped, (W, Y) in zip(fit.blocks, _dropped(fit, setting), found, strict=True)
    )
    return replace(fit, blocks=blocks)


def instruments_with_friction(
    Z: Sequence[FloatArray],
    fit: Fit,
    setting: Setting,
    simulated: Sequence[Simulated],
    values: Mapping[str, float],
) -> tuple[FloatArray, ...]:
    """Return instruments, in SI, (n, columns) a block, with that friction as it is in the simulation."""
    runs, bodies = [one.record for one in simulated], _bodies(fit, setting)
    records = [_with_directions(runs, bodies, one) for one in simulated]
    parts = [(z, np.zeros(len(z))) for z in Z]
    return tuple(W for W, _ in _added(parts, fit, setting, records, values))


def _dropped(fit: Fit, setting: Setting) -> list[tuple[DroppedFriction, ...]]:
    found = []
    for block in fit.blocks:
        friction = dropped_friction(setting.model, block.row)
        guessed = any(one.key in setting.guessed for one in friction)
        found.append(friction if block.turning or guessed else ())
    return found


def _with_directions(records: Sequence[Record], bodies: Iterable[str], simulated: Simulated) -> Record:
    """Return a record with directions of bodies as channels, of the motion that it holds."""
    record = records[simulated.index]
    return record.edited(directions(simulated, sorted(bodies), record))


def _bodies(fit: Fit, setting: Setting) -> set[str]:
    """Return the bodies whose friction rows of the fit drop."""
    return {one.body for dropped in _dropped(fit, setting) for one in dropped}


def directions(simulated: Simulated, bodies: Iterable[str], record: Record) -> dict[str, FloatArray]:
    """Return the directions of bodies in a record, by channel, -1 to 1 (no unit), shape (n,) each."""
    return {direction_channel(body): _direction(simulated, body, record) for body in bodies}


def other_directions(
    simulated: Simulated, bodies: Iterable[str], choice: FilterChoice, loop: Loop | None
) -> dict[str, FloatArray]:
    """Return directions to compare `directions` with: of a simulation led to its record once more.

    By channel, -1 to 1 (no unit), shape (n,) each. Where a body stops for a moment, whether it reverses there
    hangs on less than its sensor's noise. Bodies turn as this motion does, and not as what is read of them
    beside it says.
    """
    closer = followed_closely(simulated, choice, loop)
    return directions(closer, bodies, closer.record)


def _direction(simulated: Simulated, body: str, record: Record) -> FloatArray:
    """Return the direction of a body in a record, -1 to 1 (no unit), shape (n,)."""
    plant, motion = simulated.plant, simulated.motion
    place = next(j for j, friction in enumerate(plant.model.friction) if friction.body == body)
    moving = motion[f"mode_{body}"] != 0.0 if place in plant.sticking else np.ones(record.n, dtype=bool)
    level = plant.value(plant.model.friction[place].coulomb_plus)
    found = mean_sign(*_recorded_speed(simulated, body, record, level * moving))
    if moving.all():
        return found
    held = motion[f"friction_{body}"] - plant.offsets[place]
    return np.where(moving, found, np.clip(held / level, -1.0, 1.0))


def _recorded_speed(
    simulated: Simulated, body: str, record: Record, level: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the speed of a body in a record, in as wide a band as noise leaves, and its change a period.

    Within the time that the low-pass resolves, noise is to change the speed by a small share of what turning
    does; where nothing of how the two differ stands out of it, it changes the speed for nothing. Beyond its
    band the speed is the simulated one, but for what friction does that turns at other
    instants: there, a force on a body moves its inertia alone. All arrays, `level` is the friction, have
    the shape (n,).
    """
    further = simulated.further(body, record)
    speed, change = simulated.motion[f"v_{body}"], simulated.motion[f"a_{body}"] * record.dt
    turns = np.flatnonzero(speed[:-1] * speed[1:] < 0.0)
    if not turns.size or further is None or not further.motion.any():
        return speed, change
    turning = float(np.median(np.abs(simulated.motion[f"a_{body}"][turns])))
    times = 1 - further.order
    shown_hz = reading_spectrum(further.motion, record.fs).visible_to_hz(times) or 0.0
    wide_hz = min(
        turning_band_hz(turning, further.noise, times, record.fs), simulated.led_hz, SHOWN * shown_hz
    )
    if wide_hz * record.n < record.fs:  # not a period of what noise leaves lies in the record
        return speed, change
    smooth = zero_phase(further.motion, LED_ORDER, wide_hz, record.fs)
    slow = speed + (smooth if times == 0 else differentiate(smooth, record.dt))
    inertia = simulated.plant.inertia[simulated.plant.bodies.index(body)]
    push, before = level * record.dt / inertia, mean_direction(speed, change)
    found, bent = slow, change
    for _ in range(TURNING_ROUNDS):
        bent = change - push * (np.sign(found) - np.sign(speed))
        steps = -push[:-1] * (mean_direction(found, bent) - before)
        gained = np.concatenate([[0.0], np.cumsum(steps)])
        found = slow + gained - zero_phase(gained, LED_ORDER, wide_hz, record.fs)
    return found, bent


def turning_points(speed: FloatArray, change: FloatArray | None = None) -> tuple[IntArray, FloatArray]:
    """Return the samples before a speed changes its sign, and behind what part of a period it does.

    Speeds (SI) are straight lines between samples; with `change`, by how much a speed changes in a period at
    its samples, shape (n,), they bend where they pass zero, as friction jumps there.
    """
    at = np.flatnonzero(speed[:-1] * speed[1:] < 0.0)
    part = speed[at] / (speed[at] - speed[at + 1])
    if change is not None:
        # periods from the sample before to zero, and from there to the one behind, at the slopes of either
        before, behind = -speed[at] * change[at + 1], speed[at + 1] * change[at]
        bends = (speed[at] * change[at] < 0.0) & (speed[at + 1] * change[at + 1] > 0.0)
        part[bends] = before[bends] / (before[bends] + behind[bends])
    return at, part


def mean_direction(speed: FloatArray, change: FloatArray) -> FloatArray:
    """Return the mean sign of a speed (SI) between each sample and the next, shape (n - 1,)."""
    sign = np.sign(speed)
    found = 0.5 * (sign[:-1] + sign[1:])
    at, part = turning_points(speed, change)
    found[at] = sign[at] * (2.0 * part - 1.0)
    return found


def mean_sign(speed: FloatArray, change: FloatArray | None = None) -> FloatArray:
    """Return the sign of a speed (SI, (n,)) where it jumps as low-passes see a jump between two samples.

    The mean over a sampling period around each, less what that mean takes off a second derivative: right to
    fourth order in frequency times period. `change` as for `turning_points`.
    """
    found = np.sign(speed)
    at, part = turning_points(speed, change)
    before = part < 0.5
    found[at[before]] *= 2.0 * part[before]
    found[at[~before] + 1] *= 2.0 * (1.0 - part[~before])
    found[1:-1] -= np.diff(found, 2) / 24.0
    return found


def _added(
    parts: Sequence[tuple[FloatArray, FloatArray]],
    fit: Fit,
    setting: Setting,
    records: Sequence[Record],
    values: Mapping[str, float],
) -> list[tuple[FloatArray, FloatArray]]:
    """Return W and Y of every block with dropped friction, linear at the fit's solution x = b(p).

    Y = W x + S g(p), with g = F c and S the derivatives of the direction, becomes

        Y - S g + S G x = (W + S G) x',    G db/dp = dg/dp.
    """
    model, choice, x = setting.model, setting.choice, fit.solution.x
    dropped_of, found = _dropped(fit, setting), []
    if any(dropped_of):
        felt, rates = _felt_with_rates(model, tuple(values.items()))
    for block, dropped, (W, Y) in zip(fit.blocks, dropped_of, parts, strict=True):
        W, Y = (W.copy(), Y.copy()) if dropped else (W, Y)
        for friction in dropped:
            factor = choice.decimation[block.record]
            rows = unmasked_rows(model, records[block.record], choice, factor, setting.drop)
            place, size = body_order(model).index(friction.body), values[friction.friction]
            c, slope = felt[block.row][:, place], size * rates[block.row][:, place]
            slope[:, model.parameters.index(friction.friction)] += c
            W[:, list(friction.columns)] = 0.0
            S = rows.derivatives(direction_channel(friction.body), tuple(range(len(c))))[block.place]
            G = _in_base(slope, model, values)
            W += S @ G
            Y += S @ (G @ x - size * c)
        found.append((W, Y))
    return found


@lru_cache(maxsize=1)  # rows and instruments of one step ask for the same
def _felt_with_rates(
    model: Model, values: tuple[tuple[str, float], ...]
) -> tuple[tuple[FloatArray, ...], tuple[FloatArray, ...]]:
    return felt_forces(model, dict(values)), _felt_rates(model, dict(values))


def _felt_rates(model: Model, values: Mapping[str, float]) -> tuple[FloatArray, ...]:
    """Return how `felt_forces` change with each parameter, (orders, bodies, parameters) a row."""
    found = []
    for name in model.parameters:
        step = DIFFERENCED * (abs(values[name]) or 1.0)
        ahead, behind = (felt_forces(model, {**values, name: values[name] + way}) for way in (step, -step))
        with np.errstate(invalid="ignore"):
            rates = [(after - before) / (2.0 * step) for after, before in zip(ahead, behind, strict=True)]
        found.append(rates)
    return tuple(np.stack(rows, axis=-1) for rows in zip(*found, strict=True))


def _in_base(slope: FloatArray, model: Model, values: Mapping[str, float]) -> FloatArray:
    """Return G with G db/dp = slope, both (orders, ...), the smallest by sizes of the base parameters."""
    size, inverse, weight = _base_inverse(model, tuple(values.items()))
    return np.asarray((slope * size) @ inverse / weight)


@lru_cache(maxsize=1)  # of every block and body of a step
def _base_inverse(
    model: Model, values: tuple[tuple[str, float], ...]
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return sizes s (p,) and w (c,) of physical and base parameters, the inverse (p, c) of db/dp s / w."""
    known = dict(values)
    size = np.array([abs(known[name]) or 1.0 for name in model.parameters])
    jacobian = model.base_jacobian(known) * size
    weight = np.linalg.norm(jacobian, axis=1)
    weight[weight == 0.0] = 1.0
    return size, np.asarray(np.linalg.pinv(jacobian / weight[:, None])), weight
