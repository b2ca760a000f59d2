"""Metrics counted on the fly against those of the log, which share no code: NumPy over
the whole flight.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from skyarm.algebra import Quaternion, Vec3
from skyarm.dynamics import State
from skyarm.dynamics.actuators import Command
from skyarm.log.metrics.accumulate import (
    advance_totals,
    first_totals,
    roll_and_pitch,
    tilt,
)
from skyarm.log.metrics.metric import MetricGoal, MetricInstant
from skyarm.log.metrics.metric_catalogue import (
    GRASPS,
    GROUPS,
    TEAMS,
    measures,
    metric_names,
    required_totals,
    values,
)
from skyarm.log.metrics.score import score
from skyarm.log.metrics.windows import Windows
from skyarm.log.tip_positions import level_tip
from skyarm.reference import Reference
from skyarm.scenario.numbers import with_numbers
from skyarm.scenario.scenario_file import scenario_from
from skyarm.simulate import Window, run
from skyarm.simulate.batch import Batch
from skyarm.simulate.tip_and_goal import goal_of
from skyarm.vehicle.vehicle_files import load_vehicle
from support import logs as of_log
from support.flights import document
from support.logs import Errors

WINDOWS = Windows(
    steady=Window(0.8, 1.6),
    transient=Window(0.1, 0.7),
    gust=Window(0.3, 1.5),
    hover=Window(0.0, 0.25),
    holds=(Window(0.2, 0.4), Window(1.0, 1.1)),
    last=0.5,
)
NAMES = tuple(
    name for name in measures(2) if name not in (*GROUPS["contact"], *GRASPS, *TEAMS)
)
"""Those of contact, of grasps and of teams have tests of their own."""


def flight(**changes):
    """A moving, gusty, tilted flight whose joints swing and whose reference changes
    between its samples.
    """
    return scenario_from(
        document(
            "case2_gust",
            **{
                "duration": 2.0,
                "initial": {
                    "quaternion_wxyz": [0.96, 0.28, 0.0, 0.0],
                    "joints": [0.3, -0.2],
                },
                "environment__ground": False,
                "environment__wind__gust__start": 0.5,
                "reference__base": {
                    "kind": "circle",
                    "radius": 0.2,
                    "frequency_hz": 0.4,
                    "center": [0.0, 0.0, 5.0],
                },
                "reference__yaw": {
                    "kind": "sine",
                    "amplitude": 0.4,
                    "frequency_hz": 0.7,
                },
                "reference__joints": [
                    {"kind": "sine", "amplitude": 0.3, "frequency_hz": 1.0},
                    0.1,
                ],
                "sensors": {"rate": 0.01},
                **changes,
            },
        ),
        "test",
    )


@pytest.fixture(scope="module")
def pairs(tmp_path_factory):
    """Metrics on the fly, and the log, of a flight to its end, and of one that meets
    the ground in the gust.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SKYARM_CACHE", str(tmp_path_factory.mktemp("cache")))
        found = {}
        for word, changes in (
            ("whole", {}),
            (
                "early",
                {
                    "environment__ground": True,
                    "initial": {"velocity": [0.0, 0.0, -12.0]},
                },
            ),
        ):
            scenario = flight(**changes)
            batch = Batch(
                scenario,
                metrics=("all", "all_continuous"),
                windows=WINDOWS,
                bit_exact=True,
            )
            found[word] = (
                {n: float(v[0]) for n, v in batch.fly({}).metrics.items()},
                run(scenario),
            )
    assert found["whole"][1].status == "completed"
    assert found["early"][1].status == "ground"
    assert 0.85 < found["early"][1].info["end_time"] < 1.1
    return found


