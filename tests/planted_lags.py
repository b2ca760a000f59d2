"""Vehicles whose motors and joint drives lag, for tests that find it again."""

import dataclasses

from skyarm.dynamics.actuators.drive import LaggedTorque
from skyarm.scenario.scenario_record import JointDrive


def with_slower_motors(vehicle, times):
    """The vehicle with the time constants of its motors so many times as long."""
    rotors = tuple(
        dataclasses.replace(
            each, time_constant_up=times * each.time_constant_up, time_constant_down=times * each.time_constant_down
        )
        for each in vehicle.rotors
    )
    return dataclasses.replace(vehicle, rotors=rotors)


def lagging_drives(vehicle, lag):
    """A drive with a lag (s) for every joint; none where there is no lag."""
    return tuple(
        JointDrive(joint=link.joint.name, drive=LaggedTorque(time_constant=lag)) for link in vehicle.links if lag
    )
