"""Episodes that end before their time: a result with status, cause and time, never a
traceback.
"""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
import pytest

from skyarm import Batch, Session
from skyarm.algebra import Quaternion, Vec3
from skyarm.algebra.scalars import where
from skyarm.dynamics import State
from skyarm.dynamics.actuators import Command
from skyarm.records.leaves import leaves
from skyarm.scenario.endings import apart, lowest_point
from skyarm.scenario.scenario_file import load_scenario, scenario_from
from skyarm.scenario.scenario_record import first_state
from skyarm.simulate import Log, Scenario, run
from skyarm.simulate.check_endings import Ended, find_ending
from support.components import with_law
from support.flights import document


def _same_ending(log: Log, status: str) -> None:
    assert log.status == status
    assert log.info["cause"]
    # rows stop where the episode does: the last one is a control period before the end
    assert log.info["end_time"] == pytest.approx(log.time.size / 200, abs=1e-12)
    assert all(np.isfinite(array).all() for array in log.arrays().values())


def _with_gains(scenario: Scenario, **gains: float) -> Scenario:
    par = scenario.controller.par
    changed = dataclasses.replace(
        par.gains, **{name: Vec3(k, k, k) for name, k in gains.items()}
    )
    return dataclasses.replace(
        scenario,
        controller=dataclasses.replace(
            scenario.controller, par=dataclasses.replace(par, gains=changed)
        ),
    )


@pytest.mark.parametrize("plant", ["rigid_body", "mujoco"])
def test_gains_far_too_large_diverge_with_time_and_cause(plant: str) -> None:
    stable = dataclasses.replace(
        load_scenario("case2_gust", plant=plant, duration=30.0), ground=False
    )
    log = run(_with_gains(stable, attitude=300.0))
    _same_ending(log, "diverged")
    assert log.info["cause"] == "position.z is over 1000 m from the reference"
    assert 5.0 < log.info["end_time"] < 30.0


@pytest.mark.parametrize("plant", ["rigid_body", "mujoco"])
@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_a_controller_that_gives_nonsense_ends_as_diverged(
    plant: str, value: float
) -> None:
    def law(
        memory: Any, measurement: Any, reference: Any, dt: Any, *, par: Any
    ) -> tuple[Any, Command]:
        del reference, dt, par
        return memory, Command(
            rotor_speeds=(where(measurement.time > 0.0999, value, 485.0),) * 4,
            efforts=(0.0, 0.0),
        )

    base = load_scenario("case1", plant=plant, duration=0.5)
    log = run(
        dataclasses.replace(
            base, controller=dataclasses.replace(base.controller, law=law)
        )
    )
    _same_ending(log, "diverged")
    assert log.info["end_time"] == 0.1
    assert log.info["cause"] == "commanded speed of rotor 'front' is not finite"


def test_a_joint_past_its_limit_ends_the_episode_by_name() -> None:
    base = load_scenario("case1", duration=10.0)
    vehicle = base.plant.vehicle
    links = list(vehicle.links)
    links[0] = dataclasses.replace(
        links[0], joint=dataclasses.replace(links[0].joint, lower=-0.2, upper=0.2)
    )
    limited = dataclasses.replace(vehicle, links=tuple(links))
    log = run(
        dataclasses.replace(
            base, plant=dataclasses.replace(base.plant, vehicle=limited)
        )
    )
    _same_ending(log, "joint_limit")
    assert "joint 'joint1'" in log.info["cause"]
    assert log.info["cause"].endswith(" passed 0.2")
    # the ramp of 0.3 rad/s starts at 6 s and passes 0.2 rad at 6.67 s
    assert 6.6 < log.info["end_time"] < 6.9
    assert np.abs(log.joints[:, 0]).max() <= 0.2


def test_the_tip_that_reaches_the_ground_ends_the_episode() -> None:
    down = {
        "kind": "signals",
        "z": [1.0, {"kind": "ramp", "start": 0.2, "duration": 2.0, "height": -1.0}],
    }
    log = run(scenario_from(document("case1", duration=5.0, reference__base=down)))
    _same_ending(log, "ground")
    assert log.tool[-1, 2] == pytest.approx(0.0, abs=0.01), (
        "the arm of 0.3 m hangs below the base"
    )
    assert log.position[-1, 2] == pytest.approx(0.3, abs=0.01)
    flown = run(
        scenario_from(
            document(
                "case1",
                duration=5.0,
                reference__base=down,
                environment={"ground": False},
            )
        )
    )
    assert flown.status == "completed"


