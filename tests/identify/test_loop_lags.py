"""Delays and lags that were planted are found again, with honest intervals; a flight
that cannot tell says so.
"""

from __future__ import annotations

import dataclasses
import tomllib
from types import SimpleNamespace

import numpy as np
import pytest
from planted_vehicles import lagging_drives, with_slower_motors

import skyarm
from skyarm.algebra import Sym3
from skyarm.dynamics.actuators.drive import LaggedTorque
from skyarm.dynamics.actuators.servo import PositionServo
from skyarm.flight_data.flight_data import Channel, FlightData
from skyarm.identify.lag_report import _solid, lag_tables
from skyarm.identify.loop_lags import (
    Estimated,
    Lag,
    LoopLags,
    _control_period,
    _fit,
    _lag,
    _vary,
    loop_lags,
)
from skyarm.identify.unknowns import Unknown
from skyarm.identify.windows import Held, lagging
from skyarm.log.flight_log import rows_of
from skyarm.scenario.scenario_record import JointDrive
from skyarm.studies.tune.excitation import of_vehicle, tuning_flight
from skyarm.vehicle.vehicle_records import MountedDrive

pytest.importorskip("scipy", reason="needs the extra 'identify'")

PERIOD = 0.005
VEHICLE = skyarm.load_vehicle("hummingbird_arm2_rotors")
DELAY, SLOWER, DRIVE = 0.012, 1.5, 0.02
"""s; of the motors over what is believed; s, of the joints' drives."""


def flight(seconds, late=DELAY, **changes):
    """A noisy flight with late commands, slow motors and, without other drives, slow
    ones of the joints.
    """
    base = tuning_flight(of_vehicle(VEHICLE, "paper_ct"))
    plant = dataclasses.replace(base.plant, vehicle=with_slower_motors(VEHICLE, SLOWER))
    changes = {"drives": lagging_drives(VEHICLE, DRIVE), "plant": plant, **changes}
    delays = skyarm.Delays(measurement=PERIOD, command=late)
    return skyarm.run(
        dataclasses.replace(base, duration=seconds, delays=delays, **changes)
    )


@pytest.fixture(scope="module")
def flown():
    """Two seconds of it."""
    return flight(2.0)


@pytest.fixture(scope="module")
def found(flown):
    return loop_lags(flown, VEHICLE)


def near(estimated: Estimated, truth: float, within: float) -> bool:
    return abs(estimated.value - truth) <= within


def test_what_was_planted_in_a_flight_is_found(found):
    """A log without noise and all else known: to 0.1 ms and 0.5 %, and in every
    interval.
    """
    rotors, believed = found.rotors, VEHICLE.rotors[0]
    assert rotors.is_known
    assert near(rotors.delay, DELAY, 1e-4)
    assert rotors.factor == pytest.approx((SLOWER, SLOWER), rel=0.005)
    assert near(rotors.up, SLOWER * believed.time_constant_up, 1e-4)
    assert near(rotors.down, SLOWER * believed.time_constant_down, 1e-4)
    # in between, the rates count: the mean that a small swing meets
    rate = 0.5 / rotors.up.value + 0.5 / rotors.down.value
    assert rotors.together.value == pytest.approx(rotors.delay.value + 1.0 / rate)
    assert rotors.explained > 0.9
    # no interval is narrower than what sampling leaves
    assert all(
        each.high - each.value > 0.1 * PERIOD
        for each in (rotors.together, rotors.delay, rotors.up)
    )
    for joint in found.joints:
        assert joint.is_known
        assert joint.apart
        assert joint.explained > 0.9
        assert near(joint.delay, DELAY, 1e-4)
        assert near(joint.up, DRIVE, 1e-4)
        assert near(joint.together, DELAY + DRIVE, 1e-4)


