"""Messages of ROS by the definitions that a bag carries: read as data, nothing of them is executed.

A definition is lines of "TYPE NAME"; those of inner messages follow behind lines of ===. ROS 1 packs fields
without gaps; ROS 2 (CDR) aligns each to its size, behind four bytes that say the order of bytes.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

DEEPEST = 12
LONGEST = 1 << 20  # characters of a definition
SIZES = {
    **{"bool": "?", "byte": "B", "char": "B", "float32": "f", "float64": "d"},
    **{f"{sign}int{8 * size}": code for sign, codes in (("", "bhiq"), ("u", "BHIQ"))
       for size, code in zip((1, 2, 4, 8), codes, strict=True)},
}  # fmt: skip
FIELD = re.compile(
    r"(?P<type>[A-Za-z][\w/]*)(?:<=\d+)?(?P<array>\[(?:<=)?(?P<count>\d*)\])?\s+(?P<name>[A-Za-z]\w*)\s*(?P<rest>.*)"
)
STAMPS = {"time": ("sec", "nsec", "II"), "duration": ("sec", "nsec", "ii")}
STANDARD = {
    "builtin_interfaces/Time": "int32 sec\nuint32 nanosec",
    "builtin_interfaces/Duration": "int32 sec\nuint32 nanosec",
    "std_msgs/Header": "builtin_interfaces/Time stamp\nstring frame_id",
    "geometry_msgs/Vector3": "float64 x\nfloat64 y\nfloat64 z",
    "geometry_msgs/Point": "float64 x\nfloat64 y\nfloat64 z",
    "geometry_msgs/Quaternion": "float64 x\nfloat64 y\nfloat64 z\nfloat64 w",
    "geometry_msgs/Pose": "Point position\nQuaternion orientation",
    "geometry_msgs/Twist": "Vector3 linear\nVector3 angular",
    "geometry_msgs/Accel": "Vector3 linear\nVector3 angular",
    "geometry_msgs/Wrench": "Vector3 force\nVector3 torque",
    **{f"geometry_msgs/{name}Stamped": f"std_msgs/Header header\n{name} {name.lower()}"
       for name in ("Pose", "Twist", "Accel", "Wrench")},
    "sensor_msgs/JointState": "std_msgs/Header header\nstring[] name\nfloat64[] position\n"
    "float64[] velocity\nfloat64[] effort",
    "sensor_msgs/Imu": "std_msgs/Header header\ngeometry_msgs/Quaternion orientation\n"
    "float64[9] orientation_covariance\ngeometry_msgs/Vector3 angular_velocity\n"
    "float64[9] angular_velocity_covariance\ngeometry_msgs/Vector3 linear_acceleration\n"
    "float64[9] linear_acceleration_covariance",
    "std_msgs/MultiArrayDimension": "string label\nuint32 size\nuint32 stride",
    "std_msgs/MultiArrayLayout": "MultiArrayDimension[] dim\nuint32 data_offset",
    **{f"std_msgs/{name}": f"{name.lower()} data" for name in
       ("Bool", "Float32", "Float64", "Int8", "Int16", "Int32", "Int64", "UInt8", "UInt16", "UInt32",
        "UInt64")},
    **{f"std_msgs/{name}MultiArray": f"MultiArrayLayout layout\n{name.lower()}[] data"
       for name in ("Float32", "Float64", "Int32", "Int64")},
}  # fmt: skip


@dataclass(frozen=True)
class Field:
    """A field of a message: `count` of an array, 0 where the message says it, None for no array."""

    name: str
    type: str
    count: int | None


Definitions = Mapping[str, tuple[Field, ...]]


def decoder(name: str, definition: str | None, aligned: bool) -> Callable[[bytes], Any] | None:
    """Return what decodes messages of a type to mappings; None for a type without a definition.

    Parameters
    ----------
    name : str
        Such as sensor_msgs/JointState or sensor_msgs/msg/JointState.
    definition : str or None
        The text that the bag carries; by default that of a standard type.
    aligned : bool
        Whether messages are those of ROS 2 (CDR), else of ROS 1.

    Raises
    ------
    ValueError
        For a definition that is none.
    """
    name = _short(name)
    if definition is None and name not in STANDARD:
        return None
    types = _definitions(name, STANDARD[name] if definition is None else definition)
    return lambda data: _Reading(data, aligned).message(types, name, 0)


def _short(name: str) -> str:
    parts = name.split("/")
    return "/".join((parts[0], parts[-1])) if len(parts) > 1 else name


def _definitions(name: str, text: str) -> Definitions:
    if len(text) > LONGEST:
        raise ValueError(f"the definition of {name} has {len(text)} characters")
    parts = re.split(r"^=+\s*$", text, flags=re.MULTILINE)
    found = {}
    for index, part in enumerate(parts):
        head, _, body = part.strip().partition("\n")
        own = re.fullmatch(r"MSG:\s*(\S+)", head.strip())
        if index == 0 and own is None:
            found[name] = _fields(name, part)
        elif own is not None:
            of = _short(own.group(1))
            found[of] = _fields(of, body)
    for of, standard in STANDARD.items():
        found.setdefault(of, _fields(of, standard))
    return found


def _fields(of: str, text: str) -> tuple[Field, ...]:
    found = []
    for line in text.splitlines():
        line = line.split("#", 1)[0].strip()
        match = FIELD.fullmatch(line)
        if match is None or match["rest"].startswith("="):  # empty, or a constant
            continue
        kind = match["type"]
        if kind not in SIZES and kind not in STAMPS and kind not in ("string", "wstring"):
            kind = (
                _short(kind)
                if "/" in kind
                else "std_msgs/Header"
                if kind == "Header"
                else (f"{of.split('/')[0]}/{kind}")
            )
        bounded = match["array"] is None or "<=" in match["array"]
        count = (
            None if match["array"] is None else 0 if bounded or not match["count"] else int(match["count"])
        )
        found.append(Field(match["name"], kind, count))
    return tuple(found)


class _Reading:
    """A message that is read from its beginning to its end."""

    def __init__(self, data: bytes, aligned: bool) -> None:
        self._data, self._aligned = data, aligned
        self._at = self._start = 4 if aligned else 0
        little = not aligned or (len(data) > 1 and data[1] % 2 == 1)
        self._order = "<" if little else ">"

    def message(self, types: Definitions, name: str, depth: int) -> dict[str, Any]:
        """Return the fields of a message."""
        if name not in types:
            raise ValueError(f"the definition of {name} is missing")
        if depth > DEEPEST:
            raise ValueError(f"messages lie more than {DEEPEST} deep in each other")
        if self._aligned and not types[name]:
            self._numbers("B", 1)  # what holds nothing is one byte
        return {field.name: self._field(types, field, depth) for field in types[name]}

    def _field(self, types: Definitions, field: Field, depth: int) -> Any:
        if field.count is None:
            return self._one(types, field.type, depth)
        count = field.count or int(self._numbers("I", 1)[0])
        if field.type in SIZES:
            return self._numbers(SIZES[field.type], count)
        if count > len(self._data) - self._at:  # each takes a byte at least
            raise ValueError(f"the array {field.name} is longer than its message")
        return [self._one(types, field.type, depth) for _ in range(count)]

    def _one(self, types: Definitions, kind: str, depth: int) -> Any:
        if kind in SIZES:
            return self._numbers(SIZES[kind], 1)[0].item()
        if kind in STAMPS and kind not in types:
            first, second, codes = STAMPS[kind]
            return {first: int(self._numbers(codes[0], 1)[0]), second: int(self._numbers(codes[1], 1)[0])}
        if kind in ("string", "wstring"):
            wide = kind == "wstring"
            raw = bytes(self._take(int(self._numbers("I", 1)[0]) * (2 if wide else 1)))
            return raw.decode("utf-16-le" if wide else "utf-8", "replace").rstrip("\0")
        return self.message(types, kind, depth + 1)

    def _numbers(self, code: str, count: int) -> npt.NDArray[Any]:
        size = struct.calcsize(code)
        if self._aligned and count:
            self._take(-(self._at - self._start) % size)
        return np.frombuffer(self._take(size * count), dtype=f"{self._order}{np.dtype(code).str[1:]}")

    def _take(self, size: int) -> bytes:
        if self._at + size > len(self._data):
            raise ValueError("a message ends within a field")
        self._at += size
        return self._data[self._at - size : self._at]
