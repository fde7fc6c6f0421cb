"""How honest the default is where a record is not as the simulator of the other benchmarks makes it.

    python benchmarks/off_bench.py [--records 20] [--only WORD] [--method iv] [--say]

Each kind of records has one thing different: a sensor, a clock, a friction, a sampling frequency. `identify`
runs with its defaults. A kind holds where every physical parameter that gets a number is covered by its 95 %
interval in 85 % of the records or more and is not more than 4 times too wide, or where none gets one, or
where a warning names the cause ("named"). Each parameter is printed with its median error, the stated
standard deviation over the error found (in brackets), and with its coverage where that is too low.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from off_bench_kinds import Kind, Reading, kinds
from off_bench_machine import FINE, Command, FloatArray, LoopOptions, Motion, run

from modelgen.cli.candidates import spec_model
from modelgen.errors import ModelgenError
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record
from modelgen.spec.load import parse_spec

COVERED, TOO_WIDE = 0.85, 4.0
SUMMED = "the value is the sum of all bodies' friction"
MARGIN = 200  # samples at both ends, so that a late channel has something to show


@dataclass(frozen=True)
class Trial:
    """One estimation: value and standard deviation by name, what was said, why there is none."""

    found: dict[str, tuple[float, float]]
    said: str
    failure: str = ""


@lru_cache
def model_of(spec: str) -> Model:
    """Return the model of a spec's only sensor set."""
    return spec_model(parse_spec(spec, "off_bench.toml"), "s")


def command(kind: Kind, motion: str, n: int, scale: float) -> Command:
    """Return reference and injected force of a motion, n samples on the fine grid."""
    machine, step = kind.nominal, 1.0 / (kind.fs * FINE)
    t = np.arange(n * FINE) * step
    T, w, zero = t[-1], machine.frequency, np.zeros(n * FINE)
    friction = machine.coulomb[0]
    peak = scale * 0.12 * kind.nominal.frequency  # rad/s
    if motion == "trapezoid":
        corners = np.array(
            [0.0, 0.02, 0.08, 0.2, 0.26, 0.3, 0.36, 0.48, 0.54, 0.6, 0.66, 0.76, 0.8, 0.86, 0.96, 1.0]
        )
        levels = np.array([0, 0, 1, 1, 0, 0, -1, -1, 0, 0, 0.4, 0.4, 0, -0.4, -0.4, 0.0])
        speed = smooth(peak * np.interp(t / T, corners, levels), step)
        return Command(np.cumsum(speed) * step, speed, np.gradient(speed, step), zero)
    low, high = 0.15 * w, min(1.8 * w, 2.0 * np.pi * 0.2 * kind.fs)
    force = scale * max(6.0 * friction, 0.02 * machine.referred * w * peak)
    if motion == "multisine":
        period = 0.5
        lines = np.arange(1, 200) * 2.0 * np.pi / period
        lines = lines[(lines > low) & (lines < high)]
        phases = np.random.default_rng(7).uniform(0.0, 2.0 * np.pi, lines.size)
        inject = sum(np.sin(line * t + phase) for line, phase in zip(lines, phases, strict=True))
        inject = force * inject / np.max(np.abs(inject))
    else:
        inject = force * np.sin(low * t + 0.5 * (high - low) * t**2 / T)
    speed = zero if motion == "rest" else np.full_like(t, 1.2 * peak) * np.minimum(t / (0.05 * T), 1.0)
    if motion == "chirp":
        # both directions, so that friction and a constant force can be told
        speed = speed * np.where(t < 0.75 * T, 1.0, np.maximum(1.0 - (t - 0.75 * T) / (0.05 * T), -1.0))
    speed = speed if kind.steps else smooth(speed, step)
    return Command(np.cumsum(speed) * step, speed, np.gradient(speed, step), inject)


