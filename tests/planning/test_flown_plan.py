"""A plan flies: the scenario that the planner writes catches the ball, and the law
knows the planned centre of mass.
"""

from __future__ import annotations

import copy
import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import skyarm
from skyarm.algebra import Quaternion, Vec3
from skyarm.control.laws.centroidal.law import planned_center
from skyarm.control.laws.predictive.cost import Weights, state_residuals
from skyarm.control.laws.predictive.preview import (
    SampledReference,
    planned_motion,
    update_sample,
)
from skyarm.control.laws.predictive.solver import examples
from skyarm.dynamics.array_front import frame_pose_world
from skyarm.planning.plan_file import plan_bytes
from skyarm.planning.plan_report import SETTLE, flight_document
from skyarm.planning.planner import Plan, states_at
from skyarm.reference.preview import with_preview
from skyarm.scenario.save import scenario_text
from support.plans import catch

NMPC = {"law": "nmpc", "mode": "plan"}


@pytest.fixture(scope="module")
def caught() -> Plan:
    return skyarm.plan(skyarm.load_task("catch_a_ball"))


@pytest.fixture(scope="module")
def followed(caught: Plan, tmp_path_factory: pytest.TempPathFactory) -> skyarm.Scenario:
    """The flight of the plan under a law that follows its whole state."""
    return skyarm.load_scenario(
        written(caught, tmp_path_factory.mktemp("followed"), controller=NMPC)
    )


def written(plan: Plan, folder: Path, **tables: Any) -> Path:
    """Scenario file that flies a plan, with other tables or entries of them."""
    (folder / "plan.npz").write_bytes(plan_bytes(plan))
    document = copy.deepcopy(
        flight_document(plan, Path("plan.npz"), plan.task.vehicle.name)
    )
    for name, entries in tables.items():
        document[name] = (
            dict(entries) if "law" in entries else {**document[name], **entries}
        )
    (folder / "flight.toml").write_text(scenario_text(document))
    return folder / "flight.toml"


@pytest.mark.parametrize(
    "plant", ["rigid_body", pytest.param("mujoco", marks=pytest.mark.thorough)]
)
def test_the_claw_catches_the_ball_and_the_tip_comes_within_ten_millimetres(
    caught: Plan, tmp_path: Path, plant: str
) -> None:
    log = skyarm.run(written(caught, tmp_path, plant={"kind": plant}))
    assert log.status == "completed"
    begin = SETTLE + caught.t[caught.edges[1]]
    near = (log.time > begin - 0.1) & (log.time < begin)
    assert np.linalg.norm((log.tip - log.tip_reference)[near], axis=1).max() < 0.01
    # the tip is where the task said, not only where the reference is
    assert np.linalg.norm(log.tip[near][-1]) < 0.01
    ball = log.object_position[-1]
    assert np.linalg.norm(ball - log.tip[-1]) < 0.05  # held, 3 m from its stand
    assert np.abs(ball[0] - 3.0) < 0.3


@pytest.mark.thorough
@pytest.mark.parametrize("plant", ["rigid_body", "mujoco"])
def test_the_tip_of_the_eagle_catch_stays_within_ten_millimetres(
    tmp_path: Path, plant: str
) -> None:
    log = skyarm.run(written(catch(), tmp_path, plant={"kind": plant}))
    assert log.status == "completed"
    held = (log.time >= SETTLE + 1.4) & (log.time <= SETTLE + 1.6)
    assert held.sum() > 30
    assert np.linalg.norm(log.tip[held], axis=1).max() < 0.01
    assert np.linalg.norm(log.velocity[held], axis=1).min() > 0.5
    assert np.linalg.norm(log.position[-1] - [5.0, 0.0, 1.5]) < 0.02


