"""Flights of a law by a stand-in for an autopilot: take-over, tracking, hand-back, and
every way to lose the link.
"""

import contextlib
import dataclasses
import gc
import math
import os
import socket
import threading
import time

import numpy as np
import pytest

from links.outside.stand_in import StandIn, free_port
from skyarm import load_scenario
from skyarm.control.laws.centroidal import make_centroidal
from skyarm.links.joint_port import (
    JointPortError,
    JointReading,
    JointServer,
    NoJoints,
    UdpJoints,
)
from skyarm.links.outside import offboard
from skyarm.links.outside.offboard import (
    OffboardFlight,
    OffboardSettings,
    require_outside,
)
from skyarm.links.outside.offboard_link import OffboardError, OffboardLink
from skyarm.links.outside.outside_law import OutsideLaw
from skyarm.scenario.scenario_record import Change, ScenarioError, with_words

SCENARIO = """
schema = 1
name = "step"
duration = {duration}
[rates]
physics = 1000
control = 250
reference = 50
[plant]
vehicle = "hummingbird"
[controller]
law = "rotors_sim_position"
[reference.base]
kind = "circle"
radius = 0.2
frequency_hz = 0.25
center = [1.0, 2.0, 1.0]
start = 0.5
stop = 10.0
"""


@pytest.fixture
def scenario(tmp_path):
    def make(duration=1.5):
        file = tmp_path / "step.toml"
        file.write_text(SCENARIO.format(duration=duration))
        return load_scenario(str(file))

    return make


SETTINGS = OffboardSettings(rate_bandwidth=(18.0, 18.0, 18.0), patience=3.0, stale=0.5)


@pytest.fixture(autouse=True)
def hurry(monkeypatch):
    monkeypatch.setattr(offboard, "LEAD", 0.1)
    monkeypatch.setattr(offboard, "TAKE_OVER", 1.0)
    monkeypatch.setattr(offboard, "MODE_KNOWN", 0.3)


def flown(scenario, settings=SETTINGS, **faults):
    """Log of a flight with a stand-in, and the stand-in."""
    port = free_port()
    with StandIn(port, **{"hover": 0.37} | faults) as peer:
        link = OffboardLink(f"mavlink://127.0.0.1:{port}")
        try:
            log = OffboardFlight(scenario, link, NoJoints(), settings).run()
        finally:
            until = time.monotonic() + 1.0
            while peer.offboard and time.monotonic() < until:
                time.sleep(0.005)
            time.sleep(0.05)
            link.close()
    return log, peer


def test_the_law_flies_its_reference_from_where_the_vehicle_is(scenario):
    """The stand-in's own path, in north, east, down, is the reference turned by its
    heading.
    """
    planned = scenario(2.0)
    log, peer = flown(planned)
    assert (log.status, log.info["cause"]) == ("completed", "")
    moved = np.array(peer.path[-1]) - peer.place  # a moment after the end
    x, y, z = (log.position_reference[-1] - log.position_reference[0]).tolist()
    c, s = math.cos(peer.heading), math.sin(peer.heading)
    assert moved == pytest.approx([c * x + s * y, s * x - c * y, -z], abs=0.12)
    assert np.linalg.norm(moved) > 0.2
    assert peer.modes == ["offboard", "hold"]
    assert log.position[0] == pytest.approx(log.position_reference[0], abs=0.02)
    said = log.info["outside"]
    assert said["autopilot"] == "PX4"
    assert said["periods"] > 300
    assert said["periods"] + said["missed"] == round(250.0 * log.time[-1]) + 1
    assert said["computing"]["p99_ms"] < 50.0


def test_the_law_holds_the_first_reference_until_tracking_starts(scenario):
    """The reference goes 0.2 m meanwhile, against which errors count."""
    planned = with_words(scenario(1.5), tracking_start=1.5)
    log, peer = flown(planned)
    assert log.status == "completed"
    assert np.linalg.norm(np.array(peer.path[-1]) - peer.place) < 0.03
    assert np.linalg.norm(log.position_reference[-1] - log.position_reference[0]) > 0.19


def test_the_law_follows_its_reference_from_the_start_of_tracking_on(scenario):
    at_once, later = (
        flown(scenario(1.5))[1],
        flown(with_words(scenario(1.5), tracking_start=0.5))[1],
    )
    ways = [
        np.linalg.norm(np.array(peer.path[-1]) - peer.place)
        for peer in (at_once, later)
    ]
    assert ways[1] > 0.5 * ways[0] > 0.05


