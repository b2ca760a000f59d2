"""A law on servos and rotors with tables, exported to C, gives the commands of the law in Python."""

from __future__ import annotations

import dataclasses
import re
import tomllib
from pathlib import Path

import numpy as np

from c_compiler import CAREFUL, needs_cc
from exported_law import Loaded
from flown import cases
from skyarm.control.actuator_layer import plain_model, with_actuators
from skyarm.control.catalogue import make_controller
from skyarm.control.model import Model
from skyarm.onboard.export_c import export_c
from skyarm.vehicle.thrust_table import ThrustTable
from skyarm.vehicle.vehicle_files import load_vehicle

VEHICLE = Path(__file__).parents[1] / "data" / "servo_arm.toml"
TABLE = ThrustTable(speed=(300.0, 600.0, 1100.0), thrust=(0.75, 2.9, 9.0), torque=(0.012, 0.048, 0.15))


@needs_cc
def test_setpoints_and_speeds_are_those_of_python(tmp_path):
    """Also with an integral, whose belief remembers, and a latency, which has a queue."""
    vehicle = load_vehicle(VEHICLE)
    assert tomllib.loads(VEHICLE.read_text())["drives"]["elbow"]["latency"] > 0.0
    k_f, k_m = TABLE.thrust_coefficient, TABLE.moment_coefficient
    rotors = tuple(
        dataclasses.replace(each, table=TABLE, thrust_coefficient=k_f, moment_coefficient=k_m)
        for each in vehicle.rotors
    )
    drives = tuple(
        dataclasses.replace(each, drive=dataclasses.replace(each.drive, integral=3.0)) for each in vehicle.drives
    )
    model = Model(vehicle=dataclasses.replace(vehicle, rotors=rotors, drives=drives))
    controller = with_actuators(make_controller("decoupled_pd", plain_model(model)), model, 0.005)
    text = export_c(controller, name="law", period=0.005).text
    in_c, memory = Loaded(text, tmp_path, ("-O2", *CAREFUL, "-ffp-contract=off")), controller.memory
    for case in cases(6, 3, joints=2):
        measurement = dataclasses.replace(case.measurement(), rotor_speeds=(700.0,) * 6)
        memory, command = controller.law(memory, measurement, case.reference(), 0.005, par=controller.par)
        wanted = [float(each) for each in (*command.rotor_speeds, *command.efforts)]
        np.testing.assert_allclose(in_c(measurement, case.reference()), wanted, rtol=1e-12, atol=1e-12)
    members = re.findall(r"^    double \w+(?:\[\d+\])*;.*$", text, re.MULTILINE)
    assert [line for line in members if not re.search(r"/\* .*\S \*/$", line)] == []
