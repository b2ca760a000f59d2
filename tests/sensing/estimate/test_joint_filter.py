"""The filter of the encoders: steady rates, its lag under an acceleration, old
readings, readings that do not come.
"""

from __future__ import annotations

import numpy as np
import pytest

from skyarm.sensing.estimate.filter_models import FilteredJoints, filter_joints
from skyarm.sensing.sensor_kinds import EncoderReading

DT = 0.005
BANDWIDTH = 60.0


def flown(
    motion,
    seconds: float = 1.0,
    latency: float = 0.0,
    every: int = 1,
    inertial=lambda k: k * DT,
):
    """Follow a motion of one joint; what the filter believes at the end and the instant
    of it.

    ``inertial`` is the instant of the inertial unit's last reading in each period.
    """
    memory, reading = FilteredJoints(joints=(0.0,), rates=(0.0,), read=0.0), None
    for k in range(round(seconds / DT) + 1):
        t = k * DT
        if k % every == 0:
            read = max(0.0, t - latency)
            reading = EncoderReading(
                time=read, joints=(motion(read),), joint_rates=(9.0,)
            )
        memory = filter_joints(memory, reading, k > 0, BANDWIDTH, inertial(k), DT)
    return memory, t


@pytest.mark.parametrize(
    ("latency", "every"), [(0.0, 1), (0.015, 1), (0.0, 4), (0.02, 4)]
)
def test_a_steady_rate_is_followed_without_error(latency, every):
    memory, t = flown(lambda t: 0.3 + 0.7 * t, 2.0, latency, every)
    assert memory.rates[0] == pytest.approx(0.7, abs=1e-6)
    assert memory.joints[0] == pytest.approx(0.3 + 0.7 * t, abs=1e-7)


@pytest.mark.parametrize(
    "inertial",
    [
        pytest.param(lambda k: k // 2 * 2 * DT, id="100 Hz"),
        pytest.param(lambda k: k // 4 * 4 * DT, id="50 Hz"),
        pytest.param(
            lambda k: (k if k <= 340 else 340) * DT, id="lost for the last 300 ms"
        ),
        pytest.param(
            lambda k: (k if k <= 300 or k >= 390 else 300) * DT,
            id="lost for 450 ms and back",
        ),
        pytest.param(lambda k: 0.0, id="never a second one"),
    ],
)
def test_joints_are_of_the_present_whether_the_inertial_unit_speaks_or_not(inertial):
    memory, t = flown(lambda t: 0.3 + 0.7 * t, 2.0, 0.01, 1, inertial)
    assert memory.now == pytest.approx(t, abs=1e-9)
    assert memory.rates[0] == pytest.approx(0.7, abs=1e-6)
    assert memory.joints[0] == pytest.approx(0.3 + 0.7 * t, abs=1e-7)


def test_joints_are_as_old_as_an_inertial_unit_that_is_late():
    """Late by 20 ms at 100 Hz: after the start one instant holds for all that the law
    is told, or a period more.
    """
    memory, t = flown(
        lambda t: 0.3 + 0.7 * t, 2.0, 0.0, 1, lambda k: max(0, k // 2 * 2 - 4) * DT
    )
    assert memory.now == pytest.approx(t - 0.02, abs=1e-9)
    assert memory.rates[0] == pytest.approx(0.7, abs=1e-6)
    assert memory.joints[0] == pytest.approx(0.3 + 0.7 * memory.now, abs=1e-7)


def test_the_clock_of_the_readings_counts_not_the_period_that_is_stated():
    """Where the calls come 1 % slower than stated the joints keep up with the readings'
    instants.
    """
    memory, dt = FilteredJoints(joints=(0.0,), rates=(0.0,), read=0.0), 1.01 * DT
    for k in range(1000):
        reading = EncoderReading(
            time=k * dt, joints=(0.7 * k * dt,), joint_rates=(9.0,)
        )
        memory = filter_joints(memory, reading, k > 0, BANDWIDTH, k * dt, DT)
    assert memory.joints[0] == pytest.approx(0.7 * 999 * dt, abs=1e-7)
    assert memory.rates[0] == pytest.approx(0.7, abs=1e-6)


def test_a_steady_acceleration_leaves_a_rate_error_of_twice_its_size_by_bandwidth():
    memory, t = flown(lambda t: 0.5 * 3.0 * t * t)
    assert 3.0 * t - memory.rates[0] == pytest.approx(2 * 3.0 / BANDWIDTH, rel=0.2)


def test_both_poles_are_at_the_bandwidth():
    """The error of a step decays as (1 + c k) b^k: its logarithm falls by the bandwidth
    a second.
    """
    off = [
        abs(1.0 - flown(lambda t: 1.0 if t > 0 else 0.0, s)[0].joints[0])
        for s in (0.2, 0.3)
    ]
    assert np.log(off[0] / off[1]) / 0.1 == pytest.approx(BANDWIDTH, rel=0.15)


def test_a_reading_is_used_once():
    start = FilteredJoints(joints=(0.0,), rates=(0.0,), read=0.0)
    reading = EncoderReading(time=DT, joints=(0.1,), joint_rates=(0.0,))
    once = filter_joints(start, reading, True, BANDWIDTH, DT, DT)
    again = filter_joints(once, reading, True, BANDWIDTH, 2 * DT, DT)
    assert again.rates == once.rates
    assert again.joints[0] == pytest.approx(
        once.joints[0] + once.rates[0] * DT, rel=1e-14
    )
