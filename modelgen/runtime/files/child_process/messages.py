"""Recordings of robots -> Source: .mcap (needs mcap and mcap-ros2-support), bags of ROS 1 and ROS 2."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from modelgen.errors import listed
from modelgen.runtime.files.child_process.reader_process import ask
from modelgen.runtime.files.size_limits import check_columns
from modelgen.runtime.files.source import Columns, Source


def open_mcap(path: Path) -> Source:
    """Return the source of an MCAP file; raises as `open_messages`."""
    return open_messages(path, "mcap", "an MCAP file")


def open_rosbag(path: Path) -> Source:
    """Return the source of a bag of ROS 1 (.bag) or ROS 2 (.db3); raises as `open_messages`."""
    return open_messages(path, "rosbag", f"a bag of ROS {1 if path.suffix.lower() == '.bag' else 2}")


def open_messages(path: Path, kind: str, title: str) -> Source:
    """Return the source of a recording: a column a number of a message, a column of times a stream.

    A stream is a topic, or one publisher's messages where several write different joints on one topic.

    Raises
    ------
    DataError
        When the libraries are missing, the file is none or damaged, or holds too many columns.
    """
    streams, left_out = ask(f"{kind}.listing", path)
    names: dict[str, None] = {}
    places: dict[str, tuple[str, str]] = {}
    times: dict[str, tuple[str, list[str]]] = {}  # column of times -> topic, fields of its messages
    clocks: dict[str, str] = {}
    topics: dict[str, None] = {}
    for entry in streams:
        topic, fields = entry["topic"], entry["fields"]
        again = topic in topics
        clock = "time" if not times else f"time ({topic}.{fields[0]})" if again else f"time ({topic})"
        topics[topic] = None
        names[clock], times[clock] = None, (topic, fields)
        for field in fields:
            name = f"{topic}.{field}"
            names[name], places[name], clocks[name] = None, (topic, field), clock
    check_columns(path, len(names))

    def load(asked: Sequence[str]) -> Columns:
        samples = [name for name in asked if name in places]
        wanted = [places[name] for name in samples]
        # all times are counted from one instant
        read = ask(f"{kind}.columns", path, wanted=wanted, clocks=list(times.values()))
        found = dict(zip([*samples, *times], read, strict=True))
        return {name: found[name] for name in asked}

    took = [f"{title} of {len(topics)} topic(s), times of the messages' headers, or of logging"]
    if left_out:
        took.append("left out: " + listed(f"{topic} ({why})" for topic, why in left_out.items()))
    units = dict.fromkeys(names, "") | dict.fromkeys(times, "s")  # brackets hold names of joints, "m" too
    several = clocks if len(times) > 1 else {}
    dates: dict[str, int | None] = dict.fromkeys(times)
    return Source(path, tuple(names), load, units=units, clocks=several, took=tuple(took), starts=dates)
