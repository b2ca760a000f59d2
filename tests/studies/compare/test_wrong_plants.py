"""The plants that nobody believes in: bounds, independence of what flies, and that each
of them can be.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from skyarm.scenario.numbers import number_at, with_numbers
from skyarm.simulate import Delays
from skyarm.studies.compare.perturbed_plants import Spread, draw
from skyarm.studies.compare.suite import CASES, conditions

SCENARIO = CASES["case3_wind"].build()
COUNT = 2000


@pytest.fixture(scope="module")
def drawn():
    return draw(SCENARIO, Spread(), COUNT, seed=3)


def shares(drawn, path):
    return drawn[path] / number_at(SCENARIO, path)


@pytest.mark.parametrize(
    ("path", "low", "high"),
    [
        ("plant.vehicle.base.mass", 0.8, 1.2),
        ("plant.vehicle.links.1.body.mass", 0.8, 1.2),
        ("plant.vehicle.base.inertia.xx", 0.7, 1.3),
        ("plant.vehicle.rotors.2.thrust_coefficient", 0.90, 1.05),
    ],
)
def test_a_share_fills_its_bounds_evenly(drawn, path, low, high):
    found = (shares(drawn, path) - low) / (high - low)
    # 2000 even numbers fail this less than once in a thousand seeds
    assert stats.kstest(found, "uniform").pvalue > 1e-3


@pytest.mark.parametrize(
    ("path", "high"),
    [
        ("plant.vehicle.links.0.joint.damping", 0.02),
        ("plant.payload.mass", 0.1),
        ("delays.command", 0.010),
    ],
)
def test_a_number_from_nothing_fills_its_bounds_evenly(drawn, path, high):
    assert stats.kstest(drawn[path] / high, "uniform").pvalue > 1e-3


def test_centres_of_mass_move_by_a_centimetre_at_most_along_each_axis(drawn):
    for axis in "xyz":
        path = f"plant.vehicle.links.0.body.com.{axis}"
        moved = (drawn[path] - number_at(SCENARIO, path)) / 0.01
        assert stats.kstest(0.5 * (moved + 1.0), "uniform").pvalue > 1e-3


def test_the_wind_blows_from_every_side_with_an_even_strength(drawn):
    force = np.stack(
        [drawn[f"environment.wind.force_W.{axis}"] for axis in "xyz"], axis=1
    )
    strength = np.linalg.norm(force, axis=1)
    assert stats.kstest(strength / 3.0, "uniform").pvalue > 1e-3
    height = force[:, 2] / strength
    assert stats.kstest(0.5 * (height + 1.0), "uniform").pvalue > 1e-3
    azimuth = np.arctan2(force[:, 1], force[:, 0]) / (2.0 * np.pi) + 0.5
    assert stats.kstest(azimuth, "uniform").pvalue > 1e-3


def test_numbers_of_different_things_are_not_correlated(drawn):
    paths = [
        "plant.vehicle.base.mass",
        "plant.vehicle.base.inertia.xx",
        "plant.payload.mass",
        "delays.command",
    ]
    paths += [
        "plant.vehicle.rotors.0.thrust_coefficient",
        "plant.vehicle.base.com.x",
        "environment.wind.force_W.x",
    ]
    table = np.corrcoef([drawn[path] for path in paths]) - np.eye(len(paths))
    # standard error 1 / sqrt(2000) = 0.022
    assert np.abs(table).max() < 0.1


def test_the_moments_of_a_body_change_together_so_that_it_stays_a_body(drawn):
    xx, yy = (
        shares(drawn, "plant.vehicle.base.inertia.xx"),
        shares(drawn, "plant.vehicle.base.inertia.yy"),
    )
    assert np.allclose(xx, yy, rtol=1e-15)


def test_every_one_of_them_is_a_vehicle(drawn):
    late = SCENARIO.__class__(
        **{**_fields(SCENARIO), "delays": Delays(longest_command=0.010)}
    )
    for k in range(0, COUNT, 100):
        with_numbers(late, {path: float(values[k]) for path, values in drawn.items()})


def test_the_first_plants_do_not_depend_on_how_many_there_are(drawn):
    few = draw(SCENARIO, Spread(), 10, seed=3)
    assert all(np.array_equal(few[path], drawn[path][:10]) for path in drawn)


def test_another_seed_gives_other_plants(drawn):
    other = draw(SCENARIO, Spread(), COUNT, seed=4)
    assert not np.any(
        other["plant.vehicle.base.mass"] == drawn["plant.vehicle.base.mass"]
    )


def test_all_conditions_name_cases_of_the_suite():
    assert {case for each in conditions().values() for case in each.cases} == set(CASES)


def _fields(record):
    return {name: getattr(record, name) for name in record.__dataclass_fields__}
