"""Electrical power of rotors: by a table of currents at its voltage, else by torque,
speed and efficiency.
"""

import dataclasses

import pytest

import skyarm
from skyarm.vehicle.battery import rotor_power

ROTOR = skyarm.load_vehicle("hummingbird_arm2_rotors").rotors[0]


def test_power_is_torque_times_speed_over_efficiency_and_all_other_loads():
    torque = float(ROTOR.thrust_coefficient * ROTOR.moment_coefficient) * 500.0**2
    assert rotor_power((ROTOR,) * 2, (500.0,) * 2, 0.7, 11.1, 5.0) == pytest.approx(
        5.0 + 2.0 * torque * 500.0 / 0.7
    )


def test_a_table_of_currents_gives_them_at_its_voltage():
    class Table:
        current = (1.0, 2.0)

        def current_at(self, speed):
            return 0.01 * speed

    measured = dataclasses.replace(ROTOR)
    object.__setattr__(measured, "table", Table())
    assert rotor_power((measured,), (300.0,), 0.7, 11.1, 5.0) == pytest.approx(
        5.0 + 3.0 * 11.1
    )
