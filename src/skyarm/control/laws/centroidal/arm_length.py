"""The damping of the tip's task for arms of other lengths than that of the presets.

The damping is the singular value of the tip's Jacobian, m, below which a direction counts as out of reach: that of the
presets was chosen on an arm of 0.3 m. A longer arm that hangs straight takes the same small errors of height for calls
to fold: 44 N that push the tip of a vehicle of 12 kg up and down drove its arm of 0.81 m to 0.5 m of error, the
paper's computed torque to 0.07 m. A damping that grows as the length costs a hover's accuracy under noise two thirds,
one that grows as its root a tenth to a third (a half under four times the bench's noise), and both hold the arm; with
1 kg at the tip that nobody told, an arm of 0.63 m is lost without.
"""

from __future__ import annotations

import math

from skyarm.algebra import Vec3
from skyarm.vehicle.linkage import BASE
from skyarm.vehicle.vehicle_records import Vehicle

PRESETS_ARM = 0.3
"""m, length of the arm on which the presets were chosen."""

SHORTEST = 0.01
"""m, length that an arm is given at least; one whose tip sits on its first joint has none."""


def arm_length(vehicle: Vehicle) -> float:
    """Length of the arm from its first joint to the tip, m, along its links; what slides is at zero."""
    frame = vehicle.frame()
    total, index = _size(frame.position), frame.link
    while index != BASE and vehicle.moving[index].parent != BASE:
        total += _size(vehicle.moving[index].joint.position)
        index = vehicle.moving[index].parent
    return total


def damping_share(vehicle: Vehicle) -> float:
    """Of the presets' damping, what suits a vehicle's arm: the root of its length over theirs."""
    return math.sqrt(max(arm_length(vehicle), SHORTEST) / PRESETS_ARM)


def _size(offset: Vec3) -> float:
    return math.hypot(*(float(c) for c in offset))