def test_the_lines_to_paste_fly_the_scenario_that_was_found(found):
    text = lag_tables(found, measured=0.005)
    tables = tomllib.loads(text)
    assert tables["delays"]["command"] == pytest.approx(DELAY, abs=0.0015)
    # 12 ms and the age of 5 ms, in whole control periods
    assert (
        "# controller.delay = 0.015\n" in text,
        "# controller.delay_periods = 3\n" in text,
    ) == (True, True)
    document = {
        "schema": 1,
        "name": "found",
        "duration": 0.1,
        "plant": {"vehicle": "hummingbird_arm2_rotors", **tables["plant"]},
        "controller": {"law": "centroidal", "mode": "tip", "delay": 0.015},
        "delays": tables["delays"],
        "reference": {
            "base": {"kind": "hover", "position": [0.0, 0.0, 1.0]},
            "joints": [0.0, 0.0],
        },
    }
    scenario = skyarm.scenario_from(document)
    assert [each.drive.time_constant for each in scenario.drives] == pytest.approx(
        [DRIVE, DRIVE], rel=0.15
    )
    assert "time_constant_up" in text
    # a lag that is none asks for no drive
    prompt = Estimated(value=5e-4, low=1e-4, high=2e-3)
    joints = tuple(
        dataclasses.replace(each, up=prompt, down=prompt, apart=True)
        for each in found.joints
    )
    assert "[plant.drives" in text
    assert "[plant.drives" not in lag_tables(dataclasses.replace(found, joints=joints))


def test_a_log_that_cannot_tell_says_so(flown):
    held = {
        name: np.full_like(flown[name], 500.0) for name in ("rotor_commands", "efforts")
    }
    still = loop_lags(dataclasses.replace(flown, **held), VEHICLE)
    assert {each.reason for each in (still.rotors, *still.joints)} == {
        "the commands hardly change"
    }
    assert lag_tables(still) == ""


@pytest.mark.thorough
def test_commands_of_another_flight_explain_nothing(flown):
    other = 500.0 + 20.0 * np.random.default_rng(3).standard_normal(
        flown.rotor_commands.shape
    )
    strange = loop_lags(
        dataclasses.replace(flown, rotor_commands=other), VEHICLE
    ).rotors
    assert not strange.is_known
    assert strange.explained < 0.5
    nothing = LoopLags(
        period=PERIOD, seconds=2.0, rotors=strange, joints=(), left_out={}
    )
    assert lag_tables(nothing) == ""


def test_a_planted_delay_is_that_of_a_cross_correlation():
    """An independent oracle: where commands of a joint and what came of them correlate
    most; drives without a lag.
    """
    from scipy.signal import correlate, correlation_lags

    late = 0.023
    log = flight(2.0, late, drives=())
    accelerations = np.diff(log.joint_rates[:, 1], n=2)
    commands = np.diff(log.efforts[:, 1])
    correlation = correlate(accelerations, commands[: len(accelerations)])
    lags = correlation_lags(len(accelerations), len(accelerations))
    assert lags[
        np.argmax(np.where(lags >= 0, correlation, 0.0))
    ] * PERIOD == pytest.approx(late, abs=0.51 * PERIOD)
    found = loop_lags(log, VEHICLE)
    for each in found.joints:
        assert near(each.together, late, 1e-4)
        # a lag that is none has an interval that says so
        assert each.up.low == 0.0
        assert each.up.high < 0.002
    assert near(found.rotors.delay, late, 1e-4)
    assert "plant.drives" not in lag_tables(found)


@pytest.mark.parametrize("lag", [0.0004, 0.012])
def test_efforts_behind_a_lag_are_those_of_small_steps(lag):
    """Impulse and first moment of each step against Euler's method in steps of 2 us;
    settled at the first command.
    """
    rng, fine = np.random.default_rng(0), 2500
    setpoints = rng.standard_normal((21, 1))
    late = np.concatenate([[0.0], rng.integers(1, fine, 19) / fine * PERIOD])
    held = Held(setpoints[:-1], setpoints[1:], late)
    got, flat = lagging(held, lag, PERIOD), lagging(held, lag, PERIOD, flat=True)
    assert got.late == pytest.approx(0.5 * PERIOD)
    assert np.array_equal(flat.before, flat.after)
    value, instants = setpoints[0, 0], (np.arange(fine) + 0.5) / fine
    for k, switch in enumerate(np.rint(late / PERIOD * fine).astype(int)):
        rows = np.empty(fine)
        for i in range(fine):
            before, value = (
                value,
                value + PERIOD / fine / lag * (setpoints[k + (i >= switch), 0] - value),
            )
            rows[i] = 0.5 * (before + value)
        halves = np.where(instants < 0.5, got.before[k, 0], got.after[k, 0])
        assert halves.mean() == pytest.approx(rows.mean(), abs=0.002)
        assert flat.after[k, 0] == pytest.approx(rows.mean(), abs=0.002)
        assert (instants * halves).mean() == pytest.approx(
            (instants * rows).mean(), abs=0.002
        )


