"""Attitude law: from a force and its derivatives to a desired attitude, body rate and
angular acceleration.

Centre of mass and tip in base axes have their derivatives by the vehicle's kinematics
over Taylor series.

Source: Lee, Leok, McClamroch 2010 (geometric tracking on SE(3)); derivatives by Taylor
series in place of written-out formulas. Deviations: gains on accelerations; a bounded
tilt and a smallest vertical force, so that the direction of the thrust is always
defined.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Annotated

from skyarm.algebra import ZERO3, Mat3, Scalar, Vec3
from skyarm.algebra.scalars import add, cos, divide, mul, neg, sin, sqrt, sub, where
from skyarm.algebra.scalars.taylor import Taylor, choose, nth_derivative
from skyarm.control.blocks.geometric import attitude_error
from skyarm.dynamics.kinematics import Pose, link_poses
from skyarm.records.immutable import immutable, positional
from skyarm.records.leaves import leaves, rebuild
from skyarm.records.units import Unit
from skyarm.vehicle import BASE, Body, Vehicle


@positional
class Posture:
    """Posture of the vehicle: centre of mass, tip and link poses relative to the base,
    as Taylor series in time.

    Attributes:
        com: centre of mass of the whole vehicle. tip: its tip (the base origin if there
            is none).
        links: poses of the links.
    """

    com: Vec3
    tip: Vec3
    links: tuple[Pose, ...]


def posture(vehicle: Vehicle, joints: Sequence[Taylor], order: int) -> Posture:
    """Centre of mass, tip and link poses as Taylor series, for joint trajectories given
    as Taylor series.
    """
    # every number a series: an engine's scalar on the left of a product would not know
    # what a series is
    lifted = rebuild(
        vehicle, [Taylor.constant(number, order) for number in leaves(vehicle)]
    )
    poses = tuple(link_poses(lifted, [q.truncate(order) for q in joints], summed=True))

    def share(body: Body) -> Taylor:
        return Taylor.constant(divide(body.mass, vehicle.mass), order)

    com = lifted.base.com * share(vehicle.base)
    for link, own, pose in zip(vehicle.moving, lifted.moving, poses, strict=True):
        com = (
            com
            + pose.p * share(link.body)
            + pose.R.apply(own.body.com * share(link.body))
        )
    tip = ZERO3
    if vehicle.end_effector:
        frame = lifted.frame()
        tip = (
            frame.position
            if frame.link == BASE
            else poses[frame.link].apply(frame.position)
        )
    return Posture(com, tip, poses[: vehicle.n])


def derivative(v: Vec3, k: int) -> Vec3:
    """The k-th derivative of a vector of Taylor series; an int component is a
    constant.
    """
    return Vec3(*(nth_derivative(c, k) for c in v))


def moving(values: Iterable[Scalar], *rates: Iterable[Scalar]) -> list[Taylor]:
    """Taylor series in time of several signals from their values and time
    derivatives.
    """
    return [Taylor.of_derivatives(each) for each in zip(values, *rates, strict=True)]


def vector_series(motion: Sequence[Vec3]) -> Vec3:
    """Vector of Taylor series in time from its value and time derivatives."""
    return Vec3(*moving(*motion))


FALL = 0.875
"""Width of the range in which :func:`upright` raises a vertical force, as a fraction of
``start``. Chosen: with a start at 0.8 of the weight what is below 0.1 becomes 0.45."""

TINY = 1e-12
"""Squared sine between thrust and heading below which the heading does not fix the
attitude. The tilt limit keeps far away from it."""


OVERTURNED = 0.2
"""Angle (rad) to half a turn within which the attitude error stays as long as at its
border, or longer: from 179 and 180 degrees the vehicle then turns back alike, and falls
half as far as from 179 degrees by the sine."""


@positional
class DesiredAttitude:
    """Desired attitude R_d, with its body rate (rad/s) and angular acceleration
    (rad/s^2) in desired body axes.
    """

    R: Mat3
    rate: Vec3
    acceleration: Vec3


def reachable(force: Vec3, tilt: Scalar, floor: Scalar) -> Vec3:
    """Force (Taylor series, N) with a vertical part of at least ``floor`` and a tilt of
    at most atan(``tilt``).
    """
    z = choose(force.z > floor, force.z, floor)
    side = force.x * force.x + force.y * force.y
    steep = side > z * z * (tilt * tilt)
    # the root of a horizontal force of zero has no derivatives, so it is taken of 1
    # there
    length = choose(steep, side, 1.0)
    share = choose(steep, z * tilt / sqrt(length), 1.0)
    return Vec3(force.x * share, force.y * share, z)


def upright(
    force: Vec3, weight: Scalar, start: Scalar, along: Vec3 | None = None
) -> Vec3:
    """Desired force (Taylor series, N) with a small vertical part raised smoothly, so
    that the attitude turns slowly.

    Near free fall the direction of a small force turns quickly, and noise in it
    requires more torque than rotors at low speed give. With t = (start - f_z /
    weight) / width from 0 to 1 the vertical part is f_z + width weight (t^3 - t^4 / 2),
    twice continuously differentiable; it ends at start - width / 2.

    ``along`` (Taylor series, N) is a planned force whose direction the raise keeps;
    without one it is upwards.
    """
    width = start * FALL
    # the series stands first: an engine's scalar on the left would not know what a
    # series is
    t = (force.z - start * weight) * divide(-1.0, width * weight)
    t = choose(t > 0.0, t, 0.0)
    deep = t < 1.0
    t = choose(deep, t, 1.0)
    z = choose(deep, force.z, (start - width) * weight)
    more = _quartic(t) * (width * weight)
    raised = z + more
    if along is None:
        return Vec3(force.x, force.y, raised)
    share = (raised - force.z) / along.z
    return Vec3(force.x + along.x * share, force.y + along.y * share, raised)


def _quartic(t: Taylor) -> Taylor:
    """Polynomial t^3 - t^4 / 2 of a Taylor series t, as a Taylor series."""
    x, v, *rest = t.c
    square = x * x
    slope = square * (3.0 - 2.0 * x)
    coefficients = [square * x * (1.0 - 0.5 * x), mul(slope, v)]
    if rest:
        # a series has half of the second derivative
        coefficients.append(
            add(mul(slope, rest[0]), mul(3.0 * (x - square), mul(v, v)))
        )
    return Taylor(coefficients)


def attitude(force: Vec3, yaw: Taylor) -> DesiredAttitude:
    """Attitude with body z along a force and body x nearest to the heading, with body
    rate and angular acceleration.

    With w the body rate, R' = R S(w): derivatives of f = F b3 in the axes R give F'/F
    and w', w across b3; the heading H = R^T [cos yaw, sin yaw, 0] has no component
    along b2, nor have its derivatives, which gives w about b3.
    """
    c, s = cos(yaw.derivative(0)), sin(yaw.derivative(0))
    turn, turning = yaw.derivative(1), yaw.derivative(2)
    f, fd, fdd = (derivative(force, k) for k in range(3))
    per_force = _inverse_length(f)
    b3 = f * per_force
    # b3 x heading, heading = [c, s, 0]; its length is H_x
    across = Vec3(-(b3.z * s), b3.z * c, b3.x * s - b3.y * c)
    per = _inverse_length(across)
    b2 = across * per
    R = Mat3.columns(b2.cross(b3), b2, b3)
    first, second = R.apply_T(fd) * per_force, R.apply_T(fdd) * per_force
    x, y = neg(first.y), first.x
    heading, twice = Vec3(divide(1.0, per), 0, b3.x * c + b3.y * s), mul(2.0, first.z)
    # the horizontal normal of the heading in the axes R
    normal = Vec3(across.z * heading.z * per, b3.z * per, neg(across.z))
    z = mul(add(mul(turn, normal.y), mul(x, heading.z)), per)
    x_turning = sub(mul(y, z), add(second.y, mul(twice, x)))
    y_turning = sub(second.x, add(mul(twice, y), mul(x, z)))
    # 2 R^T heading' - w x H
    moved = normal * mul(2.0, turn) - Vec3(mul(y, heading.z), 0, neg(mul(y, heading.x)))
    slower = sub(mul(z, moved.x), mul(x, moved.z))
    z_turning = mul(
        sub(add(mul(turning, normal.y), mul(x_turning, heading.z)), slower), per
    )
    return DesiredAttitude(R, Vec3(x, y, z), Vec3(x_turning, y_turning, z_turning))


def _inverse_length(v: Vec3) -> Scalar:
    square = v.dot(v)
    return divide(1.0, sqrt(where(square > TINY, square, 1.0)))


def angular_acceleration(
    gains: BaseGains, desired: DesiredAttitude, R: Mat3, w: Vec3
) -> Vec3:
    """Commanded angular acceleration (rad/s^2, body axes) from attitude and rate
    errors.

    -KR e_R - Kw e_w + R^T R_d w_d' - w x R^T R_d w_d with e_w = w - R^T R_d w_d: Lee's
    law times the inverse inertia.
    """
    relative = R.T @ desired.R
    w_d = relative.apply(desired.rate)
    pull = gains.attitude.hadamard(
        attitude_error(R, desired.R, OVERTURNED)
    ) + gains.rate.hadamard(w - w_d)
    return relative.apply(desired.acceleration) - w.cross(w_d) - pull


@immutable
class BaseGains:
    """Feedback gains of the base: from errors of centre of mass and attitude to linear
    and angular accelerations.

    Attributes:
        position: 1/s^2. velocity: 1/s. Of the centre of mass, world axes.
        attitude: 1/s^2. rate: 1/s. Body axes.
    """

    position: Annotated[
        Vec3,
        Unit(
            "1/s^2",
            "acceleration of the centre of mass per position error, world axes",
            effect=(
                "higher values correct position errors faster and need faster attitude"
                " loops"
            ),
        ),
    ]
    velocity: Annotated[
        Vec3,
        Unit(
            "1/s",
            "acceleration of the centre of mass per velocity error, world axes",
            effect=(
                "higher values damp the position more and amplify noise of the velocity"
            ),
        ),
    ]
    attitude: Annotated[
        Vec3,
        Unit(
            "1/s^2",
            "angular acceleration per attitude error, body axes",
            effect="higher values turn the base faster; motor lag and delay limit them",
        ),
    ]
    rate: Annotated[
        Vec3,
        Unit(
            "1/s",
            "angular acceleration per body rate error, body axes",
            effect=(
                "higher values damp the attitude more and amplify noise of the"
                " gyroscope"
            ),
        ),
    ]