def test_set_points_go_only_beside_heartbeats_and_end_with_the_flight(scenario):
    log, peer = flown(scenario(0.6))
    assert log.status == "completed"
    assert {"HEARTBEAT", "TIMESYNC", "SET_ATTITUDE_TARGET", "COMMAND_LONG"} <= {
        *peer.seen
    }
    last = len(peer.seen) - 1 - peer.seen[::-1].index("SET_ATTITUDE_TARGET")
    # hold is asked for after the last set point
    assert "COMMAND_LONG" in peer.seen[last:]
    gaps = np.diff(peer.setpoints)
    assert 100.0 < len(gaps) / (peer.setpoints[-1] - peer.setpoints[0]) <= 260.0


@pytest.mark.parametrize(
    ("fault", "status", "cause"),
    [
        ({"silent_at": 0.5}, "link_lost", "no estimate from the autopilot for 0.5 s"),
        pytest.param(
            {"nan_at": 0.5},
            "link_lost",
            "no estimate from the autopilot for 0.5 s",
            marks=pytest.mark.thorough,
        ),
        pytest.param(
            {"back_at": 0.5},
            "link_lost",
            "no estimate from the autopilot for 0.5 s",
            marks=pytest.mark.thorough,
        ),
        (
            {"ahead_at": 0.5},
            "link_lost",
            "the autopilot's clock went on by 1e+03 s between two estimates",
        ),
        ({"leaves_at": 0.6}, "taken_back", "PX4 left the mode that takes set points"),
        ({"disarms_at": 0.6}, "taken_back", "PX4 is no longer armed"),
    ],
)
def test_a_fault_ends_the_flight_with_its_log(scenario, fault, status, cause):
    log, peer = flown(scenario(3.0), **fault)
    assert (log.status, log.info["cause"]) == (status, cause)
    assert 0.3 < log.time[-1] < 1.5
    # a vehicle that left the mode is not asked to come back
    if fault.keys() & {"leaves_at"}:
        assert (peer.modes, peer.asked) == (["offboard", "left"], ["offboard"])
    # nothing is sent to a vehicle that is no longer ours
    count = len(peer.setpoints)
    assert count > 50
    assert peer.setpoints[-1] - peer.setpoints[0] < 2.0


def test_a_vehicle_that_its_pilot_has_just_taken_is_not_asked_to_hold(
    scenario, monkeypatch
):
    """The flight ends before it has noticed the pilot's mode."""
    monkeypatch.setattr(offboard, "MODE_KNOWN", 60.0)
    log, peer = flown(scenario(0.8), leaves_at=0.72)
    assert log.status == "completed"
    assert (peer.modes, peer.asked) == (["offboard", "left"], ["offboard"])


def test_a_mode_that_is_entered_without_an_answer_is_handed_back(scenario, monkeypatch):
    """It may follow the request at any time, so the vehicle is ours from the request
    on.
    """
    monkeypatch.setattr(offboard, "TAKE_OVER", 0.4)
    peers = []
    monkeypatch.setattr(
        StandIn,
        "__enter__",
        lambda self, enter=StandIn.__enter__: peers.append(self) or enter(self),
    )
    with pytest.raises(OffboardError, match="does not take set points"):
        flown(scenario(), mute=True)
    assert peers[0].asked[:1] == ["offboard"]
    assert peers[0].modes[:2] == ["offboard", "hold"]


def test_a_law_that_needs_an_accelerometer_flies_only_with_one(tmp_path):
    (tmp_path / "indi.toml").write_text(
        SCENARIO.format(duration=1.0).replace("rotors_sim_position", "indi")
    )
    planned = load_scenario(str(tmp_path / "indi.toml"))
    log, _ = flown(planned)
    assert log.status == "completed"
    log, peer = flown(planned, forceless_at=0.3)
    assert (log.status, log.info["cause"]) == (
        "link_lost",
        "no accelerometer reading from the autopilot for 0.5 s",
    )
    assert peer.modes == ["offboard", "hold"]
    words = (
        r"law 'indi' needs an accelerometer: raise the rate .* HIGHRES_IMU, or fly"
        r" another law; no reading came within"
    )
    with pytest.raises(OffboardError, match=words) as error:
        flown(
            planned, dataclasses.replace(SETTINGS, patience=0.4), forceless_at=-np.inf
        )
    assert "\n" not in str(error.value)