def test_efforts_behind_a_drive_of_the_engine_are_its_own():
    """Step for step, of setpoints that are held for the whole of it."""
    setpoints, drive = (
        np.random.default_rng(0).standard_normal(30),
        LaggedTorque(time_constant=0.012),
    )
    held = Held(setpoints[:, None], setpoints[:, None], np.zeros(30))
    memory, wanted = drive.begin(0.0, setpoints[0], PERIOD), []
    for setpoint in setpoints:
        memory = drive.advance(memory, setpoint, 0.0, 0.0, PERIOD)
        wanted.append(drive.effort(memory, setpoint, 0.0, 0.0))
    assert lagging(held, 0.012, PERIOD, flat=True).after[:, 0] == pytest.approx(
        wanted, abs=1e-12
    )


def modelled(vehicle, *, links=1.0, inertia=(1.0, 1.0, 1.0), thrust=1.0, damping=1.0):
    """A model that has other masses of links, inertias, thrust and friction than the
    vehicle.
    """
    base = vehicle.base.inertia
    moments = {
        name: getattr(base, name) * times
        for name, times in zip(("xx", "yy", "zz"), inertia, strict=True)
    }

    def heavier(link):
        body, more = (
            link.body,
            Sym3(*(links * each for each in link.body.inertia.entries)),
        )
        joint = dataclasses.replace(link.joint, damping=damping * link.joint.damping)
        return dataclasses.replace(
            link,
            body=dataclasses.replace(body, mass=links * body.mass, inertia=more),
            joint=joint,
        )

    rotors = [
        dataclasses.replace(
            each,
            thrust_coefficient=thrust * each.thrust_coefficient,
            drag_coefficient=0.0,
        )
        for each in vehicle.rotors
    ]
    return dataclasses.replace(
        vehicle,
        base=dataclasses.replace(
            vehicle.base, inertia=dataclasses.replace(base, **moments)
        ),
        links=tuple(map(heavier, vehicle.links)),
        rotors=tuple(rotors),
    )


@pytest.mark.thorough
@pytest.mark.parametrize(
    "wrong",
    [{"links": 1.25}, {"inertia": (1.2, 0.9, 1.1), "damping": 3.0, "thrust": 0.9}],
    ids=str,
)
def test_a_model_with_wrong_masses_and_strengths_finds_the_same_lags(flown, wrong):
    """Strengths and slow efforts are found beside the lags; what the model's errors
    leave is below 1 ms.
    """
    found = loop_lags(flown, modelled(VEHICLE, **wrong))
    assert found.rotors.is_known
    assert near(found.rotors.delay, DELAY, 0.001)
    assert found.rotors.factor == pytest.approx((SLOWER, SLOWER), rel=0.08)
    for joint in found.joints:
        assert joint.is_known
        assert near(joint.together, DELAY + DRIVE, 0.001)


@pytest.mark.thorough
def test_of_a_short_flight_rotors_that_are_believed_slow_are_found(flown):
    """Their speeds follow from a part of the flight only, which is shorter than eight
    of the believed constants.
    """
    short = rows_of(flown, slice(0, 240))
    found = loop_lags(short, with_slower_motors(VEHICLE, 8.0)).rotors
    assert found.is_known
    assert found.factor == pytest.approx((SLOWER / 8.0, SLOWER / 8.0), rel=0.05)
    assert near(found.delay, DELAY, 5e-4)


@pytest.mark.thorough
def test_a_servo_of_the_flight_flies_in_the_model_and_its_joint_is_left_out():
    """The other joint and the rotors are found as well as without it, though the
    vehicle at hand has no servo.
    """
    servo = PositionServo(inertia=0.001, stiffness=2.0, damping=0.09)
    drives = (
        JointDrive(joint="joint1", drive=servo),
        *lagging_drives(VEHICLE, DRIVE)[1:],
    )
    log = flight(2.0, drives=drives)
    found = loop_lags(log, VEHICLE)
    assert found.left_out == {"joint1": "its drive takes a setpoint, rad or m"}
    assert [each.name for each in found.joints] == ["joint2"]
    assert near(found.joints[0].together, DELAY + DRIVE, 2e-4)
    assert near(found.rotors.delay, DELAY, 2e-4)
    assert found.rotors.factor == pytest.approx((SLOWER, SLOWER), rel=0.01)


