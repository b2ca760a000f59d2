"""ROS message types: definitions and field lists.

Definitions: ros2/common_interfaces, ros2/geometry2 and ros2/rcl_interfaces, branch
humble, without comments and constants. They are written into every file, so that a
reader needs no ROS. Bytes are written and read by them in
:mod:`skyarm.log.ros.message_bytes`.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from typing import NamedTuple

from skyarm.log.log_columns import LogColumn
from skyarm.records.files import shipped_tables

DEFINITIONS: Mapping[str, str] = shipped_tables(__file__)["definitions"]
"""Message type, without ``/msg/`` in its name -> its fields."""

FLIGHT = "skyarm_msgs/Flight"
"""Message type of skyarm: every number of a log at one control instant, one field per
column."""


class MessageField(NamedTuple):
    """Field of a ROS message: name, type, and list length (0 for a variable length,
    None for a single value).
    """

    name: str
    kind: str
    length: int | None


_FIELD = re.compile(r"^([\w/]+)(\[(\d*)\])? +(\w+) *(?:#.*)?$", re.MULTILINE)


@lru_cache(maxsize=256)
def fields(text: str) -> tuple[MessageField, ...]:
    """Fields of a ROS message definition, without its constants."""
    rows = _FIELD.findall(text)
    return tuple(
        MessageField(name, kind, int(length or 0) if bracket else None)
        for kind, bracket, length, name in rows
    )


def full_name(kind: str) -> str:
    """Full name of a message type in ROS 2: ``std_msgs/msg/Header``."""
    package, _, name = kind.partition("/")
    return f"{package}/msg/{name}"


def flight_definition(columns: Sequence[LogColumn]) -> str:
    """Definition of the ROS message with all columns of a log, whose units are
    comments.
    """
    width = max(len(each.name) for each in columns)
    rows = (
        (each.name, ", ".join(filter(None, (each.unit, each.meaning))))
        for each in columns
    )
    return "\n".join(
        f"float64 {name:{width}} # {words}" if words else f"float64 {name}"
        for name, words in rows
    )


def definition(kind: str, definitions: Mapping[str, str]) -> str:
    """Definition of a ROS message type followed by those of its nested types, as MCAP
    requires.
    """
    nested = dict.fromkeys(_nested_types(kind, definitions))
    parts = (f"{'=' * 80}\nMSG: {each}\n{definitions[each]}\n" for each in nested)
    return "".join([f"{definitions[kind]}\n", *parts])


def _nested_types(kind: str, definitions: Mapping[str, str]) -> Iterator[str]:
    for field in fields(definitions[kind]):
        if "/" in field.kind:
            yield field.kind
            yield from _nested_types(field.kind, definitions)
