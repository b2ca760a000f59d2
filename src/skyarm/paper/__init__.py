"""Equations of motion of Barakou et al. 2026 (Drones 10, 274) in Euler coordinates, for
any vehicle.
"""

from skyarm.paper.equations import (
    coriolis_matrix,
    forward_kinematics,
    gravity_vector,
    mass_matrix,
)

__all__ = ["coriolis_matrix", "forward_kinematics", "gravity_vector", "mass_matrix"]
