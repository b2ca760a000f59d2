"""PX4 by uXRCE-DDS: flights of a law that commands motors, by a stand-in whose types
and encoder are another hand's.
"""

import dataclasses
import math
import os
import struct
import time

import numpy as np
import pytest

pytest.importorskip("cyclonedds", reason="needs the extra 'ros'")

from links.outside.dds_stand_in import DdsStandIn
from links.outside.test_offboard import SCENARIO
from skyarm import load_scenario
from skyarm.algebra import Vec3
from skyarm.dynamics.actuators import Command
from skyarm.links.joint_port import NoJoints
from skyarm.links.outside import offboard
from skyarm.links.outside.autopilot_link import open_link
from skyarm.links.outside.dds_link import DdsLink, parse_domain
from skyarm.links.outside.offboard import OffboardFlight, OffboardSettings
from skyarm.links.outside.offboard_link import OffboardError
from skyarm.links.outside.outside_law import MotorSettings, require_full_thrust
from skyarm.links.outside.px4_topics import DEFINITIONS, OUT
from skyarm.links.ros.ros2_node import CONFIGURATION, LOOPBACK_ONLY
from skyarm.log.ros.message_bytes import decode, encode
from skyarm.records.coerce import RecordError
from support.commands import skyarm

DOMAIN = 100 + os.getpid() % 100
"""Of this process alone: another one of the tests flies at the same time."""

SETTINGS = OffboardSettings(patience=5.0, stale=0.5)


@pytest.fixture(autouse=True)
def hurry(monkeypatch):
    monkeypatch.setattr(offboard, "LEAD", 0.1)
    monkeypatch.setattr(offboard, "TAKE_OVER", 1.0)
    monkeypatch.setattr(offboard, "MODE_KNOWN", 0.3)


@pytest.fixture
def scenario(tmp_path):
    def make(duration=1.5):
        file = tmp_path / "step.toml"
        file.write_text(SCENARIO.format(duration=duration))
        return load_scenario(str(file))

    return make


def flown(scenario, settings=SETTINGS, space="", **faults):
    """Log of a flight with a stand-in, and the stand-in."""
    link = open_link(f"dds://{DOMAIN}{space}")
    try:
        with DdsStandIn(
            0, vehicle=scenario.plant.vehicle, domain=DOMAIN, space=space, **faults
        ) as peer:
            log = OffboardFlight(scenario, link, NoJoints(), settings).run()
            time.sleep(0.3)
    finally:
        link.close()
    return log, peer


@pytest.mark.parametrize(("space", "mixed"), [("", False), ("/px4_1", True)])
def test_the_law_turns_the_motors_and_flies_its_reference(scenario, space, mixed):
    """The stand-in's own path, in north, east, down, is the reference turned by its
    heading.
    """
    log, peer = flown(scenario(3.0), space=space, mixed=mixed)
    assert (log.status, log.info["cause"]) == ("completed", "")
    moved = np.array(peer.path[-1]) - peer.place
    x, y, z = (log.position_reference[-1] - log.position_reference[0]).tolist()
    c, s = math.cos(peer.heading), math.sin(peer.heading)
    assert moved == pytest.approx([c * x + s * y, s * x - c * y, -z], abs=0.12)
    assert peer.modes == ["offboard", "hold"]
    assert (
        peer.seen.count("actuator_motors")
        == peer.seen.count("offboard_control_mode")
        > 100
    )
    assert (
        np.linalg.norm(log.position - log.position_reference, axis=1)[-50:].max() < 0.1
    )


def test_each_set_point_says_that_motors_are_set_and_when(scenario):
    """Times are of the autopilot's clock, so that one that was held up on its way is
    too old for it.
    """
    log, peer = flown(scenario(0.6), zero=1.8e9)
    assert log.status == "completed"
    apart = np.diff(peer.stamps) * 1e-6
    assert 1.8e9 < peer.stamps[0] * 1e-6 < 1.8e9 + 60.0
    assert 0.002 < np.quantile(apart, 0.1) < 0.006  # a busy machine leaves periods out


@pytest.mark.parametrize(
    ("fault", "status", "cause"),
    [
        ({"silent_at": 0.5}, "link_lost", "no estimate from the autopilot for 0.5 s"),
        ({"nan_at": 0.5}, "link_lost", "no estimate from the autopilot for 0.5 s"),
        ({"leaves_at": 0.6}, "taken_back", "PX4 left the mode that takes set points"),
        ({"disarms_at": 0.6}, "taken_back", "PX4 is no longer armed"),
    ],
)
def test_a_fault_ends_the_flight_with_its_log(scenario, fault, status, cause):
    log, peer = flown(scenario(3.0), **fault)
    assert (log.status, log.info["cause"]) == (status, cause)
    assert peer.asked[:1] == ["offboard"]
    assert (peer.modes == ["offboard", "left"]) == ("leaves_at" in fault)


@pytest.mark.parametrize(
    ("state", "settings", "words"),
    [
        ({"refuses": True}, {}, r"PX4 does not take set points \(result 1\)"),
        (
            {"armed": False},
            {"patience": 1.5},
            "the vehicle was not armed, in the air and slow",
        ),
        (
            {"landed": True},
            {"patience": 1.5},
            "the vehicle was not armed, in the air and slow",
        ),
        (
            {},
            {"rate_bandwidth": (18.0, 18.0, 18.0)},
            "--rate-bandwidth: must be left out for motors",
        ),
    ],
)
def test_a_vehicle_that_cannot_be_taken_over_is_left_alone(
    scenario, state, settings, words
):
    with pytest.raises(OffboardError, match=words):
        flown(scenario(), dataclasses.replace(SETTINGS, **settings), **state)