def test_an_autopilot_that_waits_for_mavlink_2_is_flown(scenario):
    """It begins in MAVLink 1, as PX4 does, and sends the message of its estimator only
    in MAVLink 2.
    """
    log, peer = flown(scenario(0.3), old="first")
    assert (log.status, peer.old) == ("completed", "")


def test_an_autopilot_that_stays_in_mavlink_1_is_named(scenario):
    settings = dataclasses.replace(SETTINGS, patience=0.4)
    words = r"sent nothing within 0.4 s \(only MAVLink 1 came: set MAV_PROTO_VER = 2"
    with pytest.raises(OffboardError, match=words) as error:
        flown(scenario(), settings, old="always")
    assert "\n" not in str(error.value)


def test_an_autopilot_that_stays_in_mavlink_1_flies_by_its_older_messages(scenario):
    log, _ = flown(scenario(0.3), old="always", odometry=False)
    assert log.status == "completed"


def test_a_law_that_needs_none_flies_without_an_accelerometer(scenario):
    log, _ = flown(scenario(0.5), forceless_at=-np.inf)
    assert log.status == "completed"


def test_a_vehicle_far_from_its_reference_is_handed_back(scenario):
    # far too much: it climbs
    settings = dataclasses.replace(SETTINGS, hover_share=0.9, leash=0.3)
    log, peer = flown(scenario(5.0), settings)
    assert log.status == "diverged"
    assert "m from its reference" in log.info["cause"]
    assert peer.modes == ["offboard", "hold"]


def test_the_law_begins_anew_until_its_commands_count(scenario, monkeypatch):
    """Before the take-over the autopilot does not obey: an integrator would wind up."""
    calls = []

    def noted(name, own):
        def note(self, *given):
            calls.append(name)
            return own(self, *given)

        return note

    for name in ("reset", "step"):
        monkeypatch.setattr(OutsideLaw, name, noted(name, getattr(OutsideLaw, name)))
    log, _ = flown(scenario(0.3))
    flying = len(calls) - log.info["outside"]["periods"]
    before = "".join(name[0] for name in calls[:flying])
    assert calls[flying:] == ["step"] * (len(calls) - flying)
    assert before.count("s") > 10
    assert "ss" not in before
    assert before.endswith("sr")


def test_a_law_that_stood_still_hands_back(scenario, monkeypatch):
    """What came meanwhile lies in the socket, so the estimates alone do not show it."""
    calls = iter(range(400))

    def stand(self, state, tick, reference, record=None, answer=OffboardFlight._answer):
        if record is not None and next(calls) == 100:
            time.sleep(0.7)
        return answer(self, state, tick, reference, record)

    monkeypatch.setattr(OffboardFlight, "_answer", stand)
    log, peer = flown(scenario(5.0))
    assert log.status == "link_lost"
    assert "this process stood still for " in log.info["cause"]
    assert peer.modes == ["offboard", "hold"]


def test_ctrl_c_hands_back(scenario, monkeypatch):
    calls = iter(range(200))

    def stop(self, state, tick, reference, record=None, answer=OffboardFlight._answer):
        if record is not None and next(calls) == 100:
            raise KeyboardInterrupt
        return answer(self, state, tick, reference, record)

    monkeypatch.setattr(OffboardFlight, "_answer", stop)
    log, peer = flown(scenario(5.0))
    assert (log.status, log.info["cause"]) == (
        "stopped",
        "stopped by Ctrl-C or a signal",
    )
    assert peer.modes == ["offboard", "hold"]


