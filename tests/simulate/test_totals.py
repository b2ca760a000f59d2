"""Metrics counted on the fly against those of the log, which share no code: NumPy over the whole flight."""

from __future__ import annotations

import math

import numpy as np
import pytest
from simulate_flights import document

from skyarm.algebra import Quaternion
from skyarm.simulate import Window, run
from skyarm.simulate import metrics as of_log
from skyarm.simulate.batch import Batch
from skyarm.simulate.metrics import Errors
from skyarm.simulate.scenario_file import scenario_from
from skyarm.simulate.totals import Instant, Windows, counted, metrics, nothing_yet, roll_and_pitch

STEADY, EARLY = Window(0.8, 1.6), Window(0.1, 0.7)
WINDOWS = Windows(steady_start=0.8, steady_stop=1.6, transient_start=0.1, transient_stop=0.7)


@pytest.fixture(scope="module")
def pair(tmp_path_factory):
    """A moving, gusty, tilted flight: metrics on the fly and from its log."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SKYARM_CACHE", str(tmp_path_factory.mktemp("cache")))
        scenario = scenario_from(
            document(
                "case2_gust",
                duration=2.0,
                initial={"quaternion_wxyz": [0.96, 0.28, 0.0, 0.0], "joints": [0.3, -0.2]},
                environment__ground=False,
                reference__base__position=[0.0, 0.0, 5.0],
            ),
            "test",
        )
        outcome = Batch(scenario, windows=WINDOWS, exact=True).fly({})
        log = run(scenario)
    assert log.status == "completed"
    return {name: float(value[0]) for name, value in outcome.metrics.items()}, log


def expected(log):
    errors = Errors.held(log)
    found = of_log.constant_wind(log, errors, STEADY, EARLY)
    found |= of_log.motion(log, STEADY)
    found |= of_log.steady_and_transient(log, errors, STEADY, EARLY)
    return found


NAMES = [
    "position_error_mean",
    "position_error_max",
    "position_min",
    "joint_error_mean",
    "joint_error_max",
    "ee_error_mean",
    "ee_error_max",
    "pitch_mean",
    "pitch_rms",
    "pitch_ripple",
    "roll_rms",
    "peak_pitch",
    "peak_position",
    "iae_position",
    "iae_joint",
    "tau1_rms",
    "tau2_rms",
]


@pytest.mark.parametrize("name", NAMES)
def test_a_metric_counted_on_the_fly_is_that_of_the_log(pair, name):
    """Sums of 160 to 400 numbers in another order: 1e-12 relative."""
    ours, log = pair
    wanted = expected(log)[name]
    assert wanted != 0.0
    assert ours[name] == pytest.approx(wanted, rel=1e-12)


def test_every_metric_is_compared(pair):
    assert set(pair[0]) == set(NAMES)


def instant(position=0.0, pitch=0.0):
    return Instant(position=position, joint=0.0, tool=0.0, roll=0.0, pitch=pitch, efforts=(0.0,))


def test_windows_are_half_open():
    windows = Windows(steady_start=1.0, steady_stop=2.0, transient_start=0.0, transient_stop=1.0)
    totals = nothing_yet(1)
    for time, error in ((0.5, 8.0), (1.0, 1.0), (1.5, 3.0), (2.0, 64.0)):
        totals = counted(totals, instant(error, -error), time, windows)
    found = metrics(totals, 0.5)
    assert totals.count == 2.0
    assert found["position_error_mean"] == 2.0
    assert found["position_error_max"] == 3.0
    assert found["position_min"] == 1.0
    assert found["pitch_mean"] == -2.0
    assert found["pitch_ripple"] == 1.0
    assert found["peak_position"] == 8.0
    assert found["iae_position"] == 0.5 * 76.0


def test_roll_and_pitch_are_those_of_scipy():
    Rotation = pytest.importorskip("scipy.spatial.transform").Rotation
    for angles in np.random.default_rng(2).uniform([-3.1, -1.5, -3.1], [3.1, 1.5, 3.1], (200, 3)):
        x, y, z, w = Rotation.from_euler("ZYX", angles[::-1]).as_quat()
        roll, pitch = roll_and_pitch(Quaternion(*map(float, (w, x, y, z))))
        assert roll == pytest.approx(angles[0], abs=1e-12)
        # near +-90 degrees arcsin loses half of the digits
        assert pitch == pytest.approx(angles[1], abs=1e-12 / max(math.cos(angles[1]), 1e-3))