def test_an_episode_that_ends_at_once_has_an_empty_log_that_can_be_saved(
    tmp_path: Any,
) -> None:
    below = document("case1", reference__base__position=[0.0, 0.0, 0.1])
    log = run(scenario_from(below))
    _same_ending(log, "ground")
    assert log.time.size == 0
    assert log.tool.shape == (0, 3)
    assert log.euler.shape == (0, 3)
    assert Log.load_npz(log.save_npz(tmp_path / "empty.npz")).joints.shape == (0, 2)
    assert (
        log.save_csv(tmp_path / "empty.csv").read_text(encoding="utf-8").count("\n")
        == 1
    )


def _pitched(degrees: float, controller: str) -> Scenario:
    high = document("case1", duration=4.0, reference__base__position=[0.0, 0.0, 100.0])
    base = scenario_from(high, replaced={"controller": controller})
    half = math.radians(degrees) / 2
    start = dataclasses.replace(
        first_state(base),
        quaternion=Quaternion(math.cos(half), 0.0, math.sin(half), 0.0),
    )
    return dataclasses.replace(base, initial=start)


@pytest.mark.parametrize("controller", ["bulut2019", "paper_ct_euler"])
def test_the_euler_form_is_undefined_at_a_pitch_of_90_degrees_and_says_so(
    controller: str,
) -> None:
    log = run(_pitched(90.0, controller))
    _same_ending(log, "controller_undefined")
    assert "pitch near 90 degrees" in log.info["cause"]


def test_the_body_form_flies_from_a_pitch_of_90_degrees() -> None:
    log = run(_pitched(90.0, "paper_ct"))
    assert log.status == "completed"
    assert abs(log.euler[-1, 1]) < 0.1
    assert np.linalg.norm(log.position[-1] - log.position_reference[-1]) < 1.0


def test_the_lowest_point_is_the_tip_of_a_hanging_arm_and_a_rotor_when_inverted() -> (
    None
):
    vehicle = load_scenario("case1").plant.vehicle
    at = {
        "position": Vec3(0.0, 0.0, 2.0),
        "velocity": Vec3(0.0, 0.0, 0.0),
        "rate": Vec3(0.0, 0.0, 0.0),
        "joint_rates": (0.0, 0.0),
        "rotor_speeds": (0.0,) * 4,
    }
    level, inverted = Quaternion(1.0, 0.0, 0.0, 0.0), Quaternion(0.0, 1.0, 0.0, 0.0)
    assert lowest_point(
        vehicle, State(quaternion=level, joints=(0.0, 0.0), **at)
    ) == pytest.approx(1.7)
    assert lowest_point(
        vehicle, State(quaternion=level, joints=(math.pi / 2, 0.0), **at)
    ) == pytest.approx(2.0)
    # pitched by 0.3 rad with the arm held vertical the tip is under the base; left in
    # line with it, 0.3 cos 0.3 below
    pitched = Quaternion(math.cos(0.15), 0.0, math.sin(0.15), 0.0)
    assert lowest_point(
        vehicle, State(quaternion=pitched, joints=(0.0, 0.0), **at)
    ) == pytest.approx(2.0 - 0.3 * math.cos(0.3))
    # pitching nose down (+) lifts the tail: an arm swung by th backwards ends 0.3
    # cos(th + 0.3) below
    swung = lowest_point(vehicle, State(quaternion=pitched, joints=(0.4, 0.0), **at))
    assert swung == pytest.approx(2.0 - 0.3 * math.cos(0.7))
    # hubs sit 0.01 m above the base origin, and the arm points up
    assert lowest_point(
        vehicle, State(quaternion=inverted, joints=(0.0, 0.0), **at)
    ) == pytest.approx(1.99)


