"""The shipped catch: the tip rests while the base flies by, within all limits, at the
nodes and between them.
"""

from __future__ import annotations

import dataclasses
import io
import math
import os
import subprocess
import sys
from pathlib import Path

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from skyarm.planning.plan_file import plan_arrays, plan_bytes
from skyarm.planning.plan_report import summary
from skyarm.planning.planner import nearest_of, plan, states_at
from skyarm.planning.task import load_task, task_from
from skyarm.plant.mujoco_model import build_spec, joint_addresses
from skyarm.world.scene.vehicle_shapes import vehicle_shapes
from support.plans import Bodies, between_nodes, box, catch, planned, reach


def test_the_catch_meets_its_goals() -> None:
    found = catch()
    bodies, (start, begins, ends, last) = Bodies(found.task.vehicle), found.edges
    assert found.solution.solved
    assert found.solution.violation < 1e-6
    n = found.task.vehicle.n
    np.testing.assert_array_equal(
        found.x[start, :13], [-5.0, 0.0, 1.0, 1.0, *np.zeros(9)]
    )
    np.testing.assert_allclose(
        found.t[[start, begins, ends, last]], [0.0, 1.4, 1.6, 3.2], atol=1e-12
    )
    for k in range(begins, ends + 1):
        place, velocity = bodies.tip(found.x[k])
        np.testing.assert_allclose(velocity, 0.0, atol=2e-6)
        np.testing.assert_allclose(place, 0.0, atol=1e-3)
    np.testing.assert_allclose(bodies.tip(found.x[begins])[0], 0.0, atol=2e-6)
    np.testing.assert_allclose(found.x[last, :3], [5.0, 0.0, 1.5], atol=2e-6)
    np.testing.assert_allclose(found.x[last, 7 : 13 + 2 * n], 0.0, atol=2e-6)
    # what the task is about: the base flies by
    assert np.linalg.norm(found.x[begins:ends, 7:10], axis=1).min() > 0.5
    assert np.linalg.norm(found.x[ends, :3] - found.x[begins, :3]) > 0.2


def test_the_tip_hardly_moves_between_the_nodes_of_the_hold() -> None:
    found = catch()
    bodies = Bodies(found.task.vehicle)
    tips = [
        bodies.tip(x)
        for k in range(found.edges[1], found.edges[2])
        for x in between_nodes(found, bodies, k, 10)
    ]
    assert max(np.linalg.norm(place) for place, _ in tips) < 5e-4
    assert max(np.linalg.norm(velocity) for _, velocity in tips) < 0.05


def test_limits_hold_at_the_nodes_and_between_them() -> None:
    found = catch()
    vehicle, limits = found.task.vehicle, found.task.limits
    bodies, hover, (n, m) = (
        Bodies(vehicle),
        np.array(found.stage.hover),
        (vehicle.n, len(vehicle.rotors)),
    )
    rows = np.array(
        [
            x
            for k in range(0, len(found.u), 2)
            for x in between_nodes(found, bodies, k, 4)
        ]
    )
    up = Rotation.from_quat(rows[:, 3:7], scalar_first=True).as_matrix()[:, 2, 2]
    assert np.arccos(up).max() < limits.tilt + 2e-3
    assert np.arccos(up).max() > limits.tilt - 1e-2
    most = np.array([float(rotor.max_speed) for rotor in vehicle.rotors])
    shares = (rows[:, 13 + 2 * n : 13 + 2 * n + m] * hover / most) ** 2
    assert shares.max() < limits.thrust_share
    assert shares.min() > 0.0
    joints, rates = rows[:, 13 : 13 + n], rows[:, 13 + n : 13 + 2 * n]
    assert 0.9 * limits.joint_rate < np.abs(rates).max() < limits.joint_rate + 1e-5
    for j, link in enumerate(vehicle.links):
        assert float(link.joint.lower) - 1e-3 < joints[:, j].min()
        assert joints[:, j].max() < float(link.joint.upper) + 1e-3
    efforts = np.array([float(link.joint.effort_limit) for link in vehicle.links])
    assert (np.abs(found.torques) / efforts).max() < limits.torque_share + 1e-6


def test_the_same_task_is_the_same_file_twice() -> None:
    found = catch()
    again = plan(load_task("eagle_catch"))
    assert plan_bytes(again) == plan_bytes(found)
    with np.load(io.BytesIO(plan_bytes(found)), allow_pickle=False) as archive:
        arrays = {name: archive[name] for name in archive.files}
    for name, value in plan_arrays(found).items():
        np.testing.assert_array_equal(arrays[name], value)