@pytest.mark.parametrize(
    ("state", "words"),
    [
        ({"refuses": True}, "PX4 does not take set points"),
        (
            {"armed": False},
            (
                "the vehicle was not armed, in the air and slow, in a mode of its own,"
                " within 0.4 s"
            ),
        ),
        (
            {"offboard": True},
            (
                "the vehicle was not armed, in the air and slow, in a mode of its own,"
                " within 0.4 s"
            ),
        ),
        (
            {"landed": True},
            (
                "the vehicle was not armed, in the air and slow, in a mode of its own,"
                " within 0.4 s"
            ),
        ),
        (
            {"secrets": ("MPC_THR_HOVER",)},
            "PX4 does not send its parameter MPC_THR_HOVER",
        ),
        ({"hover": 0.01}, "PX4's MPC_THR_HOVER = 0.01: must be from 0.05 to 0.95"),
        (
            {"autopilot": 3},
            (
                "ArduPilot's GUID_OPTIONS = 0: must include 8, so that thrust is not a"
                " climb rate"
            ),
        ),
        ({"autopilot": 8}, "no autopilot of PX4 or ArduPilot was heard"),
    ],
)
def test_a_vehicle_that_cannot_be_taken_over_is_left_alone(scenario, state, words):
    settings = dataclasses.replace(SETTINGS, patience=0.4)
    with pytest.raises(OffboardError, match=words) as error:
        flown(scenario(), settings, **state)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("autopilot", "wide", "numbers", "words"),
    [
        (
            12,
            None,
            {"MC_YAW_TQ_CUTOFF": 2.0},
            "PX4's MC_YAW_TQ_CUTOFF = 2: must be 0 or at least 8 Hz",
        ),
        (
            12,
            (18.0, 18.0, 6.0),
            {"MC_YAW_TQ_CUTOFF": 2.0},
            "PX4's MC_YAW_TQ_CUTOFF = 2: must be 0 or at least 8 Hz",
        ),
        (
            3,
            (18.0, 18.0, 6.0),
            {"ATC_RAT_YAW_FLTE": 2.5},
            "ArduPilot's ATC_RAT_YAW_FLTE = 2.5: must be 0 or at",
        ),
        (3, None, {}, "--rate-bandwidth: must be given for ArduPilot"),
    ],
)
def test_an_autopilot_whose_rate_loop_cannot_be_inverted_is_left_alone(
    scenario, autopilot, wide, numbers, words
):
    settings = dataclasses.replace(SETTINGS, rate_bandwidth=wide)
    with pytest.raises(OffboardError, match=words):
        flown(
            scenario(),
            settings,
            autopilot=autopilot,
            numbers={"GUID_OPTIONS": 8.0, **numbers},
        )


def test_a_port_that_reads_another_number_of_joints_is_named(scenario, monkeypatch):
    monkeypatch.setattr(NoJoints, "read", lambda self: JointReading(0.0, (0.1,), ()))
    with pytest.raises(
        JointPortError, match="--joints: 1 angles and 0 rates: must be 0 of each"
    ):
        flown(scenario())


def test_collections_and_scheduling_are_as_before_after_a_flight():
    before = os.sched_getscheduler(0)
    with contextlib.suppress(KeyboardInterrupt), offboard.real_time():
        assert not gc.isenabled()
        raise KeyboardInterrupt
    assert gc.isenabled()
    assert os.sched_getscheduler(0) == before


def test_real_time_ends_without_the_right_to_take_its_flag_back(monkeypatch):
    policies = [os.SCHED_OTHER]

    def schedule(_, policy, __):
        if policies[-1] & os.SCHED_RESET_ON_FORK and not (
            policy & os.SCHED_RESET_ON_FORK
        ):
            raise PermissionError
        policies.append(policy)

    monkeypatch.setattr(os, "sched_getscheduler", lambda _: policies[-1])
    monkeypatch.setattr(os, "sched_setscheduler", schedule)
    fast, usual = (
        policy | os.SCHED_RESET_ON_FORK for policy in (os.SCHED_FIFO, os.SCHED_OTHER)
    )
    for _ in range(2):
        with offboard.real_time():
            assert policies[-1] == fast
        assert gc.isenabled()
        assert policies[-1] == usual


@pytest.mark.parametrize("missing", [PermissionError, AttributeError])
def test_a_system_that_does_not_let_it_go_first_flies_as_well(monkeypatch, missing):
    def refuse(*_):
        raise missing

    monkeypatch.setattr(os, "sched_setscheduler", refuse, raising=False)
    with offboard.real_time():
        assert not gc.isenabled()
    assert gc.isenabled()


def test_attitude_and_position_apart_fly_as_well(scenario):
    log, _ = flown(scenario(1.0), odometry=False)
    assert log.status == "completed"
    assert np.linalg.norm(log.position - log.position_reference, axis=1).max() < 0.3


