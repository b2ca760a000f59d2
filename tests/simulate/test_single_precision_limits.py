"""Numbers beyond what 32 bits hold become infinite in a batch of 32-bit floats, without
a warning from inside.
"""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import skyarm

LIMIT = "plant.vehicle.links.0.joint.effort_limit"


@pytest.fixture(autouse=True)
def _quiet():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        yield


def planned(**changes):
    return skyarm.load_scenario(
        "case2_gust", **{"controller": "paper_ct", "duration": 0.5, **changes}
    )


def test_an_effort_limit_that_no_joint_reaches_flies_as_an_infinite_one():
    flown = []
    for limit in (1e300, np.inf, 1e30):
        scenario = skyarm.with_numbers(planned(), {LIMIT: 1.0})
        batch = skyarm.Batch(
            scenario, [LIMIT], metrics=("all", "all_continuous"), single=True
        )
        with np.errstate(all="warn"):
            flown.append(batch.fly({LIMIT: np.array([limit, 0.5])}))
    for other in flown[1:]:
        assert (
            np.asarray(other.state.joints[0]).tobytes()
            == np.asarray(flown[0].state.joints[0]).tobytes()
        )
    assert flown[0].completed.all()


@pytest.mark.parametrize(
    "controller", ["paper_ct", "centroidal_tip", "indi", "l1_adaptive", "kim2013"]
)
def test_no_law_and_no_metric_warns(controller):
    """Every first memory, every row of the reference and every first total, in
    lanes.
    """
    scenario = planned(controller=controller, duration=0.05)
    with np.errstate(all="warn"):
        outcome = skyarm.Batch(
            scenario, metrics=("all", "all_continuous"), single=True
        ).fly({})
    assert outcome.completed.all()


def test_a_lane_that_diverges_ends_and_warns_of_nothing():
    scenario = planned(duration=1.0)
    batch = skyarm.Batch(scenario, ["environment.wind.force.0"], single=True)
    with np.errstate(all="warn"):
        outcome = batch.fly({"environment.wind.force.0": np.array([0.0, 1e12])})
    assert outcome.status.tolist() == ["completed", "diverged"]
