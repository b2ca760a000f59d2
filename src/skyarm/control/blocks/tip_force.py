"""Estimate of the force at the tip from the disturbance observer.

A force f at the tip (base axes) appears in the observed disturbance as J^T f at the
joints, r x f in the base's torque and f in its force, in addition to the bias b of
wind, wrong masses and friction: f is the weighted least squares

    |J^T f - (d_q - b_q)|^2 / l_q^2 + |r x f - (d_w - b_w)|^2 / l_w^2
        + |f - (d_F - b_F)|^2

with lengths l that say by which torque a force is wrong by as much as one of the base
of 1 N. Joints weigh most, since little else pushes there; the base gives the direction
that an arm in a plane does not.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Annotated, Any, TypeVar

from skyarm.algebra import E_X, E_Y, E_Z, Mat3, Scalar, Scalars, Vec3, ldl_solve
from skyarm.algebra.scalars import add, divide, mul
from skyarm.control.blocks.prediction import Disturbance, no_disturbance
from skyarm.dynamics.kinematics import frame_pose, jacobian_columns
from skyarm.records.immutable import immutable, positional
from skyarm.records.units import Unit
from skyarm.vehicle import Link, Vehicle

# ints are known before compilation, so that products with them vanish
AXES = (E_X, E_Y, E_Z)

Term = TypeVar("Term", Scalar, Vec3)


@immutable
class ForceErrors:
    """Errors of base torque and joint efforts that count as much as 1 N of base force
    in the tip force estimate.

    Chosen. At a lever of 0.15 m 0.0045 N m are 0.03 N, by which a joint weighs a
    thousand times what the base's force does, on which wind acts.
    """

    turning: Annotated[
        Scalar,
        Unit(
            "N m", "effort error of a revolute joint that weighs as 1 N of base force"
        ),
    ] = 0.0045
    sliding: Annotated[
        Scalar,
        Unit("N", "effort error of a prismatic joint that weighs as 1 N of base force"),
    ] = 0.02
    base: Annotated[
        Scalar, Unit("N m", "torque error of the base that weighs as 1 N of base force")
    ] = 0.055

    def weight_of(self, link: Link) -> Scalar:
        """Least-squares weight of a joint's effort relative to the base force."""
        error = self.turning if link.joint.turns else self.sliding
        return divide(1.0, error * error)


@positional
class TipLevers:
    """Tip position and Jacobian at one configuration, which map a force at the tip to
    base and joints.

    Attributes:
        vehicle: model. R: R_WB.
        tip: position of the tip against the base origin, m, base axes. columns: columns
            of its Jacobian, base axes.
    """

    vehicle: Vehicle
    R: Mat3
    tip: Vec3
    columns: tuple[Vec3, ...]

    def disturbance(self, force: Vec3) -> Disturbance:
        """Disturbance on base and joints caused by a force at the tip (N, world
        axes).
        """
        own = self.R.apply_T(force)
        efforts = tuple(column.dot(own) for column in self.columns)
        return Disturbance(force=force, torque=self.tip.cross(own), efforts=efforts)

    def velocity(self, base: Vec3, rate: Vec3, joint_rates: Sequence[Scalar]) -> Vec3:
        """Velocity of the tip (m/s, world axes) from base velocity (world axes), body
        rate and joint rates.
        """
        moving = rate.cross(self.tip)
        for column, joint_rate in zip(self.columns, joint_rates, strict=True):
            moving = moving + column * joint_rate
        return base + self.R.apply(moving)


def levers(vehicle: Vehicle, R: Mat3, joints: Sequence[Scalar]) -> TipLevers:
    """Tip position and Jacobian at an attitude and joint positions."""
    frame = vehicle.frame()
    columns = tuple(
        column.linear
        for column in jacobian_columns(vehicle, frame, joints, summed=True)
    )
    return TipLevers(
        vehicle, R, frame_pose(vehicle, frame, joints, summed=True).p, columns
    )


def tip_force(errors: ForceErrors, at: TipLevers, rest: Disturbance) -> Vec3:
    """Force at the tip (N, world axes) by weighted least squares from the observed
    disturbance minus its bias.
    """
    return at.R.apply(Vec3(*_of_disturbance(errors, at, rest).solve()))


def effort_shares(errors: ForceErrors, at: TipLevers, n: Vec3) -> Scalars:
    """Derivative of the estimated force along n (unit, world axes) by each joint's
    observed effort, 1/m or 1.
    """
    squares = _of_disturbance(errors, at, no_disturbance(len(at.columns)))
    squares.b = list(at.R.apply_T(n))
    # A^-1 n: the estimate is linear in the efforts, with J weight on the right-hand
    # side
    gain = Vec3(*squares.solve())
    rows = zip(at.vehicle.links, at.columns, strict=True)
    return tuple(mul(errors.weight_of(link), column.dot(gain)) for link, column in rows)


def _of_disturbance(
    errors: ForceErrors, at: TipLevers, rest: Disturbance
) -> LeastSquares:
    """Least-squares problem for the force at the tip (base axes) that explains a
    disturbance.
    """
    squares = LeastSquares(3)
    # the base's force is the unit of all weights
    squares.prefer(at.R.apply_T(rest.force), 1)
    for link, column, effort in zip(
        at.vehicle.links, at.columns, rest.efforts, strict=True
    ):
        squares.require(tuple(column), effort, errors.weight_of(link))
    rows = zip(*map(at.tip.cross, AXES), strict=True)
    for row, torque in zip(rows, rest.torque, strict=True):
        squares.require(row, torque, divide(1.0, errors.base * errors.base))
    return squares


class LeastSquares:
    """Normal equations A x = b of a weighted least-squares problem; only the lower
    triangle of A is used.
    """

    def __init__(self, n: int) -> None:
        self.A: list[list[Scalar]] = [[0] * n for _ in range(n)]
        self.b: list[Scalar] = [0] * n

    def require(self, columns: Sequence[Term], value: Term, weight: Scalar) -> None:
        """Add ``weight`` |columns x - value|^2 to a least-squares cost, for a scalar or
        vector ``value``.
        """
        for i, c in enumerate(columns):
            self.b[i] = add(self.b[i], mul(weight, _product(c, value)))
            # the lower triangle, which is all that ldl_solve reads
            for j, d in enumerate(columns[: i + 1]):
                self.A[i][j] = add(self.A[i][j], mul(weight, _product(c, d)))

    def prefer(self, values: Iterable[Scalar], weight: Scalar, first: int = 0) -> None:
        """Add ``weight`` |x - values|^2 to a least-squares cost, for consecutive
        unknowns x from index ``first``.
        """
        for i, value in enumerate(values, first):
            self.A[i][i] = add(self.A[i][i], weight)
            self.b[i] = add(self.b[i], mul(weight, value))

    def solve(self) -> Scalars:
        """Solution of the least-squares problem."""
        return tuple(ldl_solve(self.A, self.b))


def _product(a: Any, b: Any) -> Scalar:
    return a.dot(b) if isinstance(a, Vec3) else mul(a, b)
