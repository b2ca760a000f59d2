"""Division of a sideways force between rotors that push across body z and tilting of
the vehicle.

A force F at the common centre of mass r_c of a vehicle that does not turn is the wrench
(r_c x F, F) about the base origin; each rotor's squared speed is linear in it. With b_i
of the vertical part, c_i of the rest and room_i the distance from b_i to the limit that
c_i goes to, the gauge of the reachable forces is max_i |c_i| / room_i; the 8-norm
(sum_i (c_i / room_i)^8)^(1/8) >= max takes its place, which has all derivatives.

Of a desired force the part (1 + (gauge / share)^8)^(-1/8) goes across the held axis;
the attitude is that of the rest.
Source: Franchi, Carli, Bicego, Ryll 2018, Full-pose tracking control for aerial robotic
systems with laterally bounded input force, whose hard bound of the lateral force is
smooth here.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, cast

from skyarm.algebra import E_X, E_Y, E_Z, Mat3, Scalar, Scalars, Vec3
from skyarm.algebra.scalars import cos, divide, mul, sin, sqrt
from skyarm.algebra.scalars.taylor import Taylor, choose
from skyarm.control.blocks.attitude import derivative, vector_series
from skyarm.control.laws.centroidal.step_records import RotorForce
from skyarm.dynamics.actuators import Mixer
from skyarm.records.immutable import immutable
from skyarm.records.units import Unit

LEAST = 0.4
"""Least available squared speed of a rotor, as a fraction of that in hover. Less lets
the base swing far over when thrust goes away for a moment; more counts on force that is
not there (tried from 0.05 to 1 near free fall)."""


@immutable
class SidewaysGains:
    """Constants of the rotors' sideways force; ``attitude``: roll and pitch held by
    sideways force, None for level.
    """

    share: Annotated[
        Scalar,
        Unit(
            "",
            "fraction of the rotors' range available to a sideways force at level"
            " attitude",
        ),
    ]
    attitude: (
        Annotated[
            tuple[Scalar, Scalar],
            Unit("rad", "roll and pitch that sideways force holds"),
        ]
        | None
    )

    def rotor_force(self, mixer: Mixer, com: Vec3, weight: Scalar) -> SidewaysForce:
        """Force that the rotors give, with the centre of mass at ``com`` (m, base axes)
        and the weight in N.
        """
        return SidewaysForce(self, reach_of(mixer, com, weight))


@immutable(kw_only=False)
class RotorReach:
    """Squared rotor speeds per unit of force, and limits of the squared speeds, for
    sideways forces.

    Attributes:
        rows: squared speed of each rotor per force at the centre of mass, body axes,
            (rad/s)^2 / N.
        highest: largest squared speed of each, (rad/s)^2. least: least room, (rad/s)^2.
    """

    rows: tuple[Vec3, ...]
    highest: Scalars
    least: Scalars


@immutable(kw_only=False)
class SidewaysForce(RotorForce):
    """Achievable force of rotors that can also push across body z, within their speed
    limits.
    """

    gains: SidewaysGains
    reach: RotorReach

    def leaning(self, force: Vec3, yaw: Taylor) -> Vec3:
        """Part of a desired force (series, N, world axes) along which the vehicle
        tilts; the rest is given sideways.
        """
        angles = self.gains.attitude
        axis = None if angles is None else thrust_axis(angles, yaw.truncate(2))
        return leaning(self.reach, force, self.gains.share, axis)

    def achievable(self, force: Sequence[Vec3], R: Mat3, w: Vec3) -> Vec3:
        """Force (N, world axes) that the rotors can give at this attitude, or its first
        derivative (N/s).
        """
        order = len(force) - 1
        series = vector_series(force)
        turning = [
            [R.column(k), R.apply(w.cross(axis))]
            for k, axis in enumerate((E_X, E_Y, E_Z))
        ]
        axes = [vector_series(each[: order + 1]) for each in turning]
        x, y, z = (axis.dot(series) for axis in axes)
        side = gauge(self.reach, Vec3(x, y, z))
        # shortened until the rotors' eighth powers sum up to 1
        share = 1.0 / _eighth_root(choose(side > 1.0, side, 1.0))
        x, y = x * share, y * share
        return derivative(axes[0] * x + axes[1] * y + axes[2] * z, order)

    def across(self, R: Mat3, force: Vec3) -> Vec3:
        """Components of an achievable force across body z (N, body axes)."""
        inside = R.apply_T(force)
        return Vec3(inside.x, inside.y, 0)


def reach_of(mixer: Mixer, com: Vec3, weight: Scalar) -> RotorReach:
    """Matrix from force at the centre of mass to squared rotor speeds, of a mixer with
    sideways force.
    """
    rows = []
    for turning, across in zip(mixer.inverse, mixer.across, strict=True):
        rows.append(Vec3(*(*across, turning[3])) + Vec3(*turning[:3]).cross(com))
    least = tuple(LEAST * weight * turning[3] for turning in mixer.inverse)
    return RotorReach(rows=tuple(rows), highest=mixer.highest, least=least)


def gauge(reach: RotorReach, force: Vec3) -> Taylor:
    """Sum over the rotors of (used fraction of the speed margin)^8 under a sideways
    force (Taylor series).
    """
    total: Any = 0
    for row, top, least in zip(reach.rows, reach.highest, reach.least, strict=True):
        upward, change = force.z * row.z, force.x * row.x + force.y * row.y
        # a rotor that is to push more has the room up to its limit, else that down to
        # rest
        room = choose(change > 0.0, upward * -1 + top, upward)
        room = choose(room > least, room, least)
        share = change / room
        square = share * share
        fourth = square * square
        total = fourth * fourth + total
    result: Taylor = total
    return result


def leaning(
    reach: RotorReach, force: Vec3, share: Scalar, upright: Vec3 | None = None
) -> Vec3:
    """Force (Taylor series, N) along which the vehicle tilts: the desired force minus
    its sideways part.

    Sideways is across ``upright`` (series), or world z. The second derivative counts as
    the rest does: the snap of a reference is rough where its acceleration bends.
    """
    along: Any = force.z if upright is None else force.dot(upright)
    thrust = (E_Z if upright is None else upright) * along
    x, y, z = Vec3(force.x, force.y, 0) if upright is None else force - thrust
    side = _square(
        (x * x + y * y + z * z) * slightest(reach, along) * divide(1.0, share * share)
    )
    left = 1.0 - 1.0 / _eighth_root(_square(side) + 1.0)
    rest = left.c[0]
    tilting = Vec3(x * left, y * left, z * left) + thrust
    return Vec3(*(Taylor([*each.c[:2], mul(rest, each.c[2])]) for each in tilting))


def thrust_axis(attitude: Sequence[Scalar], yaw: Taylor) -> Vec3:
    """Body z in world axes (Taylor series) for a constant roll and pitch (rad, Z-Y-X
    angles) and a moving yaw.
    """
    roll, pitch = attitude
    forward, left, up = cos(roll) * sin(pitch), -sin(roll), cos(roll) * cos(pitch)
    c, s = cos(yaw), sin(yaw)
    return Vec3(
        c * forward - s * left,
        s * forward + c * left,
        Taylor.constant(up, len(yaw.c) - 1),
    )


def slightest(reach: RotorReach, vertical: Taylor) -> Taylor:
    """Squared fraction of rotor margin used per N of sideways force in the worst
    direction, 1/N^2 (Taylor series).
    """
    total: Any = 0
    for row, top, least in zip(reach.rows, reach.highest, reach.least, strict=True):
        upward, size = vertical * row.z, row.x * row.x + row.y * row.y
        # the worst direction may use the room on either side
        for room in (upward, upward * -1 + top):
            inverse = 1.0 / choose(room > least, room, least)
            share = _square(_square(inverse) * size)
            total = _square(_square(share)) + total
    return _eighth_root(total)


def _square(value: Taylor) -> Taylor:
    return value * value


def _eighth_root(value: Taylor) -> Taylor:
    return cast(Taylor, sqrt(sqrt(sqrt(value))))