@pytest.mark.thorough
def test_without_the_planned_centre_of_mass_the_tip_misses(
    caught: Plan, tmp_path: Path
) -> None:
    scenario = skyarm.load_scenario(written(caught, tmp_path))
    tables = skyarm.load_scenario(written(caught, tmp_path)).agent.reference
    assert tables.planned is not None
    end = caught.t[caught.edges[2]] + SETTLE
    errors = []
    for flown in (scenario, scenario.with_agent(without_center(scenario.agent))):
        log = skyarm.run(flown)
        during = (log.time > end - 0.4) & (log.time < end - 0.2)
        wanted = [tables.at(float(t)).tip for t in log.time[during]]
        errors.append(
            float(np.linalg.norm(log.tip[during] - np.array(wanted), axis=1).max())
        )
    assert errors[1] > 3.0 * errors[0]


def without_center(agent: Any) -> Any:
    """An agent whose reference says nothing of the centre of mass."""
    return dataclasses.replace(
        agent, reference=dataclasses.replace(agent.reference, planned=None)
    )


def test_a_governor_beside_a_plan_is_refused(caught: Plan, tmp_path: Path) -> None:
    with pytest.raises(
        skyarm.ScenarioError, match=r"reference\.governor: must be left out with a plan"
    ):
        skyarm.load_scenario(written(caught, tmp_path, reference={"governor": True}))


def test_the_planned_centre_moves_on_as_taylors_polynomial_between_samples() -> None:
    # value and derivatives of a quartic along x
    c = np.array([1.0, -2.0, 0.5, 3.0, -4.0])
    held = tuple(float(v) for value in c for v in (value, 2.0 * value, 0.0))
    moved = planned_center(held, 0.3)
    polynomial = np.polynomial.Polynomial(c / [1.0, 1.0, 2.0, 6.0, 24.0])
    for k, vector in enumerate(moved):
        exact = polynomial.deriv(k)(0.3) if k else polynomial(0.3)
        assert [*vector] == pytest.approx([exact, 2.0 * exact, 0.0], abs=1e-12)


def test_a_preview_of_a_plan_is_the_plan_between_its_samples(
    caught: Plan, followed: skyarm.Scenario
) -> None:
    """Of the law's horizon: states by the plan's own interpolation and finite
    differences, at odd times.
    """
    agent, par, n, m = followed.agent, followed.agent.controller.par, 3, 6
    reference, now = agent.law_reference, SETTLE + 1.63
    ahead = (
        np.append(0.0, np.cumsum([0.005, 0.005, 0.01, 0.03, 0.07, 0.12, 0.16])) + 0.0037
    )
    sample = update_sample(
        with_preview(reference.at(now), par.preview, lambda t: reference.at(now + t)),
        None,
        0.005,
    )
    motion, planned = planned_motion(sample, np.array(par.preview), ahead)
    exact = states_at(caught, now - SETTLE + ahead)
    np.testing.assert_allclose(motion[0][:, :3], exact[:, :3], atol=1e-4)
    np.testing.assert_allclose(motion[0][:, 4:], exact[:, 13 : 13 + n], atol=1e-3)
    np.testing.assert_allclose(motion[1][:, :3], exact[:, 7:10], atol=5e-3)
    turned = Rotation.from_quat(planned[:, :4], scalar_first=True)
    off = turned.inv() * Rotation.from_quat(exact[:, 3:7], scalar_first=True)
    assert np.abs(off.as_rotvec()).max() < 1e-3
    np.testing.assert_allclose(planned[:, 4:7], exact[:, 10:13], atol=0.03)
    # a stage has the mean acceleration of what the plan does in it; far ahead samples
    # are rarer than nodes
    speeds = exact[:, 13 + 2 * n : 13 + 2 * n + m] * np.array(caught.stage.hover)
    np.testing.assert_allclose(
        (planned[:-1, 7:] * np.diff(ahead)[:, None])[:4],
        np.diff(speeds, axis=0)[:4],
        atol=0.3,
    )
    # after the end the motion rests
    late = planned_motion(sample, np.array(par.preview), np.array([5.0, 6.0]))[0]
    np.testing.assert_array_equal(late[0][0], late[0][1])


