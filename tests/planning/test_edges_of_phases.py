"""Ends of phases keep what their goals state: directions, rest, contacts, attitudes of
either sign, limits.
"""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from skyarm.planning.plan_file import plan_arrays
from skyarm.planning.plan_report import summary
from skyarm.planning.planner import (
    Plan,
    PlanError,
    attitude,
    coarse_phases,
    guess_from,
    outline,
    plan,
    problem_of,
    seeds,
    stage_of,
)
from skyarm.planning.stage import ARM_UNIT, SPIN_UNIT
from skyarm.planning.task import Task, TaskError, task_from
from skyarm.reference.reference_tables import reference_from
from skyarm.reference.task_records import Setting
from support.plans import Bodies

HEXACOPTER = "hexacopter370_flying_arm_3"


def task(
    phases: list[dict[str, Any]], vehicle: str = HEXACOPTER, **fields: Any
) -> Task:
    return task_from(
        {"schema": 1, "name": "edges", "vehicle": vehicle, "phases": phases, **fields}
    )


def go(duration: float | None = 1.0, **to: Any) -> dict[str, Any]:
    """Free phase with a goal."""
    return {"to": to} | ({} if duration is None else {"duration": duration})


def test_the_tip_points_to_its_goal_and_not_away_from_it() -> None:
    """By MuJoCo's site; the straight arm points upwards, against the goal."""
    axis = [0.0, 0.0, -1.0]
    found = plan(task([go(base=[0.0, 0.0, 1.0], tip_axis=axis, rest=True)]))
    bodies = Bodies(found.task.vehicle)
    bodies.place(found.x[-1])
    np.testing.assert_allclose(
        bodies.data.site_xmat[bodies.site].reshape(3, 3)[:, 2], axis, atol=1e-5
    )


def test_a_direction_that_an_arm_cannot_reach_is_no_plan() -> None:
    to: dict[str, Any] = {
        "base": [0.0, 0.0, 1.0],
        "heading": 0.0,
        "tip_axis": [0.0, 0.0, -1.0],
        "rest": True,
    }
    with pytest.raises(PlanError, match="no motion within the limits was found"):
        plan(task([go(**to)], "crazyflie_arm1", step=0.1))


def test_a_reversed_heading_is_off_its_goal() -> None:
    """Of a base that looks back, the sine is zero: the limit beside it is not, at the
    goal alone.
    """
    own = task([go(base=[0.0, 0.0, 1.0], heading=0.0), go(base=[1.0, 0.0, 1.0])])
    stage, shape = stage_of(own), outline(own)
    problem = problem_of(own, stage, [5, 5], 0.05)
    guess = guess_from(own, stage, [5, 5], seeds(own, shape)[0], shape)
    row, column = stage.goal["heading"].start, stage.names.index("heading")
    assert np.flatnonzero(problem.limits[:, column]).tolist() == [5]
    for turn, value in ((0.0, -2.0), (np.pi, 2.0), (0.5 * np.pi, 0.0)):
        guess.x[:, 3:7] = Rotation.from_rotvec([0.0, 0.0, turn]).as_quat(
            scalar_first=True
        )
        values = stage.values(guess.x, guess.u, problem.data)[0][5]
        assert values[stage.goals][row] == pytest.approx(np.sin(turn), abs=1e-12)
        assert values[stage.limits][column] == pytest.approx(value, abs=1e-12)


def test_an_attitude_has_the_same_bits_on_every_processor() -> None:
    found = attitude((-0.4437143021358807, -0.6813963506856231, 1.4272773199197815))
    assert {type(each) for each in found} == {float}
    assert [each.hex() for each in found] == [
        "0x1.7c846697d757cp-1",
        "0x1.cf8101152cf80p-5",
        "-0x1.8758f478d5572p-2",
        "0x1.17af27d247d49p-1",
    ]


def test_a_phase_that_ends_at_rest_rests_before_one_that_ends_in_motion() -> None:
    found = plan(
        task(
            [
                go(base=[1.0, 0.0, 1.0], rest=True),
                go(base=[2.0, 0.0, 1.0], velocity=[1.0, 0.0, 0.0]),
            ]
        )
    )
    between, end = found.x[found.edges[1]], found.x[-1]
    np.testing.assert_allclose(between[7:13], 0.0, atol=2e-6)
    np.testing.assert_allclose(end[7:10], [1.0, 0.0, 0.0], atol=2e-6)


