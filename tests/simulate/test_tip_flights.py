"""Flights along a reference of the tip: on both plants, in batches, by path, and read
back from a log.
"""

from functools import cache

import numpy as np
import pytest

import skyarm
from skyarm.log.formats import save_log
from skyarm.scenario.numbers import number_at, with_numbers
from skyarm.scenario.scenario_file import load_scenario
from skyarm.simulate.batch import Batch
from support.cases import sampled

TASK = {
    "name": "task",
    "duration": 6.0,
    "plant": {"vehicle": "hummingbird_arm2_rotors"},
    "controller": {"preset": "centroidal_tip"},
    "reference": {
        "tip": {
            "posture": [0.4, -0.8],
            "base_share": 0.6,
            "path": {
                "kind": "phases",
                "position": [0.0, 0.0, 0.7],
                "phases": [
                    {"kind": "hold", "duration": 0.5},
                    {"kind": "go_to", "position": [0.3, 0.2, 0.8], "duration": 2.5},
                    {"kind": "go_to", "position": [0.3, 0.2, 0.65], "duration": 2.0},
                ],
            },
        }
    },
}


def task(**plant):
    return skyarm.scenario_from(TASK | {"plant": TASK["plant"] | plant})


@cache
def flown(kind="rigid_body"):
    return skyarm.run(task(kind=kind))


@pytest.mark.parametrize("kind", sampled(["rigid_body", "mujoco"], 2))
def test_the_tip_stays_on_its_path(kind):
    log = flown(kind)
    assert log.status == "completed"
    error = np.linalg.norm(log.tip - log.tip_reference, axis=1)
    assert error.mean() < 1.5e-3
    assert error.max() < 10e-3
    np.testing.assert_allclose(log.tip[-1], [0.3, 0.2, 0.65], atol=1e-3)
    assert np.ptp(log.joints[:, 1]) > 0.1  # the arm did its share


def test_the_log_and_the_metrics_hold_the_tips_own_reference():
    log = flown()
    path = task().reference.tip
    wanted = np.array([path.path(float(t))[0] for t in log.time[::50]], dtype=float)
    np.testing.assert_array_equal(log.tip_reference[::50], wanted)
    error = np.linalg.norm(log.tip - log.tip_held, axis=1)
    metrics = skyarm.score(log)
    assert metrics["ee_error_max"] == pytest.approx(
        error[log.time >= 2.0].max(), rel=1e-12
    )


def test_a_batch_that_varies_the_path_flies_what_single_flights_fly():
    short = skyarm.scenario_from(
        TASK | {"duration": 1.5, "controller": {"preset": "paper_pd"}}
    )
    path = "reference.tip.x.signals.0.value"
    assert number_at(short, path) == 0.0
    batch = Batch(short, (path,), metrics=("ee_error_max",))
    found = batch.fly({path: np.array([0.0, 0.2])})
    for value, lane in zip((0.0, 0.2), found.metrics["ee_error_max"], strict=True):
        log = skyarm.run(with_numbers(short, {path: value}))
        assert lane == pytest.approx(skyarm.score(log)["ee_error_max"], rel=1e-9)
        assert log.tip_reference[0, 0] == value


def test_a_log_flies_again(tmp_path):
    save_log(flown(), tmp_path / "task.npz")
    again = load_scenario(tmp_path / "task.npz")
    assert again.reference == task().reference


def test_a_phase_waits_until_the_error_is_small_and_no_longer_than_its_timeout():
    phases = [
        {
            "kind": "go_to",
            "position": [0.2, 0.0, 0.7],
            "duration": 0.8,
            "until": {"error": 2e-3, "hold": 0.2},
        },
        {"kind": "hold", "duration": 0.2, "until": {"error": 1e-12, "timeout": 0.3}},
        {"kind": "go_to", "position": [0.0, 0.0, 0.7], "duration": 2.0},
    ]
    path = {"kind": "phases", "position": [0.0, 0.0, 0.7], "phases": phases}
    tip = {"posture": [0.4, -0.8], "path": path}
    # gains that leave something to wait for
    slow = {
        "controller": {"law": "centroidal", "mode": "tip", "bandwidth": 0.5},
        "duration": 3.0,
    }
    scenario = skyarm.scenario_from(TASK | slow | {"reference": {"tip": tip}})
    log = skyarm.run(scenario)
    error = np.linalg.norm(log.tip - log.tip_reference, axis=1)
    settled = next(
        k
        for k in range(160, 600)
        if (error[k - 40 : k + 1] <= 2e-3).all() and k - 40 >= 160
    )
    # the second phase, and its guard that is never met
    leaves = settled / 200 + 0.2 + 0.3
    assert 0.25 < settled / 200 - 0.8 < 1.5
    still = (log.time >= 0.8) & (log.time <= leaves + 1e-9)
    np.testing.assert_allclose(
        log.tip_reference[still], [[0.2, 0.0, 0.7]] * still.sum(), atol=1e-12
    )
    assert (log.tip_reference[log.time > leaves + 0.3][:, 0] < 0.2).all()
    assert log.tip_reference[round(leaves * 200) + 20, 0] < 0.2
    again = skyarm.replay(log)
    np.testing.assert_array_equal(
        again.log.tip if hasattr(again, "log") else again.tip, log.tip
    )
