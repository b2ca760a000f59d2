"""Comparison of laws on a scenario of several vehicles: every vehicle flies the law, a
row for each.
"""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

import skyarm
from skyarm.scenario.controller_table import under_law
from skyarm.scenario.scenario_record import Change, Scenario
from skyarm.studies.compare.cell_flights import SUCCESS_METRIC, Cell, successes
from skyarm.studies.compare.own_scenario import LAWS
from support.teams import team


def two() -> Scenario:
    """Two vehicles with arms in one scenario, which nothing joins."""
    one, other = (
        skyarm.load_scenario(name, duration=0.6) for name in ("case1", "case3")
    )
    return dataclasses.replace(one, agents={"left": one.agent, "right": other.agent})


def test_every_vehicle_flies_the_law_and_has_a_row(tmp_path: Path) -> None:
    scenario = two()
    found = skyarm.compare(scenario, ["own", "paper_pd"], tmp_path)
    ((laws,),) = (found.document["summaries"]["given"].values(),)
    assert [*laws] == ["own", "paper_pd"]
    flown = skyarm.score(
        skyarm.run(under_law(scenario, "paper_pd")), ["position_error_mean_continuous"]
    )
    means = {name: laws["paper_pd"]["metrics"][name]["mean"] for name in flown}
    assert means == pytest.approx(flown, rel=1e-9)
    assert [row[:3] for row in found.report.sections[0].tables[0].rows] == [
        [law, agent, "1 of 1"] for law in laws for agent in ("left", "right")
    ]
    assert "largest force at a grasp" in found.report.markdown()


def test_a_success_is_one_of_all_vehicles() -> None:
    """Four flights: both tips near, the left one away, the right one away, and near in
    a flight that ended early.
    """
    errors = {"left": [0.01, 0.03, 0.01, 0.01], "right": [0.019, 0.01, 0.021, 0.01]}
    metrics = {
        f"{name}/{SUCCESS_METRIC}": np.array(column) for name, column in errors.items()
    }
    cell = Cell(metrics=metrics, status=np.array(["completed"] * 3 + ["ground"]))
    assert successes(cell).tolist() == [True, False, False, False]


@pytest.mark.thorough
def test_usual_laws_that_do_not_fit_are_named_with_the_reason(tmp_path: Path) -> None:
    found = skyarm.compare(team("bar", duration=0.2), None, tmp_path)
    assert {*found.document["not_flown"]} == {*LAWS} - {"own"}
    assert "paper_pd does not fly: " in found.report.markdown()
    with pytest.raises(ValueError, match=r"paper_ct.*does not fit this model"):
        skyarm.compare(team("bar", duration=0.2), ["paper_ct"], tmp_path / "other")


def test_a_law_of_all_vehicles_ends_the_changes_of_their_laws() -> None:
    gains = Change(at=0.1, path="agents.left.controller.gains.position.x", value=4.0)
    mass = Change(at=0.1, path="agents.left.plant.vehicle.base.mass", value=0.8)
    changed = under_law(dataclasses.replace(two(), changes=(gains, mass)), "paper_ct")
    assert changed.changes == (mass,)
    assert {each.controller.name for each in changed.agents.values()} == {
        "hybrid_computed_torque"
    }


def test_each_vehicle_has_the_law_for_its_own_model() -> None:
    one, other = skyarm.load_scenario("case1"), skyarm.load_scenario("pull_door")
    pair = dataclasses.replace(one, agents={"left": one.agent, "right": other.agent})
    under = under_law(pair, "centroidal")
    models = {
        name: each.controller.par.model.vehicle.name
        for name, each in under.agents.items()
    }
    assert models == {"left": "hummingbird_arm2", "right": "hexarotor_arm6"}


def test_a_log_of_several_vehicles_is_flown_again_under_another_law() -> None:
    log = skyarm.run(two())
    again = skyarm.replay(log)
    other = skyarm.replay(log, "paper_pd")
    for name, own in log.agents.items():
        assert (again.agents[name].position == own.position).all()
        assert other.agents[name].info["controller"] == "decoupled_pd"
        assert (other.agents[name].position != own.position).any()
    with pytest.raises(ValueError, match=r"^agents = left, right: must be one here"):
        skyarm.replay(log, two().agents["left"].controller)
