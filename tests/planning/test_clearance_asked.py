"""A plan keeps the clearance that its task asks for between coarse nodes, too, or says
where it does not.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from measure_plans import box, goal

from skyarm.algebra import Vec3
from skyarm.planning.plan_report import summary, summary_lines
from skyarm.planning.planner import SLACK, SMOOTH_STEP, plan, states_at
from skyarm.planning.task import Goal, PlanPhase, Start, Task, TaskLimits
from skyarm.vehicle.vehicle_files import load_vehicle
from skyarm.world.contact.surface import Surface


def past_a_board(step: float) -> Task:
    """Flight of 4 m of a vehicle without an arm, past a thin board on its way."""
    board = Surface(
        name="board", shape="box", size=(0.05, 0.6, 0.6), position=Vec3(2.0, 0.05, 0.02)
    )
    to = Goal(base=Vec3(4.0, 0.0, 0.0), heading=0.0, rest=True)
    vehicle, phase = load_vehicle("hummingbird"), PlanPhase(to=to, duration=2.4)
    return Task(vehicle=vehicle, phases=(phase,), obstacles=(board,), step=step)


def test_a_board_thinner_than_a_step_is_flown_around() -> None:
    """At 2.5 m/s 0.5 m lie between two nodes; no node need be near the board, and all
    keep off by 20 mm too little.
    """
    found = plan(past_a_board(0.2))
    assert found.nearest is not None
    assert found.nearest.short == ""
    # the base passes its edge, further off than the rotors reach
    x = states_at(found, np.arange(0.0, found.t[-1], 1e-3))[:, :3]
    off = np.maximum(np.abs(x - [2.0, 0.05, 0.02]) - [0.025, 0.3, 0.3], 0.0)
    assert np.linalg.norm(off, axis=1).min() > 0.05 - SLACK


@pytest.mark.thorough
def test_boxes_between_coarse_nodes_are_flown_around() -> None:
    rng = np.random.default_rng(7)
    for _ in range(8):
        task = dataclasses.replace(box(rng), step=0.2)
        found = plan(task)
        assert found.nearest is not None
        assert found.nearest.apart > task.limits.clearance - SLACK
        assert "box" not in found.nearest.short


def test_a_folded_arm_nearer_to_itself_than_asked_is_named() -> None:
    """Its tip and wrist are 17 mm apart at the start, which no plan can change."""
    found = plan(goal(np.random.default_rng(5)))
    numbers = summary(found)
    assert numbers.short.startswith(
        "0.05 m: link/hand/tip and link/wrist_roll_link/wrist_pitch, 0.0169 m at "
    )
    assert numbers.short.endswith(" s")
    assert f"nearer than limits.clearance = {numbers.short}" in summary_lines(
        "goal", numbers
    )
    less = dataclasses.replace(found.task.limits, clearance=0.015)
    assert not summary(plan(dataclasses.replace(found.task, limits=less))).short


def dash(distance: float, step: float) -> Task:
    to = Goal(
        base=Vec3(distance, 0.0, 1.0), heading=0.0, joints=(0.0, 0.0, 0.0), rest=True
    )
    vehicle, start = (
        load_vehicle("hexacopter370_flying_arm_3"),
        Start(position=Vec3(0.0, 0.0, 1.0)),
    )
    limits = TaskLimits(rotor_lag=np.inf)
    return Task(
        vehicle=vehicle,
        start=start,
        phases=(PlanPhase(to=to),),
        limits=limits,
        minimise="time",
        step=step,
    )


@pytest.mark.thorough
@pytest.mark.parametrize("distance", [5.0, 10.0])
def test_least_time_does_not_depend_on_the_nodes(distance: float) -> None:
    """But for the limits of the rotors' accelerations, which hold at the far end of a
    step: the longer it is, the narrower they are. Measured: 0.22 % at 5 m, 0.13 % at
    10 m.
    """
    coarse, usual, fine = (plan(dash(distance, step)) for step in (0.04, 0.02, 0.01))
    assert coarse.t[-1] == pytest.approx(usual.t[-1], rel=0.01)
    assert usual.t[-1] == pytest.approx(fine.t[-1], rel=0.003)
    for found in (coarse, usual, fine):
        steps = np.diff(found.t)
        assert steps[[0, -1]] == pytest.approx(SMOOTH_STEP)
        assert np.ptp(steps[1:-1]) < 1e-9
        assert np.abs(found.u[[0, -1], :6]).max() < 1e-5
