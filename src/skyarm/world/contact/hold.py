"""Spring and damper by which a vehicle holds a body: at a place, and in the attitude
that they have to each other.

Grippers (:mod:`skyarm.world.contact.gripper`) and grasps
(:mod:`skyarm.world.contact.grasp`) hold by this one law; they differ in when they hold
and where they give way.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated

from skyarm.algebra import Mat3, Scalar, Vec3
from skyarm.algebra.matrix import orientation_error
from skyarm.algebra.scalars import maximum, sqrt
from skyarm.dynamics.point_motion import PointMotion
from skyarm.records.immutable import immutable, positional
from skyarm.records.units import positive
from skyarm.world.contact.carrier import CarriedFrame
from skyarm.world.contact.material import BRISTLE_STEP, euler_step_of

Stiffness = Annotated[
    Scalar,
    positive(
        "N/m",
        "stiffness of the grasp",
        effect=(
            "higher values hold the body more rigidly and need smaller integration"
            " steps"
        ),
    ),
]


@immutable
class Hold:
    """Force and torque of a grasp on the grasped body, world axes.

    Attributes:
        force: N, at ``place`` (m). torque: N m, beside that of the force.
        twist: rad, world axes, from the body's attitude to that of the grasp, as much
            of it as friction in the socket of a ball bears; None of what has no
            friction.
    """

    force: Vec3
    torque: Vec3
    place: Vec3
    twist: Vec3 | None = None

    def __mul__(self, share: Scalar) -> Hold:
        """Share of the force and torque, at the same place."""
        return replace(self, force=self.force * share, torque=self.torque * share)


@positional
class Spring:
    """Spring and damper between a frame of a vehicle and a body.

    Attributes:
        stiffness: N/m. damping: N s/m.
        frame: frame of the vehicle. body: axes of the body.
    """

    stiffness: Scalar
    damping: Scalar
    frame: CarriedFrame
    body: CarriedFrame

    def force(self, place: Vec3) -> Vec3:
        """Force (N) on the body that pulls one of its places (m, world axes) to the
        origin of the frame.
        """
        stretch = self.frame.position - place
        speed = self.frame.velocity_at(place) - self.body.velocity_at(place)
        return stretch * self.stiffness + speed * self.damping

    def error(self, turn: Mat3) -> Vec3:
        """Error of the body's attitude (rad, world axes; its length is the sine of the
        angle).

        Args:
            turn: rotation from the axes of the body to those of the frame that is to be
                kept.
        """
        return orientation_error(self.body.rotation, self.frame.rotation @ turn)

    def torque(self, error: Vec3, square: Scalar) -> Vec3:
        """Torque (N m) on the body against an error of its attitude; ``square`` is that
        of the patch's radius, m^2.
        """
        return (
            error * self.stiffness
            + (self.frame.turning - self.body.turning) * self.damping
        ) * square


def longest_step(square: Scalar, decay: Scalar, *, euler: bool) -> Scalar:
    """Longest stable integration step (s) of a spring and damper.

    Args:
        square: square of the angular frequency, 1/s^2.
        decay: damping by inertia, 1/s.
        euler: True for the semi-implicit Euler method.
    """
    if euler:
        return euler_step_of(square, decay)
    # the faster of the two poles of an overdamped grasp, or the frequency
    half = 0.5 * decay
    return BRISTLE_STEP / (
        maximum(half, sqrt(square)) + sqrt(maximum(half * half - square, 0.0))
    )


def frame_of(motion: PointMotion, name: str) -> CarriedFrame:
    """World pose and velocity of a vehicle's frame; of the tip for an empty name."""
    at = motion.vehicle.frame(name or None)
    columns = [motion.to_world(at.rotation.column(i), at.link) for i in range(3)]
    return CarriedFrame(
        position=motion.position(at.position, at.link),
        rotation=Mat3.columns(*columns),
        velocity=motion.velocity(at.position, at.link),
        turning=motion.to_world(motion.angular_velocity(at.link), at.link),
    )
