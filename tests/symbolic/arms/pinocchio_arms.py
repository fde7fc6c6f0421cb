"""An arm as a model of pinocchio, with the same parameters: what the derivation is compared with."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from modelgen.spec.arms.arm import LINK_PARAMETERS, ArmSpec
from modelgen.symbolic.arms.placements import placement

#: kinds of a link's parameters in the order of pinocchio's regressor
ORDER = ("m", "mx", "my", "mz", "Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz")


def pinocchio() -> Any:
    return pytest.importorskip("pinocchio", reason="pinocchio (pip install pin) is not installed")


def random_parameters(spec: ArmSpec, rng: np.random.Generator) -> dict[str, float]:
    """Return physical parameters of every link: of four points of positive mass each."""
    values = {}
    for joint in spec.joints:
        if not joint.link:
            continue
        mass, points = rng.uniform(0.2, 2.0, 4), rng.uniform(-0.4, 0.4, (4, 3))
        tensor = sum(
            m * (p @ p * np.eye(3) - np.outer(p, p)) for m, p in zip(mass, points, strict=True)
        )  # fmt: skip
        moment = mass @ points
        upper = [tensor[i, k] for i in range(3) for k in range(i, 3)]
        values.update(zip(joint.link, [*upper, *moment, mass.sum()], strict=True))
    return values


def pinocchio_model(spec: ArmSpec, values: dict[str, float]) -> Any:
    """Return the model; links of fixed joints belong to the body that carries them, and are frames."""
    pin = pinocchio()
    model = pin.Model()
    model.gravity.linear = np.array([float(g) for g in spec.gravity])
    frames = {None: (0, pin.SE3.Identity())}
    for joint in spec.joints:
        place = placement(joint)
        rotation = np.array([[float(x) for x in row] for row in place.rotation])
        offset = np.array([float(sum(component.values())) for component in place.offset])
        body, at = frames[joint.parent]
        at = at * pin.SE3(rotation, offset)
        if joint.kind != "fixed":
            kind = pin.JointModelRZ() if joint.kind == "revolute" else pin.JointModelPZ()
            body, at = model.addJoint(body, kind, at, joint.name), pin.SE3.Identity()
        if joint.link and body:
            inertia = pin.Inertia.FromDynamicParameters(_dynamic(joint.link, values))
            model.appendBodyToJoint(body, inertia, at)
        model.addFrame(pin.Frame(joint.name, body, 0, at, pin.FrameType.OP_FRAME))
        frames[joint.name] = (body, at)
    return model


def _dynamic(names: tuple[str, ...], values: dict[str, float]) -> np.ndarray:
    return np.array([values[names[LINK_PARAMETERS.index(kind)]] for kind in ORDER])


def random_motion(spec: ArmSpec, samples: int, rng: np.random.Generator) -> dict[tuple[str, int], np.ndarray]:
    return {(joint.name, order): rng.standard_normal(samples) for order in (0, 1, 2) for joint in spec.moving}


def state(spec: ArmSpec, motion: dict[tuple[str, int], np.ndarray], sample: int) -> list[np.ndarray]:
    """Return q, qd, qdd of one sample, in the order of the joints that move."""
    return [np.array([motion[joint.name, order][sample] for joint in spec.moving]) for order in (0, 1, 2)]