def test_a_tip_that_is_held_rests_to_the_end_of_its_phase() -> None:
    tip = [1.0, 0.0, 0.5]
    hold = {"kind": "hold", "duration": 0.2}
    away = go(tip=[2.0, 0.0, 0.5], tip_velocity=[0.5, 0.0, 0.0])
    found = plan(task([go(tip=tip), hold, away]))
    bodies = Bodies(found.task.vehicle)
    for k in range(found.edges[1], found.edges[2] + 1):
        np.testing.assert_allclose(bodies.tip(found.x[k])[1], 0.0, atol=2e-6)
    np.testing.assert_allclose(bodies.tip(found.x[-1])[1], [0.5, 0.0, 0.0], atol=2e-6)


def reference(found: Plan, folder: Path, **changes: Any) -> Any:
    """Reference of a plan's file, with other arrays."""
    np.savez(folder / "plan.npz", **(plan_arrays(found) | changes))
    return reference_from(
        {"kind": "plan", "file": str(folder / "plan.npz")}, 3, "reference", Setting()
    )


def test_a_plan_that_ends_in_motion_is_flown_as_it_is_planned(tmp_path: Path) -> None:
    """Velocities of base and joints, and the tip by MuJoCo, at every node and just
    before the last.
    """
    found = plan(task([go(1.5, base=[2.0, 0.0, 1.0], velocity=[2.0, 0.0, 0.0])]))
    flown, bodies, n = (
        reference(found, tmp_path),
        Bodies(found.task.vehicle),
        found.task.vehicle.n,
    )
    for k, t in enumerate([*found.t[:-1], found.t[-1] - 1e-9]):
        sample = flown.at(float(t))
        np.testing.assert_allclose([*sample.velocity], found.x[k, 7:10], atol=5e-3)
        np.testing.assert_allclose(
            [*sample.joint_rates], found.x[k, 13 + n : 13 + 2 * n], atol=0.03
        )
        np.testing.assert_allclose([*sample.tip], bodies.tip(found.x[k])[0], atol=1e-6)
    np.testing.assert_allclose([*sample.position], found.x[-1, :3], atol=1e-6)


def test_attitudes_of_a_plan_and_of_its_file_keep_their_signs(tmp_path: Path) -> None:
    """Turned on and on: behind half a turn the quaternion of a goal has the other sign
    than that of the motion.
    """
    place = {"base": [0.0, 0.0, 1.0]}
    found = plan(task([go(1.5, **place, heading=h) for h in (2.5, -2.5, -0.5)]))
    q, own = found.x[:, 3:7], plan_arrays(found)["quaternion"]
    assert (q[1:] * q[:-1]).sum(1).min() > 0.9
    assert found.nearest.gap > 0.0
    # a file of another program, of either sign; between the nodes as scipy turns
    mixed = own * np.where(np.arange(len(own)) % 3 == 1, -1.0, 1.0)[:, None]
    flown, t = (
        reference(found, tmp_path, quaternion=mixed),
        0.5 * (found.t[1:] + found.t[:-1]),
    )
    attitudes = [
        Rotation.from_quat(
            np.array(flown.at(float(each)).turning[:4]), scalar_first=True
        )
        for each in t
    ]
    nodes = Rotation.from_quat(own, scalar_first=True)
    middle = nodes[:-1] * Rotation.from_rotvec(
        0.5 * (nodes[:-1].inv() * nodes[1:]).as_rotvec()
    )
    assert (
        max((a.inv() * b).magnitude() for a, b in zip(attitudes, middle, strict=True))
        < 0.02
    )


def test_the_seed_turns_on_where_the_goal_before_has_the_other_sign() -> None:
    own = task([go(base=[0.0, 0.0, 1.0], heading=h) for h in (2.5, -2.5, -0.5)])
    shape = outline(own)
    q = guess_from(own, stage_of(own), [20, 20, 20], seeds(own, shape)[0], shape).x[
        :, 3:7
    ]
    assert (q[1:] * q[:-1]).sum(1).min() > 0.9


@pytest.mark.parametrize("to", [{}, {"tip": [1.0, 0.3, 0.5]}])
def test_a_tip_stays_on_the_plane_that_it_presses(to: dict[str, Any]) -> None:
    slide = {
        "kind": "contact",
        "contact": {"kind": "plane", "force": 1.0},
        "duration": 0.6,
        "to": to,
    }
    away = go(base=[1.0, 0.3, 1.5], rest=True)
    found = plan(
        task([go(1.5, tip=[1.0, 0.0, 0.5], tip_velocity=[0.0, 0.0, 0.0]), slide, away])
    )
    bodies, (_, begins, ends, _) = Bodies(found.task.vehicle), found.edges
    heights, speeds = zip(
        *((p[2], v[2]) for p, v in map(bodies.tip, found.x[begins : ends + 1])),
        strict=True,
    )
    assert np.abs(np.array(heights) - 0.5).max() < 1e-3
    assert np.abs(speeds[-1]) < 1e-5