def test_a_servo_of_the_flight_is_flown_with_and_the_other_drives_are_fitted(
    flown, monkeypatch
):
    """Joint 1 has a servo in the log alone. Of the rotors, the rise is found half as
    slow again and the fall twice.
    """
    servo, fitted = (
        PositionServo(inertia=0.001, stiffness=2.0, damping=0.09),
        SimpleNamespace(),
    )
    flying = {"joint1": servo, "joint2": LaggedTorque(time_constant=DRIVE)}
    up, down = (
        1.5 * VEHICLE.rotors[0].time_constant_up,
        2.0 * VEHICLE.rotors[0].time_constant_down,
    )

    def fit(flight, start, driven, searched, known, gravity):
        fitted.__dict__.update(
            flight=flight, start=start, driven=driven, searched=searched, known=known
        )
        return "errors", "fit"

    def lag(name, searched, errors, fit, period):
        assert (errors, fit) == ("errors", "fit")
        values = {"together": 0.03, "delay": DELAY, "up": up, "down": down}
        return Lag(
            name=name,
            explained=1.0,
            **{part: Estimated.of(each, 0.001) for part, each in values.items()},
        )

    module = "skyarm.identify.loop_lags"
    for name, each in (
        ("drives_of", lambda info: flying),
        ("setpoints_of", lambda info: {"joint1": "rad or m"}),
    ):
        monkeypatch.setattr(f"{module}.{name}", each)
    for name, each in (("_fit", fit), ("_lag", lag)):
        monkeypatch.setattr(f"{module}.{name}", each)
    # what is believed is that of the first rotor
    slow = [
        (
            dataclasses.replace(each, time_constant_up=0.05, time_constant_down=0.06)
            if i
            else each
        )
        for i, each in enumerate(VEHICLE.rotors)
    ]
    found = loop_lags(flown, dataclasses.replace(VEHICLE, rotors=tuple(slow)))
    begins = {each.name: each.start for each in fitted.searched["rotors"]}
    assert begins["rotors.time_constant_up"] == VEHICLE.rotors[0].time_constant_up
    assert begins["rotors.time_constant_down"] == VEHICLE.rotors[0].time_constant_down
    assert fitted.start.drives == (MountedDrive(name="joint1", drive=servo),)
    assert fitted.driven == [False, True]
    assert list(fitted.searched) == ["joint2", "rotors"]
    assert fitted.known["drives.joint2.hold"] == fitted.known["setpoint_hold"] == 1.0
    assert found.rotors.factor == pytest.approx((1.5, 2.0))
    assert [each.name for each in found.joints] == ["joint2"]
    assert found.left_out == {"joint1": "its drive takes a setpoint, rad or m"}
    assert (found.period, found.seconds) == pytest.approx((PERIOD, 2.0), abs=PERIOD)


NAMES = ["delay", "rotors.time_constant_up", "rotors.time_constant_down", "thrust"]


def lag_of(
    delay=0.012,
    up=0.02,
    down=0.03,
    halves=(1e-3, 2e-3, 0.05, 0.1),
    explained=(0.9, 0.6, 0.9),
):
    """Lag of rotors from a search whose logarithms of time constants stand behind
    another number, and its slopes.
    """
    order, rows = [3, 1, 2, 0], []
    names = [NAMES[i] for i in order]
    values = np.array([7.0, np.log(up), np.log(down), delay])

    def half_widths(given):
        rows.append(given)
        return np.array([halves[0], halves[1], up * halves[2], down * halves[3]])

    errors = SimpleNamespace(
        names=names,
        values=lambda each: np.append(each[:1], [*np.exp(each[1:3]), each[3]]),
    )
    fit = SimpleNamespace(values=values, half_widths=half_widths)
    shares = dict(
        zip(
            ("rate.x", "rate.y", "rate.z", "arm.position"),
            (*explained, 0.001),
            strict=True,
        )
    )
    searched = [SimpleNamespace(name=each) for each in NAMES[:3]]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            "skyarm.identify.loop_lags.explained_shares", lambda *_: (shares, {})
        )
        return _lag("rotors", searched, errors, fit, PERIOD), rows[0]