def test_a_previewed_attitude_turns_about_all_axes() -> None:
    """A body that turns at a constant rate, as scipy turns it, and rotors whose speed
    is a parabola of time.
    """
    leads, rate, first = (
        np.array([0.02, 0.05, 0.1]),
        np.array([1.0, -2.0, 3.0]),
        Rotation.random(random_state=4),
    )
    knots, ahead = np.append(0.0, leads), np.array([0.0, 0.03, 0.07, 0.09])

    def quaternions(t: np.ndarray) -> np.ndarray:
        return np.asarray(
            (first * Rotation.from_rotvec(t[:, None] * rate)).as_quat(scalar_first=True)
        )

    step = 1e-6
    turning = np.zeros((2, 4, 6))
    turning[0, :, :4] = quaternions(knots)
    turning[1, :, :4] = (quaternions(knots + step) - quaternions(knots - step)) / (
        2.0 * step
    )
    turning[:, :, 4], turning[:, :, 5] = (
        [400.0 + 5e3 * knots**2, 1e4 * knots],
        [
            [300.0] * 4,
            [0.0] * 4,
        ],
    )
    zero = np.zeros(5)
    sample = SampledReference(
        np.zeros((3, 5)),
        zero,
        0.0,
        zero,
        zero,
        coming=np.zeros((3, 4, 5)),
        turning=turning,
    )
    _, found = planned_motion(sample, leads, ahead)
    np.testing.assert_allclose(found[:, :4], quaternions(ahead), atol=1e-6)
    np.testing.assert_allclose(found[:, 4:7], np.tile(rate, (4, 1)), atol=1e-3)
    np.testing.assert_allclose(
        found[:-1, 7], np.diff(5e3 * ahead**2) / np.diff(ahead), rtol=1e-9
    )
    np.testing.assert_allclose(found[:, 8], 0.0, atol=1e-9)


def test_a_plan_that_begins_later_is_a_new_sample(followed: skyarm.Scenario) -> None:
    reference, leads = (
        followed.agent.law_reference,
        followed.agent.controller.par.preview,
    )

    def at(t: float) -> Any:
        return with_preview(reference.at(t), leads, lambda lead: reference.at(t + lead))

    still = update_sample(at(0.05), update_sample(at(0.0), None, 0.005), 0.05)
    assert still.age == 0.05
    coming = update_sample(at(0.9), still, 0.85)
    assert coming.age == 0.0
    assert coming.coming[0, -1, 0] > still.coming[0, -1, 0]


@pytest.mark.parametrize("axis", range(3))
def test_residuals_of_a_planned_state_are_errors_from_it_at_any_tilt(axis: int) -> None:
    """Turned and moved as one body, the plan upside down or not: the errors of scipy's
    rotations, weighted.
    """
    model, weights = (
        skyarm.Model(vehicle=skyarm.load_vehicle("hexacopter370_flying_arm_3")),
        Weights(),
    )
    rng = np.random.default_rng(axis)
    state, _, _, goal = examples(3, 6, planned=True)
    planned_at, turn = (
        Rotation.random(random_state=axis),
        Rotation.from_rotvec(0.01 * np.eye(3)[axis]),
    )
    position, joints = rng.normal(size=3), tuple(rng.normal(size=3).tolist())
    q = [
        np.roll(each.as_quat(), 1).tolist() for each in (planned_at, planned_at * turn)
    ]
    goal = dataclasses.replace(
        goal,
        position=Vec3(*position),
        joints=joints,
        planned=dataclasses.replace(
            goal.planned, attitude=Quaternion(*q[0]), rate=Vec3(1.0, 2.0, 3.0)
        ),
    )
    state = dataclasses.replace(
        state,
        position=Vec3(*position),
        quaternion=Quaternion(*q[1]),
        joints=joints,
        rate=Vec3(1.0, 2.0, 3.5),
    )
    found = np.array(state_residuals(model, weights, state, goal, "plan"))
    np.testing.assert_allclose(
        found[6:9], weights.heading * np.sin(0.01) * np.eye(3)[axis], atol=1e-9
    )
    np.testing.assert_allclose(found[9:12], [0.0, 0.0, weights.rate * 0.5], atol=1e-12)
    arm = np.array(
        frame_pose_world(
            model.vehicle, np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]), np.array(joints)
        )[0]
    )
    np.testing.assert_allclose(
        found[-3:],
        weights.tool * ((planned_at * turn).apply(arm) - planned_at.apply(arm)),
    )
    np.testing.assert_allclose(
        np.delete(found, [6, 7, 8, 11, 18, 19, 20]), 0.0, atol=1e-12
    )