@pytest.mark.parametrize(
    ("field", "value", "cause"),
    [
        ("velocity", Vec3(0.0, -2e4, 0.0), "velocity.y passed 10000"),
        ("rate", Vec3(0.0, 0.0, 2e4), "rate.z passed 10000"),
        ("joint_rates", (0.0, -2e4), "rate of joint 'joint2' passed 10000"),
        (
            "position",
            Vec3(1002.0, 0.0, 5.0),
            "position.x is over 1000 m from the reference",
        ),
    ],
)
def test_divergence_names_the_quantity(field: str, value: Any, cause: str) -> None:
    base = load_scenario("case1", duration=0.1)
    log = run(
        dataclasses.replace(
            base, initial=dataclasses.replace(first_state(base), **{field: value})
        )
    )
    assert (log.status, log.info["cause"], log.info["end_time"]) == (
        "diverged",
        cause,
        0.0,
    )


def test_a_joint_that_became_nan_is_a_divergence_with_its_name() -> None:
    base = load_scenario("case1", duration=0.1)
    broken = dataclasses.replace(first_state(base), joints=(math.nan, 0.0))
    ended = find_ending(base, 0.05, leaves(broken), (0.0, 0.0, 1.0))
    assert ended == Ended("diverged", "joint 'joint1' is not finite", 0.05)


def test_a_flight_far_from_the_origin_is_no_divergence() -> None:
    far = document("case1", duration=0.1, reference__base__position=[5e5, 4e6, 700.0])
    assert run(scenario_from(far)).status == "completed"


@pytest.mark.parametrize(
    ("value", "limit", "expected"),
    [
        (0.2004, 0.2, ("0.2004", "0.2")),
        (0.20000004, 0.2, ("0.20000004", "0.2")),
        (-1.5708, -math.pi / 2, ("-1.5708", "-1.570796")),
        (1.6, math.pi / 2, ("1.6", "1.571")),
        (math.nextafter(0.3, 1.0), 0.3, ("0.30000000000000004", "0.29999999999999999")),
    ],
)
def test_a_joint_and_the_limit_it_passed_are_told_apart(
    value: float, limit: float, expected: tuple[str, str]
) -> None:
    assert apart(value, limit) == expected


def test_a_joint_just_past_its_limit_says_which_and_by_how_much() -> None:
    base = load_scenario("case1", duration=0.1)
    vehicle = base.plant.vehicle
    first = vehicle.links[0]
    held = dataclasses.replace(
        first, joint=dataclasses.replace(first.joint, lower=-1.0, upper=0.2)
    )
    world = dataclasses.replace(
        base.plant,
        vehicle=dataclasses.replace(vehicle, links=(held, *vehicle.links[1:])),
    )
    start = dataclasses.replace(first_state(base), joints=(0.20004, 0.0))
    log = run(dataclasses.replace(base, plant=world, initial=start))
    assert (log.status, log.info["cause"]) == (
        "joint_limit",
        "joint 'joint1' at 0.20004 passed 0.2",
    )


def test_an_ending_in_the_very_last_period_is_told_in_one_way_everywhere() -> None:
    """A vehicle without thrust reaches the ground as its time is over; beside it one
    falls from higher up.
    """

    def falling(
        memory: Any, measurement: Any, reference: Any, dt: Any, *, par: Any
    ) -> tuple[Any, Command]:
        del measurement, reference, dt, par
        return memory, Command(rotor_speeds=(0.0,) * 4, efforts=(0.0, 0.0))

    base = with_law(load_scenario("case1", duration=2.0), falling, memory=())
    base = dataclasses.replace(base, initial=first_state(base))
    end = run(base).info["end_time"]
    assert 0.3 < end < 0.7
    short, longer = (
        dataclasses.replace(base, duration=end + more) for more in (0.0, 0.005)
    )
    session = Session(short)
    assert (run(short).status, session.run().status, session.ended.status) == (
        "ground",
        "ground",
        "ground",
    )
    at, heights = "initial.position.z", np.array([base.initial.position.z, 3.0])
    for planned in (short, longer):
        found = Batch(planned, [at], bit_exact=True).fly({at: heights})
        assert found.status.tolist() == ["ground", "completed"]
        assert found.completed.tolist() == [False, True]
        assert found.end_time[0] == end
