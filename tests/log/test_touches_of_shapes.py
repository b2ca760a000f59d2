"""What a report says of shapes that touched: pairs, times and forces, and a metric."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import skyarm
from skyarm.log.flight_summary import facts, summary
from skyarm.log.periods import contact_pairs
from skyarm.scenario.scenario_file import scenario_from
from support.shaped import shaped


@pytest.fixture(scope="module")
def landed(tmp_path_factory: Any) -> skyarm.Log:
    """A ball of 2 cm, 10 cm below a vehicle that flies down through z = 0.12 m."""
    folder = Path(tmp_path_factory.mktemp("landed"))
    ball = {"shape": "sphere", "size": [0.02], "position": [0.0, 0.0, -0.1]}
    down = {"kind": "ramp", "start": 0.2, "duration": 1.0, "height": -0.2}
    document = {
        "schema": 1,
        "name": "lands",
        "duration": 2.0,
        "plant": {"vehicle": shaped(folder, [ball])},
        "controller": {"law": "decoupled_pd"},
        "reference": {
            "base": {
                "kind": "signals",
                "z": [{"kind": "constant", "value": 0.3}, down],
            }
        },
        "world": {"surfaces": [{"name": "room/floor"}, {"name": "roof", **ROOF}]},
    }
    return skyarm.run(scenario_from(document, folder))


ROOF = {"shape": "sphere", "size": [0.1], "position": [0.0, 0.0, 9.0]}


def test_touched_pairs_are_reported_with_first_touch_and_largest_force(landed):
    force = landed.component("collision_force")
    assert not force[:, 1].any(), "nothing touches the roof"
    first = int(np.argmax(force[:, 0] > 0.0))
    low = landed.position[:, 2] < 0.12
    # of a ball below a vehicle that hardly tilts
    assert abs(int(np.argmax(low)) - first) <= 1
    touch = landed.contact_periods[0]
    assert touch.start == landed.time[first]
    assert (touch.point, touch.surface) == ("base", "room/floor")
    assert contact_pairs(landed, "collision_force")[0] == ("base", "room/floor")
    (fact,) = facts(landed)["contacts"]
    assert fact["pair"] == "base/room/floor"
    assert not {"surface", "point"} & {*fact}
    start = f"base touched room/floor at {landed.time[first]:g} s: lost "
    lines = map(str, summary(landed, facts(landed)))
    (line,) = (each for each in lines if each.startswith(start))
    assert line.endswith(f"largest force {force.max():.3g} N")


def test_the_metric_is_the_largest_force_of_any_pair(landed):
    score = skyarm.score(landed, ["collision_force"])
    assert score["collision_force"] == landed.component("collision_force").max() > 0.0


def test_a_flight_without_shapes_has_no_collision_force():
    log = skyarm.run(skyarm.load_scenario("case1"))
    assert skyarm.score(log, ["collision_force"]) == {"collision_force": 0.0}


def test_a_touch_of_two_vehicles_is_logged_and_counted_once(tmp_path):
    """One flies into the other, which hovers 0.6 m away; balls of 0.2 m."""
    vehicle = shaped(tmp_path, [{"shape": "sphere", "size": [0.2]}])
    surge = {"kind": "ramp", "start": 0.2, "duration": 1.0, "height": 0.4}
    agents = {
        name: {
            "plant": {"vehicle": vehicle},
            "controller": {"law": "decoupled_pd"},
            "reference": {"base": {"kind": "signals", "x": x, "z": 1.0}},
        }
        for name, x in (("left", surge), ("right", 0.6))
    }
    world = {"surfaces": [{"name": "ground"}]}
    document = {"schema": 1, "name": "two", "duration": 2.0, "agents": agents}
    scenario = scenario_from({**document, "world": world}, tmp_path)
    log = skyarm.run(scenario)
    force = log.component("collision_force")
    assert force[:, :2].max() == 0.0 < force[:, 2].max()
    assert contact_pairs(log, "collision_force")[2] == ("left.base", "right.base")
    apart = np.linalg.norm(
        log.agents["left"].position - log.agents["right"].position, axis=1
    )
    first = int(np.argmax(force[:, 2] > 0.0))
    assert abs(int(np.argmax(apart < 0.4)) - first) <= 1
    assert skyarm.score(log, ["collision_force"]) == {"collision_force": force.max()}
    counted = skyarm.Batch(scenario, metrics=["collision_force"]).fly({}).metrics
    assert counted["collision_force"] == pytest.approx([force.max()], rel=1e-9)
