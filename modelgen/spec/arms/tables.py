"""First pass over an arm's file: every table by itself, with messages in the terms of mechanics.

What a number or text of a length or an angle stands for is worked out here once: in the document its place
is taken by the `Length` or `Angle`.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import partial
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, Field

from modelgen.number_expression import Misread, exact_number
from modelgen.spec.arms.angles import read_angle
from modelgen.spec.arms.arm import ArmMeasures, Friction, JointKind
from modelgen.spec.arms.lengths import read_length
from modelgen.spec.arms.parameters import DRIVE_PREFIXES
from modelgen.spec.table_checks import (
    FileForm,
    Name,
    NonzeroNumber,
    Number,
    Table,
    Title,
    explained,
    misread,
    unreadable,
)
from modelgen.spec.words import identifier_problem, shown, suggest

SYMBOLIC = "symbolic"  # a length that has a name and no value
BASE = "base"  # what does not move
LONGEST_JOINT = 48  # letters: with what stands before and behind it, a parameter's name has 64 at most
#: Marks in names of a URDF's joints that become _.
MARKS = str.maketrans(dict.fromkeys("-./: ", "_"))
_JOINT = re.compile(rf"[A-Za-z0-9_]{{1,{LONGEST_JOINT}}}")


def joint_problem(text: str) -> tuple[str, str] | None:
    """Return what is wrong with a joint's name and the remedy; None if it is good ("1" is)."""
    if not _JOINT.fullmatch(text):
        plain = text.translate(MARKS)
        remedy = f"use letters, digits and _ (ASCII, {LONGEST_JOINT} at most)"
        if _JOINT.fullmatch(plain):
            remedy = f'write "{plain}", also where a URDF has another mark'
        return f"{shown(text)} is no name of a joint", remedy
    if text == BASE:
        return f'"{BASE}" is what does not move', "choose another name"
    return None


def _joint_name(text: str) -> str:
    problem = joint_problem(text)
    if problem:
        raise explained(*problem)
    return text


def _read(value: object, reader: Callable[[object], Any]) -> object:
    try:
        return reader(value)
    except Misread as found:
        what = found.what if found.what.startswith("is ") else f"is {shown(value)}, which {found.what}"
        raise misread(what, found.remedy) from None


def _exact(value: object) -> object:
    """Return the number that was written, not its nearest double."""
    return exact_number(value) if isinstance(value, str) else value


def _three(example: str) -> BeforeValidator:
    def check(value: object) -> object:
        if not (isinstance(value, list) and len(value) == 3):
            raise misread(f"must be a list of three, not {shown(value)}", f"write for example {example}")
        return value

    return BeforeValidator(check)


def _range(value: object) -> object:
    if not (isinstance(value, list) and len(value) == 2):
        raise misread(f"must be a list of two, not {shown(value)}", "write the lower and the upper limit")
    return value


def _own_name(value: object) -> object:
    """Return a parameter's name, or whether there is one with the usual name."""
    if isinstance(value, bool):
        return value
    if not isinstance(value, str):
        raise unreadable("a name in quotes, true or false")
    problem = identifier_problem(value)
    if problem:
        raise explained(*problem)
    return value


def _drive(value: object) -> object:
    if not (isinstance(value, list) and all(isinstance(item, str) for item in value)):
        raise unreadable("a list of words")
    wrong = next((item for item in value if item not in DRIVE_PREFIXES), None)
    if wrong is not None:
        raise misread(
            f"has {shown(wrong)}, which is not part of a drive", suggest(wrong, DRIVE_PREFIXES, "parts")
        )
    return value


def _length_value(value: object) -> object:
    return None if value == SYMBOLIC else value


def _scalar(value: object) -> object:
    """Return a limit as it is written; what it means depends on the kind of the joint."""
    if isinstance(value, str) or (isinstance(value, int | float) and not isinstance(value, bool)):
        return value
    raise misread(f"is {shown(value)}, no limit", 'write for example "180 deg/s", or 0.5 (m/s) of a slide')


_Length = Annotated[Any, BeforeValidator(partial(_read, reader=read_length))]
_Angle = Annotated[Any, BeforeValidator(partial(_read, reader=read_angle))]
_Scalar = Annotated[Any, BeforeValidator(_scalar)]
_JointName = Annotated[str, AfterValidator(_joint_name)]
_OwnName = Annotated[Any, BeforeValidator(_own_name)]
_Gravity = Annotated[list[Number], _three("gravity = [0, 0, -9.81]")]