@pytest.fixture
def joined(monkeypatch):
    """Participants of other programs may be there first."""
    monkeypatch.setenv(CONFIGURATION, LOOPBACK_ONLY)


def test_two_vehicles_on_the_same_topics_are_refused(scenario, joined):
    planned = scenario()
    words = "2 vehicles publish /fmu/out/vehicle_odometry: must be one"
    other = DdsStandIn(0, vehicle=planned.plant.vehicle, domain=DOMAIN)
    with other, pytest.raises(OffboardError, match=words):
        flown(planned)


def test_bytes_that_are_no_message_are_counted(monkeypatch):
    link = DdsLink(f"dds://{DOMAIN}")
    try:
        monkeypatch.setattr(
            type(link._node),
            "take",
            lambda self, topic: [b"", b"\0\1\0\0" + bytes(7), b"\7" * 40],
        )
        link.wait(0.0)
        assert link.lost == 3 * 6
        assert (link.state, link.title) == (None, "")
    finally:
        link.close()


def test_an_estimate_carries_the_force_that_arrives_with_it(monkeypatch):
    """The accelerometer is read first; its axes are forward, right, down."""
    sent = {
        "/fmu/out/sensor_combined": {"accelerometer_m_s2": (1.0, 2.0, -9.8)},
        "/fmu/out/vehicle_odometry": {
            "timestamp_sample": 5,
            "pose_frame": 1,
            "velocity_frame": 1,
            "q": (1.0, 0.0, 0.0, 0.0),
        },
    }

    def take(self, topic):
        if topic not in sent:
            return []
        return [encode(OUT[topic], DEFINITIONS, sent[topic], 1)[0].tobytes()]

    link = DdsLink(f"dds://{DOMAIN}")
    try:
        monkeypatch.setattr(type(link._node), "take", take)
        link.wait(0.0)
    finally:
        link.close()
    assert tuple(link.state.specific_force) == pytest.approx((1.0, -2.0, 9.8))


def test_rotors_without_a_highest_speed_have_no_share(scenario):
    vehicle = scenario().plant.vehicle
    endless = dataclasses.replace(vehicle.rotors[1], max_speed=math.inf)
    rotors = (vehicle.rotors[0], endless, *vehicle.rotors[2:])
    with pytest.raises(
        RecordError, match=r"model.vehicle.rotors\[1\].max_speed = inf: must be finite"
    ):
        require_full_thrust(dataclasses.replace(vehicle, rotors=rotors))


def test_more_rotors_than_a_set_point_has_motors_are_refused(scenario):
    vehicle = scenario().plant.vehicle
    rotors = tuple(
        dataclasses.replace(vehicle.rotors[0], name=f"r{i}") for i in range(13)
    )
    with pytest.raises(
        RecordError, match=r"model\.vehicle\.rotors = 13: must be at most 12"
    ):
        require_full_thrust(dataclasses.replace(vehicle, rotors=rotors))


def test_shares_are_those_of_thrust(scenario):
    """Half the speed is a quarter of the thrust; more than the highest speed is 1."""
    model = scenario().controller.par.model
    most = model.vehicle.rotors[0].max_speed
    command = Command(rotor_speeds=(most, 0.5 * most, 0.0, 2.0 * most), efforts=())
    _, found = MotorSettings(period=0.01).set_point(
        model, Vec3(0.0, 0.0, 0.0), None, None, command
    )
    assert found.thrusts == pytest.approx((1.0, 0.25, 0.0, 1.0))


@pytest.mark.parametrize(
    ("url", "found"), [("dds://0", (0, "")), ("dds://17/px4_1", (17, "/px4_1"))]
)
def test_a_link_names_domain_and_namespace(url, found):
    assert parse_domain(url) == found


@pytest.mark.parametrize(
    "url",
    [
        "dds:0",
        "dds://",
        "dds://233",
        "dds://x",
        "dds://0/a b",
        "dds://0?x=1",
        "dds://-1",
        "dds://0/ü",
        "dds://0/1x",
        "dds://٣",
    ],
)
def test_other_links_are_one_line(url, tmp_path):
    (tmp_path / "step.toml").write_text(SCENARIO.format(duration=0.5))
    ended = skyarm("fly", str(tmp_path / "step.toml"), "--link", url)
    assert ended.code == 2
    assert (
        f"--link = {url!r}: must be dds://DOMAIN or dds://DOMAIN/NAMESPACE, with a"
        " domain from 0 to 232" in ended.err
    )
    assert ended.err.count("\n") == 1


def test_the_command_flies_by_dds(tmp_path, monkeypatch, joined):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "step.toml").write_text(SCENARIO.format(duration=0.5))
    vehicle = load_scenario("step.toml").plant.vehicle
    with DdsStandIn(0, vehicle=vehicle, domain=DOMAIN) as peer:
        ended = skyarm(
            "fly", "step.toml", "--link", f"dds://{DOMAIN}", "--patience", "5"
        )
    assert ended.code == 0, ended.err
    assert peer.modes == ["offboard", "hold"]


@pytest.mark.parametrize("more", [10, 7])
def test_the_mode_of_px4_is_read_whichever_fields_its_version_has_behind_it(
    more: int,
) -> None:
    """Bytes laid out by hand: v1.18 (px4_msgs, release/1.18) has one flag and the
    source less than v1.17.
    """
    flags = [True, False, False, False, True] + [False] * more
    data = b"\0\1\0\0" + struct.pack(f"<Q{len(flags)}?", 1_000_000, *flags)
    found = decode("px4_msgs/VehicleControlMode", DEFINITIONS, data)
    assert found["timestamp"] == 1_000_000
    assert [bool(each) for name, each in found.items() if name != "timestamp"] == flags[
        :5
    ]
