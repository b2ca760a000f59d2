"""The lagged torque against the differential equation it stands for, whatever the
control period.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from skyarm.dynamics.actuators.drive import LaggedTorque, TorqueDrive
from skyarm.records.registry import find

LAG = 0.04


@pytest.mark.parametrize("dt", [0.0025, 0.005, 0.02, 0.1])
def test_the_impulse_of_every_period_is_that_of_the_continuous_lag(dt):
    setpoints = [0.3, -1.0, -1.0, 0.7, 0.7, 0.7]
    drive = LaggedTorque(time_constant=LAG)
    memory, torque = drive.begin(0.0, 0.2, dt), 0.2
    for setpoint in setpoints:
        memory = drive.advance(memory, setpoint, 0.0, 0.0, dt)
        found = solve_ivp(
            lambda _, y, u=setpoint: [(u - y[0]) / LAG, y[0]],
            (0.0, dt),
            [torque, 0.0],
            rtol=1e-10,
            atol=1e-12,
        )
        torque, impulse = found.y[:, -1]
        assert drive.effort(memory, setpoint, 0.0, 0.0) * dt == pytest.approx(
            impulse, abs=1e-9
        )
        assert memory.following == pytest.approx(torque, abs=1e-9)


def test_it_begins_with_what_holds_the_arm_and_settles_at_its_setpoint():
    drive = LaggedTorque(time_constant=LAG)
    memory = drive.begin(0.1, -0.4, 0.005)
    assert drive.effort(memory, -0.4, 0.1, 0.0) == -0.4
    assert drive.standing(-0.4, 0.1) == -0.4
    assert drive.effort(drive.steady_memory(memory, 0.1, 0.9), 0.9, 0.1, 0.0) == 0.9
    assert drive.effort(drive.start(0.1), 0.0, 0.1, 0.0) == 0.0


def test_it_has_a_name_and_refuses_a_lag_of_nothing():
    assert find("drive", "lagged_torque") is LaggedTorque
    assert issubclass(LaggedTorque, TorqueDrive), (
        "its command is a torque, counted and logged as such"
    )
    for lag in (0.0, -0.1, np.nan):
        with pytest.raises(ValueError, match=r"time_constant"):
            LaggedTorque(time_constant=lag)
