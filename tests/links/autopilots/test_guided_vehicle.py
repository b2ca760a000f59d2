"""A vehicle under guidance: origin of its frame, set points in its axes, obedience,
with the frames that it sends.
"""

from __future__ import annotations

import pytest

from skyarm.links import mavlink
from skyarm.links.autopilots.autopilot import BaseGoal, LinkError
from skyarm.links.autopilots.guided_vehicle import GuidedVehicle

PX4, ARDUPILOT = 12, 3
OFFBOARD, HOLD, GUIDED, BRAKE = 6 << 16, 4 << 16 | 3 << 24, 4, 17


class Sent(list[mavlink.Message]):
    """Messages that were sent, in order."""

    def __init__(self) -> None:
        super().__init__()
        self._parser = mavlink.Parser()

    def __call__(self, frame: bytes) -> None:
        self += self._parser.feed(frame)


def guided(
    kind: int = PX4, mode: int = OFFBOARD, armed: bool = True
) -> tuple[GuidedVehicle, Sent]:
    """Vehicle that has beaten once, as system 7, and what is sent to it."""
    sent = Sent()
    vehicle = GuidedVehicle(kind, sent)
    say(vehicle, "HEARTBEAT", autopilot=kind, base_mode=128 * armed, custom_mode=mode)
    return vehicle, sent


def say(
    vehicle: GuidedVehicle,
    name: str,
    system: int = 7,
    component: int = 1,
    **fields: object,
) -> bool:
    """Give the vehicle's side a message; whether it was taken."""
    frame = mavlink.pack(name, sequence=0, system=system, component=component, **fields)  # type: ignore[arg-type]
    (message,) = mavlink.Parser().feed(frame)
    return vehicle.hear(message)


def test_its_origin_is_the_mean_of_the_last_differences_at_rest() -> None:
    vehicle, _ = guided()
    assert vehicle.compare_place((0.0, 0.0, 0.0), True) == 0  # no place yet
    for k in range(4):
        say(vehicle, "LOCAL_POSITION_NED", x=10.0 + k, y=-20.0, z=-30.0)
        assert vehicle.compare_place((1.0, 2.0, 3.0), True) == k + 1
    vehicle.find_origin(2)
    assert vehicle.origin == pytest.approx((11.5, 18.0, 27.0))
    assert vehicle.rise(1.0) == pytest.approx(30.0 - 27.0 - 1.0)
    assert vehicle.compare_place((1.0, 2.0, 3.0), False) == 0


def test_its_rise_is_none_before_its_origin_is_known() -> None:
    vehicle, _ = guided()
    say(vehicle, "LOCAL_POSITION_NED", x=0.0, y=0.0, z=-30.0)
    assert vehicle.rise(1.0) == 0.0
    vehicle.origin, vehicle.place = (0.0, 0.0, 0.0), None
    assert vehicle.rise(1.0) == 0.0


def test_a_set_point_is_north_east_down_about_its_origin() -> None:
    vehicle, sent = guided()
    vehicle.origin = (10.0, 20.0, 30.0)
    vehicle.send_goal(
        1.25, BaseGoal((0.5, -0.3, 1.5), (0.1, 0.2, 0.3), (0.4, 0.5, 0.6), 0.7)
    )
    (told,) = sent
    place = [
        told[f] for f in ("x", "y", "z", "vx", "vy", "vz", "afx", "afy", "afz", "yaw")
    ]
    assert place == pytest.approx(
        [10.5, -19.7, -31.5, 0.1, -0.2, -0.3, 0.4, -0.5, -0.6, -0.7], rel=1e-6
    )
    assert (told["time_boot_ms"], told["type_mask"], told["coordinate_frame"]) == (
        1250,
        2048,
        1,
    )
    assert (told["target_system"], told["target_component"]) == (7, 1)


def test_a_set_point_that_mavlink_cannot_carry_is_a_link_error() -> None:
    vehicle, _ = guided(ARDUPILOT, GUIDED)
    vehicle.origin = (0.0, 0.0, 0.0)
    with pytest.raises(LinkError, match="a set point cannot be sent to ArduPilot: "):
        vehicle.send_goal(0.0, BaseGoal((1e300, 0.0, 0.0), (0.0,) * 3, (0.0,) * 3, 0.0))