def test_px4s_gains_are_read_where_no_bandwidth_is_given(scenario):
    port = free_port()
    with StandIn(port) as peer:
        link = OffboardLink(f"mavlink://127.0.0.1:{port}")
        try:
            OffboardFlight(
                scenario(0.3),
                link,
                NoJoints(),
                dataclasses.replace(SETTINGS, rate_bandwidth=None),
            ).run()
        finally:
            link.close()
        assert link.parameters["MC_ROLLRATE_P"] == pytest.approx(0.15)
        assert peer.seen.count("PARAM_REQUEST_READ") >= 15


def test_a_silent_arm_ends_the_flight(scenario, tmp_path):
    planned = load_scenario("case3", duration=3.0)
    stop = threading.Event()
    server = JointServer(0, 2)

    def serve():
        begun = time.monotonic()
        while not stop.is_set() and time.monotonic() - begun < 1.2:
            server.exchange(0.0, (0.0, 0.0), (0.0, 0.0))
            time.sleep(0.002)

    thread = threading.Thread(target=serve, daemon=True)
    thread.start()
    port = free_port()
    arm, link = (
        UdpJoints("127.0.0.1", server.port, 2),
        OffboardLink(f"mavlink://127.0.0.1:{port}"),
    )
    try:
        with StandIn(port) as peer:
            log = OffboardFlight(planned, link, arm, SETTINGS).run()
    finally:
        stop.set()
        thread.join()
        for each in (arm, link, server):
            each.close()
    assert (log.status, log.info["cause"]) == (
        "link_lost",
        "no joint reading for 0.5 s",
    )
    assert peer.modes == ["offboard", "hold"]


@pytest.mark.parametrize(
    ("name", "controller", "words"),
    [
        ("peg_in_hole", None, "must have no phases that wait"),
        ("case1", "px4", "must be a law"),
    ],
)
def test_a_scenario_that_needs_a_simulator_is_refused(name, controller, words):
    scenario = load_scenario(name, controller=controller)
    with pytest.raises(ScenarioError, match=words):
        require_outside(scenario)


@pytest.mark.parametrize(
    ("path", "refused"),
    [
        ("model.payload.mass", True),
        ("controller.gains.position.z", True),
        ("plant.base.mass", False),
    ],
)
def test_changes_of_law_and_model_in_flight_are_refused_those_of_the_plant_are_not(
    path, refused
):
    scenario = dataclasses.replace(
        load_scenario("case3"), changes=(Change(at=1.0, path=path, value=0.9),)
    )
    if not refused:
        return require_outside(scenario)
    with pytest.raises(
        ScenarioError, match=f"changes: {path} at 1 s: must be left out"
    ):
        require_outside(scenario)


def test_a_law_that_reads_a_force_sensor_is_refused():
    begun, soft = (
        load_scenario("case3"),
        {
            "mass": [1.0] * 3,
            "damping": [10.0] * 3,
            "stiffness": [0.0] * 3,
        },
    )
    law = make_centroidal(
        begun.controller.par.model, mode="tip", admittance=soft, force_sensor=True
    )
    with pytest.raises(ScenarioError, match="must leave force_sensor out"):
        require_outside(begun.with_controller(law))


def test_a_flight_holds_no_port_after_its_end(scenario):
    port = free_port()
    with StandIn(port):
        link = OffboardLink(f"mavlink://127.0.0.1:{port}")
        OffboardFlight(scenario(0.2), link, NoJoints(), SETTINGS).run()
        link.close()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", port))


class LateJoints(NoJoints):
    """Joint port whose first reading comes some reads after the autopilot's first
    heartbeat.
    """

    def __init__(self, link, reads):
        self.link, self.left = link, reads

    def read(self):
        self.left -= self.link.has_autopilot
        return super().read() if self.left < 0 else None


@pytest.mark.parametrize(
    ("reads", "silent"),
    [(5, "--link: the autopilot's estimator"), (10**9, "--joints: the arm")],
)
def test_the_silent_one_of_estimator_and_arm_is_named(scenario, reads, silent):
    """The arm is not blamed for an estimator that says nothing after the arm's first
    reading came late.
    """
    port = free_port()
    link = OffboardLink(f"mavlink://127.0.0.1:{port}")
    try:
        flight = OffboardFlight(scenario(1.0), link, LateJoints(link, reads), SETTINGS)
        with (
            StandIn(port, hover=0.37, nan_at=-np.inf),
            pytest.raises(OffboardError, match=f"^{silent} sent nothing"),
        ):
            flight.run()
    finally:
        link.close()
