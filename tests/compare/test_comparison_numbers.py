"""Numbers of the comparison's own: the turned wind, the ends of every spread, tables and lists as printed."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from skyarm.algebra import Vec3
from skyarm.compare.comparison import Comparison
from skyarm.compare.comparison_tables import markdown
from skyarm.compare.entrants import ENTRANTS
from skyarm.compare.overwrites import replaced
from skyarm.compare.perturbed_plants import Spread, draw
from skyarm.compare.suite import CASES, conditions, turned
from skyarm.environment.wind import ForceWind
from skyarm.scenario.numbers import number_at

COUNT = 2000


@pytest.mark.parametrize("angle", [0.5 * math.pi, -0.3, 2.0, math.pi])
def test_a_turned_wind_is_that_of_scipy_about_the_vertical(angle):
    wind = ForceWind(force_W=Vec3(1.0, 0.4, -0.2), air_velocity_W=Vec3(-3.0, 2.0, 0.5))
    found = turned(wind, angle)
    about = Rotation.from_rotvec([0.0, 0.0, angle])
    assert np.allclose([*found.force_W], about.apply([1.0, 0.4, -0.2]), rtol=0.0, atol=1e-15)
    assert np.allclose([*found.air_velocity_W], about.apply([-3.0, 2.0, 0.5]), rtol=0.0, atol=1e-14)


def bounds():
    """Path, lowest and highest value of every kind of number of a spread, about the truth of the case."""
    scenario, spread = CASES["case3_wind"].build(), Spread()
    truth = scenario.world.vehicle
    low, high = spread.thrust
    found = {
        "plant.payload.mass": (0.0, spread.payload),
        "delays.command": (0.0, spread.delay),
        "plant.vehicle.links.0.joint.damping": (0.0, spread.damping),
    }
    shares = {"plant.vehicle.base.mass": spread.mass, "plant.vehicle.links.1.body.mass": spread.mass}
    shares |= {"plant.vehicle.links.0.body.inertia.yy": spread.inertia, "plant.vehicle.base.inertia.zz": spread.inertia}
    for path, share in shares.items():
        found[path] = ((1.0 - share) * number_at(scenario, path), (1.0 + share) * number_at(scenario, path))
    for i in range(len(truth.rotors)):
        path = f"plant.vehicle.rotors.{i}.thrust_coefficient"
        found[path] = ((1.0 + low) * number_at(scenario, path), (1.0 + high) * number_at(scenario, path))
    for body in ("base", "links.0.body", "links.1.body"):
        for axis in "xyz":
            path = f"plant.vehicle.{body}.com.{axis}"
            found[path] = (number_at(scenario, path) - spread.com, number_at(scenario, path) + spread.com)
    return found


@pytest.fixture(scope="module")
def drawn():
    return draw(CASES["case3_wind"].build(), Spread(), COUNT, seed=11)


@pytest.mark.parametrize(("path", "ends"), bounds().items(), ids=str)
def test_2000_plants_come_within_half_a_percent_of_both_ends_and_never_past_them(drawn, path, ends):
    """An even number misses the last half percent 2000 times in a row once in 20000 seeds."""
    low, high = ends
    near, slack = 0.005 * (high - low), 1e-12 * (high - low)
    assert low - slack <= drawn[path].min() < low + near
    assert high - near < drawn[path].max() <= high + slack


def test_numbers_of_different_bodies_and_axes_are_drawn_apart(drawn):
    paths = [f"plant.vehicle.{body}.com.{axis}" for body in ("base", "links.0.body", "links.1.body") for axis in "xyz"]
    paths += ["plant.vehicle.base.mass", "plant.vehicle.links.0.body.mass", "plant.vehicle.links.1.body.mass"]
    paths += ["plant.vehicle.base.inertia.xx", "plant.vehicle.links.0.body.inertia.xx"]
    table = np.corrcoef([drawn[path] for path in paths]) - np.eye(len(paths))
    # standard error 1 / sqrt(2000) = 0.022
    assert np.abs(table).max() < 0.1


@pytest.mark.parametrize("columns", [1, 2, 4])
def test_a_table_has_a_rule_for_every_column_with_numbers_to_the_right(columns):
    head, rule, row = markdown(["law", "a", "b", "c"][:columns], [["x", "1", "2", "3"][:columns]]).splitlines()
    assert rule.strip("|").split("|") == [" --- ", *[" ---: "] * (columns - 1)]
    assert head.count("|") == rule.count("|") == row.count("|") == columns + 1


@pytest.mark.parametrize("count", [3, 4, 5])
def test_up_to_four_laws_of_another_comparison_are_named_more_are_counted(tmp_path, count):
    laws = sorted(ENTRANTS)[:count]
    summaries = {"perfect": {"case1": {law: {"episodes": 1} for law in laws}}}
    file = tmp_path / "results.json"
    file.write_text(json.dumps({"seed": 0, "plant": "rigid_body", "summaries": summaries}))
    comparison = Comparison(
        entrants={sorted(ENTRANTS)[-1]: ENTRANTS[sorted(ENTRANTS)[-1]]},
        conditions={"perfect": conditions(1, 1)["perfect"]},
    )
    assert replaced(comparison, file) == [f"laws {', '.join(laws)}" if count <= 4 else "laws (5)"]
