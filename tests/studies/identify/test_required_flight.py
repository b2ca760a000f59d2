"""What a motion requires of rotors: the wrench of their thrusts."""

import numpy as np
import pytest

import skyarm
from skyarm.scenario.scenario_record import first_state
from skyarm.studies.identify.required_flight import wrench_of_pushes
from skyarm.studies.tune.excitation import of_vehicle


def test_the_wrench_of_a_hover_holds_the_vehicle():
    """Of the speeds at which a scenario begins, the thrust is the weight, and no torque turns the base."""
    vehicle = skyarm.load_vehicle("hummingbird_arm2_rotors")
    state = first_state(of_vehicle(vehicle, "paper_ct"))
    wrench = wrench_of_pushes(vehicle.rotors) @ np.array([float(w) ** 2 for w in state.rotor_speeds])
    assert wrench[2] == pytest.approx(vehicle.mass * 9.81, rel=0.02)
    assert wrench[5] == pytest.approx(0.0, abs=1e-9)
