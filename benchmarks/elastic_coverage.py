"""Elastic arm, every usual set of sensors, many noisy records of one fast motion: bias and coverage.

    .venv/bin/python benchmarks/elastic_coverage.py [--records 100] [--sets "link encoders"] [--method wls]
    .venv/bin/python benchmarks/elastic_coverage.py --mirrored --records 12
    .venv/bin/python benchmarks/elastic_coverage.py --closed-loop --records 21 --sets "motor encoders"

The catalogue's `elastic_two_link` moves by five sines a joint up to 6 Hz for 6 s, 1 kHz; encoders read with
5e-6 rad, tachometers with 1e-3 rad/s, accelerometers with 1e-2 m/s^2, torques with 0.1 N m of white noise
(`USUAL_NOISE`). A line a set: share of 95 % intervals that hold, of all and of the worst parameter; stated
over found deviation: least, median and most; bias in found deviations, rms and worst, and by how much chance
moves each. With `--mirrored` every record is followed by one whose noise is the negative of its own: what is
odd in the noise cancels in the mean, and a dozen records say what hundreds do without.

With `--closed-loop` motors follow such motions under PD, with Coulomb friction: every record is another
motion of one of three machines (motors, friction, springs and dampers up to twice or half of the nominal
ones), and identified by default. The line says which share of all intervals holds, and the rms of error over
deviation.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace
from math import log

import numpy as np
from elastic_motion import elastic_motion, record_along

from modelgen import JointController, Record, identify, simulate_arm
from modelgen.cli.arms.simulate_arm import mounted
from modelgen.errors import ModelgenError
from modelgen.render.arms.arm_writer import arm_files
from modelgen.runtime.model.model import Model, model_from_text
from modelgen.runtime.planning.arms.predicted_sets import USUAL_NOISE
from modelgen.runtime.simulation.arms.arm_plant import arm_plant, checked_base
from modelgen.runtime.simulation.arms.joint_motion import JointMotion
from modelgen.runtime.simulation.arms.joint_reference import JointReference
from modelgen.runtime.simulation.arms.mounted_sensors import sensor_channels
from modelgen.spec.arms.arm import ArmSpec
from modelgen.spec.arms.load import load_arm
from modelgen.spec.load import catalog_path
from modelgen.symbolic.arms.arm_sensor_sets import USUAL_SETS, with_usual_sets

FS, DURATION_S, HIGHEST_HZ = 1000.0, 6.0, 6.0
# Estimates of a number from which its deviation is told.
FEWEST = 5
MACHINES, VARIED = 3, ("Ia", "Fv", "Fs", "K", "D")


def described() -> tuple[ArmSpec, dict[str, Model]]:
    """Return the arm with the usual sets, and their models."""
    arm = with_usual_sets(load_arm(catalog_path("elastic_two_link")))
    sets = {key(name): sensors for name, sensors in arm.sensor_sets.items()}
    arm, models = replace(arm, sensor_sets=sets), {}
    for name in sets:
        ((file, text),) = arm_files(arm, name).items()
        models[name] = model_from_text(text, file)
    return arm, models


def key(label: str) -> str:
    """Return the name of a usual set as a word."""
    return label.replace(",", "").replace(" ", "_")


def main(records: int, chosen: list[str], method: str, mirrored: bool) -> None:
    """Print a line a sensor set, and one a parameter that is far off."""
    arm, models = described()
    values = arm.parameter_sets["nominal"]
    t, rng = np.arange(0.0, DURATION_S, 1.0 / FS), np.random.default_rng(1)
    links = {}
    for joint in arm.moving:
        parts = [(0.5 / k, 2.0 * np.pi * HIGHEST_HZ * k / 5.0) for k in range(1, 6)]
        links[joint.name] = sum(size * np.sin(w * t + rng.uniform(0.0, 6.0)) for size, w in parts)
    moved = elastic_motion(models["motor_and_link_encoders"], values, links, FS)
    for label in chosen:
        model = models[key(label)]
        base = model.base_from_physical({name: values[name] for name in model.parameters})
        begun, refused, rows = time.process_time(), 0, []
        at = mounted(arm, model.sensor_set)
        exact = record_along(model, moved, noise=dict.fromkeys(USUAL_NOISE, 0.0), mounted=at)
        for seed in range(records):
            record = record_along(model, moved, seed=seed, mounted=at)
            other = {key: 2.0 * exact.signals[key] - line for key, line in record.signals.items()}
            both = (record, Record(other, FS, "mirrored")) if mirrored else (record,)
            try:
                found = [identify(model, one, method) for one in both]
            except ModelgenError:
                refused += 1
                continue
            pair = [[one.params.get(n, np.nan) for n in model.base_parameters] - base for one in found]
            rows.append((pair, [[one.bse.get(n, np.nan) for n in model.base_parameters] for one in found]))
        each = (time.process_time() - begun) / records / (1 + mirrored)
        report(label, model.base_parameters, base, np.array(rows), f"{refused} refused, {each:.1f} s each")


def in_closed_loop(records: int, chosen: list[str]) -> None:
    """Print a line a sensor set, of records in closed loop identified by default."""
    arm, models = described()
    full = models["motor_and_link_encoders"]
    found: dict[str, list[float]] = {label: [] for label in chosen}
    for number in range(records):
        values, rng = dict(arm.parameter_sets["nominal"]), np.random.default_rng([7, number % MACHINES])
        for name in sorted(values):
            if name.partition("_")[0] in VARIED and number % MACHINES:
                values[name] *= float(np.exp(rng.uniform(-log(2.0), log(2.0))))
        reference = moving(np.random.default_rng([8, number]), len(full.module.JOINTS))
        motion = simulate_arm(full, values, reference, controller=JointController(bandwidth_hz=10.0))
        plant = arm_plant(full, checked_base(full, values))
        for label in chosen:
            model, noise = models[key(label)], np.random.default_rng([9, number])
            true = sensor_channels(plant, mounted(arm, model.sensor_set), motion.motion)
            true |= {name: motion.true[name] for name in plant.forces}
            units = {one.key: one.unit for one in (*model.sensors, *model.actuators)}
            read = {
                name: true[name] + USUAL_NOISE[units[name]] * noise.standard_normal(len(true[name]))
                for name in model.channels
            }
            try:
                estimate = identify(model, Record(read, FS, f"closed_{number}"))
            except ModelgenError as error:
                print(f"{label}, record {number}: {error}", flush=True)
                continue
            base = dict(zip(model.base_parameters, model.base_from_physical(values), strict=True))
            found[label] += [
                (value - base[name]) / estimate.bse[name]
                for name, value in estimate.params.items()
                if np.isfinite(estimate.bse[name])
            ]
    for label, errors in found.items():
        inside, rms = np.mean(np.abs(errors) < 1.96), np.sqrt(np.mean(np.square(errors)))
        print(f"{label}, closed loop: {inside:.3f} of {len(errors)} intervals hold, error {rms:.2f} sd (rms)")


def moving(rng: np.random.Generator, joints: int) -> JointReference:
    """Return five sines a joint up to `HIGHEST_HZ`."""
    t, motion = np.arange(0.0, DURATION_S, 1.0 / FS), np.zeros((3, joints, round(DURATION_S * FS)))
    for k in range(1, 6):
        rate, phases = 2.0 * np.pi * HIGHEST_HZ * k / 5.0, rng.uniform(0.0, 6.0, (joints, 1))
        for order in range(3):
            motion[order] += 0.5 / k * rate**order * np.sin(rate * t + phases + order * np.pi / 2.0)
    return JointReference(JointMotion(*motion, FS))


def report(label: str, names: tuple[str, ...], base: np.ndarray, rows: np.ndarray, told: str) -> None:
    """Print what errors and deviations, shape (records, 2, 1 or 2 mirrored, parameters), say of a set."""
    if not len(rows):
        print(f"{label}: no record gives an estimate; {told}", flush=True)
        return
    means = rows[:, 0].mean(axis=1)
    error, std = (rows[:, k].reshape(-1, len(names)) for k in (0, 1))
    counted = np.isfinite(error).sum(axis=0)
    use = np.flatnonzero(counted >= max(FEWEST, len(error) // 2))
    if not use.size:
        print(f"{label}: no number is found often enough to say how precise it is; {told}", flush=True)
        return
    inside = np.nanmean(np.where(np.isfinite(error), np.abs(error) < 1.96 * std, np.nan)[:, use], axis=0)
    spread = np.nanstd(error[:, use], axis=0)
    ratio = np.sqrt(np.nanmean(std[:, use] ** 2, axis=0)) / spread
    bias = np.nanmean(error[:, use], axis=0) / spread
    chance = np.nanstd(means[:, use], axis=0) / np.sqrt(len(means)) / spread
    worst = np.abs(bias).max()
    print(
        f"{label}: {len(use)} of {len(names)} numbers, covered {inside.mean():.3f} "
        f"(least {inside.min():.2f}), stated over found {ratio.min():.2f} {np.median(ratio):.2f} "
        f"{ratio.max():.2f}, bias rms {np.sqrt(np.mean(bias**2)):.2f}, worst {worst:.2f} "
        f"(each within {np.sqrt(np.mean(chance**2)):.2f}); {told}",
        flush=True,
    )
    for k, place in enumerate(use):
        name = names[place]
        far = inside[k] < 0.9 or abs(bias[k]) > 0.25 + 2.0 * chance[k] or not 0.8 < ratio[k] < 1.25
        if far or name.startswith("K"):
            percent = 100.0 * spread[k] / abs(base[place]) if base[place] else np.inf
            print(
                f"    {name}: covered {inside[k]:.2f}, stated over found {ratio[k]:.2f}, "
                f"bias {bias[k]:+.2f}, deviation {percent:.2g} %",
                flush=True,
            )


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--records", type=int, default=100)
    parser.add_argument("--sets", nargs="*", default=list(USUAL_SETS))
    parser.add_argument("--method", default="wls")
    parser.add_argument("--mirrored", action="store_true")
    parser.add_argument("--closed-loop", action="store_true")
    asked = parser.parse_args()
    if not asked.closed_loop and asked.records * (1 + asked.mirrored) < FEWEST:
        least = -(-FEWEST // (1 + asked.mirrored))
        parser.error(f"--records {asked.records} is too few to tell deviations from: give {least} or more")
    if asked.closed_loop:
        in_closed_loop(asked.records, asked.sets)
    else:
        main(asked.records, asked.sets, asked.method, asked.mirrored)