def expected(log):
    """Every metric from the log."""
    found = {}
    for suffix, errors in (
        ("", Errors.held(log)),
        ("_continuous", Errors.continuous(log)),
    ):
        paper = of_log.constant_wind(log, errors, WINDOWS.steady, WINDOWS.transient)
        paper |= of_log.motion(log, WINDOWS.steady)
        paper |= of_log.steady_and_transient(
            log, errors, WINDOWS.steady, WINDOWS.transient
        )
        paper |= of_log.calmness(log, errors, WINDOWS.steady) | of_log.last(
            log, errors, WINDOWS.last
        )
        gusty = of_log.gust(log, errors, WINDOWS.gust) | {
            "ee_peak_x": of_log.tool_peak(log, errors, WINDOWS.gust)
        }
        paper |= {f"gust_{name}": value for name, value in gusty.items()}
        paper["x_error_max"] = _largest_along_x(log, suffix)
        paper["ee_time_outside"] = _time_away(log, suffix)
        paper["held_position_error"] = of_log.held_position_error(
            log, errors, WINDOWS.holds
        )
        found |= {f"{name}{suffix}": value for name, value in paper.items()}
    # the vehicle's file: 838 rad/s; a law that cuts to the model's limits sends just
    # these
    efforts = [
        link.joint.effort_limit
        for link in load_vehicle("hummingbird_arm2_rotors").links
    ]
    found |= of_log.saturation(
        log, WINDOWS.steady, np.full(4, 838.0), np.array(efforts)
    )
    found["rotor_jitter_mean"] = of_log.rotor_jitter_mean(log, WINDOWS.steady)
    # no governor flies here: no lag, where there are instants to look at
    steady = (log.time >= WINDOWS.steady.start) & (log.time < WINDOWS.steady.stop)
    found |= {
        "reference_lag_mean": 0.0 if steady.any() else float("nan"),
        "reference_lag_max": 0.0,
        "phases_done": 0.0,
    }
    return found | {"hover_offset": of_log.hover_offset(log, WINDOWS.hover)}


def _time_away(log, suffix):
    """Control periods in which the tip is over 5 cm from where it should be, s."""
    goal = log.tool_reference if suffix else log.tool_held
    inside = (log.time >= WINDOWS.steady.start) & (log.time < WINDOWS.steady.stop)
    return float(
        np.sum(np.sum((log.tool - goal)[inside] ** 2, axis=1) > 0.05**2) / 200.0
    )


def _largest_along_x(log, suffix):
    """Position against reference along x, its largest value with its sign."""
    goal = log.position_reference if suffix else log.position_held
    inside = (log.time >= WINDOWS.steady.start) & (log.time < WINDOWS.steady.stop)
    return float((log.position - goal)[inside, 0].max())


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("word", ["whole", "early"])
def test_a_metric_counted_on_the_fly_is_that_of_the_log(pairs, word, name):
    """Sums of 40 to 400 numbers in another order: 1e-12 relative."""
    ours, log = pairs[word]
    wanted = expected(log)[name]
    none = ("reference_lag", "phases", "rotor_saturation", "joint_saturation")
    assert wanted != 0.0 or name.startswith(none), (
        "nothing lags without a governor, and the flight is gentle"
    )
    if word == "early" and "last" in name:
        assert math.isnan(wanted), "it ended before the last seconds"
    assert ours[name] == pytest.approx(wanted, rel=1e-12, nan_ok=True)


LIMITED = (
    "plant.vehicle.rotors.0.max_speed",
    "plant.vehicle.links.0.joint.effort_limit",
)


def test_lanes_with_lower_limits_are_at_them_as_often_as_their_logs():
    """Limits are numbers of a lane: a rotor's, a joint's, none; each share is a count
    over the log's commands.
    """
    scenario, names = flight(duration=1.6), ("rotor_saturation", "joint_saturation")
    lanes = [(480.0, 0.5), (838.0, 0.03), (838.0, 0.5)]
    columns = dict(zip(LIMITED, np.transpose(lanes), strict=True))
    batch = Batch(scenario, LIMITED, metrics=names, windows=WINDOWS, bit_exact=True)
    found = batch.fly(columns, episodes=np.zeros(3, dtype=int)).metrics
    for k, (speed, effort) in enumerate(lanes):
        log = run(
            with_numbers(scenario, dict(zip(LIMITED, (speed, effort), strict=True)))
        )
        wanted = of_log.saturation(
            log,
            WINDOWS.steady,
            np.array([speed, *[838.0] * 3]),
            np.array([effort, 0.5]),
        )
        assert not any(wanted.values()) if k == 2 else 0.0 < wanted[names[k]] < 1.0
        for name in names:
            assert (
                found[name][k]
                == score(log, names, WINDOWS)[name]
                == pytest.approx(wanted[name], rel=1e-12)
            )


