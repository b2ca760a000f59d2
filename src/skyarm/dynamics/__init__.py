"""Rigid-body dynamics of a floating base with any tree of joints, over any scalar type.

Accelerations are *proper* (gravity already subtracted: R^T (dv/dt + g e_z)) and in base
axes, so that neither attitude, position nor velocity of the base enters the recursions.
:mod:`skyarm.dynamics.array_front` is the NumPy front.
"""

from skyarm.dynamics.articulated_body import forward_dynamics
from skyarm.dynamics.composite_body import mass_matrix, mass_matrix_at_rest
from skyarm.dynamics.energy import (
    Momentum,
    center_of_mass,
    kinetic_energy,
    momentum,
    potential_energy,
)
from skyarm.dynamics.kinematics import Pose, frame_pose, joint_placement, link_poses
from skyarm.dynamics.newton_euler import JointMotion, inverse_dynamics, load_forces
from skyarm.dynamics.state import State, proper_acceleration

__all__ = [
    "JointMotion",
    "Momentum",
    "Pose",
    "State",
    "center_of_mass",
    "forward_dynamics",
    "frame_pose",
    "inverse_dynamics",
    "joint_placement",
    "kinetic_energy",
    "link_poses",
    "load_forces",
    "mass_matrix",
    "mass_matrix_at_rest",
    "momentum",
    "potential_energy",
    "proper_acceleration",
]