@pytest.mark.thorough
@pytest.mark.parametrize("plant", ["rigid_body", "mujoco"])
def test_nmpc_follows_the_whole_plan(tmp_path: Path, plant: str) -> None:
    log = skyarm.run(written(catch(), tmp_path, controller=NMPC, plant={"kind": plant}))
    assert log.status == "completed"
    off = np.linalg.norm(log.tip - log.tip_reference, axis=1)
    held = (log.time >= SETTLE + 1.4) & (log.time <= SETTLE + 1.6)
    assert off[held].max() < 2e-3
    assert off.max() < 3e-3
    assert (
        np.linalg.norm(np.gradient(log.tip, log.time, axis=0), axis=1)[held].max() < 0.1
    )


@pytest.mark.thorough
def test_nmpc_follows_a_plan_through_a_tilt_of_ninety_degrees(tmp_path: Path) -> None:
    plan = skyarm.plan(skyarm.load_task("passthrough"))
    log = skyarm.run(written(plan, tmp_path))  # under nmpc by itself
    assert log.status == "completed"
    up = Rotation.from_quat(log.quaternion, scalar_first=True).as_matrix()[:, 2, 2]
    assert np.degrees(np.arccos(up)).max() > 89.0
    assert np.linalg.norm(log.position - log.position_reference, axis=1).max() < 5e-3
    assert np.linalg.norm(log.tip - log.tip_reference, axis=1).max() < 5e-3


def test_without_a_plan_its_mode_is_refused(
    caught: Plan, followed: skyarm.Scenario
) -> None:
    document = flight_document(
        caught, Path("plan.npz"), "hexacopter370_flying_arm_3"
    ) | {"controller": NMPC}
    hover = {
        "base": {"kind": "hover", "position": [0.0, 0.0, 1.0]},
        "joints": [0.0, 0.0, 0.0],
    }
    with pytest.raises(
        skyarm.ScenarioError,
        match=r"controller\.mode = 'plan': must be left out without a reference",
    ):
        skyarm.scenario_from({**document, "reference": hover})
    agent, planned = followed.agent, followed.agent.reference.planned
    assert planned is not None
    fewer = dataclasses.replace(planned, rotors=planned.rotors[:4])
    other = dataclasses.replace(
        agent, reference=dataclasses.replace(agent.reference, planned=fewer)
    )
    with pytest.raises(
        skyarm.ScenarioError, match=r"reference\.planned\.rotors = 4 signals: must be 6"
    ):
        skyarm.run(followed.with_agent(other))
    short = {"efforts": planned.efforts[:2], "force": (planned.times[1:],) * 3}
    for (name, rows), count in zip(short.items(), (3, 3), strict=True):
        wrong = dataclasses.replace(
            agent.reference, planned=dataclasses.replace(planned, **{name: rows})
        )
        words = (
            rf"reference\.planned\.{name}: must be {count} lists of 121 numbers, one"
            r" for each time"
        )
        with pytest.raises(skyarm.ScenarioError, match=words):
            skyarm.run(followed.with_agent(dataclasses.replace(agent, reference=wrong)))


def test_laws_that_do_not_follow_the_state_do_not_get_it(
    caught: Plan, followed: skyarm.Scenario, tmp_path: Path
) -> None:
    flagship, whole = (
        skyarm.load_scenario(written(caught, tmp_path)).agent.law_reference.at(2.0),
        followed.agent.law_reference.at(2.0),
    )
    assert flagship.turning == ()
    assert len(whole.turning) == 2 * (4 + 6)
    assert dataclasses.replace(whole, turning=()) == flagship
