"""The largest share of the joints' accelerations for which the rotors can hold the base.

An arm that accelerates turns the base the other way, and the rotors must give the torque against it. Attitude and
altitude come before tip and joints: where the rotors do not reach, the joints are given s times their accelerations.
Body torque and squared rotor speeds are affine in s, f_i = a_i + s b_i: a_i holds attitude and thrust, b_i the arm.
Every rotor keeps a margin m_i free of the arm on both sides, and a rotor that attitude and thrust take beyond that
leaves m_i to the arm, so that the joints can always move:

    min(m_i, a_i - m_i) <= f_i <= max(top_i - m_i, a_i + m_i).

s = 0 fits always, and the largest s in [0, 1] is the least of one ratio for each rotor. Yaw torque gives way to roll,
pitch and thrust in the allocation, so s counts that fits with all of it or with none of it, whichever is larger.

Derived for this law. That joints' accelerations are slowed on one common factor keeps their directions, as in the
scaling of saturated joints: Antonelli, Chiaverini, Fusco 2003.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from skyarm import dynamics
from skyarm.actuation import Mixer
from skyarm.algebra import Mat3, Vec3, inner_product, ldl_solve
from skyarm.scalars import absolute, add, divide, maximum, minimum, mul, sub, where
from skyarm.vehicle.vehicle_records import Vehicle


@dataclass(frozen=True, slots=True)
class Reaction:
    """What joint accelerations need under a given force on the base, whose angular acceleration stays as desired.

    Blocks of the mass matrix, with t the base's translation, w its rotation, j the joints; the base's origin moves
    freely.

    Attributes:
        joints: M_jj - M_jt M_tj / m, joint torques per joint acceleration, a row a joint.
        base: M_wj - M_wt M_tj / m, body torque (base axes) per joint acceleration, three rows.
    """

    joints: list[list[Any]]
    base: list[list[Any]]

    def torque(self, accelerations: Sequence[Any]) -> Vec3:
        """Body torque of joint accelerations, N m, base axes."""
        return Vec3(*(inner_product(row, accelerations) for row in self.base))

    def efforts(self, accelerations: Sequence[Any]) -> list[Any]:
        """Joint torques or forces of joint accelerations."""
        return [inner_product(row, accelerations) for row in self.joints]

    def accelerations(self, efforts: Sequence[Any]) -> list[Any]:
        """Joint accelerations of joint torques or forces."""
        return ldl_solve(self.joints, list(efforts)) if self.joints else []


def reaction(vehicle: Vehicle, joints: Sequence[Any]) -> Reaction:
    """The reaction of an arm at a posture (rad or m)."""
    if not joints:
        return Reaction([], [[], [], []])
    M = dynamics.mass_matrix(vehicle, Mat3.identity(), joints)
    share, n = divide(1.0, vehicle.mass), len(joints)

    def reduced(row: int, column: int) -> Any:
        total = M[row][column]
        for k in range(3):
            total = sub(total, mul(mul(M[row][k], M[column][k]), share))
        return total

    return Reaction(
        joints=[[reduced(6 + i, 6 + j) for j in range(n)] for i in range(n)],
        base=[[reduced(k, 6 + j) for j in range(n)] for k in range(3, 6)],
    )


def margins(mixer: Mixer, weight: Any, share: Any) -> list[Any]:
    """Squared speed of each rotor that is kept free of the arm: a share of what the weight takes, (rad/s)^2."""
    return [mul(mul(share, absolute(row[3])), weight) for row in mixer.inverse]


def largest_share(fixed: Sequence[Any], arm: Sequence[Any], highest: Sequence[Any], margin: Sequence[Any]) -> Any:
    """Largest s in [0, 1] with min(m_i, a_i - m_i) <= a_i + s b_i <= max(top_i - m_i, a_i + m_i) for all i.

    Args:
        fixed: a_i, squared speeds without the arm, (rad/s)^2, as all others.
        arm: b_i, what the arm's accelerations add.
        highest: top_i.
        margin: m_i.
    """
    share: Any = 1.0
    for a, b, top, m in zip(fixed, arm, highest, margin, strict=True):
        room = where(b > 0.0, maximum(sub(sub(top, m), a), m), maximum(sub(a, m), m))
        size = absolute(b)
        share = minimum(share, where(size > 0.0, divide(room, size), 1.0))
    return share


def arm_share(mixer: Mixer, alone: Vec3, arm: Vec3, thrust: Any, margin: Sequence[Any]) -> Any:
    """Share of the arm's accelerations that the rotors leave room for beside attitude and thrust.

    Args:
        mixer: of the rotors.
        alone: body torque (N m, base axes) with joints that do not accelerate.
        arm: body torque of the joints' accelerations.
        thrust: N.
        margin: squared speeds that are kept free, (rad/s)^2.
    """

    def squares(torque: Vec3, rest: Sequence[Any]) -> list[Any]:
        return [
            add(add(mul(row[0], torque.x), mul(row[1], torque.y)), other)
            for row, other in zip(mixer.inverse, rest, strict=True)
        ]

    def turned(torque: Vec3) -> list[Any]:
        return [mul(row[2], torque.z) for row in mixer.inverse]

    fixed = squares(alone, [mul(row[3], thrust) for row in mixer.inverse])
    moved = squares(arm, [0.0] * len(mixer.inverse))
    without = largest_share(fixed, moved, mixer.highest, margin)
    fixed = [add(a, b) for a, b in zip(fixed, turned(alone), strict=True)]
    moved = [add(a, b) for a, b in zip(moved, turned(arm), strict=True)]
    return maximum(without, largest_share(fixed, moved, mixer.highest, margin))


@dataclass(frozen=True, slots=True)
class Slower:
    """Torques of the motion which is left: on the base (N m, base axes), of the joints, and the share s of it."""

    torque: Vec3
    efforts: tuple[Any, ...]
    share: Any


def slower(
    mixer: Mixer,
    found: Reaction,
    accelerations: Sequence[Any],
    torque: Vec3,
    efforts: Sequence[Any],
    thrust: Any,
    margin: Sequence[Any],
) -> Slower:
    """Scale joint accelerations until the rotors reach.

    Args:
        mixer: of the rotors.
        found: reaction of the arm.
        accelerations: of the joints.
        torque: on the base, that gives them, N m, base axes.
        efforts: of the joints, that give them.
        thrust: N.
        margin: squared speeds that are kept free of the arm, (rad/s)^2.
    """
    arm = found.torque(accelerations)
    share = arm_share(mixer, torque - arm, arm, thrust, margin)
    lost = [mul(each, sub(1.0, share)) for each in accelerations]
    left = tuple(sub(effort, less) for effort, less in zip(efforts, found.efforts(lost), strict=True))
    return Slower(torque - found.torque(lost), left, share)
