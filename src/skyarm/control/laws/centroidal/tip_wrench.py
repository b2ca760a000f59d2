"""Force and torque at the tip in what the disturbance observer holds.

A force f and a torque t at the tip (base axes) appear in the observed disturbance as J_v^T f + J_w^T t at the joints,
r x f + t on the base's turning and f on its motion. Weighted as in :mod:`skyarm.control.laws.centroidal.tip_force`,
six numbers in n + 6 of the disturbance: an arm of six joints tells all of them by its joints alone, any other needs the
base's torque, too, of which wrong rotors are a part.
"""

from __future__ import annotations

from collections.abc import Sequence

from skyarm.algebra import Vec3
from skyarm.control.blocks.disturbance import Disturbance
from skyarm.control.blocks.normal_equations import NormalEquations
from skyarm.control.laws.centroidal.tip_force import AXES, ForceErrors, TipLevers
from skyarm.vehicle.vehicle_records import Vehicle


def tip_wrench(
    vehicle: Vehicle, errors: ForceErrors, at: TipLevers, turns: Sequence[Vec3], rest: Disturbance
) -> tuple[Vec3, Vec3]:
    """Force (N) and torque about the tip (N m), world axes, in ``rest``: weighted least squares.

    Args:
        vehicle: model.
        errors: of the parts of the disturbance.
        at: levers of the force.
        turns: angular columns of the tip's Jacobian, base axes.
        rest: the observed disturbance without its bias.
    """
    A = [[1 if i == j and i < 3 else 0 for j in range(6)] for i in range(6)]
    squares = NormalEquations(A, [*at.R.apply_T(rest.force), 0, 0, 0])
    for link, column, turn, effort in zip(vehicle.links, at.columns, turns, rest.efforts, strict=True):
        error = errors.turning if link.joint.kind == "revolute" else errors.sliding
        squares.require((*column, *turn), effort, error)
    levers = [tuple(at.tip.cross(axis)) for axis in AXES]
    for k, torque in enumerate(rest.torque):
        squares.require([*(each[k] for each in levers), *AXES[k]], torque, errors.base)
    found = squares.solve()
    return at.R.apply(Vec3(*found[:3])), at.R.apply(Vec3(*found[3:]))
