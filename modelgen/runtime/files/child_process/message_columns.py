"""Messages of a recording -> columns: every number in a message is one, named by topic and field.

A topic /joint_states with an array of positions gives /joint_states.position[0], or .position[elbow] where
the message names what its arrays hold: joints may change their places from message to message, and
several publishers may write their own joints on one topic. Messages without a common field are streams.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any

import numpy as np

from modelgen.runtime.files.size_limits import MOST_COLUMNS

DEEPEST = 12  # messages within messages
MOST_ENTRIES = 100  # of an array in a message: what has more is a scan or a picture
MOST_COMPARED = 400  # messages of a topic with named entries that are asked for further joints
LABEL = re.compile(r"[A-Za-z][\w ./:-]{0,59}", re.ASCII)
NAMED = re.compile(r"\[[A-Za-z]")
Decoder = Callable[[bytes], Any]
#: topic, decoder (None where there is none), bytes, time of logging in ns
Message = tuple[str, Decoder | None, bytes, int]


def listing_of(messages: Iterable[Message], unknown: str) -> Iterator[Any]:
    """Yield the streams, {"topic", "fields"}, and the topics that are left out with the reason.

    `unknown` is that of topics without a decoder. A topic has a stream for every publisher whose joints the
    others do not have.
    """
    topics: dict[str, list[dict[str, None]]] = {}
    seen: Counter[str] = Counter()
    left_out: dict[str, str] = {}
    columns = 0
    for topic, decode, data, _ in messages:
        seen[topic] += 1
        if topic in left_out or (topic in topics and not _may_have_others(topics[topic], seen[topic])):
            continue
        if decode is None:
            left_out[topic] = unknown
        elif fields := dict.fromkeys(name for name, _ in _numbers(decode(data))):
            columns += _add_fields(topics.setdefault(topic, []), fields)
        elif topic not in topics:
            left_out[topic] = "without numbers"
        if columns + len(left_out) > MOST_COLUMNS:
            break
    yield [{"topic": topic, "fields": list(one)} for topic, streams in topics.items() for one in streams]
    yield left_out


def _may_have_others(streams: list[dict[str, None]], seen: int) -> bool:
    """Return whether further messages of a topic can have other fields: those whose entries have names."""
    return seen <= MOST_COMPARED and any(map(NAMED.search, streams[0]))


def _add_fields(streams: list[dict[str, None]], fields: dict[str, None]) -> int:
    """Add the fields of a message to the stream that shares one, else as a stream; return their number."""
    known = {field for stream in streams for field in stream}
    further = dict.fromkeys(field for field in fields if field not in known)
    stream = next((one for one in streams if one.keys() & fields.keys()), None)
    if stream is None:
        streams.append(further)
    else:
        stream.update(further)
    return len(further)


def columns_of(
    messages: Callable[[Sequence[str]], Iterable[Message]],
    wanted: Sequence[Sequence[str]],
    clocks: Sequence[Sequence[Any]],
) -> Iterator[Any]:
    """Yield the samples of fields, (topic, field) each, then the times of streams in s.

    A stream is (topic, fields): the messages with one of these fields. A message without another gives NaN.
    Times are those of the message's header, else of its logging, since the first time of all streams that
    are asked for. `messages` gives those of some topics.
    """
    streams = [(topic, frozenset(fields)) for topic, fields in clocks]
    samples: list[list[float]] = [[] for _ in wanted]
    times: list[list[int]] = [[] for _ in streams]
    places = [
        [(k, field) for k, (of, field) in enumerate(wanted) if of == topic and field in fields]
        for topic, fields in streams
    ]
    alone = Counter(topic for topic, _ in streams)
    asked = {topic for topic, _ in wanted}
    for topic, decode, data, logged_ns in messages(sorted(alone)):
        if decode is None:
            continue
        decoded = decode(data)
        whole = alone[topic] == 1 and topic not in asked  # only its times matter
        numbers = {} if whole else dict(_numbers(decoded))
        for (of, fields), stamps, own in zip(streams, times, places, strict=True):
            if of == topic and (whole or not fields.isdisjoint(numbers)):
                stamps.append(_stamp_ns(decoded) or logged_ns)
                for k, field in own:
                    samples[k].append(numbers.get(field, np.nan))
    for values in samples:
        yield np.array(values, dtype=float)
    start = min((stamps[0] for stamps in times if stamps), default=0)
    for stamps in times:
        yield 1e-9 * (np.array(stamps, dtype=np.int64) - start).astype(float)


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
    """Return whether a field is an array of so many numbers."""
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
