"""The force at the tip in what the disturbance observer holds.

A force f at the tip (base axes) appears in the observed disturbance as J^T f at the joints, r x f on the base's turning
and f on its motion, beside what is no contact: wind, wrong masses, friction (the bias b). Of the joints it tells most,
since little else pushes there, so f is the weighted least squares

    |J^T f - (d_q - b_q)|^2 / l_q^2 + |r x f - (d_w - b_w)|^2 / l_w^2 + |f - (d_F - b_F)|^2

with lengths l that say by what torque a force is wrong by as much as one of the base of 1 N: no vehicle's weight is in
them. An arm of two joints in a plane tells two of the three directions; the base tells the third.

Force and torque at the tip in what the disturbance observer holds.

A force f and a torque t at the tip (base axes) appear in the observed disturbance as J_v^T f + J_w^T t at the joints,
r x f + t on the base's turning and f on its motion. Weighted as in :mod:`skyarm.control.laws.centroidal.tip_force`,
six numbers in n + 6 of the disturbance: an arm of six joints tells all of them by its joints alone, any other needs the
base's torque, too, of which wrong rotors are a part.

Weighted least squares: normal equations A x = b to which one row after the other is added.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any

from skyarm.algebra import ZERO3, Mat3, Vec3, ldl_solve
from skyarm.control.blocks.disturbance import Disturbance
from skyarm.dynamics.kinematics import frame_pose, jacobian_columns
from skyarm.records.units import Unit
from skyarm.scalars import Scalar, add, divide, mul
from skyarm.vehicle.vehicle_records import Vehicle

AXES = (Vec3(1, 0, 0), Vec3(0, 1, 0), Vec3(0, 0, 1))


@dataclass(frozen=True, kw_only=True, slots=True)
class ForceErrors:
    """How far parts of the disturbance tell the tip's force: the error of each that weighs as 1 N of the base's.

    Attributes:
        turning: N m, of a revolute joint. sliding: N, of a prismatic one. base: N m, of the base's torque.
    """

    turning: Annotated[Scalar, Unit("N m", "of a revolute joint, as much as 1 N of the base's force")] = 0.0045
    sliding: Annotated[Scalar, Unit("N", "of a prismatic joint, as much as 1 N of the base's force")] = 0.02
    base: Annotated[Scalar, Unit("N m", "of the base's torque, as much as 1 N of its force")] = 0.055


@dataclass(frozen=True, slots=True)
class TipLevers:
    """How a force at the tip reaches base and joints.

    Attributes:
        R: R_WB. tip: m, of the tip against the base origin, base axes. columns: of its Jacobian, base axes.
    """

    R: Mat3
    tip: Vec3
    columns: tuple[Vec3, ...]

    def disturbance(self, force: Vec3) -> Disturbance:
        """What a force at the tip (N, world axes) does to base and joints."""
        own = self.R.apply_T(force)
        efforts = tuple(column.dot(own) for column in self.columns)
        return Disturbance(force=force, torque=self.tip.cross(own), efforts=efforts)


def levers(vehicle: Vehicle, R: Mat3, joints: Sequence[Any]) -> TipLevers:
    """Levers of the tip at an attitude and joint positions."""
    frame = vehicle.frame()
    columns = tuple(column.linear for column in jacobian_columns(vehicle, frame, joints))
    return TipLevers(R, frame_pose(vehicle, frame, joints).p, columns)


def tip_force(vehicle: Vehicle, errors: ForceErrors, at: TipLevers, rest: Disturbance) -> Vec3:
    """The tip's force (N, world axes) in ``rest``, the observed disturbance without its bias: least squares."""
    return tip_wrench(vehicle, errors, at, (), rest)[0]


def tip_wrench(
    vehicle: Vehicle, errors: ForceErrors, at: TipLevers, turns: Sequence[Vec3], rest: Disturbance
) -> tuple[Vec3, Vec3]:
    """Force (N) and torque about the tip (N m), world axes, in ``rest``: weighted least squares.

    Args:
        vehicle: model.
        errors: of the parts of the disturbance.
        at: levers of the force.
        turns: angular columns of the tip's Jacobian, base axes; empty without a torque.
        rest: the observed disturbance without its bias.
    """
    n = 6 if turns else 3
    A = [[1 if i == j and i < 3 else 0 for j in range(n)] for i in range(n)]
    squares = NormalEquations(A, [*at.R.apply_T(rest.force), *((0,) * (n - 3))])
    for i, (link, column, effort) in enumerate(zip(vehicle.links, at.columns, rest.efforts, strict=True)):
        error = errors.turning if link.joint.kind == "revolute" else errors.sliding
        squares.require((*column, *(turns[i] if turns else ())), effort, error)
    levers = [tuple(at.tip.cross(axis)) for axis in AXES]
    for k, torque in enumerate(rest.torque):
        squares.require([*(each[k] for each in levers), *(AXES[k] if turns else ())], torque, errors.base)
    found = squares.solve()
    return at.R.apply(Vec3(*found[:3])), at.R.apply(Vec3(*found[3:])) if turns else ZERO3


@dataclass(frozen=True, slots=True)
class NormalEquations:
    """Least squares of |row . x - wanted|^2 / error^2 over all rows, beside what is known beforehand.

    Attributes:
        A: symmetric, of which the lower triangle counts, as lists. b: the right-hand side.
    """

    A: list[list[Any]]
    b: list[Any]

    def require(self, row: Sequence[Any], wanted: Any, error: Any) -> None:
        """One row, its right-hand side, and the error that weighs as 1."""
        weight = divide(1.0, error * error)
        for i in range(len(self.b)):
            self.b[i] = add(self.b[i], mul(weight, mul(row[i], wanted)))
            for j in range(i + 1):
                self.A[i][j] = add(self.A[i][j], mul(weight, mul(row[i], row[j])))

    def solve(self) -> list[Any]:
        """The x of the least sum."""
        return ldl_solve(self.A, self.b)