def smooth(speed: FloatArray, step: float) -> FloatArray:
    """Return a speed with jerk as a drive's generator of motion leaves it: no force steps between samples."""
    width = round(0.004 / step)
    padded = np.pad(speed, (width // 2, width - 1 - width // 2), mode="edge")
    return np.convolve(padded, np.ones(width) / width, "valid")


def read(samples: FloatArray, kind: Kind, key: str, motion: Motion, n: int) -> FloatArray:
    """Return n readings of a fine signal with what is wrong with the channel."""
    wrong = kind.readings.get(key, Reading())
    if wrong.lag_s:
        samples = lagged(samples, wrong.lag_s, motion.step)
    if wrong.high_pass_hz:
        samples = samples - lagged(samples, 0.5 / (np.pi * wrong.high_pass_hz), motion.step)
    t = (MARGIN + np.arange(n) * (1.0 + 1e-6 * wrong.clock_ppm)) / kind.fs - wrong.late_s
    fine = np.arange(samples.size) * motion.step
    return wrong.gain * np.interp(t, fine, samples) + wrong.zero


def lagged(samples: FloatArray, lag_s: float, step: float) -> FloatArray:
    """Return a signal behind a first-order low-pass."""
    from scipy.signal import lfilter

    share = step / (lag_s + 0.5 * step)
    return np.asarray(lfilter([0.5 * share, 0.5 * share], [1.0, share - 1.0], samples))


def record(kind: Kind, motion_name: str, rng: np.random.Generator, scale: float) -> Record:
    """Return one measured record."""
    n = round(kind.duration_s * kind.fs)
    total, step = n + 2 * MARGIN, 1.0 / (kind.fs * FINE)
    machine = kind.change(kind.nominal)
    levels = noise_levels(kind)
    loop_noise = rng.standard_normal(total + 2) * levels["q_m"] if kind.noisy_loop else np.zeros(0)
    loop = LoopOptions(kind.lag_s, kind.held, loop_noise)
    motion = run(machine, command(kind, motion_name, total, scale), step, loop, total)
    signals = {}
    for key in (*kind.sensors, "T"):
        reading = read(fine_signal(kind, key, motion), kind, key, motion, n)
        width = kind.readings.get(key, Reading()).step
        if key == "q_m" and kind.noisy_loop:
            reading = reading + loop_noise[MARGIN : MARGIN + n]
        elif width:
            start = rng.uniform()
            reading = width * (np.round(reading / width + start) - start)
        else:
            reading = reading + levels[key] * rng.standard_normal(n)
        if key == "q_c" and kind.zeros_differ:
            reading = reading + kind.zeros_differ * rng.standard_normal()
        signals[key] = reading
    return Record(signals, kind.fs, motion_name, motion_name)


def fine_signal(kind: Kind, key: str, motion: Motion) -> FloatArray:
    """Return a channel on the fine grid without noise."""
    if key == "T":
        return motion.command if kind.lag_s or kind.held else motion.force
    if key == "d":
        return motion.position[:, 0] / kind.nominal.ratio[0] - motion.position[:, 1]
    source = {"q": motion.position, "v": motion.speed, "a": motion.acceleration}[key[0]]
    return source[:, "mcl".index(key[2])]


def noise_levels(kind: Kind) -> dict[str, float]:
    """Return the standard deviations of noise, scaled with the machine's elastic frequency."""
    small = kind.nominal.frequency < 0.5 * kind.nominal.stiffness[0] or kind.machine == "geared"
    q, a, force = (
        (3e-6, 0.5, 0.02 * kind.nominal.coulomb[0]) if small else (2e-5, 2.0, 0.02 * kind.nominal.coulomb[0])
    )
    gear = 1.0 / kind.nominal.ratio[0]
    level = {
        "q_m": q,
        "q_c": q * gear,
        "q_l": q * gear,
        "v_m": 100 * q,
        "v_c": 100 * q,
        "a_m": a,
        "a_c": a * gear,
        "d": q,
        "T": force,
    }
    return {key: kind.noise * value for key, value in level.items()}


def trial(kind: Kind, method: str | None, seed: int) -> Trial:
    """Identify one set of noisy records; the motions differ by a few percent from seed to seed."""
    rng = np.random.default_rng((sum(map(ord, kind.name)), seed))
    scale = float(rng.uniform(0.9, 1.1))
    records = [record(kind, name, rng, scale) for name in kind.motions]
    try:
        estimate = identify(model_of(kind.spec), records, **({"method": method} if method else {}))
    except ModelgenError as error:
        return Trial({}, str(error), str(error))
    said = " ".join([*estimate.fit.notes, *(str(one) for one in estimate.checks.advice)])
    return Trial({p.name: (p.value, p.std) for p in estimate.parameters.physical}, said)


def within(found: tuple[float, float], true: float) -> bool:
    """Tell whether the 95 % interval of a value and its standard deviation holds the truth."""
    return abs(found[0] - true) <= 1.96 * found[1]


def true_values(kind: Kind, trial: Trial) -> dict[str, float]:
    """Return the truth of what a trial tells: of a value that it labels as a sum, that sum."""
    return {**kind.truth, **(kind.sums if SUMMED in trial.said else {})}


def told(kind: Kind, trials: Sequence[Trial]) -> tuple[str, bool, bool]:
    """Return a line on each parameter, whether all are covered and none too wide, whether one is narrow."""
    parts, fine, narrow = [], True, False
    for name in kind.truth:
        telling = [t for t in trials if name in t.found]
        if not telling:
            parts.append(f"{name} refused")
            continue
        pairs = [t.found[name] for t in telling]
        true = np.array([true_values(kind, t)[name] for t in telling])
        values, spreads = np.array(pairs).T
        error = values - true
        covered = float(np.mean([within(*one) for one in zip(pairs, true, strict=True)]))
        rms = float(np.sqrt(np.mean(error**2)))
        ratio = float(np.sqrt(np.mean(spreads**2))) / rms if rms > 0.0 else np.inf
        good = covered >= COVERED and (ratio <= TOO_WIDE or len(pairs) < 5)
        fine &= good
        narrow |= covered < COVERED
        bias = f"{100.0 * float(np.median(error / np.abs(true))):+.2g}%"
        few = "" if len(pairs) == len(trials) else f" n={len(pairs)}"
        parts.append(f"{name} {bias} ({ratio:.2g}){few}" + ("" if good else f" !{covered:.2f}"))
    return ", ".join(parts), fine, narrow


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--records", type=int, default=20)
    parser.add_argument("--only", help="kinds whose name contains this")
    parser.add_argument(
        "--skip", type=int, default=0, help="so many of the kinds at the beginning are left out"
    )
    parser.add_argument("--method", help="another one than the default")
    parser.add_argument("--workers", type=int, help="processes, by default one a core")
    parser.add_argument("--say", action="store_true", help="print what was said on the first record")
    options = parser.parse_args()
    chosen = [kind for kind in kinds() if not options.only or options.only in kind.name][options.skip :]
    held = narrow_ones = intervals = covered = 0
    with ProcessPoolExecutor(options.workers) as pool:
        jobs = [
            [pool.submit(trial_of, kind.name, options.method, seed) for seed in range(options.records)]
            for kind in chosen
        ]
        for kind, running in zip(chosen, jobs, strict=True):
            trials = [job.result() for job in running]
            line, fine, narrow = told(kind, trials)
            named = [t for t in trials if any(word in t.said for word in kind.named)]
            inside = [
                within(t.found[key], true)
                for t in trials
                for key, true in true_values(kind, t).items()
                if key in t.found
            ]
            intervals, covered = intervals + len(inside), covered + sum(inside)
            by_name = bool(kind.named) and len(named) >= COVERED * len(trials)
            holds = fine or by_name
            held += holds
            narrow_ones += by_name and narrow
            mark = "holds" if fine else "named" if by_name else "FAILS"
            print(f"{mark:<6}{kind.name:<38}{line}", flush=True)
            if options.say:
                for said in dict.fromkeys(t.failure or t.said for t in trials[:1]):
                    print(f"      {said}")
    print(f"{held} of {len(chosen)} kinds hold, {narrow_ones} of them by the named cause only")
    print(f"{100.0 * covered / intervals:.1f} % of {intervals} intervals hold the truth")


def trial_of(name: str, method: str | None, seed: int) -> Trial:
    """Return a trial of the kind of this name: functions of kinds do not travel to other processes."""
    return trial(next(kind for kind in kinds() if kind.name == name), method, seed)


if __name__ == "__main__":
    main()