@pytest.mark.parametrize("word", ["whole", "early"])
def test_metrics_over_a_log_are_those_that_were_counted_in_flight(pairs, word):
    """The same functions in the same order, so to the bit, but that a log's tip is
    rounded on its own.
    """
    ours, log = pairs[word]
    found = score(log, ("all", "all_continuous"), WINDOWS)
    assert set(found) == set(ours)
    for name, value in ours.items():
        slack = 1e-13 if "ee_" in name else 0.0
        assert found[name] == pytest.approx(value, rel=slack, abs=0.0, nan_ok=True), (
            name
        )


def test_every_metric_is_compared_and_differs_from_its_twin(pairs):
    ours, log = pairs["whole"]
    assert set(ours) == set(NAMES)
    # settling needs the steady mean before the flight is over
    missing = set(expected(log)) - set(ours)
    assert {name.removesuffix("_continuous") for name in missing} <= {
        "settling_time",
        *(
            "peak_pitch",
            "pitch_rms",
            "pitch_mean",
            "pitch_ripple",
            "roll_rms",
            "tau1_rms",
            "tau2_rms",
        ),
        *(
            "rotor_jitter",
            "rate_rms",
            "tilt_rms",
            "tilt_max",
            "gust_pitch_rms",
            "gust_peak_pitch",
        ),
    }
    # extremes may fall on an instant at which the samples are fresh; means and
    # integrals see the reference move between
    for name in NAMES:
        if f"{name}_continuous" in NAMES and ("mean" in name or "iae" in name):
            assert ours[name] != ours[f"{name}_continuous"], name


def test_the_first_command_of_a_flight_is_no_change(tmp_path, monkeypatch):
    """What the rotors did before is no command."""
    monkeypatch.setenv("SKYARM_CACHE", str(tmp_path))
    scenario, window = flight(duration=0.1, sensors={}), Window(0.0, 0.05)
    batch = Batch(
        scenario,
        metrics=("rotor_jitter",),
        windows=Windows(steady=window),
        bit_exact=True,
    )
    log = run(scenario)
    wanted = of_log.calmness(log, Errors.held(log), window)["rotor_jitter"]
    assert batch.fly({}).metrics["rotor_jitter"][0] == pytest.approx(wanted, rel=1e-12)


def test_a_level_tool_is_where_the_table_of_a_log_has_it():
    """An arm that leaves its plane, at any heading: the other formula turns by a
    quaternion.
    """
    vehicle = load_vehicle("hexarotor_arm6")
    rng = np.random.default_rng(5)
    for _ in range(20):
        position, joints, yaw = (
            rng.normal(size=3),
            rng.uniform(-1.0, 1.0, 6),
            rng.uniform(-3.0, 3.0),
        )
        reference = Reference(
            position=Vec3(*position.tolist()),
            yaw=float(yaw),
            joints=tuple(joints.tolist()),
        )
        wanted = level_tip(vehicle, position[None], np.array([yaw]), joints[None])[0]
        assert tuple(goal_of(vehicle, reference).tool) == pytest.approx(
            wanted, abs=1e-14
        )


def test_the_settling_time_is_refused_and_what_there_is_is_told():
    with pytest.raises(
        ValueError,
        match=(
            "'settling_time': must be one of standard, gust, wind, paper, effort,"
            " contact, team, all"
        ),
    ):
        metric_names(["settling_time"], 2)


def test_groups_and_names_are_written_out_once_and_in_order():
    assert metric_names(["tau2_rms", "wind", "position_min"], 2) == (
        *(
            "tau2_rms",
            "position_min",
            "position_max",
            "position_ripple",
            "pitch_mean",
            "pitch_ripple",
        ),
    )
    assert metric_names(["wind_continuous"], 2) == (
        *(
            "position_min_continuous",
            "position_max_continuous",
            "position_ripple_continuous",
        ),
    )
    assert set(metric_names(["all", "all_continuous"], 2)) == set(NAMES)
    assert {word for word in GROUPS if not metric_names([word], 2)} == set()


