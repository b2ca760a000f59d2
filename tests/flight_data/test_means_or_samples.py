"""Rates of PX4's sensor_combined are means over their spans, or samples at their
stamps: its attitude tells which.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from skyarm.flight_data.px4_topics import by_attitude
from skyarm.flight_data.raw_tables import RawTable

SPAN = 0.005
FINE = np.arange(0, 6.0, SPAN / 20.0)
RATES = np.stack(
    [2.0 * np.sin(7.0 * FINE), np.cos(11.0 * FINE), 0.5 * np.sin(3.0 * FINE + 1.0)],
    axis=1,
)


def tables(
    means: bool, bias: float = 0.0, noise: float = 0.0
) -> tuple[RawTable, RawTable]:
    """Rates by their spans, placed at the middles of these, and the attitude that SciPy
    makes of them.
    """
    turns = Rotation.from_rotvec(RATES * (FINE[1] - FINE[0]))
    attitude = [Rotation.identity()]
    for turn in turns[:-1]:
        attitude.append(attitude[-1] * turn)
    rows = np.arange(20, len(FINE), 20)
    rates = np.stack(
        [RATES[k - 20 : k].mean(axis=0) if means else RATES[k] for k in rows]
    )
    rates += bias + noise * np.random.default_rng(3).standard_normal(rates.shape)
    q = Rotation.concatenate(attitude).as_quat(scalar_first=True)[::40] * np.resize(
        [1.0, -1.0], (len(FINE) // 40, 1)
    )
    gyro = {f"gyro_rad[{i}]": rates[:, i] for i in range(3)} | {
        "gyro_integral_dt": np.full(len(rows), 1e6 * SPAN)
    }
    gyro |= {
        "accelerometer_integral_dt": np.full(len(rows), 8e3),
        "accelerometer_time": FINE[rows] - 0.004,
    }
    motion = RawTable(columns=gyro, time=FINE[rows] - 0.5 * SPAN)
    return motion, RawTable(
        columns={f"q[{i}]": q[:, i] for i in range(4)}, time=FINE[::40][: len(q)]
    )


@pytest.mark.parametrize(("bias", "noise"), [(0.0, 0.0), (0.05, 0.02)])
def test_means_stay_at_the_middles_of_their_spans(bias: float, noise: float) -> None:
    motion, attitude = tables(True, bias, noise)
    assert by_attitude(motion, attitude) is motion


@pytest.mark.parametrize(("bias", "noise"), [(0.0, 0.0), (0.05, 0.02)])
def test_samples_go_back_to_their_stamps(bias: float, noise: float) -> None:
    motion, attitude = tables(False, bias, noise)
    found = by_attitude(motion, attitude)
    assert found.time == pytest.approx(motion.time + 0.5 * SPAN)
    assert found.columns["accelerometer_time"] == pytest.approx(
        motion.columns["accelerometer_time"] + 0.004
    )


def test_where_no_attitude_tells_them_they_are_means() -> None:
    motion, attitude = tables(False)
    still = RawTable(
        columns={
            name: np.full(9, column[0]) for name, column in attitude.columns.items()
        },
        time=FINE[:9],
    )
    for none in (still, RawTable(columns={}, time=attitude.time)):
        assert by_attitude(motion, none) is motion
