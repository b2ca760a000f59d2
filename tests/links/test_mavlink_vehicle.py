"""The MAVLink conversation with an autopilot: what is sent, by its fields, and what is
heard, and from whom.
"""

from __future__ import annotations

import math
import time

import pytest

from skyarm.links import mavlink
from skyarm.links.mavlink_vehicle import MODES, MavlinkVehicle


def talk(**options: object) -> tuple[MavlinkVehicle, list[mavlink.Message]]:
    """Vehicle, and the messages that are sent to it."""
    sent, parser = list[mavlink.Message](), mavlink.Parser()
    return MavlinkVehicle(
        MODES, lambda frame: sent.extend(parser.feed(frame)), **options
    ), sent  # type: ignore[arg-type]


def say(
    vehicle: MavlinkVehicle,
    name: str,
    system: int = 7,
    component: int = 1,
    **fields: object,
) -> bool:
    """Give the vehicle's side a message; whether it was taken."""
    frame = mavlink.pack(name, sequence=0, system=system, component=component, **fields)  # type: ignore[arg-type]
    (message,) = mavlink.Parser().feed(frame)
    return vehicle.hear(message)


def test_the_first_autopilot_that_beats_is_the_one_that_is_heard() -> None:
    vehicle, _ = talk()
    assert vehicle.modes is None
    assert not say(vehicle, "STATUSTEXT", severity=2, text="before")
    assert not say(vehicle, "HEARTBEAT", autopilot=8)  # a ground station
    assert not say(vehicle, "HEARTBEAT", autopilot=12, component=2)
    assert (vehicle.system, vehicle.beaten) == (0, -math.inf)
    assert say(
        vehicle,
        "HEARTBEAT",
        autopilot=12,
        base_mode=128,
        custom_mode=6 << 16,
        system_status=5,
    )
    assert (vehicle.system, vehicle.mode, vehicle.armed, vehicle.status) == (
        7,
        6 << 16,
        True,
        5,
    )
    assert 0.0 <= time.monotonic() - vehicle.beaten < 5.0
    assert vehicle.modes is MODES[12]
    assert not say(vehicle, "HEARTBEAT", system=8, autopilot=12, custom_mode=1)
    assert not say(vehicle, "STATUSTEXT", system=8, severity=2, text="another")
    assert say(vehicle, "HEARTBEAT", autopilot=12, base_mode=1, custom_mode=4 << 16)
    assert (vehicle.mode, vehicle.armed, vehicle.said) == (4 << 16, False, "")


def test_a_stated_system_is_heard_from_its_first_message() -> None:
    vehicle, _ = talk(system=3)
    assert not say(vehicle, "HEARTBEAT", autopilot=3)
    assert say(vehicle, "STATUSTEXT", system=3, severity=2, text="here")
    assert vehicle.said == "here"


def test_places_are_north_west_up_and_finite_and_texts_at_least_notices() -> None:
    vehicle, _ = talk()
    say(vehicle, "HEARTBEAT", autopilot=12)
    say(vehicle, "LOCAL_POSITION_NED", x=1.0, y=2.0, z=-3.0)
    assert vehicle.place == (1.0, -2.0, 3.0)
    say(vehicle, "LOCAL_POSITION_NED", x=1.0, y=math.nan, z=-4.0)
    assert vehicle.place == (1.0, -2.0, 3.0)
    say(vehicle, "STATUSTEXT", severity=5, text="notice")
    say(vehicle, "STATUSTEXT", severity=6, text="chatter")
    assert vehicle.said == "notice"


def test_of_parameters_only_those_that_were_asked_for_are_kept() -> None:
    vehicle, sent = talk()
    say(vehicle, "HEARTBEAT", autopilot=12)
    vehicle.request_parameter("MC_ROLL_P")
    for name in ("MC_ROLL_P", "OTHER"):
        say(vehicle, "PARAM_VALUE", param_id=name, param_value=6.5, param_type=9)
    assert vehicle.parameters == {"MC_ROLL_P": 6.5}
    vehicle.set_parameter("MPC_XY_P", 0.5)
    asked, told = sent
    assert (asked.name, asked["param_index"], asked["param_id"]) == (
        "PARAM_REQUEST_READ",
        -1,
        "MC_ROLL_P",
    )
    assert (told.name, told["param_id"], told["param_value"], told["param_type"]) == (
        "PARAM_SET",
        "MPC_XY_P",
        0.5,
        9,
    )


def test_commands_are_addressed_and_numbered() -> None:
    frames: list[bytes] = []
    vehicle = MavlinkVehicle(MODES, frames.append, sender=(0, 191), role=18)
    say(vehicle, "HEARTBEAT", autopilot=12)
    vehicle.beat()
    vehicle.request_outside()
    vehicle.request_hold()
    vehicle.request_streams({"LOCAL_POSITION_NED": 50, "ODOMETRY": 250})
    vehicle.command(400, 1)
    beat, *commands = mavlink.Parser().feed(b"".join(frames))
    assert (beat.name, beat["type"], beat["autopilot"], beat["system_status"]) == (
        "HEARTBEAT",
        18,
        8,
        4,
    )
    # sequence and sender
    assert [tuple(frame[4:7]) for frame in frames] == [(k, 7, 191) for k in range(6)]
    assert {(m["target_system"], m["target_component"]) for m in commands} == {(7, 1)}
    assert [
        [m["command"], m["param1"], m["param2"], m["param3"]] for m in commands
    ] == [
        [176, 1, 6, 0],
        [176, 1, 4, 3],
        [511, 32, 20_000, 0],
        [511, 331, 4000, 0],
        [400, 1, 0, 0],
    ]


def test_ours_is_system_255_or_what_is_stated_and_1_for_an_unknown_autopilot() -> None:
    for options, system in (
        ({}, 255),
        ({"sender": (0, 191)}, 1),
        ({"sender": (9, 1)}, 9),
    ):
        vehicle, sent = talk(**options)
        vehicle.beat()
        assert sent[0].system == system


@pytest.mark.parametrize(
    ("kind", "outside", "hold"), [(12, 6 << 16, 4 << 16 | 3 << 24), (3, 4, 17)]
)
def test_modes_are_told_apart_by_all_their_bits(
    kind: int, outside: int, hold: int
) -> None:
    modes = MODES[kind]
    for mode in (outside, hold, outside | 1 << 24, hold ^ 1 << 24, 0):
        assert modes.is_outside(mode) == (mode == outside)
        assert modes.is_hold(mode) == (mode == hold)
    assert (modes.main(outside), modes.main(hold)) == (
        (6, 4) if kind == 12 else (4, 17)
    )
