"""Flights whose reference a governor slows: the same bits on every engine, errors
against the command, lag beside.
"""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

import skyarm
from skyarm.log.flight_summary import facts
from skyarm.log.metrics.path_distance import path_distance
from skyarm.log.metrics.score import score
from skyarm.reference.path_time import governed_reference
from skyarm.scenario.scenario_file import scenario_from
from skyarm.simulate.batch import Batch
from skyarm.simulate.loop import run_in_python
from skyarm.studies.stability.flight_margins import hovering

CIRCLE = {"kind": "sine", "amplitude": 0.6, "frequency_hz": 1.2}
DOCUMENT = {
    "name": "slowed",
    "duration": 2.0,
    "plant": {"vehicle": "hummingbird_arm2_rotors"},
    "controller": {"preset": "paper_ct"},
    "reference": {
        "base": {
            "kind": "signals",
            "x": CIRCLE,
            "z": {"kind": "sum", "signals": [2.0, CIRCLE | {"phase": 1.5}]},
        },
        "joints": [CIRCLE, 0.2],
        "governor": {"reserve": 0.2},
    },
}
SLOWED = scenario_from(DOCUMENT)


@pytest.fixture(scope="module")
def log():
    return skyarm.run(SLOWED)


def same(a, b):
    return a.arrays().keys() == b.arrays().keys() and all(
        np.array_equal(array, b.arrays()[name]) for name, array in a.arrays().items()
    )


def test_machine_code_python_and_sessions_fly_the_same_bits(log):
    assert log.status == "completed"
    assert same(log, run_in_python(SLOWED))
    session = skyarm.Session(SLOWED)
    while session.step():
        pass
    assert same(log, session.log)
    assert same(log, skyarm.run(log.scenario))


def test_a_batch_flies_it_too_with_its_lag_among_the_metrics(log):
    names = (
        "reference_lag_mean",
        "reference_lag_max",
        "position_error_mean_continuous",
    )
    batch = Batch(SLOWED, ["plant.gravity"], metrics=names, bit_exact=True)
    found = batch.fly({"plant.gravity": np.array([9.81, 9.9])}).metrics
    alone = score(log, names)
    for name in names:
        assert found[name][0] == pytest.approx(alone[name], rel=1e-12)
    assert found["reference_lag_max"][1] == found["reference_lag_max"][0]
    assert alone["reference_lag_max"] == (log.time - log.path_time).max() > 0.3


def test_the_law_gets_the_governed_sample_and_errors_are_taken_against_the_command(log):
    received = []

    def listen(memory, measurement, reference, dt, *, par):
        received.append(reference)
        return law(memory, measurement, reference, dt, par=par)

    law = SLOWED.controller.law
    heard = dataclasses.replace(SLOWED.controller, law=listen, compiled=False)
    skyarm.run(dataclasses.replace(SLOWED, controller=heard, duration=1.0))
    for k in (0, 60, 130):
        # samples are published at 50 Hz and held for four periods of 200 Hz
        wanted = governed_reference(
            SLOWED.reference, SLOWED.path_time, (k // 4 * 4) / 200.0
        )
        for name in ("position", "velocity", "acceleration", "joints", "joint_rates"):
            given = np.array(list(getattr(received[-200 + k], name)), dtype=float)
            assert np.allclose(
                given,
                np.array(list(getattr(wanted, name)), dtype=float),
                rtol=1e-12,
                atol=1e-12,
            )
    commanded = SLOWED.reference.at(log.time)
    assert np.allclose(log.position_reference[:, 0], commanded.position.x, atol=1e-12)


def test_the_log_keeps_the_path_s_time_in_every_file(log, tmp_path):
    assert np.array_equal(log.path_time, SLOWED.path_time.derivatives(log.time)[0])
    assert np.array_equal(
        skyarm.Log.load_npz(log.save_npz(tmp_path / "a.npz")).path_time, log.path_time
    )
    assert (
        ",path_time [s]" in log.save_csv(tmp_path / "a.csv").read_text().splitlines()[0]
    )
    free = skyarm.run(dataclasses.replace(SLOWED, path_time=None, duration=0.02))
    assert "path_time" not in free.arrays()
    assert score(free, ("reference_lag_max",))["reference_lag_max"] == 0.0


def test_the_distance_to_a_path_is_that_to_its_nearest_line():
    path = np.array(
        [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0]]
    )
    points = np.array(
        [[0.5, -0.2, 0.0], [1.3, 0.5, 0.4], [-3.0, 4.0, 0.0], [1.0, 0.25, 0.0]]
    )
    assert np.allclose(path_distance(points, path), [0.2, 0.5, 5.0, 0.0])
    assert np.allclose(path_distance(points, path[:1]), np.linalg.norm(points, axis=1))


def test_a_run_s_summary_has_the_lag_beside_the_errors(log):
    found = facts(log)
    beside = found["governor"]
    assert set(beside) == {"lag", "base_to_path", "tip_to_path"}
    assert beside["lag"]["max_whole_flight"] == (log.time - log.path_time).max()
    assert (
        beside["base_to_path"]["max_whole_flight"]
        < found["errors_continuous"]["position"]["max_whole_flight"]
    )
    free = skyarm.run(dataclasses.replace(SLOWED, path_time=None, duration=0.02))
    assert "governor" not in facts(free)


def test_a_settled_hover_of_a_governed_scenario_has_no_governor():
    assert hovering(SLOWED).path_time is None


EXAMPLE = Path(__file__).resolve().parents[2] / "examples/fast_circle.toml"


@pytest.mark.thorough
@pytest.mark.parametrize("plant", ["rigid_body", "mujoco"])
def test_the_example_flies_along_a_path_on_which_it_is_lost_as_commanded(plant):
    scenario = skyarm.load_scenario(EXAMPLE, plant=plant)
    log = skyarm.run(scenario)
    assert log.status == "completed"
    distance = path_distance(log.tip, log.tip_reference)
    assert distance.mean() < 0.015
    assert distance.max() < 0.06
    lost = skyarm.run(dataclasses.replace(scenario, path_time=None))
    assert path_distance(lost.tip, lost.tip_reference).max() > 0.5