class ArmTable(Table):
    """The table [arm]."""

    name: Name = Field(description='name = "my_arm"')
    title: Title | None = Field(None, description='title = "My arm"')
    urdf: str | None = Field(None, description='urdf = "my_arm.urdf"')
    gravity: _Gravity | None = Field(None, description="gravity = [0, 0, -9.81]")
    drive: Annotated[Any, BeforeValidator(_drive)] = Field(None, description='drive = ["viscous", "coulomb"]')
    friction: Friction | None = Field(None, description='friction = "asymmetric"')


class JointTable(Table):
    """A table [[joints]]."""

    name: _JointName = Field(description='name = "1"')
    type: JointKind | None = Field(None, description='type = "revolute"')
    parent: str | None = Field(None, description='parent = "base"')
    gamma: _Angle = Field(None, description="gamma = 90")
    b: _Length = Field(None, description="b = 0.1")
    alpha: _Angle = Field(None, description="alpha = 90")
    d: _Length = Field(None, description="d = 0.1")
    theta: _Angle = Field(None, description="theta = 90")
    r: _Length = Field(None, description="r = 0.1")
    xyz: Annotated[list[_Length], _three("xyz = [0, 0, 0.3]")] | None = Field(
        None, description="xyz = [0, 0, 0.3]"
    )
    rpy: Annotated[list[_Angle], _three("rpy = [90, 0, 0]")] | None = Field(
        None, description="rpy = [90, 0, 0]"
    )
    massless: bool | None = Field(None, description="massless = true")
    rotor_inertia: _OwnName = Field(None, description='rotor_inertia = "Ia_1"')
    viscous: _OwnName = Field(None, description='viscous = "Fv_1"')
    coulomb: _OwnName = Field(None, description='coulomb = "Fs_1"')
    offset: _OwnName = Field(None, description='offset = "off_1"')
    stiffness: _OwnName = Field(None, description="stiffness = true")
    damping: _OwnName = Field(None, description="damping = true")
    stiffness3: _OwnName = Field(None, description="stiffness3 = true")
    gain: _OwnName = Field(None, description="gain = true")
    friction: Friction | None = Field(None, description='friction = "asymmetric"')
    gear: NonzeroNumber | None = Field(None, description="gear = 100")
    position_limits: Annotated[list[_Scalar], BeforeValidator(_range)] | None = Field(
        None, description="position_limits = [-170, 170]"
    )
    speed_limit: _Scalar = Field(None, description='speed_limit = "180 deg/s"')
    acceleration_limit: _Scalar = Field(None, description='acceleration_limit = "720 deg/s^2"')
    force_limit: Number | None = Field(None, description="force_limit = 50")


class CouplingTable(Table):
    """A table [[couplings]]."""

    motor: str = Field(description='motor = "6"')
    joint: str = Field(description='joint = "5"')
    ratio: NonzeroNumber = Field(description="ratio = 32")


class SensorTable(Table):
    """A sensor in a table [sensors.NAME]."""

    joint: str | None = Field(None, description='joint = "1"')
    deflection: str | None = Field(None, description='deflection = "1"')
    side: Literal["motor", "link"] | None = Field(None, description='side = "motor"')
    measures: ArmMeasures = Field(description='measures = "position"')
    xyz: Annotated[list[_Length], _three("xyz = [0, 0, 0.1]")] | None = Field(
        None, description="xyz = [0, 0, 0.1]"
    )
    rpy: Annotated[list[_Angle], _three("rpy = [90, 0, 0]")] | None = Field(
        None, description="rpy = [90, 0, 0]"
    )
    mounting: Literal["given", "estimated"] | None = Field(None, description='mounting = "estimated"')


class PayloadTable(Table):
    """A table [payload.NAME]."""

    joint: str | None = Field(None, description='joint = "6"')
    mass: Number | None = Field(None, description="mass = 4.6")


class ArmFileTable(Table):
    """The whole file."""

    arm: ArmTable = Field(description="[arm]")
    joints: list[JointTable] | None = Field(None, description="[[joints]] for every joint")
    couplings: list[CouplingTable] | None = Field(None, description="[[couplings]] for every coupling")
    lengths: dict[str, Annotated[Number | None, BeforeValidator(_length_value)]] | None = Field(
        None, description="[lengths]"
    )
    payload: dict[str, PayloadTable] | None = Field(None, description="[payload.disc]")
    known: dict[str, Number] | None = Field(None, description="[known]")
    parameters: dict[str, dict[str, Number]] | None = Field(None, description="[parameters.nominal]")
    sensors: dict[str, dict[str, SensorTable]] | None = Field(
        None,
        description='[sensors.encoders] with qm_1 = { joint = "1", side = "motor", measures = "position" }',
    )


FORM = FileForm(
    ArmFileTable,
    {
        ("arm", 2): ArmTable,
        ("joints", 3): JointTable,
        ("couplings", 3): CouplingTable,
        ("sensors", 4): SensorTable,
        ("payload", 3): PayloadTable,
    },
)
