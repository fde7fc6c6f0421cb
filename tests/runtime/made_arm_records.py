"""Records of arms with known parameters: Fourier series at the joints, torques from the module itself."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

import modelgen
from modelgen.render.arms.arm_writer import arm_module
from modelgen.runtime.model.model import Model, model_from_text
from modelgen.runtime.records.record import Record
from modelgen.spec.arms.arm import ArmSpec
from modelgen.spec.arms.load import load_arm, parse_arm
from modelgen.symbolic.arms.arm_rows import RowKind, arm_rows
from modelgen.symbolic.arms.base_parameters import arm_base_model

CATALOG = Path(modelgen.__file__).parent / "catalog" / "arms"
FS = 1000.0
HARMONICS = 5


def catalogued(name: str) -> ArmSpec:
    return load_arm(CATALOG / f"{name}.toml")


def written(text: str) -> ArmSpec:
    return parse_arm(text, "arm.toml")


def model_of(spec: ArmSpec, kind: RowKind = "joint", base_rows: bool = False, sensor_set: str = "") -> Model:
    rows = arm_rows(spec, kind, base_rows, sensor_set)
    return model_from_text(arm_module(arm_base_model(rows)), spec.name)


def values_of(model: Model, seed: int = 0) -> dict[str, float]:
    """Return random values of all parameters."""
    rng = np.random.default_rng(seed)
    return {name: float(rng.uniform(0.5, 1.5)) for name in model.parameters}


def motion(model: Model, seconds: float, seed: int, fs: float = FS, hz: float = 0.1) -> dict[str, np.ndarray]:
    """Return every signal of the joints: the sum of harmonics of `hz`, the highest five times as fast."""
    rng, t = np.random.default_rng(seed), np.arange(0.0, seconds, 1.0 / fs)
    found = {}
    for sensor in (one for one in model.sensors if one.key not in model.derived):
        sums = np.zeros((3, len(t)))
        for k in range(1, HARMONICS + 1):
            w, (a, b) = 2.0 * np.pi * hz * k, 0.4 * rng.standard_normal(2)
            wave = a * np.sin(w * t) + b * np.cos(w * t)
            sums += [wave, w * (a * np.cos(w * t) - b * np.sin(w * t)), -(w**2) * wave]
        found |= {f"{order}{sensor.key}": line for order, line in zip(("", "d1_", "d2_"), sums, strict=True)}
    return found


def record_of(
    model: Model,
    values: Mapping[str, float],
    seconds: float = 20.0,
    seed: int = 1,
    noise: tuple[float, float] = (0.0, 0.0),
    carried: Sequence[str] = (),
) -> Record:
    """Return positions and torques of motors along `motion`; `noise` is that of each (rms, SI).

    Where gains are parameters, torques are what the drives report. `carried` names the payloads.
    """
    signals, rng = motion(model, seconds, seed), np.random.default_rng(seed + 1000)
    forces, base = [one.key for one in model.actuators], model.base_from_physical(values)
    rest = np.zeros(len(next(iter(signals.values()))))
    loads = {key: rest + (key.removeprefix("load_") in carried) for key in model.loads}
    still = {**signals, **loads, **dict.fromkeys(forces, rest)}

    def left(given: Mapping[str, np.ndarray]) -> np.ndarray:
        return np.asarray(model.measurement(given) - model.regressor(given) @ base)

    wanted = -left(still)
    ratios = np.array([(left({**still, key: rest + 1.0}) + wanted)[0] for key in forces]).T
    torques = np.linalg.solve(ratios, wanted.T)
    exact = {key: signals[key] for key in model.channels if key in signals}
    read = {key: line + noise[0] * rng.standard_normal(len(line)) for key, line in exact.items()}
    pushed = zip(forces, torques, strict=True)
    read |= {key: line + noise[1] * rng.standard_normal(len(line)) for key, line in pushed}
    return Record(read, FS, "loaded" if carried else "arm").carrying(*carried)


def of_bodies(model: Model, seed: int = 0) -> dict[str, float]:
    """Return values that links can have: point masses about the frames, drives with inertia and friction."""
    rng = np.random.default_rng(seed)
    values = {name: 0.0 for name in model.parameters}
    joints = dict.fromkeys(name.rpartition("_")[2] for name in model.parameters if name.startswith("m_"))
    for k, joint in enumerate(joints):
        masses = rng.uniform(0.2, 1.5, 6) * 4.0 / (1 + k)
        x, y, z = rng.uniform(-0.25, 0.25, (3, 6)) / (1.0 + 0.3 * k)
        moments = {"m": masses, "mx": masses * x, "my": masses * y, "mz": masses * z}
        moments |= {"Ixx": masses * (y * y + z * z), "Iyy": masses * (x * x + z * z)}
        moments |= {"Izz": masses * (x * x + y * y), "Ixy": -masses * x * y}
        moments |= {"Ixz": -masses * x * z, "Iyz": -masses * y * z}
        values |= {
            f"{name}_{joint}": float(m.sum()) for name, m in moments.items() if f"{name}_{joint}" in values
        }
    scale = {"inertia": 0.3, "viscous": 2.0, "coulomb": 1.5, "offset": 0.2, "gain": 1.0}
    for name, role in model.roles.items():
        if name in values and role.role in scale:
            values[name] = scale[role.role] * float(rng.uniform(0.5, 1.5))
    return values
