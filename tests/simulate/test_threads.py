"""Episodes share nothing: flown from several threads at once they give the bits that
they give one after another.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from skyarm.scenario.scenario_file import load_scenario, scenario_from
from skyarm.simulate import Log, Scenario, run
from support.flights import document


@pytest.fixture
def eager_switching() -> Iterator[None]:
    """Threads that take turns after microseconds, so that what they share is hit in
    between.
    """
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    yield
    sys.setswitchinterval(before)


def episodes() -> list[Scenario]:
    """Equal and unequal ones: noise, wind, delays, the same vehicle under two
    controllers, and on both plants.
    """
    noisy = [
        document("everything", duration=0.1, plant__kind=plant)
        for plant in ("rigid_body", "mujoco")
    ]
    found = [
        scenario_from(noisy[k], replaced={"seed": seed})
        for k, seed in ((0, 3), (0, 4), (0, 3), (1, 3))
    ]
    paper = (
        load_scenario("case3_wind", controller=c, duration=0.1)
        for c in ("paper_ct", "paper_pd")
    )
    return [
        *found,
        *paper,
        load_scenario(
            "case3_wind", plant="mujoco", controller="paper_ct", duration=0.1
        ),
    ]


def same(one: Log, other: Log) -> bool:
    return one.info == other.info and all(
        np.array_equal(array, other.arrays()[name], equal_nan=True)
        for name, array in one.arrays().items()
    )


@pytest.mark.usefixtures("eager_switching")
def test_episodes_flown_at_once_equal_those_flown_one_after_another() -> None:
    scenarios = episodes()
    alone = [run(scenario) for scenario in scenarios]
    with ThreadPoolExecutor(len(scenarios)) as pool:
        together = list(pool.map(run, scenarios))
    assert [same(a, b) for a, b in zip(alone, together, strict=True)] == [True] * len(
        scenarios
    )
    # the comparison can tell: another seed is another flight
    assert not same(alone[0], alone[1])
    assert same(alone[0], alone[2])
