"""Rotors, mixer and joint drives: from commands to forces on the vehicle."""

from skyarm.dynamics.actuators.command import Command
from skyarm.dynamics.actuators.drive import (
    friction,
    friction_per_rate,
    joint_force,
    limited_effort,
    stop_force,
)
from skyarm.dynamics.actuators.mixer import (
    AllocationError,
    Mixer,
    allocation_matrix,
    make_mixer,
    mix,
)
from skyarm.dynamics.actuators.rotor import (
    rotor_force,
    rotor_forces,
    speed_after,
    speeds_after,
)

__all__ = [
    "AllocationError",
    "Command",
    "Mixer",
    "allocation_matrix",
    "friction",
    "friction_per_rate",
    "joint_force",
    "limited_effort",
    "make_mixer",
    "mix",
    "rotor_force",
    "rotor_forces",
    "speed_after",
    "speeds_after",
    "stop_force",
]
