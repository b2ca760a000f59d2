"""Definitions of MAVLink messages against the oracle pymavlink, and the checksum
against its definition bit by bit.
"""

from __future__ import annotations

import random

import pytest
from pymavlink.dialects.v20 import ardupilotmega

from skyarm.links import mavlink
from skyarm.links.mavlink_messages import (
    DEFINITIONS,
    DEFINITIONS_BY_NUMBER,
    checksum,
    is_possible_checksum,
)

ORACLE = {each.msgname: each for each in ardupilotmega.mavlink_map.values()}

NEWER = {
    "SET_ATTITUDE_TARGET": {"thrust_body"},
    "TIMESYNC": {"target_system", "target_component"},
}
"""Extensions of mavlink.io's ``common`` (2026-02, which PX4 takes) that the dialects in
pymavlink do not have yet."""

NAMES = [
    "HEARTBEAT",
    "PARAM_REQUEST_READ",
    "PARAM_VALUE",
    "PARAM_SET",
    "ATTITUDE_QUATERNION",
    "LOCAL_POSITION_NED",
    "ODOMETRY",
    "SET_ATTITUDE_TARGET",
    "SET_POSITION_TARGET_LOCAL_NED",
    "COMMAND_LONG",
    "COMMAND_ACK",
    "TIMESYNC",
    "HIL_SENSOR",
    "HIL_GPS",
    "HIGHRES_IMU",
    "HIL_ACTUATOR_CONTROLS",
    "ESTIMATOR_STATUS",
    "EKF_STATUS_REPORT",
    "EXTENDED_SYS_STATE",
    "STATUSTEXT",
]


def bitwise(data: bytes) -> int:
    """Bit by bit: polynomial x^16 + x^12 + x^5 + 1, lowest bit first, from 0xFFFF
    on.
    """
    crc = 0xFFFF
    for byte in data:
        for bit in range(8):
            odd = (crc ^ byte >> bit) & 1
            crc = crc >> 1 ^ (0x8408 if odd else 0)
    return crc


def test_every_message_that_the_links_need_is_defined() -> None:
    assert set(DEFINITIONS) == set(NAMES)
    assert len(DEFINITIONS_BY_NUMBER) == len(NAMES)


@pytest.mark.parametrize("name", NAMES)
def test_a_definition_is_the_oracle_s(name: str) -> None:
    ours, oracle = DEFINITIONS[name], ORACLE[name]
    fields = [each for each in ours.fields if each.name not in NEWER.get(name, ())]
    assert all(each.extension for each in ours.fields if each not in fields)
    assert (ours.number, ours.check[0]) == (oracle.id, oracle.crc_extra)
    assert DEFINITIONS_BY_NUMBER[oracle.id] is ours
    assert [each.name for each in fields] == list(oracle.ordered_fieldnames)
    assert [each.count for each in fields] == list(oracle.array_lengths)
    letters = bytes(oracle.native_format).decode()
    assert "<" + "".join(each.format[-1] for each in fields) == letters.replace(
        "c", "s"
    )


@pytest.mark.parametrize("name", NAMES)
def test_extensions_follow_the_base_part(name: str) -> None:
    """The check byte depends on names and types of the base part, so the oracle's
    confirms where it ends.
    """
    extensions = [each.extension for each in DEFINITIONS[name].fields]
    assert extensions == sorted(extensions)


def test_no_field_has_the_name_of_an_argument_of_pack() -> None:
    fields = {field.name for each in DEFINITIONS.values() for field in each.fields}
    assert fields.isdisjoint({"name", "sequence", "system", "component"})


@pytest.mark.parametrize(
    ("name", "field", "low", "high"),
    [
        ("HIL_GPS", "vn", -(2**15), 2**15 - 1),
        ("HIL_GPS", "eph", 0, 2**16 - 1),
        ("TIMESYNC", "tc1", -(2**63), 2**63 - 1),
    ],
)
def test_whole_numbers_are_refused_beyond_the_range_that_is_named(
    name: str, field: str, low: int, high: int
) -> None:
    for value in (low, high):
        (message,) = mavlink.Parser().feed(
            mavlink.pack(name, sequence=0, **{field: value})
        )
        assert message[field] == value
    for value in (low - 1, high + 1):
        with pytest.raises(mavlink.MavlinkError, match=f"from {low} to {high}"):
            mavlink.pack(name, sequence=0, **{field: value})


def test_the_checksum_is_the_published_one_and_that_of_its_definition() -> None:
    rng = random.Random(29)
    # catalogue of CRC algorithms, CRC-16/MCRF4XX
    assert checksum(b"123456789") == 0x6F91
    for length in (0, 1, 2, 3, 9, 64, 280):
        data = rng.randbytes(length)
        assert checksum(data) == bitwise(data)


def test_a_checksum_is_possible_where_one_more_byte_gives_it() -> None:
    data = random.Random(30).randbytes(20)
    possible = {bitwise(data + bytes([byte])) for byte in range(256)}
    assert len(possible) == 256
    assert {
        crc for crc in range(1 << 16) if is_possible_checksum(data, crc)
    } == possible