@pytest.mark.parametrize(
    ("kind", "obeys", "holds", "words"),
    [
        (PX4, OFFBOARD, HOLD, "PX4 left offboard mode for its mode 4: why not"),
        (
            ARDUPILOT,
            GUIDED,
            BRAKE,
            "ArduPilot left guided mode for its mode 17: why not",
        ),
    ],
)
def test_it_may_leave_our_mode_for_three_seconds(
    kind: int, obeys: int, holds: int, words: str
) -> None:
    vehicle, _ = guided(kind, obeys)
    assert (vehicle.obeys, vehicle.holds) == (True, False)
    vehicle.require_obedience(True, 0.5)
    say(vehicle, "STATUSTEXT", severity=4, text="why not")
    for left in (1, 2):
        say(vehicle, "HEARTBEAT", autopilot=kind, base_mode=128, custom_mode=holds)
        assert (vehicle.obeys, vehicle.holds) == (False, True)
        for _ in range(6):
            vehicle.require_obedience(True, 0.5)
        assert vehicle.away == left
        if left == 1:
            say(vehicle, "HEARTBEAT", autopilot=kind, base_mode=128, custom_mode=obeys)
            vehicle.require_obedience(True, 0.5)
    with pytest.raises(LinkError) as caught:
        vehicle.require_obedience(True, 0.5)
    assert str(caught.value) == words


def test_a_part_of_a_mode_is_another_mode() -> None:
    vehicle, _ = guided(PX4, 4 << 16 | 2 << 24)
    assert (vehicle.obeys, vehicle.holds) == (False, False)


@pytest.mark.parametrize(
    ("said", "words"),
    [("", "PX4 disarmed in flight"), ("oh", "PX4 disarmed in flight: oh")],
)
def test_a_disarmed_vehicle_does_not_fly(said: str, words: str) -> None:
    vehicle, _ = guided()
    vehicle.said = said
    with pytest.raises(LinkError) as caught:
        vehicle.require_obedience(False, 0.1)
    assert str(caught.value) == words


def stating(*parameters: tuple[str, float]) -> tuple[GuidedVehicle, Sent]:
    """Vehicle of a user who states parameters."""
    sent = Sent()
    vehicle = GuidedVehicle(PX4, sent, parameters)
    say(vehicle, "HEARTBEAT", autopilot=PX4)
    return vehicle, sent


def test_stated_parameters_are_asked_for_once_a_second_until_they_have_come() -> None:
    vehicle, sent = stating(("A", 1.5), ("B", 2.0))
    asked = []
    for time in (10.0, 10.4, 11.0, 11.5):
        assert vehicle.has_parameters(time, 5.0) is False
        asked.append([m["param_id"] for m in sent])
        sent.clear()
        if time == 10.4:
            say(vehicle, "PARAM_VALUE", param_id="B", param_value=2.0, param_type=9)
    assert asked == [["A", "B"], [], ["A"], []]
    say(vehicle, "PARAM_VALUE", param_id="A", param_value=1.5, param_type=9)
    assert vehicle.has_parameters(11.6, 5.0) is True
    assert not sent


def test_many_parameters_are_requested_few_at_a_time_and_timed_from_an_answer() -> None:
    names = [f"P{k}" for k in range(20)]
    vehicle, sent = stating(*((name, 1.0) for name in names))
    for k in range(12):  # 0.5 s each, 6 s in all
        assert vehicle.has_parameters(0.5 * k, 1.0) is False
        assert len(sent) <= 8
        for name in [m["param_id"] for m in sent][:4] if k % 2 == 0 else []:
            say(vehicle, "PARAM_VALUE", param_id=name, param_value=1.0, param_type=9)
        sent.clear()
        if len(vehicle.parameters) == 20:
            break
    assert vehicle.has_parameters(6.0, 1.0) is True
    vehicle, sent = stating(*((name, 1.0) for name in names))
    assert vehicle.has_parameters(0.0, 1.0) is False
    for message in sent:
        say(
            vehicle,
            "PARAM_VALUE",
            param_id=message["param_id"],
            param_value=1.0,
            param_type=9,
        )
    sent.clear()
    assert vehicle.has_parameters(0.01, 1.0) is False
    assert [m["param_id"] for m in sent] == names[8:16]  # at once


def test_without_stated_parameters_nothing_is_asked() -> None:
    vehicle, sent = stating()
    assert vehicle.has_parameters(0.0, 5.0) is True
    assert not sent


def test_a_stated_parameter_that_is_changed_or_unknown_ends_the_flight() -> None:
    vehicle, _ = stating(("A", 1.5))
    vehicle.has_parameters(0.0, 5.0)
    say(vehicle, "PARAM_VALUE", param_id="A", param_value=1.25, param_type=9)
    with pytest.raises(
        LinkError,
        match=(
            r"^controller\.parameters\.A = 1\.5: must be what PX4 takes; it has 1\.25$"
        ),
    ):
        vehicle.has_parameters(1.0, 5.0)
    vehicle, _ = stating(("A", 1.5))
    vehicle.has_parameters(3.0, 5.0)
    assert vehicle.has_parameters(8.0, 5.0) is False
    with pytest.raises(
        LinkError,
        match=r"^controller\.parameters\.A = 1\.5: must be a parameter that PX4 knows$",
    ):
        vehicle.has_parameters(8.1, 5.0)
