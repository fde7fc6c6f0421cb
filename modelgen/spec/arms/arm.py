"""The description of an arm: frozen values that need no pydantic.

Frames follow the modified convention of Denavit and Hartenberg (Khalil and Kleinfinger 1986): the frame of a
joint is fixed to the link behind it, and its z is the joint's axis.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Literal

JointKind = Literal["revolute", "prismatic", "fixed"]
Friction = Literal["symmetric", "asymmetric"]
Side = Literal["motor", "link", "deflection", "between"]
ArmMeasures = Literal["position", "velocity", "acceleration", "torque", "gyro", "accelerometer"]
#: What sensors with three axes, mounted on a link, measure.
INERTIAL = ("gyro", "accelerometer")

#: The ten parameters of a link about the origin of its joint's frame, in the order of the regressor.
LINK_PARAMETERS = ("Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz", "mx", "my", "mz", "m")


@dataclass(frozen=True)
class Length:
    """A length of an arm: a number (m), times a length with a name if there is one.

    Attributes
    ----------
    factor
        The number itself [m] where there is no name; else how often the named length counts, with its sign.
    name
        Name of a length that stays a symbol in formulas, or None.
    """

    factor: Fraction
    name: str | None = None


@dataclass(frozen=True)
class Angle:
    """An angle that is fixed: cosine and sine as fractions whose squares sum to one exactly.

    Attributes
    ----------
    cosine, sine
        Exact for multiples of 90 degrees; else within 1e-16 of those of `radians`.
    radians
        As the file says it.
    """

    cosine: Fraction
    sine: Fraction
    radians: float


@dataclass(frozen=True)
class Turn:
    """A rotation about an axis (0, 1, 2: x, y, z) of the frame as it stands."""

    axis: int
    angle: Angle


@dataclass(frozen=True)
class Shift:
    """A translation along an axis (0, 1, 2: x, y, z) of the frame as it stands."""

    axis: int
    length: Length


Step = Turn | Shift


@dataclass(frozen=True)
class Joint:
    """A joint and the link behind it.

    Attributes
    ----------
    name
        Part of the names of the parameters and of the coordinate, q_NAME.
    parent
        Name of the joint whose link carries this one; None for the base.
    placement
        Steps from the parent's frame to this joint's frame at q = 0, first to last.
    link
        Names of the ten parameters of the link, in the order of `LINK_PARAMETERS`; empty for a joint whose
        link has no mass.
    rotor_inertia, viscous, coulomb, offset
        Names of the parameters of the drive, seen from the joint (Ia, Fv, Fs, off); None where there is none.
    friction
        Asymmetric: viscous and coulomb become _plus and _minus.
    gain
        Name of the drive's gain where it is a parameter, or None.
    stiffness, damping, stiffness3
        Names of the parameters of the spring between motor and link (K, D, K3); None where there is none.
    position_limits, speed_limit, acceleration_limit, force_limit
        In rad or m, and per s, s^2, and N m or N; None where the file says nothing.
    """

    name: str
    parent: str | None
    kind: JointKind
    placement: tuple[Step, ...]
    link: tuple[str, ...]
    rotor_inertia: str | None = None
    viscous: str | None = None
    coulomb: str | None = None
    offset: str | None = None
    friction: Friction = "symmetric"
    gain: str | None = None
    stiffness: str | None = None
    damping: str | None = None
    stiffness3: str | None = None
    position_limits: tuple[float, float] | None = None
    speed_limit: float | None = None
    acceleration_limit: float | None = None
    force_limit: float | None = None

    @property
    def elastic(self) -> bool:
        """Whether a spring is between the joint's motor and its link."""
        return self.stiffness is not None


@dataclass(frozen=True)
class ArmSensor:
    """A sensor of an arm.

    Attributes
    ----------
    key
        Name of what it measures; of a gyro or accelerometer the beginning of three, with _x, _y, _z behind.
    joint
        The joint at whose motor or on whose link it is.
    side
        At the motor (turns of the motor itself, in front of its gear), on the link (the joint's coordinate; a
        gyro or an accelerometer of the link), the deflection of the spring (motor, seen from the joint, less
        link), or between both (the torque that the link receives).
    measures
        What of that.
    mounting
        Steps from the link's frame to that of a gyro or an accelerometer.
    estimated
        Whether how it is mounted is to be found; `mounting` is where simulations have it.
    """

    key: str
    joint: str
    side: Side
    measures: ArmMeasures
    mounting: tuple[Step, ...] = ()
    estimated: bool = False

    @property
    def channels(self) -> tuple[str, ...]:
        """What it gives: one key, or three."""
        if self.measures in INERTIAL:
            return tuple(f"{self.key}_{axis}" for axis in "xyz")
        return (self.key,)


@dataclass(frozen=True)
class Payload:
    """What some records have on a link, and others not.

    Attributes
    ----------
    name
        Part of the names of its parameters.
    joint
        On whose link it is; its parameters are about the origin of that joint's frame.
    link
        Names of its ten parameters, in the order of `LINK_PARAMETERS`.
    """

    name: str
    joint: str
    link: tuple[str, ...]


@dataclass(frozen=True)
class ArmSpec:
    """An arm as its user described it, free of contradictions.

    Attributes
    ----------
    joints
        Parents come before their children; fixed joints included.
    gravity
        Acceleration of gravity in the base's frame [m/s^2].
    transmission
        Motor positions = transmission @ joint positions, over the joints that move, in their order; torques
        of joints = transmission^T @ torques of motors. Gears on the diagonal, couplings off it.
    lengths
        Value [m] of every named length, or None where the file gives none.
    known
        Value (SI) of every parameter that is not to be estimated.
    parameter_sets, sensor_sets
        By name of the set. Without sensor sets the coordinates of all joints are measured.
    payloads
        What records say of by a signal each: 1 where the arm carries it, else 0.
    source, sha256
        Name of the file, without its folder, and the hash of its bytes.
    """

    name: str
    title: str
    joints: tuple[Joint, ...]
    gravity: tuple[Fraction, Fraction, Fraction]
    transmission: tuple[tuple[Fraction, ...], ...]
    lengths: Mapping[str, float | None]
    known: Mapping[str, float]
    parameter_sets: Mapping[str, Mapping[str, float]]
    source: str
    sha256: str
    sensor_sets: Mapping[str, tuple[ArmSensor, ...]] = field(default_factory=dict)
    payloads: tuple[Payload, ...] = ()

    @property
    def elastic(self) -> bool:
        """Whether a joint is."""
        return any(joint.elastic for joint in self.joints)

    @property
    def moving(self) -> tuple[Joint, ...]:
        """The joints with a coordinate, in order."""
        return tuple(joint for joint in self.joints if joint.kind != "fixed")