def test_passive_joints_and_rotors_without_a_largest_speed_are_refused() -> None:
    own = task([go(base=[1.0, 0.0, 1.0], rest=True)])
    vehicle, rotors = own.vehicle, own.vehicle.rotors
    loose = vehicle.with_joints(effort_limit=0.0)
    with pytest.raises(
        TaskError,
        match=(
            r"^vehicle = '.*': joints\[shoulder\]\.effort_limit = 0: must be above 0 "
        ),
    ):
        dataclasses.replace(own, vehicle=loose)
    fast = dataclasses.replace(
        vehicle,
        rotors=(*rotors[:-1], dataclasses.replace(rotors[-1], max_speed=np.inf)),
    )
    with pytest.raises(
        TaskError,
        match=rf"rotors\[{rotors[-1].name}\]\.max_speed = inf: must be finite",
    ):
        dataclasses.replace(own, vehicle=fast)


def test_joints_without_a_largest_effort_have_torques_all_the_same() -> None:
    own = task([go(base=[1.0, 0.0, 1.0], rest=True)])
    found = plan(
        dataclasses.replace(own, vehicle=own.vehicle.with_joints(effort_limit=np.inf))
    )
    bodies, at = Bodies(own.vehicle), found.stage.at
    for x, torques in zip(found.x, found.torques, strict=True):
        speeds, joints = (
            x[at.speeds] * found.stage.hover,
            x[at.arm] * ARM_UNIT,
        )
        np.testing.assert_allclose(
            bodies.accelerations(x, speeds, joints, np.zeros(3))[1], torques, atol=1e-8
        )
    torque = summary(found).torque
    assert torque is not None
    assert torque.share == 0.0


def test_the_last_node_has_limits_of_joint_torques() -> None:
    """Nearly twice the effort of a weak arm would be there without them; by MuJoCo's
    inverse dynamics.
    """
    own = task([go(0.4, base=[0.3, 0.0, 0.3], joints=[0.8, 0.4, 0.2])])
    found = plan(
        dataclasses.replace(own, vehicle=own.vehicle.with_joints(effort_limit=0.3))
    )
    bodies, end, at = Bodies(own.vehicle), found.x[-1], found.stage.at
    speeds, joints = end[at.speeds] * found.stage.hover, end[at.arm] * ARM_UNIT
    torques = bodies.accelerations(end, speeds, joints, np.zeros(3))[1]
    assert 0.5 < np.abs(torques).max() / (0.3 * own.limits.torque_share) < 1.0 + 2e-6


def test_commands_of_rotors_are_within_their_range_to_the_end_of_a_stage() -> None:
    """Speed at the end of a stage and the lag that its rate takes, by the vehicle's
    numbers.
    """
    own = task(
        [go(0.9, base=[3.0, 0.0, 1.0])], limits={"thrust_share": 1.0, "rotor_lag": 10.0}
    )
    rotors = [
        dataclasses.replace(each, max_speed=0.62 * each.max_speed)
        for each in own.vehicle.rotors
    ]
    found = plan(
        dataclasses.replace(
            own, vehicle=dataclasses.replace(own.vehicle, rotors=tuple(rotors))
        )
    )
    most = np.array([float(each.max_speed) for each in rotors])
    rates = found.u[:, : len(rotors)] * SPIN_UNIT * np.array(found.stage.hover)
    lag = np.array(
        [
            [float(each.time_constant_up), float(each.time_constant_down)]
            for each in rotors
        ]
    ).T
    commands = found.rotor_speeds[1:] + rates * np.where(rates > 0.0, *lag)
    assert (commands / most).max() < 1.0 + 2e-6
    assert (commands / most).min() > -2e-6
    assert (found.rotor_speeds / most).max() > 0.9  # the limit is near


def test_a_free_phase_has_nodes_as_near_as_its_step() -> None:
    """Slower than its distance lets expect: nodes would be 0.27 s apart, and the speed
    between them above its limit.
    """
    to = {"base": [4.0, 0.0, 0.0], "heading": 0.0, "rest": True}
    found = plan(
        task([go(None, **to)], "hummingbird", limits={"speed": 1.0}, step=0.08)
    )
    assert np.diff(found.t).max() < 1.1 * 0.08
    assert not any(coarse_phases(found))
    assert found.t[-1] > 4.0
    assert np.linalg.norm(found.x[:, 7:10], axis=1).max() < 1.0 + 2e-6
