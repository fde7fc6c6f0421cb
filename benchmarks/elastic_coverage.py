"""Elastic arm, every usual set of sensors, many noisy records of one fast motion: bias and coverage.

    .venv/bin/python benchmarks/elastic_coverage.py [--records 100] [--sets "link encoders"] [--method wls]

The catalogue's `elastic_two_link` moves by five sines a joint up to 6 Hz for 6 s, 1 kHz; encoders read with
5e-6 rad, tachometers with 1e-3 rad/s, accelerometers with 1e-2 m/s^2, torques with 0.1 N m of white noise
(`USUAL_NOISE`). A line a set: share of 95 % intervals that hold, of all and of the worst parameter; stated
over found deviation: least, median and most; bias in found deviations, rms and worst (chance alone: 1 /
sqrt(records)).
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace

import numpy as np
from elastic_motion import elastic_motion, record_along

from modelgen import identify
from modelgen.cli.arms.simulate_arm import mounted
from modelgen.errors import ModelgenError
from modelgen.render.arms.arm_writer import arm_files
from modelgen.runtime.model.model import model_from_text
from modelgen.spec.arms.load import load_arm
from modelgen.spec.load import catalog_path
from modelgen.symbolic.arms.arm_sensor_sets import USUAL_SETS, with_usual_sets

FS, DURATION_S, HIGHEST_HZ = 1000.0, 6.0, 6.0


def main(records: int, chosen: list[str], method: str) -> None:
    """Print a line a sensor set, and one a parameter that is far off."""
    arm = with_usual_sets(load_arm(catalog_path("elastic_two_link")))
    sets = {name.replace(",", "").replace(" ", "_"): sensors for name, sensors in arm.sensor_sets.items()}
    arm, values = replace(arm, sensor_sets=sets), arm.parameter_sets["nominal"]
    models = {}
    for name in sets:
        ((file, text),) = arm_files(arm, name).items()
        models[name] = model_from_text(text, file)
    t, rng = np.arange(0.0, DURATION_S, 1.0 / FS), np.random.default_rng(1)
    links = {}
    for joint in arm.moving:
        parts = [(0.5 / k, 2.0 * np.pi * HIGHEST_HZ * k / 5.0) for k in range(1, 6)]
        links[joint.name] = sum(size * np.sin(w * t + rng.uniform(0.0, 6.0)) for size, w in parts)
    moved = elastic_motion(models["motor_and_link_encoders"], values, links, FS)
    for label in chosen:
        model = models[label.replace(",", "").replace(" ", "_")]
        base = model.base_from_physical({name: values[name] for name in model.parameters})
        begun, refused, rows = time.process_time(), 0, []
        for seed in range(records):
            try:
                record = record_along(model, moved, seed=seed, mounted=mounted(arm, model.sensor_set))
                found = identify(model, record, method)
            except ModelgenError:
                refused += 1
                continue
            names = model.base_parameters
            rows.append(
                [
                    (found.params.get(n, np.nan) - b, found.bse.get(n, np.nan))
                    for n, b in zip(names, base, strict=True)
                ]
            )
        each = (time.process_time() - begun) / records
        report(label, model.base_parameters, base, np.array(rows), f"{refused} refused, {each:.1f} s each")


def report(label: str, names: tuple[str, ...], base: np.ndarray, rows: np.ndarray, told: str) -> None:
    """Print what errors and deviations, shape (records, parameters, 2), say of a set."""
    error, std = rows[:, :, 0], rows[:, :, 1]
    counted = np.isfinite(error).sum(axis=0)
    use = np.flatnonzero(counted >= max(5, len(rows) // 2))
    inside = np.nanmean(np.where(np.isfinite(error), np.abs(error) < 1.96 * std, np.nan)[:, use], axis=0)
    spread = np.nanstd(error[:, use], axis=0)
    ratio = np.sqrt(np.nanmean(std[:, use] ** 2, axis=0)) / spread
    bias = np.nanmean(error[:, use], axis=0) / spread
    worst = np.abs(bias).max()
    print(
        f"{label}: {len(use)} of {len(names)} numbers, covered {inside.mean():.3f} "
        f"(least {inside.min():.2f}), stated over found {ratio.min():.2f} {np.median(ratio):.2f} "
        f"{ratio.max():.2f}, bias rms {np.sqrt(np.mean(bias**2)):.2f}, worst {worst:.2f}; {told}",
        flush=True,
    )
    for k, place in enumerate(use):
        name = names[place]
        far = inside[k] < 0.9 or abs(bias[k]) > 0.25 + 2.0 / np.sqrt(len(rows)) or not 0.8 < ratio[k] < 1.25
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
    asked = parser.parse_args()
    main(asked.records, asked.sets, asked.method)
