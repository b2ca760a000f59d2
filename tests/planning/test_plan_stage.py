"""One stage of a plan: derivatives by central differences and by JAX, its step by
MuJoCo, its tangent by SciPy.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from skyarm.algebra import Vec3
from skyarm.planning.planner import (
    guess_from,
    node_counts,
    obstacle_places,
    outline,
    problem_of,
    seeds,
    stage_of,
)
from skyarm.planning.stage import ARM_UNIT, GOALS, CompiledStage, gap, retraction
from skyarm.planning.task import Goal, PlanPhase, Start, Task, task_from
from skyarm.records.leaves import leaves, rebuild
from skyarm.vehicle.vehicle_files import load_vehicle
from support.engines import jax_doubles
from support.plans import Bodies, between_nodes, box, catch, reach

RICH = reach(
    phases__0__duration=None,
    phases__1={
        "name": "push",
        "kind": "contact",
        "contact": {"kind": "point", "force": 2.0},
        "duration": 0.2,
    },
    phases__2__to={
        "base": [2.0, 0.3, 1.5],
        "attitude": [0.1, 0.2, 0.3],
        "joints": [0.1, 0.2, 0.3],
    },
    limits={"speed": 4.0, "rate": 5.0},
    obstacles=[box([1.0, 0.4, 0.5], [0.2, 0.3, 0.4], angles=[0.1, 0.2, 0.3])],
)
"""A task with everything that a stage may have: contact, a free length, obstacles, all
limits."""


@pytest.fixture(scope="module")
def rich():
    """Compiled stage, problem and a motion about its seed, of the rich task."""
    task = task_from(RICH)
    stage, shape = stage_of(task), outline(task)
    counts = node_counts(task, shape.lengths)
    problem = problem_of(task, stage, counts, 0.05)
    guess = guess_from(task, stage, counts, seeds(task, shape)[0], shape)
    rng = np.random.default_rng(3)
    x = stage.retract(guess.x, rng.normal(scale=0.1, size=(len(guess.x), stage.nt)))
    return task, stage, problem, x, rng.normal(scale=0.2, size=guess.u.shape)


def turned(x, d):
    """States moved by a tangent, with SciPy's exponential of rotations: the same to
    first order.
    """
    q = Rotation.from_quat(x[:, 3:7], scalar_first=True) * Rotation.from_rotvec(
        d[:, 3:6]
    )
    sign = np.sign((q.as_quat(scalar_first=True) * x[:, 3:7]).sum(1, keepdims=True))
    return np.hstack(
        [x[:, :3] + d[:, :3], sign * q.as_quat(scalar_first=True), x[:, 7:] + d[:, 6:]]
    )


def outputs(stage: CompiledStage, x, u, following, data):
    """Outputs of the stages by the Python function on NumPy lanes, with a gap by
    SciPy's logarithm.
    """
    given = rebuild(stage.stage.example(), iter(data.T))
    values = stage.stage(list(x.T), list(u.T), given)
    end = np.stack(np.broadcast_arrays(*values.end), axis=1)
    turn = Rotation.from_quat(following[:, 3:7], scalar_first=True).inv()
    turn *= Rotation.from_quat(end[:, 3:7], scalar_first=True)
    apart = np.hstack(
        [
            (end - following)[:, :3],
            2.0 * np.sin(0.5 * turn.magnitude())[:, None] * _axis(turn),
        ]
    )
    rows = [*apart.T, *(end - following)[:, 7:].T, *values.costs]
    rows += [error for name in GOALS for error in values.goals[name]]
    rows += [value for _, value in (*values.inputs, *values.limits)]
    return np.stack([np.broadcast_to(row, len(x)) for row in rows], axis=1)


def _axis(turn: Rotation):
    vector = turn.as_rotvec()
    return vector / np.maximum(np.linalg.norm(vector, axis=1, keepdims=True), 1e-300)


def test_values_and_derivatives_of_all_stages_are_those_of_the_function_on_numbers(
    rich,
) -> None:
    _, stage, problem, x, u = rich
    values = stage.values(x, u, problem.data)[0][:-1]
    np.testing.assert_allclose(
        values,
        outputs(stage, x[:-1], u, x[1:], problem.data[:-1]),
        rtol=1e-9,
        atol=1e-9,
    )
    exact, nodes, nt = (
        stage.jacobians(x, u, problem.data),
        np.arange(0, len(u), 6),
        stage.nt,
    )
    assert exact.shape == (len(x), values.shape[1], nt + stage.nu)
    # all differences of fourth order at once, each a lane: steps, directions, nodes
    steps = (
        np.array([1e-4, -1e-4, 2e-4, -2e-4])[:, None, None, None]
        * np.eye(nt + stage.nu)[:, None, :]
    )
    d = np.broadcast_to(steps, (4, nt + stage.nu, len(nodes), nt + stage.nu)).reshape(
        -1, nt + stage.nu
    )
    x_h, u_h, ahead, data = (
        np.tile(each, (len(d) // len(nodes), 1))
        for each in (x[nodes], u[nodes], x[nodes + 1], problem.data[nodes])
    )
    rows = outputs(stage, turned(x_h, d[:, :nt]), u_h + d[:, nt:], ahead, data).reshape(
        4, nt + stage.nu, len(nodes), -1
    )
    slopes = ((8.0 * (rows[0] - rows[1]) - (rows[2] - rows[3])) / 12e-4).transpose(
        1, 2, 0
    )
    error = np.abs(slopes - exact[nodes]) / (1.0 + np.abs(slopes))
    # the nearest points of two bodies may change within the step of a difference
    labels = [""] * stage.limits.start + list(stage.names)
    assert error[:, [not name.startswith("clearance") for name in labels]].max() < 1e-6
    assert np.quantile(error, 0.999) < 1e-6


def test_a_share_of_a_step_moves_states_inputs_and_the_states_behind_the_gaps(
    rich,
) -> None:
    _, stage, problem, x, u = rich
    rng = np.random.default_rng(5)
    dx, du = (
        rng.normal(scale=0.1, size=(len(x), stage.nt)),
        rng.normal(scale=0.1, size=u.shape),
    )
    shares = np.array([0.0, 0.25, 1.0])
    lanes = stage.values(x, u, problem.data, (dx, du), shares)
    for lane, share in zip(lanes, shares, strict=True):
        there = stage.values(
            stage.retract(x, share * dx), u + share * du, problem.data
        )[0]
        np.testing.assert_allclose(lane, there, rtol=1e-12, atol=1e-12)


def test_the_gap_after_a_step_is_the_step_of_the_state_that_was_left(rich) -> None:
    _, stage, _, x, _ = rich
    d = np.random.default_rng(8).normal(scale=0.3, size=(len(x), stage.nt))
    after = np.stack(retraction(list(x.T), list(d.T)), axis=1)
    np.testing.assert_allclose(np.linalg.norm(after[:, 3:7], axis=1), 1.0, atol=1e-14)
    back = np.stack(gap(list(after.T), list(x.T)), axis=1)
    shorter = np.sqrt(1.0 + 0.25 * (d[:, 3:6] ** 2).sum(1, keepdims=True))
    d[:, 3:6] /= shorter
    np.testing.assert_allclose(back, d, atol=1e-13)
    np.testing.assert_allclose(stage.retract(x, np.zeros_like(d)), x, atol=1e-15)


@pytest.mark.thorough
def test_derivatives_are_those_of_jax(rich) -> None:
    jax = pytest.importorskip("jax")
    _, stage, problem, x, u = rich
    exact, nt = stage.jacobians(x, u, problem.data), stage.nt
    with jax_doubles():

        def values(d, k):
            at = retraction([*map(float, x[k])], list(d[:nt]))
            given = rebuild(stage.stage.example(), iter(problem.data[k].tolist()))
            found = stage.stage(
                at, [a + b for a, b in zip(u[k].tolist(), d[nt:], strict=True)], given
            )
            goals = [error for name in GOALS for error in found.goals[name]]
            rows = [*gap(found.end, x[k + 1].tolist()), *found.costs, *goals]
            limits = [
                value
                for name, value in (*found.inputs, *found.limits)
                if not name.startswith("clearance")
            ]
            return jax.numpy.stack(
                [jax.numpy.asarray(row, dtype=float) for row in (*rows, *limits)]
            )

        smooth = [
            k for k, name in enumerate(stage.names) if not name.startswith("clearance")
        ]
        columns = [
            *range(stage.limits.start),
            *(stage.limits.start + k for k in smooth),
        ]
        for k, d in zip(
            (0, 7, 30),
            np.random.default_rng(4).normal(size=(3, nt + stage.nu)),
            strict=True,
        ):
            _, slopes = jax.jvp(
                lambda d, k=k: values(d, k), (np.zeros(nt + stage.nu),), (d,)
            )
            np.testing.assert_allclose(
                exact[k][columns] @ d, slopes, rtol=1e-9, atol=1e-9
            )


def test_a_stage_ends_where_mujoco_leads_the_vehicle_and_takes_its_torques(
    rich,
) -> None:
    task, stage, problem, x, u = rich
    bodies, (n, m) = Bodies(task.vehicle), (task.vehicle.n, len(task.vehicle.rotors))
    values, hover = (
        stage.values(x, u, problem.data)[0][:, stage.limits],
        np.array(stage.stage.hover),
    )
    pushed = 0
    for k in range(0, len(u), 4):
        given = rebuild(stage.stage.example(), iter(problem.data[k].tolist()))
        push = u[k, m + n :] * given.touching * stage.stage.weight
        pushed += np.linalg.norm(push) > 0.1
        soon = dataclasses.replace(given, dt=0.002, free=(0.0,))
        np.testing.assert_allclose(
            stage.stage(x[k].tolist(), u[k].tolist(), soon).end,
            bodies.step(x[k], u[k], push, stage.stage, 0.002),
            atol=1e-7,
        )
        joints = x[k, 13 + 2 * n + m : 13 + 3 * n + m] * ARM_UNIT
        _, efforts = bodies.accelerations(
            x[k], x[k, 13 + 2 * n : 13 + 2 * n + m] * hover, joints, push
        )
        for link, effort in zip(task.vehicle.links, efforts, strict=True):
            share = effort / (float(link.joint.effort_limit) * task.limits.torque_share)
            first = stage.names.index(f"torque of {link.joint.name}")
            np.testing.assert_allclose(
                values[k, first : first + 2], [share - 1.0, -share - 1.0], atol=1e-9
            )
    assert 0 < pushed < len(range(0, len(u), 4))


def test_a_stage_of_a_plan_is_one_runge_kutta_step_that_is_fine_enough() -> None:
    found = catch()
    bodies = Bodies(found.task.vehicle)
    for k in (0, 30, 40, 60):
        fine = between_nodes(found, bodies, k, 20)[-1]
        np.testing.assert_allclose(fine, found.x[k + 1], atol=1e-3)
        np.testing.assert_allclose(fine[:7], found.x[k + 1, :7], atol=2e-5)


def test_goals_of_the_tip_are_those_of_mujoco(rich) -> None:
    task, stage, problem, x, u = rich
    bodies, values = Bodies(task.vehicle), stage.values(x, u, problem.data)[0]
    goals = values[:, stage.goals]
    names = {name: goals[:, part] for name, part in stage.goal.items()}
    given = [rebuild(stage.stage.example(), iter(row)) for row in problem.data]
    for k in range(0, len(x), 5):
        tip, velocity = bodies.tip(x[k])
        np.testing.assert_allclose(
            names["tip"][k], tip - np.array([*given[k].tip]), atol=1e-12
        )
        np.testing.assert_allclose(
            names["tip_velocity"][k],
            velocity - np.array([*given[k].tip_velocity]),
            atol=1e-11,
        )
        np.testing.assert_allclose(
            names["lift"][k], [velocity @ np.array([*given[k].normal])], atol=1e-11
        )
        axis = bodies.data.site_xmat[bodies.site].reshape(3, 3)[:, 2]
        np.testing.assert_allclose(
            names["axis"][k], axis - np.array([*given[k].axis]), atol=1e-12
        )
        R = bodies.data.xmat[bodies.base].reshape(3, 3)
        ahead = Rotation.from_quat([*given[k].attitude], scalar_first=True).as_matrix()
        vector = (
            Rotation.from_matrix(ahead).inv() * Rotation.from_matrix(R)
        ).as_quat()[:3]
        sign = np.sign(vector @ names["attitude"][k])
        np.testing.assert_allclose(
            names["attitude"][k], 2.0 * sign * vector, atol=1e-12
        )
        np.testing.assert_allclose(
            names["heading"][k],
            [ahead[0, 0] * R[1, 0] - ahead[1, 0] * R[0, 0]],
            atol=1e-12,
        )


def test_a_body_at_rest_on_its_rotors_is_still() -> None:
    found = catch()
    bodies, n, last = Bodies(found.task.vehicle), found.task.vehicle.n, found.x[-1]
    speeds = last[found.stage.at.speeds] * found.stage.hover
    a, _ = bodies.accelerations(last, speeds, np.zeros(n), np.zeros(3))
    assert np.abs(a[:3]).max() < 2e-5
    assert np.abs(a[3:6]).max() < 1e-4
    np.testing.assert_allclose(last[7:13], 0.0, atol=2e-6)


def test_limits_are_zero_where_the_quantity_is_at_its_limit(rich) -> None:
    task, stage, problem, x, u = rich
    values = stage.values(x, u, problem.data)[0][:, stage.limits]
    rows = {name: values[:, k] for k, name in enumerate(stage.names)}
    R = Rotation.from_quat(x[:, 3:7], scalar_first=True).as_matrix()
    np.testing.assert_allclose(
        rows["tilt"], np.cos(task.limits.tilt) - R[:, 2, 2], atol=1e-14
    )
    goals = [rebuild(stage.stage.example(), iter(row)).attitude for row in problem.data]
    ahead = Rotation.from_quat(
        [[*each] for each in goals], scalar_first=True
    ).as_matrix()
    np.testing.assert_allclose(
        rows["heading"], -2.0 * (R[:, :2, 0] * ahead[:, :2, 0]).sum(1), atol=1e-14
    )
    np.testing.assert_allclose(
        rows["speed"], (x[:, 7:10] ** 2).sum(1) / 16.0 - 1.0, atol=1e-13
    )
    np.testing.assert_allclose(
        rows["rate"], (x[:, 10:13] ** 2).sum(1) / 25.0 - 1.0, atol=1e-13
    )
    push = np.vstack([u, np.zeros(stage.nu)])[:, -3:]
    given = [rebuild(stage.stage.example(), iter(row)) for row in problem.data]
    normal = np.array([[*each.normal] for each in given])
    along = (push * normal).sum(1)
    across = push - along[:, None] * normal
    friction = np.array([each.friction for each in given])
    np.testing.assert_allclose(
        rows["friction"], (across**2).sum(1) - (friction * along) ** 2, atol=1e-13
    )
    np.testing.assert_allclose(
        rows["contact force"],
        np.array([each.press for each in given]) - along,
        atol=1e-13,
    )
    counts = {name: stage.names.count(name) for name in stage.names}
    for link in task.vehicle.links:
        assert counts[f"torque of {link.joint.name}"] == 2
        # at a node, and between it and the next
        assert counts[f"rate of {link.joint.name}"] == 4
        assert counts[f"position of {link.joint.name}"] == 2
    for rotor in task.vehicle.rotors:
        assert (
            counts[f"thrust of {rotor.name}"]
            == counts[f"acceleration of {rotor.name}"]
            == 2
        )


def test_places_of_obstacles_are_data(rich) -> None:
    """One compiled stage serves other places: the numbers are in the data, none of them
    in the code.
    """
    task, stage, problem, x, u = rich
    moved_box = dataclasses.replace(
        task.obstacles[0], position=task.obstacles[0].position + Vec3(0.0, 0.0, 1.0)
    )
    other = dataclasses.replace(task, obstacles=(moved_box,))
    assert stage_of(other) is stage
    away = problem.data.copy()
    first = leaves(obstacle_places(task, stage)[0])
    start = away.shape[1] - len(first)
    np.testing.assert_array_equal(away[0, start:], first)
    away[:, start:] = leaves(obstacle_places(other, stage)[0])
    near = [
        k
        for k, name in enumerate(stage.names)
        if name.startswith("clearance") and "obstacle0" in name
    ]
    one, two = (
        stage.values(x, u, data)[0][:, stage.limits][:, near]
        for data in (problem.data, away)
    )
    assert near
    assert not np.allclose(one, two)


def test_goals_in_whole_numbers_are_those_in_floats() -> None:
    vehicle = load_vehicle("hexacopter370_flying_arm_3")
    tables = []
    for one, two in ((1, 2), (1.0, 2.0)):
        to = Goal(
            base=Vec3(two, 0 * one, one),
            velocity=Vec3(0 * one, one, 0 * one),
            heading=one,
            joints=(one,) * 3,
        )
        phase = PlanPhase(name="go", to=to, duration=0.1)
        task = Task(
            vehicle=vehicle,
            start=Start(position=Vec3(0 * one, 0 * one, one)),
            phases=(phase,),
        )
        tables.append(problem_of(task, stage_of(task), [2], np.full(3, 0.05)).data)
    assert np.array_equal(*tables)
