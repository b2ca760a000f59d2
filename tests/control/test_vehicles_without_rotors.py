"""A vehicle without rotors, as files of simulators give that name them in plugins, is
refused by every law.
"""

from __future__ import annotations

import dataclasses

import pytest

from skyarm.control.catalogue import make_controller
from skyarm.control.controller import ControllerError
from skyarm.control.model import Model
from skyarm.dynamics.actuators import AllocationError
from skyarm.records.registry import names
from skyarm.vehicle.vehicle_files import load_vehicle


@pytest.mark.parametrize("law", names("law"))
def test_a_law_refuses_a_vehicle_without_rotors_in_a_line(law):
    bare = dataclasses.replace(load_vehicle("hummingbird_arm2_rotors"), rotors=())
    with pytest.raises((AllocationError, ControllerError), match="rotor"):
        make_controller(law, Model(vehicle=bare))
