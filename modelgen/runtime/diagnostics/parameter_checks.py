"""Why a parameter is uncertain, and which values contradict physics: advice on the estimate itself."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import DataError
from modelgen.runtime.advice import Advice
from modelgen.runtime.diagnostics.noise_bias import significant_bias, takes_instruments
from modelgen.runtime.diagnostics.row_noise import block_noise, hardly_weighed
from modelgen.runtime.diagnostics.thresholds import (
    LARGEST_NOISE,
    LEAST_SNR_DB,
    NEGLIGIBLE,
    NULL_SHARE,
    SIGNIFICANT_MOVE,
)
from modelgen.runtime.diagnostics.unforced_rows import taken_over
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.filter_choice.signal_to_noise import SignalToNoise
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.hac_covariance import hac_covariance
from modelgen.runtime.model.model import Model
from modelgen.runtime.parameters.bounds import negative_parameters
from modelgen.runtime.parameters.parameter import Parameter, may_be_zero
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.row_block import RowBlock

REMEDIES = {
    "inertia": "accelerate harder",
    "stiffness": "excite up to the mode of vibration",
    "stiffness3": "stretch the spring further: its cube needs large deflections",
    "damping": "excite near the mode of vibration",
    "viscous": "add stretches of different constant speeds",
    "coulomb": "add slow motion in both directions",
    "offset": "add slow motion in both directions",
    "link": "move this link and those before it faster, and through more postures",
    "gain": "add a record with a payload of known mass",
    "mounting": "turn the link with this sensor faster, and about more axes",
    "bending": "excite up to the mode of vibration",
}


def slowest_mode_hz(model: Model, physical: Mapping[str, float]) -> float | None:
    """Return the frequency of the slowest mode of vibration; None where it is not determined."""
    if not model.actuators:
        return None
    from modelgen.runtime.simulation.closed_loop import vibration
    from modelgen.runtime.simulation.plant import make_plant

    values = {name: 0.0 for name in model.parameters} | dict(model.known) | dict(physical)
    try:
        elastic = vibration(make_plant(model, values)).elastic_hz
    except (DataError, np.linalg.LinAlgError):
        return None
    return float(elastic[0]) if elastic.size else None


def null_solution(
    fit: Fit, model: Model, records: Sequence[Record], choice: FilterChoice, bias: FloatArray | None = None
) -> tuple[Advice, ...]:
    """Return the rows that the estimate leaves without meaning: run away to zero, or explaining nothing.

    A row whose force is hardly more than noise of the sensors has nothing to explain: it weighs next to
    nothing and does no harm; nor does one without a force if another record explains that row, or values
    within the intervals do. Noise is named as the cause where `bias`, shape (c,) in SI, what it shifts each
    column by, is significant for one of the row, or not known. With instruments noise biases no row: one that
    leaves nothing else is right.
    """
    found, by_instruments = [], bool(fit.projected)
    for index, left in _null_rows(fit, model, records, choice):
        block = fit.blocks[index]
        if hardly_weighed(fit, index):
            continue
        where = f"{block.record_name}, row {block.row_name}"
        if block.has_force:
            what = f"leaves {100.0 * left:.0f} % of its force unexplained"
            remedy = "check channels, signs, units and delays"
        else:
            unexplained = f"leaves {100.0 * left:.0f} % of its largest term"
            what = f"has no force and {unexplained}"
            remedy = "lower the noise, or sense a force in that row"
            if not by_instruments and not _pulled(fit, block, bias):
                remedy = f"check channels and signs, {remedy}"
            elif not by_instruments:
                what = f"{what}: noise biases it towards zero"
                other = "method iv" if takes_instruments(model) else "a lower cut-off"
                remedy = f"use {other}, {remedy}"
        found.append(Advice("null solution", where, what, remedy))
    return tuple(found)


def _pulled(fit: Fit, block: RowBlock, bias: FloatArray | None) -> bool:
    """Return whether noise is known, or may be taken, to pull some column of a row."""
    if bias is None:
        return True
    told = significant_bias(fit, bias, hac_covariance(fit)) != 0.0
    return bool(np.any(block.own(told | ~np.isfinite(bias))))


def _null_rows(
    fit: Fit, model: Model, records: Sequence[Record], choice: FilterChoice
) -> Iterator[tuple[int, float]]:
    """Yield the blocks of such rows, and what share they leave."""
    shares = [1.0 if share is None else share for share in map(fit.unexplained, range(len(fit.blocks)))]
    explained = {block.row for block, left in zip(fit.blocks, shares, strict=True) if left < NULL_SHARE}
    for index, (block, left) in enumerate(zip(fit.blocks, shares, strict=True)):
        if left < NULL_SHARE:
            continue
        # differentiated further it leaves most of a wide band, and that is told as more than noise
        if model.composites and block.row in explained:
            continue
        harmless = block.has_force or bool(fit.projected) or block.row in explained
        if harmless and _drowned(fit, index, model, records[block.record], choice):
            continue
        yield index, left


def null_columns(fit: Fit, model: Model, records: Sequence[Record], choice: FilterChoice) -> dict[str, str]:
    """Return the columns of a chain's rows that a fit leaves without meaning, with the reason.

    Such a row does not hold for what was recorded, and no interval holds what that moves: in rows that share
    a column with it neither. Rows without a body are not judged: differentiated further, they leave most of a
    wide band and count elsewhere.
    """
    if model.is_arm or model.composites:
        return {}
    found, shared = dict[str, str](), dict[str, str]()
    for index, left in _null_rows(fit, model, records, choice):
        block = fit.blocks[index]
        what = f"row {block.row_name} leaves {100.0 * left:.0f} % of its terms in {block.record_name}"
        why = f"{what}: a channel is not what the model means (sign, unit, faults)"
        for column in model.regressor_columns[block.row]:
            found.setdefault(model.base_parameters[column], why)
        shared = taken_over(model, block.row, why) | shared
    return {name: why for name, why in shared.items() if name in fit.columns} | found


def _drowned(fit: Fit, index: int, model: Model, record: Record, choice: FilterChoice) -> bool:
    """Return whether what a row leaves is hardly more than noise of the sensors."""
    return fit.rms(index) < LARGEST_NOISE * block_noise(fit, index, model, record, choice, rounded=True)


def negative_values(model: Model, parameters: Sequence[Parameter]) -> tuple[Advice, ...]:
    """Return the parameters that are negative by more than chance although nature has no such thing."""
    negative = negative_parameters(model, {entry.name: entry.value for entry in parameters})
    return tuple(
        negative_value(model, entry.name, entry.value, abs(entry.value) / max(entry.std, 1e-300))
        for entry in parameters
        if entry.name in negative and entry.value < -SIGNIFICANT_MOVE * entry.std
    )


def negative_value(model: Model, name: str, value: float, deviations: float) -> Advice:
    """Return what is said of a parameter so many deviations below zero that cannot be negative."""
    what = f"= {value:.4g} is {deviations:.1f} standard deviations below zero"
    if name in model.roles:
        role = model.roles[name].role
        what += f", and no {role}{' friction' if role in ('viscous', 'coulomb') else ''} is"
    remedy = "check signs of channels (--map KEY=-COLUMN), delays, and whether two are swapped"
    return Advice("negative", name, what, remedy)


def uncertain_parameters(
    model: Model,
    fit: Fit,
    parameters: Sequence[Parameter],
    percent: float,
    slowest_hz: float | None,
    excited_hz: float | None,
) -> tuple[Advice, ...]:
    """Return how large the terms of uncertain parameters are, compared with the residual of their rows.

    A term below the residual is the sign of a motion that is too slow: nothing stands out above friction and
    noise, or below the modes. Friction that is zero, and would be felt, is none (of bearings of air).

    Parameters
    ----------
    percent : float
        Relative standard deviation in % from which a parameter counts as uncertain.
    slowest_hz, excited_hz : float or None
        Slowest mode of vibration, and up to where the records excite, in Hz.
    """
    found = []
    for entry in parameters:
        role = model.roles.get(entry.name)
        if role is None or entry.relative_std < percent or entry.name not in fit.columns:
            continue
        index, zero = fit.columns.index(entry.name), abs(entry.value) <= 1.96 * entry.std
        if zero and may_be_zero(entry.name, role.role):
            continue
        if zero and role.role in ("viscous", "coulomb"):
            row, share = _largest_share(fit, index, abs(entry.value) + 1.96 * entry.std)
            if share < NEGLIGIBLE:
                what = f"is zero, to {100.0 * share:.2g} % of what row {row} holds"
                remedy = f"leave it out of the spec, or hold it at zero (--set {entry.name}=0)"
                found.append(Advice("negligible", entry.name, what, remedy))
                continue
        ratios = []
        for number, block in enumerate(fit.blocks):
            term, left = block.column_norm(index) * abs(entry.value), fit.residual_norms[number]
            if term > 0.0 and left > 0.0:
                ratios.append((term / left, block.row_name))
        if not ratios or max(ratios)[0] >= 1.0:
            continue
        ratio, row = max(ratios)
        what = f"gives no more than {ratio:.2g} times what row {row} leaves unexplained (rms)"
        slow = role.role in ("stiffness", "damping") and slowest_hz and excited_hz and excited_hz < slowest_hz
        if slow:
            what += f"; the records excite up to {excited_hz:.3g} Hz, the mode lies at {slowest_hz:.3g} Hz"
        kind = "too slow" if slow or role.role == "inertia" else "too small"
        found.append(Advice(kind, entry.name, what, REMEDIES[role.role]))
    return tuple(found)


def _largest_share(fit: Fit, index: int, value: float) -> tuple[str, float]:
    """Return the row of which a column, with a value in SI, is the largest share, and that of its force."""
    sizes = ((block, block.size(fit.solution.x)) for block in fit.blocks)
    shares = [
        (block.row_name, value * block.column_norm(index) / size) for block, size in sizes if size > 0.0
    ]
    return max(shares, key=lambda one: one[1], default=("", float("inf")))


def noisy_derivatives(model: Model, entries: Sequence[SignalToNoise]) -> tuple[Advice, ...]:
    """Return the sensors of which a derivative is mostly noise behind the filter, in every record."""
    sensors = {sensor.key for sensor in model.sensors}
    best: dict[tuple[str, int], SignalToNoise] = {}
    for entry in entries:
        key = entry.channel, entry.derivative
        if entry.snr_db is None or entry.channel not in sensors or entry.derivative == 0:
            continue
        if key not in best or entry.snr_db > (best[key].snr_db or -np.inf):
            best[key] = entry
    found = {}
    for (channel, _), entry in best.items():
        if entry.snr_db is not None and entry.snr_db < LEAST_SNR_DB:
            found[channel] = Advice(
                "noisy derivative",
                f"{entry.record}, channel {channel}",
                f"has derivative {entry.derivative} only {entry.snr_db:.0f} dB above its noise",
                "use method iv, " * takes_instruments(model)
                + "lower the cut-off, or sense a higher derivative",
            )
    return tuple(found.values())
