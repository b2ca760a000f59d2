"""Body-rate and thrust set points by which an autopilot's rate loop applies the torque
of a control law.

An autopilot takes no torque from outside: it takes body rates and a thrust, and its
rate loop makes the torque. The inverse of that loop turns a law's command into rates:
rotor speeds to torque and thrust by the model's rotors, then torque to rate error. Two
loops are known: an ideal one, whose angular acceleration is bandwidth times rate error
(dynamic inversion: Enns, Bugajski, Hendrick, Stein 1994), and a PID loop of known
gains, whose torque is inverted.

The integral of a PID loop takes over what is slower than integral over proportional
gain: the rate error carries the rest of the law's torque. The integral's torque is
therefore computed here, too; at take-over it is the law's own, since the vehicle
hovers.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Protocol

from skyarm import dynamics
from skyarm.algebra import (
    ZERO3,
    ZERO3_DATA,
    Force,
    Mat3,
    Motion,
    Scalar,
    Vec3,
    inner_product,
    ldl_solve,
)
from skyarm.algebra.scalars import clip
from skyarm.control.blocks.prediction import Disturbance, acceleration
from skyarm.control.model import Model
from skyarm.dynamics.actuators.mixer import allocation_matrix
from skyarm.dynamics.actuators.rotor import push
from skyarm.records.field_rules import checked
from skyarm.records.immutable import immutable
from skyarm.records.units import Unit, nonnegative, positive
from skyarm.reference import Reference
from skyarm.sensing.measurement import Measurement
from skyarm.vehicle import Vehicle

Three = tuple[float, float, float]


class RateLoop(Protocol):
    """Model of an autopilot's rate loop, to be inverted by a control law's set
    points.
    """

    def begin(self, torque: Vec3) -> Vec3:
        """Initial integral torque (N m) of the rate loop in a hover under a given
        torque (N m).
        """
        ...

    def rate_error(
        self, integral: Vec3, torque: Vec3, angular_acceleration: Vec3, dt: Scalar
    ) -> tuple[Vec3, Vec3]:
        """Next integral torque (N m), and the rate error (rad/s) for which the loop
        applies a torque (N m).
        """
        ...


@immutable
@checked("rate_loop")
class IdealRateLoop:
    """Rate loop with an angular acceleration of bandwidth times rate error, whatever
    the external torques.
    """

    bandwidth: Annotated[
        Three,
        positive(
            "rad/s",
            "bandwidth of the rate loop about x, y and z",
            effect=(
                "higher values assume a faster autopilot and send smaller corrections"
            ),
        ),
    ]

    def begin(self, torque: Vec3) -> Vec3:
        """Zero integral torque, since an ideal rate loop has no integral."""
        return ZERO3_DATA

    def rate_error(
        self, integral: Vec3, torque: Vec3, angular_acceleration: Vec3, dt: Scalar
    ) -> tuple[Vec3, Vec3]:
        """Integral torque as it was, and the rate error (rad/s): angular acceleration
        divided by bandwidth.
        """
        return integral, Vec3(
            *(a / k for a, k in zip(angular_acceleration, self.bandwidth, strict=True))
        )


@immutable
class GuidedRateLoop(IdealRateLoop):
    """Ideal rate loop behind an attitude loop that integrates the commanded rates to a
    desired attitude.

    The rate loop gets the command plus gain times the angle z by which the desired
    attitude is ahead, with dz/dt the commanded rate minus the body rate. Source:
    ArduCopter 4.7, body rates of its guided mode. The angle is modelled: it is zero of
    a vehicle that hovers, whose desired attitude is its own.
    """

    gain: Annotated[Three, nonnegative("1/s", "gain of the autopilot's attitude loop")]

    def rate_error(
        self, integral: Vec3, torque: Vec3, angular_acceleration: Vec3, dt: Scalar
    ) -> tuple[Vec3, Vec3]:
        """Angle (rad) of the desired attitude ahead of the actual one after ``dt``, and
        the rate error (rad/s).
        """
        rows = zip(
            integral, angular_acceleration, self.bandwidth, self.gain, strict=True
        )
        error = Vec3(*(a / k - gain * z for z, a, k, gain in rows))
        return integral + error * dt, error


@immutable
@checked("rate_loop")
class PidRateLoop:
    """PID rate loop: torque p e + z - d dw/dt about each axis with rate error e, and
    dz/dt = i e within a limit.
    """

    proportional: Annotated[
        Three, positive("N m s/rad", "proportional gain p of the autopilot's rate loop")
    ]
    integral: Annotated[
        Three, nonnegative("N m/rad", "integral gain i of the autopilot's rate loop")
    ]
    derivative: Annotated[
        Three,
        nonnegative("N m s^2/rad", "derivative gain d of the autopilot's rate loop"),
    ]
    limit: Annotated[
        Three, nonnegative("N m", "largest torque of the rate loop's integral")
    ]

    def begin(self, torque: Vec3) -> Vec3:
        """Initial integral torque (N m): the whole hover torque, within the limit of
        the integral.
        """
        return Vec3(
            *(clip(t, -most, most) for t, most in zip(torque, self.limit, strict=True))
        )

    def rate_error(
        self, integral: Vec3, torque: Vec3, angular_acceleration: Vec3, dt: Scalar
    ) -> tuple[Vec3, Vec3]:
        """Next integral torque (N m), and the rate error (rad/s) from the inverse of
        the PID loop.
        """
        rows = zip(
            integral,
            torque,
            angular_acceleration,
            self.proportional,
            self.derivative,
            strict=True,
        )
        error = [(t - z + d * a) / p for z, t, a, p, d in rows]
        gone = zip(integral, error, self.integral, self.limit, strict=True)
        return Vec3(
            *(clip(z + i * e * dt, -most, most) for z, e, i, most in gone)
        ), Vec3(*error)


@immutable
class RateCommand:
    """Set point for an autopilot: body rates (rad/s, base axes), and thrust as a
    fraction of the highest.
    """

    rates: Annotated[Vec3, Unit("rad/s", "commanded body rates, base axes")]
    thrust: Annotated[Scalar, Unit("", "normalized thrust set point, 0 to 1")]


def rotor_wrench(vehicle: Vehicle, speeds: Sequence[Scalar]) -> Force:
    """Torque (N m) about and force (N) at the base origin of rotors at given speeds
    (rad/s), base axes.
    """
    squares = [
        push(rotor, speed) for rotor, speed in zip(vehicle.rotors, speeds, strict=True)
    ]
    x, y, z, thrust, fx, fy = (
        inner_product(row, squares) for row in allocation_matrix(vehicle, sideways=True)
    )
    return Force(Vec3(x, y, z), Vec3(fx, fy, thrust))


def angular_acceleration(
    model: Model,
    measurement: Measurement,
    reference: Reference,
    applied: Force,
    efforts: Sequence[Scalar],
) -> Vec3:
    """Modelled angular acceleration (rad/s^2, base axes) of the base under a rotor
    wrench about its origin.

    Joints of torque drives accelerate by ``efforts``; with any other drive the joints
    have the accelerations of their references, and the base's follows from its rows of
    the equations of motion.
    """
    vehicle, m = model.vehicle, measurement
    R, rate, joints, rates = m.quaternion.rotation(), m.rate, m.joints, m.joint_rates
    if not vehicle.drives:
        none = Disturbance(force=ZERO3, torque=ZERO3, efforts=(0,) * vehicle.n)
        return acceleration(model, R, rate, joints, rates, applied, efforts, none)[1]
    # as in free fall: weight accelerates every body alike, and turns none
    still = Motion(ZERO3, ZERO3)
    bias = dynamics.inverse_dynamics(
        vehicle, joints, rate, rates, still, reference.joint_accelerations
    )[0]
    # a setpoint drive imposes the joints' motion: six rows of the base remain
    M = dynamics.mass_matrix(vehicle, Mat3.identity(), joints)
    rest = [*(applied.force - bias.force), *(applied.torque - bias.torque)]
    return Vec3(*ldl_solve([row[:6] for row in M[:6]], rest)[3:6])
