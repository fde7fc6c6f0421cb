"""Messages of a recording -> columns: every number in a message is one, named by topic and field.

A topic /joint_states with an array of positions gives /joint_states.position[0], or .position[elbow] where
the message names what its arrays hold: joints may change their places from message to message.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any

import numpy as np

from modelgen.runtime.files.size_limits import MOST_COLUMNS

DEEPEST = 12  # messages within messages
MOST_ENTRIES = 100  # of an array in a message: what has more is a scan or a picture
LABEL = re.compile(r"[A-Za-z][\w ./:-]{0,59}", re.ASCII)
Decoder = Callable[[bytes], Any]
#: topic, decoder (None where there is none), bytes, time of logging in ns
Message = tuple[str, Decoder | None, bytes, int]


def listing_of(messages: Iterable[Message], unknown: str) -> Iterator[Any]:
    """Yield the topics, {"topic", "fields", "messages"}, and those that are left out with the reason.

    `unknown` is that of topics without a decoder.
    """
    topics: dict[str, dict[str, Any]] = {}
    left_out: dict[str, str] = {}
    columns = 0
    for topic, decode, data, _ in messages:
        if topic in left_out:
            continue
        if topic in topics:
            topics[topic]["messages"] += 1
        elif decode is None:
            left_out[topic] = unknown
        elif not (fields := [name for name, _ in _numbers(decode(data))]):
            left_out[topic] = "without numbers"
        else:
            columns += len(fields)
            topics[topic] = {"topic": topic, "fields": fields, "messages": 1}
        if columns + len(left_out) > MOST_COLUMNS:
            break
    yield list(topics.values())
    yield left_out


def columns_of(
    messages: Callable[[Sequence[str]], Iterable[Message]],
    wanted: Sequence[Sequence[str]],
    clocks: Sequence[str],
) -> Iterator[Any]:
    """Yield the samples of fields, (topic, field) each, then the times of topics in s.

    A message without a field gives NaN. Times are those of the message's header, else of its logging, since
    the first time of all topics that are asked for. `messages` gives those of some topics.
    """
    topics = {topic for topic, _ in wanted} | set(clocks)
    samples: dict[tuple[str, str], list[float]] = {(topic, field): [] for topic, field in wanted}
    of = {topic: [key for key in samples if key[0] == topic] for topic in topics}
    times: dict[str, list[int]] = {topic: [] for topic in topics}
    for topic, decode, data, logged_ns in messages(sorted(topics)):
        if decode is None:
            continue
        decoded = decode(data)
        numbers = dict(_numbers(decoded)) if of[topic] else {}
        for key in of[topic]:
            samples[key].append(numbers.get(key[1], np.nan))
        times[topic].append(_stamp_ns(decoded) or logged_ns)
    for topic, field in wanted:
        yield np.array(samples[topic, field], dtype=float)
    start = min((stamps[0] for stamps in times.values() if stamps), default=0)
    for topic in clocks:
        yield 1e-9 * (np.array(times[topic], dtype=np.int64) - start).astype(float)


def _numbers(value: Any, name: str = "", depth: int = 0) -> Iterator[tuple[str, float]]:
    """Yield (field, number) of everything in a message but its header's stamp."""
    if depth > DEEPEST or isinstance(value, (str, bytes)):
        return
    if isinstance(value, (bool, int, float, np.number)):
        yield name, float(value)
        return
    if isinstance(value, (list, tuple, np.ndarray)):
        if len(value) <= MOST_ENTRIES:
            for k, entry in enumerate(value):
                yield from _numbers(entry, f"{name}[{k}]", depth + 1)
        return
    fields = _fields(value)
    labels = _labels(fields.get("name"))
    for key, entry in fields.items():
        inner = f"{name}.{key}" if name else str(key)
        if labels and _is_row(entry, len(labels)):
            for label, one in zip(labels, entry, strict=True):
                yield from _numbers(one, f"{inner}[{label}]", depth + 1)
        elif inner != "header":
            yield from _numbers(entry, inner, depth + 1)


def _is_row(entry: Any, count: int) -> bool:
    """Tell whether a field is an array of so many numbers."""
    listed = isinstance(entry, (list, tuple, np.ndarray)) and len(entry) == count
    return listed and all(isinstance(one, (int, float, np.number)) for one in entry)


def _labels(names: Any) -> tuple[str, ...]:
    """Return what a message calls the entries of its arrays of numbers; nothing where that cannot be."""
    if not isinstance(names, (list, tuple)) or not 0 < len(names) <= MOST_ENTRIES:
        return ()
    told = tuple(one for one in names if isinstance(one, str) and LABEL.fullmatch(one))
    return told if len(set(told)) == len(names) else ()


def _fields(message: Any) -> dict[str, Any]:
    """Return the fields of a message by name; none of what is no message."""
    if isinstance(message, dict):
        return message
    names: Any = getattr(message, "__slots__", None) or getattr(message, "__dict__", ())
    return {name: getattr(message, name) for name in names if hasattr(message, name)}


def _stamp_ns(message: Any) -> int:
    """Return header.stamp in ns since 1970, 0 where a message has none."""
    parts = _fields(_fields(_fields(message).get("header")).get("stamp"))
    seconds, nanoseconds = parts.get("sec"), parts.get("nanosec", parts.get("nsec"))
    if not (isinstance(seconds, int) and isinstance(nanoseconds, int)):
        return 0
    return seconds * 10**9 + nanoseconds
