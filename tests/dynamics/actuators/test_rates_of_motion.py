"""Angular velocity and acceleration of an attitude that is given over time; what a
motor's limits need beside them.
"""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from skyarm.dynamics.actuators.motion_demand import rates_of
from skyarm.dynamics.actuators.servo import PositionServo


def test_a_steady_turn_about_any_axis_has_its_rate_and_no_acceleration():
    rate, time = np.array([0.7, -0.4, 1.1]), np.arange(41) * 1e-3
    start = Rotation.from_euler("ZYX", [0.4, -0.3, 0.8])
    R = np.moveaxis(
        (start * Rotation.from_rotvec(np.outer(time, rate))).as_matrix(), 0, -1
    )
    found, change = rates_of(R, time)
    np.testing.assert_allclose(
        found[:, 1:-1], np.repeat(rate[:, None], 39, axis=1), rtol=1e-5
    )
    np.testing.assert_allclose(change[:, 2:-2], 0.0, atol=1e-6)


@pytest.mark.parametrize(
    ("stated", "missing"),
    [
        ({"voltage", "resistance"}, "torque_constant"),
        ({"voltage", "torque_constant"}, "resistance"),
        ({"current_limit"}, "torque_constant"),
    ],
)
def test_a_limit_of_the_motor_needs_what_turns_it_into_torque(stated, missing):
    with pytest.raises(ValueError, match=f"{missing}: must be stated beside"):
        PositionServo.require_stated(stated)
    PositionServo.require_stated(
        {"voltage", "torque_constant", "resistance", "current_limit"}
    )
    PositionServo.require_stated({"stiffness"})