def test_a_lag_is_the_dead_time_and_the_time_constants_and_what_a_small_swing_meets():
    """The swing is up and down in turn at the mean rate; slopes are those of finite
    differences of the logarithms.
    """
    found, rows = lag_of()
    swing = 2.0 / (1.0 / 0.02 + 1.0 / 0.03)
    values = [
        each.value for each in (found.together, found.delay, found.up, found.down)
    ]
    assert values == pytest.approx([0.012 + swing, 0.012, 0.02, 0.03])
    assert found.explained == pytest.approx(0.8)
    assert (found.name, found.reason, found.apart) == ("rotors", "", True)

    def numbers(searched):
        _, up, down, delay = searched
        swing = 2.0 / (np.exp(-up) + np.exp(-down))
        return np.array([delay + swing, delay, np.exp(up), np.exp(down)])

    at, step = np.array([7.0, np.log(0.02), np.log(0.03), 0.012]), 1e-6
    slopes = np.stack(
        [
            (numbers(at + step * one) - numbers(at - step * one)) / (2.0 * step)
            for one in np.eye(4)
        ],
        1,
    )
    np.testing.assert_allclose(rows, slopes, atol=1e-9)
    # a tenth of a period and a hundredth of the time itself are always left
    least = 0.1 * PERIOD + 0.01 * (0.012 + swing)
    halves = [
        each.high - each.value
        for each in (found.together, found.delay, found.up, found.down)
    ]
    assert halves == pytest.approx(np.hypot([1e-3, 2e-3, 1e-3, 3e-3], least))


@pytest.mark.parametrize(
    ("changed", "reason"),
    [
        ({"delay": 0.08}, ""),
        ({"delay": 0.0801}, "the best of them lies at the end of what is looked for"),
        ({"up": 0.49, "halves": (1e-3,) * 4}, ""),
        (
            {"up": 0.51, "halves": (1e-3,) * 4},
            "the best of them lies at the end of what is looked for",
        ),
        (
            {"down": 0.51, "halves": (1e-3,) * 4},
            "the best of them lies at the end of what is looked for",
        ),
        ({"explained": (0.021, 0.021, 0.021)}, ""),
        (
            {"explained": (0.019, 0.019, 0.019)},
            "the commands explain 1.9% of the motion, under 2%",
        ),
        ({"halves": (0.0099, 2e-3, 0.05, 0.1)}, ""),
        (
            {"halves": (0.0101, 2e-3, 0.05, 0.1)},
            "delay and lag together are known to 10 ms only, over 10 ms",
        ),
        (
            {"halves": (np.inf, 2e-3, 0.05, 0.1)},
            "the commands do not show in the motion",
        ),
        (
            {"halves": (1e-3, 2e-3, 0.05, np.nan)},
            "the commands do not show in the motion",
        ),
    ],
)
def test_a_flight_that_does_not_tell_a_lag_says_why(changed, reason):
    found, _ = lag_of(**changed)
    assert found.reason == reason
    assert found.is_known == (not reason)


@pytest.mark.parametrize(("half", "apart"), [(3.8e-3, True), (4.1e-3, False)])
def test_a_delay_that_is_known_to_four_milliseconds_is_apart_from_its_lag(half, apart):
    assert lag_of(halves=(1e-3, half, 0.05, 0.1))[0].apart is apart


def test_commands_vary_if_their_steps_do():
    """By a hundred-thousandth of their size from period to period: neither a constant
    nor an even rise varies.
    """
    time = np.arange(400.0)[:, None]
    assert not _vary(np.full((400, 4), 500.0))
    assert not _vary(500.0 + 0.1 * time)
    wave = np.where(time % 2, 1.0, -1.0)
    assert _vary(500.0 + 0.0026 * wave)
    assert not _vary(500.0 + 0.0024 * wave)


class _StopError(Exception):
    """Ends a search once it was asked."""


