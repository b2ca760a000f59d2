"""Rotors, mixer and joint drives: from commands to forces on the vehicle."""

from skyarm.actuation.command import Command
from skyarm.actuation.drive import friction, joint_force, limited_effort, stop_force
from skyarm.actuation.mixer import AllocationError, Mixer, allocation_matrix, make_mixer, mix
from skyarm.actuation.rotor import rotor_force, rotor_forces, speed_after, speeds_after

__all__ = [
    "AllocationError",
    "Command",
    "Mixer",
    "allocation_matrix",
    "friction",
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
