"""What a plan leaves to the law that flies it: rest behind a last hold, rotors that
keep up, joints off their limits.

And what it does not depend on: the clock.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import skyarm
from skyarm.algebra import Quaternion, Vec3
from skyarm.planning import planner
from skyarm.planning.plan_file import plan_arrays, plan_bytes
from skyarm.planning.plan_report import flight_document, summary, summary_lines
from skyarm.planning.planner import (
    JOINT_MARGIN,
    REACTION,
    Plan,
    PlanError,
    guess_from,
    outline,
    plan,
    problem_of,
    seeds,
    stage_of,
)
from skyarm.planning.stage import PlanStage
from skyarm.planning.task import Goal, PlanPhase, Start, Task, TaskLimits, task_from
from skyarm.scenario.save import scenario_text
from skyarm.vehicle.vehicle_files import load_vehicle
from skyarm.world.scene.clearance import clearances
from support.plans import Bodies, catch, planned, reach


def hop(minimise: str = "time", **limits: float) -> Task:
    """Flight of 5 m whose duration is free, by a vehicle that a plan of least time
    leads 0.4 m off.
    """
    to = Goal(base=Vec3(4.0, 3.0, 0.5), heading=0.0, rest=True)
    vehicle = load_vehicle("hummingbird_arm2_rotors")
    phases = (PlanPhase(to=to),)
    return Task(
        vehicle=vehicle, phases=phases, limits=TaskLimits(**limits), minimise=minimise
    )  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def quick() -> Plan:
    return plan(hop())


def test_a_plan_that_ends_with_a_hold_ends_at_rest() -> None:
    """Velocities are zero, and MuJoCo's accelerations under the plan's rotors too: it
    stays.
    """
    phases = reach()["phases"][:2]
    found = planned(phases=[phases[0] | {"duration": 1.6}, phases[1]])
    n, bodies, end = found.task.vehicle.n, Bodies(found.task.vehicle), found.x[-1]
    assert np.abs(end[7:13]).max() < 1e-6
    assert np.abs(end[13 + n : 13 + 2 * n]).max() < 1e-6
    speeds = end[13 + 2 * n : 13 + 2 * n + 6] * np.array(found.stage.hover)
    assert (
        np.abs(bodies.accelerations(end, speeds, np.zeros(n), np.zeros(3))[0][:6]).max()
        < 1e-4
    )
    np.testing.assert_allclose(bodies.tip(end)[0], [1.0, 0.0, 1.0], atol=2e-6)
    # a hold that is not the last moves on
    assert skyarm.load_task("eagle_catch").phases[1].to == Goal()


def test_a_hold_that_states_its_velocity_keeps_it() -> None:
    phases = reach()["phases"][:2]
    task = task_from(
        reach(phases=[phases[0], phases[1] | {"to": {"velocity": [0.1, 0.0, 0.0]}}])
    )
    assert not task.phases[-1].to.rest


def rotor_lag(found: Plan) -> float:
    """Largest lag of a rotor, by the speeds and times of the plan's file and the
    vehicle's own numbers.
    """
    arrays, rotors = plan_arrays(found), found.task.vehicle.rotors
    rates = np.diff(arrays["rotor_speeds"], axis=0) / np.diff(arrays["t"])[:, None]
    up, down = (
        [float(getattr(each, f"time_constant_{way}")) for each in rotors]
        for way in ("up", "down")
    )
    lags = np.maximum(
        rates * (np.array(up) + REACTION), -rates * (np.array(down) + REACTION)
    )
    thrust = sum(float(each.thrust_coefficient) for each in rotors)
    hover = math.sqrt(float(found.task.vehicle.mass) * found.task.gravity / thrust)
    return float(lags.max() / hover)


def test_free_durations_are_as_long_as_the_rotors_need(quick: Plan) -> None:
    least = plan(hop(rotor_lag=math.inf))
    assert rotor_lag(least) > 4.0 * quick.task.limits.rotor_lag
    assert rotor_lag(quick) == pytest.approx(quick.lags.max(), rel=1e-2)
    assert (
        0.6 * quick.task.limits.rotor_lag
        < rotor_lag(quick)
        < 1.02 * quick.task.limits.rotor_lag
    )
    assert quick.t[-1] > least.t[-1]
    assert quick.solution.violation < 1e-6
    assert quick.task == hop()
    assert (least.not_least, plan(hop("effort")).not_least) == ("", "")
    assert quick.not_least.startswith(
        "not looked for, rotors lag by over 0.5 of limits.rotor_lag"
    )
    assert f"least time: {quick.not_least}" in summary_lines("hop", summary(quick))
    assert not any(phase.duration for phase in quick.task.phases)


def test_a_least_time_that_is_not_found_is_told(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    best = planner._best_plan

    def gentle(task: Task, *rest: Any, **options: Any) -> Plan:
        if task.minimise == "time":
            raise PlanError("no plan")
        return best(task, *rest, **options)

    monkeypatch.setattr(planner, "_best_plan", gentle)
    found = plan(hop(rotor_lag=math.inf))
    assert (
        found.not_least
        == "no plan within the limits was found, this one has the least effort"
    )
    assert found.t[-1] == plan(hop("effort", rotor_lag=math.inf)).t[-1]


def test_a_plan_of_least_time_is_flown(quick: Plan, tmp_path: Path) -> None:
    (tmp_path / "plan.npz").write_bytes(plan_bytes(quick))
    (tmp_path / "flight.toml").write_text(
        scenario_text(flight_document(quick, Path("plan.npz"), quick.task.vehicle.name))
    )
    log = skyarm.run(tmp_path / "flight.toml")
    assert log.status == "completed"
    assert np.linalg.norm(log.tip - log.tip_reference, axis=1).max() < 0.05


def test_joints_keep_off_their_limits_but_where_start_or_goal_say_so() -> None:
    joint = load_vehicle("hexacopter370_flying_arm_3").links[0].joint
    high, margin = float(joint.upper), JOINT_MARGIN * float(joint.upper - joint.lower)
    phases = [
        {
            "to": {"base": [0.0, 0.0, 1.5], "joints": [high, 0.0, 0.0], "rest": True},
            "duration": 1.5,
        }
    ]
    at_limit = planned(phases=phases)
    assert at_limit.x[-1, 13] == pytest.approx(high, abs=1e-5)
    off = dataclasses.replace(
        at_limit.task,
        phases=(PlanPhase(to=Goal(base=Vec3(0.0, 0.0, 1.5)), duration=1.5),),
    )
    assert at_limit.stage.ranges[0][1] == high
    assert plan(off).stage.ranges[0][1] == pytest.approx(high - margin)
    assert (
        plan(
            dataclasses.replace(off, start=Start(joints=(-high, 0.0, 0.0)))
        ).stage.ranges[0][0]
        == -high
    )


def test_tilted_rotors_lean_by_the_force_alone() -> None:
    """Laws hover level: at rest the rotors do not push across, as far as 300 times the
    square of it is worth.
    """
    vehicle = load_vehicle("hextilt_flying_arm_5")
    to = Goal(base=Vec3(1.0, 0.0, 0.3), heading=0.0, rest=True)
    found = plan(Task(vehicle=vehicle, phases=(PlanPhase(to=to, duration=2.0),)))
    up = [
        np.array([float(c) for c in each.axis]) * float(each.thrust_coefficient)
        for each in vehicle.rotors
    ]
    force = plan_arrays(found)["rotor_speeds"] ** 2 @ np.array(up)
    assert (
        np.degrees(np.arctan2(np.linalg.norm(force[:, :2], axis=1), force[:, 2])).max()
        < 3.0
    )
    weight = float(vehicle.mass) * 9.81
    states = [found.stage.state(row) for row in found.x]
    across = np.array(
        [[float(each) for each in found.stage.across(state)] for state in states]
    )
    np.testing.assert_allclose(across, force[:, :2], atol=1e-9 * weight)
    assert (
        PlanStage(model=catch().stage.model).across(catch().stage.state(catch().x[0]))
        == []
    )


def test_own_bodies_that_met_may_be_as_near_as_at_the_start() -> None:
    """The tip of the straight arm is 2.5 mm from its own wrist: the clearance of 50 mm
    would leave no motion at all.
    """
    to, vehicle = (
        Goal(base=Vec3(1.0, 0.0, 0.3), heading=0.0, rest=True),
        load_vehicle("hextilt_flying_arm_5"),
    )
    task = Task(vehicle=vehicle, phases=(PlanPhase(to=to, duration=2.0),))
    pair = "link/link_5/tip", "link/link_3/wrist_roll"
    stage, shape = stage_of(task, {pair}), outline(task)
    problem = problem_of(task, stage, [50], 0.05)
    guess = guess_from(task, stage, [50], seeds(task, shape)[0], shape)
    rows = stage.values(guess.x, guess.u, problem.data)[0][:, stage.limits]
    limit = rows[:, stage.names.index("clearance of {} and {}".format(*pair))]
    near = clearances(vehicle, [])
    gaps = near.distances(
        Vec3(0.0, 0.0, 0.0), Quaternion(1.0, 0.0, 0.0, 0.0).rotation(), (0.0,) * 5
    )
    gap = next(
        float(each)
        for each, of in zip(gaps, near.pairs, strict=True)
        if (of.volume, of.other) == pair
    )
    assert 0.0 < gap < 0.005
    np.testing.assert_allclose(limit, -0.5 * gap, atol=1e-9)


def test_no_clock_changes_a_plan(quick: Plan, monkeypatch: pytest.MonkeyPatch) -> None:
    """A machine so busy that each look at the clock is 5 s later: the same bytes, or no
    plan and a word on it.
    """
    ticks = itertools.count(step=5.0)
    for clock in ("perf_counter", "process_time", "monotonic", "time"):
        monkeypatch.setattr(time, clock, lambda: next(ticks))
    assert plan_bytes(plan(quick.task, seconds=1e6)) == plan_bytes(quick)
    with pytest.raises(PlanError, match="no plan within 1 s"):
        plan(quick.task, seconds=1.0)
