"""How fast joints move against their stops and under friction, which bounds the integration step of both plants."""

from __future__ import annotations

import math

import numpy as np

from skyarm.compile import leaves
from skyarm.plant.friction_rate import fastest_mode, friction_rate
from skyarm.plant.integrators import FRICTION_STEP
from skyarm.records.coerce import concrete
from skyarm.vehicle.check import VehicleError
from skyarm.vehicle.linkage import Joint
from skyarm.vehicle.vehicle_records import Vehicle

STOP_STEP = 1.05
"""Largest product of a stop's natural frequency (rad/s) and an RK4 step. Within a stop the method is stable to 2.78,
but a step that enters or leaves it sees the bend of its force at four instants only. An elastic touch keeps its energy
to 8 % (measured); at 2.2 it gained 63 % at worst."""

FASTEST = 3e4
"""rad/s. A stiffer stop would need over 140 integration steps per control period of 5 ms."""


def joint_rate(vehicle: Vehicle) -> float:
    """Rate (1/s) by which integrators choose their step: that of friction, or what stops ask for in the same measure.

    Raises:
        VehicleError: friction or stops so stiff that no explicit integrator can afford them; names joint and field.
    """
    return max(friction_rate(vehicle), stop_frequency(vehicle) * (FRICTION_STEP / STOP_STEP))


def stop_frequency(vehicle: Vehicle) -> float:
    """Highest natural frequency (rad/s) of the joints pressed against their stops, or decay rate of the stops' damping.

    Zero without stops, or where the numbers are not concrete.
    """
    joints = [link.joint for link in vehicle.links]
    if not any(joint.has_stops for joint in joints) or not concrete(*leaves((vehicle.base, vehicle.links))):
        return 0.0
    stiffness, damping = (np.array([of(joint) for joint in joints]) for of in (_stiffness, _damping))
    squared, mode = fastest_mode(vehicle, np.sqrt(stiffness))
    decay, other = fastest_mode(vehicle, np.sqrt(damping))
    frequency = math.sqrt(squared)
    if max(frequency, decay) > FASTEST:
        field, worst = ("stop_stiffness", mode) if frequency >= decay else ("stop_damping", other)
        joint = joints[int(np.argmax(np.abs(worst)))]
        raise VehicleError(
            f"joints[{joint.name}].{field} = {getattr(joint, field)!r}: a stop this stiff moves the joint at "
            f"{max(frequency, decay):.3g} rad/s: must be at most {FASTEST:g}; lower {field}, or state the armature"
        )
    return max(frequency, decay)


def _stiffness(joint: Joint) -> float:
    return float(joint.stop_stiffness) if joint.has_stops else 0.0


def _damping(joint: Joint) -> float:
    """N m s/rad or N s/m of a stop at the depth to which the drive presses it."""
    effort = float(joint.effort_limit)
    return effort * float(joint.stop_damping) if joint.has_stops and math.isfinite(effort) else 0.0