def test_of_joints_that_hold_a_setpoint_those_with_a_servo_are_flown_with_it(
    monkeypatch,
):
    """Joint 1 has a servo and joint 2 a drive that takes efforts; gravity and the known
    numbers go to the errors.
    """
    servo = PositionServo(inertia=0.001, stiffness=2.0, damping=0.09)
    start = dataclasses.replace(
        VEHICLE, drives=(MountedDrive(name="joint1", drive=servo),)
    )
    asked, module = SimpleNamespace(), "skyarm.identify.loop_lags"
    channel = Channel(
        time=PERIOD * np.arange(200), values=np.zeros((200, 3)), source=""
    )
    flight = FlightData(name="log", file="", channels={"gyro": channel})

    def usual(vehicle, *, driven, servoed, **_):
        asked.servoed = servoed
        names = (
            "rotors.thrust_coefficient",
            "base.com.x",
            "base.second_moment.x",
            "links.link1.mass",
            "drift",
        )
        return [Unknown(name=each, unit="", start=1.0, spread=1.0) for each in names]

    def errors(windows, start, unknowns, known, driven, servoed, gravity):
        asked.__dict__.update(
            names=[each.name for each in unknowns],
            known=known,
            driven=driven,
            gravity=gravity,
        )
        raise _StopError

    fakes = {
        "on_clock": lambda *_, **__: None,
        "clock_step": lambda *_: PERIOD,
        "ClockedWindows": lambda *_: None,
    }
    for name, each in {**fakes, "unknowns_of": usual, "WindowErrors": errors}.items():
        monkeypatch.setattr(f"{module}.{name}", each)
    searched = {"rotors": [Unknown(name="delay", unit="s", start=0.0, spread=0.05)]}
    for driven, servoed in (
        ([False, True], [True, False]),
        ([False, False], [True, False]),
        ([True, True], [False] * 2),
    ):
        with pytest.raises(_StopError):
            _fit(flight, start, driven, searched, {"setpoint_hold": 1.0}, 9.7)
        assert (asked.servoed, asked.driven) == (servoed, driven)
    assert (asked.known, asked.gravity) == ({"setpoint_hold": 1.0}, 9.7)
    # beside the lags what answers to commands, and the gyro's bias; not what a delay
    # has nothing to do with
    modelled = ["rotors.thrust_coefficient", "base.second_moment.x", "links.link1.mass"]
    assert asked.names == [
        "delay",
        *modelled,
        "gyro_bias.x",
        "gyro_bias.y",
        "gyro_bias.z",
    ]


def test_an_interval_reaches_as_far_to_both_sides_but_not_below_what_is_possible():
    assert Estimated.of(0.03, 0.01) == Estimated(
        value=0.03, low=pytest.approx(0.02), high=pytest.approx(0.04)
    )
    assert Estimated.of(0.03, 0.05) == Estimated(
        value=0.03, low=0.0, high=pytest.approx(0.08)
    )
    assert Estimated.of(-0.03, 0.05) == Estimated(
        value=0.0, low=0.0, high=pytest.approx(0.02)
    )
    assert Estimated.of(-0.03, 0.01) == Estimated(value=0.0, low=0.0, high=0.0)


@pytest.mark.parametrize(("late", "even"), [(0.00996, True), (0.01004, False)])
def test_instants_may_be_off_an_even_clock_by_a_hundredth_of_a_period(
    flown, late, even
):
    time = PERIOD * np.arange(len(flown.time))
    time[200:] += late * PERIOD
    log = dataclasses.replace(flown, time=time)
    if even:
        assert _control_period(log, VEHICLE) == pytest.approx(PERIOD)
    else:
        with pytest.raises(ValueError, match="time: must be evenly spaced"):
            _control_period(log, VEHICLE)


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        (
            lambda log: {"rotor_commands": log.rotor_commands[:, :3]},
            "rotor_commands: the log has 3",
        ),
        (lambda log: {"joints": log.joints[:, :1]}, "joints: the log has 1"),
        (lambda log: {"time": log.time**2}, "time: must be evenly spaced"),
        (
            lambda log: {"time": 0.1 * log.time},
            r"^time: 0\.1995 s are too short; at least 1 s of flight are needed$",
        ),
        (lambda log: {"rate": log.rate * np.nan}, "rate: must be finite"),
        (lambda log: {"efforts": log.efforts * np.nan}, "efforts: must be finite"),
        (
            lambda log: {"quaternion": log.quaternion * 0.0},
            "quaternion: must be of unit length",
        ),
    ],
)
def test_a_log_that_does_not_fit_is_refused_in_a_line(flown, changed, message):
    with pytest.raises(ValueError, match=message):
        loop_lags(dataclasses.replace(flown, **changed(flown)), VEHICLE)


def test_bodies_of_a_planar_model_have_their_largest_moment_about_every_axis():
    planar, real = (
        skyarm.load_vehicle(name)
        for name in ("hummingbird_arm2", "hummingbird_arm2_rotors")
    )
    assert planar.planar
    found = _solid(planar)
    assert not found.planar
    for one, other in zip(found.links, planar.links, strict=True):
        inertia, flat = one.body.inertia, other.body.inertia
        assert (
            inertia.xx
            == inertia.yy
            == inertia.zz
            == max(flat.xx, flat.yy, flat.zz)
            > 0.0
        )
        assert (inertia.xy, inertia.xz, inertia.yz) == (0.0, 0.0, 0.0)
        assert (one.body.mass, one.body.com) == (other.body.mass, other.body.com)
    assert _solid(real) == real