@pytest.mark.thorough
def test_the_file_does_not_depend_on_the_number_of_threads(tmp_path: Path) -> None:
    files = [tmp_path / f"{count}.npz" for count in (1, 2)]
    for file, count in zip(files, ("1", "2"), strict=True):
        more = {
            "OPENBLAS_NUM_THREADS": count,
            "OMP_NUM_THREADS": count,
            "MKL_NUM_THREADS": count,
        }
        command = [
            sys.executable,
            "-m",
            "skyarm",
            "plan",
            "eagle_catch",
            "--out",
            str(file),
            "--quiet",
        ]
        subprocess.run(command, check=True, env=os.environ | more, timeout=300)
    assert files[0].read_bytes() == files[1].read_bytes()


def test_numbers_of_the_summary_are_those_of_the_motion() -> None:
    found = catch()
    numbers, n, m = summary(found), found.task.vehicle.n, len(found.task.vehicle.rotors)
    assert numbers.duration == pytest.approx(3.2)
    assert [name for name, _ in numbers.phases] == ["approach", "grasp", "away"]
    np.testing.assert_allclose(
        [length for _, length in numbers.phases], [1.4, 0.2, 1.6]
    )
    assert numbers.speed == np.linalg.norm(found.x[:, 7:10], axis=1).max()
    assert numbers.tilt == pytest.approx(math.radians(60.0), abs=1e-4)
    speeds = found.x[:, 13 + 2 * n : 13 + 2 * n + m] * found.stage.hover
    k, j = np.unravel_index(speeds.argmax(), speeds.shape)
    rotor = found.task.vehicle.rotors[j]
    assert (numbers.rotor.name, numbers.rotor.time) == (rotor.name, found.t[k])
    assert numbers.rotor.share == pytest.approx(
        (speeds[k, j] / float(rotor.max_speed)) ** 2
    )
    assert numbers.joint_rate is not None
    assert numbers.joint_rate.share == pytest.approx(
        np.abs(found.x[:, 13 + n : 13 + 2 * n]).max() / 3.0
    )
    assert numbers.torque is not None
    assert numbers.torque.share < 0.95


def test_the_smallest_distance_of_a_plan_is_that_of_mujoco() -> None:
    """A ball beside the tip at the catch; capsules of the arm in MuJoCo, every
    millisecond.
    """
    size, place = 0.1, [0.05, 0.145, 0.0]
    ball = {"shape": "sphere", "size": [size], "position": place, "name": "ball"}
    beside = dataclasses.replace(
        catch().task, obstacles=task_from(reach(obstacles=[ball])).obstacles
    )
    found = dataclasses.replace(catch(), task=beside)
    vehicle, n = found.task.vehicle, found.task.vehicle.n
    spec = build_spec(vehicle, 9.81)
    rods = [
        shape
        for shape in vehicle_shapes(vehicle, meshes=False)
        if shape.kind == "capsule" and shape.body >= 0
    ]
    for shape in rods:
        turn = np.zeros(4)
        mujoco.mju_mat2Quat(turn, np.array(shape.rotation, dtype=float).ravel())
        spec.body(vehicle.links[shape.body].name).add_geom(
            name=shape.name,
            type=mujoco.mjtGeom.mjGEOM_CAPSULE,
            size=[shape.size[0], 0.5 * shape.size[1], 0.0],
            pos=shape.position,
            quat=turn,
            mass=0.0,
        )
    spec.worldbody.add_geom(
        name="ball", type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[size, 0, 0], pos=place
    )
    model = spec.compile()
    data, (addresses, _) = mujoco.MjData(model), joint_addresses(vehicle, model)
    gaps, times = [], np.arange(0.0, 3.2, 1e-3)
    for x in states_at(found, times):
        data.qpos[:7], data.qpos[addresses] = x[:7], x[13 : 13 + n]
        mujoco.mj_kinematics(model, data)
        one = model.geom("ball").id
        gaps.append(
            [
                mujoco.mj_geomDistance(
                    model, data, model.geom(rod.name).id, one, 9.0, None
                )
                for rod in rods
            ]
        )
    k, j = np.unravel_index(int(np.argmin(gaps)), np.shape(gaps))
    nearest = nearest_of(found)
    assert 0.0 < nearest.gap < 0.05
    assert nearest.bodies == f"{rods[j].name} and ball"
    assert nearest.gap == pytest.approx(gaps[k][j], abs=1e-5)
    assert nearest.time == pytest.approx(times[k], abs=3e-3)