def test_what_is_not_asked_for_is_not_in_the_program():
    """One metric, one total; and a program that is smaller by the tool's pose, the
    attitude's angles, the totals.
    """
    scenario = flight(sensors={})
    sizes = {}
    for wanted in (("iae_position",), ("standard",), ("all", "all_continuous")):
        loop = (
            Batch(scenario, metrics=wanted, windows=WINDOWS)._legs[0].code.kernel.loop
        )
        sizes[wanted] = (len(loop.program.nodes), loop.carry, loop.row)
    least, standard, most = sizes.values()
    assert standard[0] - least[0] > 200
    assert most[0] - standard[0] > 100
    assert (
        standard[1] - least[1]
        == len(required_totals(metric_names(["standard"], 2), 2)) - 1
    )
    # no window's flag is fed that no metric looks at
    assert (least[2], standard[2]) == (least[2], least[2] + 2)


STILL = State(
    position=Vec3(0.0, 0.0, 0.0),
    quaternion=Quaternion(1.0, 0.0, 0.0, 0.0),
    velocity=Vec3(0.0, 0.0, 0.0),
    rate=Vec3(0.0, 0.0, 0.0),
    joints=(0.0,),
)


def instant(x):
    """An instant at which the vehicle is x metres from where it should be."""
    goal = MetricGoal(
        position=Vec3(-x, 0.0, 0.0), joints=(0.0,), tool=Vec3(0.0, 0.0, 0.0)
    )
    command = Command(rotor_speeds=(x, 3.0), efforts=(0.0,))
    return MetricInstant(
        state=STILL,
        tool=Vec3(0.0, 0.0, 0.0),
        command=command,
        before=(0.0, 3.0),
        held=goal,
        continuous=goal,
    )


def test_windows_are_half_open_and_extremes_keep_their_sign():
    names = (
        "position_error_mean",
        "position_error_max",
        "position_min",
        "gust_peak_x",
        "iae_position",
        "rotor_jitter",
    )
    times = np.array([0.5, 1.0, 1.5, 2.0])
    windows = Windows(steady=Window(1.0, 2.0), gust=Window(0.5, 2.0), holds=())
    masks = windows.of_flight(2.5).masks(times)
    wanted = required_totals(names, 1)
    totals = first_totals(wanted)
    for k, x in enumerate((-8.0, 1.0, 3.0, 64.0)):
        totals = advance_totals(
            totals,
            wanted,
            instant(x),
            {name: bool(mask[k]) for name, mask in masks.items()},
        )
    instants = {name: mask.sum() for name, mask in masks.items()}
    found = values(names, dict(zip(wanted, totals, strict=True)), instants, 1, 0.5)
    assert instants["steady"] == 2
    assert found == {
        "position_error_mean": 2.0,
        "position_error_max": 3.0,
        "position_min": 1.0,
        "gust_peak_x": -8.0,
        "iae_position": 0.5 * 76.0,
        "rotor_jitter": pytest.approx(math.sqrt((1.0 + 9.0) / 4.0), rel=1e-15),
    }


def test_roll_and_pitch_are_those_of_scipy():
    Rotation = pytest.importorskip("scipy.spatial.transform").Rotation
    for angles in np.random.default_rng(2).uniform(
        [-3.1, -1.5, -3.1], [3.1, 1.5, 3.1], (200, 3)
    ):
        turn = Rotation.from_euler("ZYX", angles[::-1])
        x, y, z, w = turn.as_quat()
        roll, pitch = roll_and_pitch(Quaternion(*map(float, (w, x, y, z))))
        assert roll == pytest.approx(angles[0], abs=1e-12)
        # near +-90 degrees arcsin loses half of the digits
        assert pitch == pytest.approx(
            angles[1], abs=1e-12 / max(math.cos(angles[1]), 1e-3)
        )
        # the angle between the two z axes, whose cosine is flat at both ends
        straight = math.acos(np.clip(turn.as_matrix()[2, 2], -1.0, 1.0))
        assert tilt(Quaternion(*map(float, (w, x, y, z)))) == pytest.approx(
            straight, abs=1e-7
        )
