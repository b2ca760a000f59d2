"""A plan flies: the scenario that the planner writes catches the ball, and the law knows the planned centre of mass."""

from __future__ import annotations

import copy
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import skyarm
from skyarm.control.laws.centroidal.law import planned_center
from skyarm.planning.plan_file import plan_bytes
from skyarm.planning.plan_report import SETTLE, flight_document
from skyarm.planning.planner import Plan
from skyarm.scenario.save import scenario_text
from support.plans import catch


@pytest.fixture(scope="module")
def caught() -> Plan:
    return skyarm.plan(skyarm.load_task("catch_a_ball"))


def written(plan: Plan, folder: Path, **tables: Any) -> Path:
    """Scenario file that flies a plan, with other tables or entries of them."""
    (folder / "plan.npz").write_bytes(plan_bytes(plan))
    document = copy.deepcopy(flight_document(plan, Path("plan.npz"), plan.task.vehicle.name))
    for name, entries in tables.items():
        document[name] = {**document[name], **entries}
    (folder / "flight.toml").write_text(scenario_text(document))
    return folder / "flight.toml"


@pytest.mark.parametrize("plant", ["rigid_body", pytest.param("mujoco", marks=pytest.mark.thorough)])
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
def test_the_tip_of_the_eagle_catch_stays_within_ten_millimetres(tmp_path: Path, plant: str) -> None:
    log = skyarm.run(written(catch(), tmp_path, plant={"kind": plant}))
    assert log.status == "completed"
    held = (log.time >= SETTLE + 1.4) & (log.time <= SETTLE + 1.6)
    assert held.sum() > 30
    assert np.linalg.norm(log.tip[held], axis=1).max() < 0.01
    assert np.linalg.norm(log.velocity[held], axis=1).min() > 0.5
    assert np.linalg.norm(log.position[-1] - [5.0, 0.0, 1.5]) < 0.02


def test_without_the_planned_centre_of_mass_the_tip_misses(caught: Plan, tmp_path: Path) -> None:
    scenario = skyarm.load_scenario(written(caught, tmp_path))
    tables = skyarm.load_scenario(written(caught, tmp_path)).agent.reference
    assert tables.planned is not None
    end = caught.t[caught.edges[2]] + SETTLE
    errors = []
    for flown in (scenario, scenario.with_agent(without_center(scenario.agent))):
        log = skyarm.run(flown)
        during = (log.time > end - 0.4) & (log.time < end - 0.2)
        wanted = [tables.at(float(t)).tip for t in log.time[during]]
        errors.append(float(np.linalg.norm(log.tip[during] - np.array(wanted), axis=1).max()))
    assert errors[1] > 3.0 * errors[0]


def without_center(agent: Any) -> Any:
    """An agent whose reference says nothing of the centre of mass."""
    import dataclasses

    return dataclasses.replace(agent, reference=dataclasses.replace(agent.reference, planned=None))


def test_a_governor_beside_a_plan_is_refused(caught: Plan, tmp_path: Path) -> None:
    with pytest.raises(skyarm.ScenarioError, match=r"reference\.governor: must be left out with a plan"):
        skyarm.load_scenario(written(caught, tmp_path, reference={"governor": True}))


def test_the_planned_centre_moves_on_as_taylors_polynomial_between_samples() -> None:
    c = np.array([1.0, -2.0, 0.5, 3.0, -4.0])  # value and derivatives of a quartic along x
    held = tuple(float(v) for value in c for v in (value, 2.0 * value, 0.0))
    moved = planned_center(held, 0.3)
    polynomial = np.polynomial.Polynomial(c / [1.0, 1.0, 2.0, 6.0, 24.0])
    for k, vector in enumerate(moved):
        exact = polynomial.deriv(k)(0.3) if k else polynomial(0.3)
        assert [*vector] == pytest.approx([exact, 2.0 * exact, 0.0], abs=1e-12)