def test_states_between_the_nodes_are_those_of_the_dynamics() -> None:
    found = catch()
    bodies, n = Bodies(found.task.vehicle), found.task.vehicle.n
    for k in (2, 33, 40, 70):
        fine = np.array(between_nodes(found, bodies, k, 8))
        read = states_at(found, np.linspace(found.t[k], found.t[k + 1], 9))
        np.testing.assert_allclose(read[:, :3], fine[:, :3], atol=5e-5)
        np.testing.assert_allclose(read[:, 3:7], fine[:, 3:7], atol=2e-3)
        np.testing.assert_allclose(
            read[:, 13 : 13 + n], fine[:, 13 : 13 + n], atol=5e-4
        )
    np.testing.assert_allclose(
        states_at(found, found.t)[:, :7], found.x[:, :7], atol=1e-12
    )


@pytest.mark.thorough
def test_free_durations_are_shorter_where_time_is_what_counts() -> None:
    table = reach(
        phases__0__duration=None, phases__2__duration=None, limits__rotor_lag=math.inf
    )
    effort, fast = (
        plan(task_from(table | {"minimise": what})) for what in ("effort", "time")
    )
    assert fast.t[-1] < 0.9 * effort.t[-1]
    assert fast.t[-1] < 2.2
    assert fast.solution.violation < 1e-6
    np.testing.assert_allclose(np.diff(fast.t[list(fast.edges)])[1], 0.2, atol=1e-12)
    bodies = Bodies(fast.task.vehicle)
    np.testing.assert_allclose(
        bodies.tip(fast.x[fast.edges[1]])[0], [1.0, 0.0, 1.0], atol=2e-6
    )


@pytest.mark.thorough
def test_plans_of_more_nodes_converge() -> None:
    """Rest begins and ends a motion with one stage each whose rotors do not change:
    least times are without them.
    """
    way = [{"to": {"base": [3.0, 0.0, 1.0], "rest": True}}]
    limits = {"rotor_lag": math.inf}
    quick = [
        planned(phases=way, minimise="time", limits=limits, step=step)
        for step in (0.04, 0.02, 0.01)
    ]
    moving = [found.t[-2] - found.t[1] for found in quick]
    assert moving[0] == pytest.approx(moving[1], rel=0.02)
    assert moving[1] == pytest.approx(moving[2], rel=0.005)
    costs = [
        plan(dataclasses.replace(catch().task, step=step)).solution.cost
        for step in (0.04, 0.02, 0.01)
    ]
    assert costs[0] > costs[1] > costs[2] > 0.9 * costs[1]
    assert costs[1] - costs[2] < 0.5 * (costs[0] - costs[1])


@pytest.mark.thorough
def test_a_plan_past_an_obstacle_keeps_its_clearance() -> None:
    found = planned(
        phases=[{"to": {"base": [3.0, 0.0, 1.0], "rest": True}, "duration": 2.5}],
        obstacles=[box([1.5, 0.0, 1.0], [0.3, 1.2, 1.0], name="pillar")],
    )
    assert found.nearest is not None
    assert found.nearest.gap >= 0.0
    # the base, by points: outside the box by its own half height at least
    away = np.abs(
        states_at(found, np.linspace(0.0, 2.5, 2000))[:, :3] - [1.5, 0.0, 1.0]
    ) - [0.15, 0.6, 0.5]
    assert away.max(axis=1).min() > 0.0


@pytest.mark.thorough
@pytest.mark.parametrize(
    "name",
    ["eagle_catch_free", "box_deployment", "catch_a_ball", "passthrough", "push_slide"],
)
def test_shipped_tasks_are_planned(name: str) -> None:
    found = plan(load_task(name))
    assert found.solution.violation < 1e-6


def test_the_tilt_of_a_phase_is_its_own_limit_at_both_its_ends() -> None:
    usual, gentle = planned(), planned(phases__1__tilt=0.1, phases__2__tilt=0.3)

    def tilts(plan):
        up = Rotation.from_quat(plan.x[:, 3:7], scalar_first=True).as_matrix()[:, 2, 2]
        return [
            np.arccos(up[a : b + 1]).max()
            for a, b in zip(plan.edges, plan.edges[1:], strict=False)
        ]

    assert tilts(gentle)[1] == pytest.approx(0.1, abs=1e-4)
    assert tilts(gentle)[2] == pytest.approx(0.3, abs=1e-4)
    assert tilts(gentle)[0] > 0.35
    assert tilts(usual)[1] > 0.15
    assert tilts(usual)[2] > 0.35
    # the code is that of the other task: a limit of tilt is data
    assert gentle.compiled is usual.compiled
