"""Centre-of-mass tracking: the force that the law requires, with two derivatives.

p_c,d = p_d + R_q h(th_d): the base's reference plus the arm's, with R_q the
quasi-static attitude. Taking R_q from the force of the centre of mass itself would
invert the zero dynamics h theta'' + g theta = x'', which are undamped for a hanging arm
and unstable for an arm on top.

Where the angular acceleration |h''''| / g that the arm's motion requires of the base
exceeds ``ARM_TURN``, the base compensates the share ARM_TURN / size of the horizontal
motion of h about its slow mean; the tip stays.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

from skyarm.algebra import E_Z, ZERO3, Mat3, Scalar, Vec3
from skyarm.algebra.scalars import divide, maximum, minimum, sqrt, where
from skyarm.algebra.scalars.taylor import inverse_root
from skyarm.control.blocks.attitude import (
    DesiredAttitude,
    derivative,
    reachable,
    vector_series,
)
from skyarm.control.laws.centroidal.parameters import CentroidalParameters
from skyarm.control.laws.centroidal.step_records import RotorForce
from skyarm.records.immutable import immutable
from skyarm.records.leaves import as_data
from skyarm.records.units import Unit


@immutable(kw_only=False)
class Thrust:
    """Desired and achievable force on the centre of mass, and the resulting
    acceleration.

    Attributes:
        force: desired, series of second order, world axes, N.
        along: N, of it along the present thrust axis. across: N, achievable across it,
            body axes.
        acceleration: a_c, m/s^2, that they give.
    """

    force: Vec3
    along: Scalar
    acceleration: Vec3
    across: Vec3 = ZERO3


ALONG_Z = RotorForce()
"""Rotor force along body z alone."""


def quasi_static(
    par: CentroidalParameters,
    mass: Scalar,
    base: list[Vec3],
    disturbance: Vec3,
    rates: Sequence[Vec3],
) -> Vec3:
    """Force (N, two derivatives) that the base's reference requires without feedback: m
    (p_d'' + g) - d.

    ``rates`` are known derivatives of the disturbance, N/s and N/s^2.
    """
    first, second = rates
    force = (base[2] + E_Z * par.model.gravity) * mass - disturbance
    series = vector_series((force, base[3] * mass - first, base[4] * mass - second))
    return reachable(series, par.center.tilt, par.center.floor)


def planned_rate(
    still: DesiredAttitude, motion: Sequence[Vec3], mass: Scalar, gravity: Scalar
) -> Vec3:
    """Rate (N/s, planned body axes) of the planned force f = m (p'' + g): R^T m p''' -
    w x R^T f.

    ``motion`` are p'' and p''' of the centre of mass.
    """
    force: Vec3 = still.R.apply_T(motion[0] + E_Z * gravity) * mass
    change: Vec3 = still.R.apply_T(motion[1]) * mass
    return change - still.rate.cross(force)


def goal(
    base: list[Vec3], h: list[Vec3], still: DesiredAttitude, moving: bool
) -> list[Vec3]:
    """Reference of the centre of mass, with four derivatives, from the base reference
    and the centre's offset ``h``.

    ``moving`` differentiates R_q too, in velocity and acceleration.
    """
    if moving:
        w, alpha = still.rate, still.acceleration
        h = [
            h[0],
            w.cross(h[0]) + h[1],
            alpha.cross(h[0]) + w.cross(w.cross(h[0])) + w.cross(h[1]) * 2.0 + h[2],
            *h[3:],
        ]
    return [p + still.R.apply(each) for p, each in zip(base, h, strict=True)]


def thrust(
    par: CentroidalParameters,
    mass: Scalar,
    *,
    wanted: list[Vec3],
    position: Vec3,
    velocity: Vec3,
    R: Mat3,
    w: Vec3,
    disturbance: Sequence[Vec3],
    rotors: RotorForce = ALONG_Z,
) -> Thrust:
    """Force (N) on the centre of mass for tracking, m (p_c,d'' + g e_3 + PD) - d, with
    derivatives.

    ``wanted`` is the reference of the centre of mass, value to fourth derivative,
    ``position`` and ``velocity`` its present ones; ``disturbance`` has its two known
    derivatives with it.
    """
    pushed, force_rate, force_bend = disturbance
    kv, gravity = par.base.velocity, E_Z * par.model.gravity
    e, ed = position - wanted[0], velocity - wanted[1]
    off = [e]
    pull = [_attraction(par, off) + kv.hadamard(ed)]
    force = (wanted[2] + gravity - _soft_limit(pull)) * mass - pushed
    per_mass = divide(1.0, mass)
    # the error's own derivatives follow from the force that the rotors can give, and
    # each is needed for the next derivative of the force
    edd = (rotors.achievable([force], R, w) + pushed) * per_mass - gravity - wanted[2]
    off.append(ed)
    pull.append(_attraction(par, off) + kv.hadamard(edd))
    first = (wanted[3] - _soft_limit(pull)) * mass - force_rate
    eddd = (rotors.achievable([force, first], R, w) + force_rate) * per_mass - wanted[3]
    off.append(edd)
    pull.append(_attraction(par, off) + kv.hadamard(eddd))
    second = (wanted[4] - _soft_limit(pull)) * mass - force_bend
    series = vector_series((force, first, second))
    limited = reachable(series, par.center.tilt, par.center.floor)
    given = rotors.achievable([derivative(limited, 0)], R, w)
    return Thrust(
        force=limited,
        along=derivative(limited, 0).dot(R.column(2)),
        acceleration=(given + pushed) * per_mass - gravity,
        across=rotors.across(R, given),
    )


APPROACH = 2.0
"""Deceleration (m/s^2) of a base that returns from a large position error; chosen, a
tilt of 12 degrees."""


def _attraction(par: CentroidalParameters, errors: list[Vec3]) -> Vec3:
    """Position feedback kp e or its derivative, reduced for large errors so that
    braking remains possible.

    kp e + kv e' settles at the velocity kp / kv e, which no bounded thrust can stop
    from far away. With e_0 = 2 a (kv / kp)^2, kp e / (1 + |e / e_0|^4)^(1/8) settles at
    sqrt(2 a |e|) there, which falls at the rate a.
    """
    kp, kv = par.base.position, par.base.velocity
    error = vector_series(errors)
    far = error.hadamard(
        Vec3(
            *(
                divide(p * p, maximum(v * v * (2.0 * APPROACH), SMALL))
                for p, v in zip(kp, kv, strict=True)
            )
        )
    )
    square = far.dot(far)
    # three halvings of the exponent: the power -1/8
    left = inverse_root(square * square + 1.0, 3)
    return kp.hadamard(derivative(error * left, len(errors) - 1))


PULL = 8.0
"""Largest feedback acceleration (m/s^2) of the centre of mass. Without a bound 2 of 16
flights of ``hexarotor_arm6`` in turbulence of 6 m/s are lost, with it none (seeds 431
to 446)."""


def _soft_limit(pull: list[Vec3]) -> Vec3:
    """Feedback acceleration or its derivative after the smooth saturation pull /
    sqrt(1 + |pull|^2 / PULL^2).
    """
    series = vector_series(pull)
    share = inverse_root(series.dot(series) * (1.0 / (PULL * PULL)) + 1.0)
    return derivative(series * share, len(pull) - 1)


ARM_TURN = 20.0
"""Largest angular acceleration (rad/s^2) of the base for the arm's motion; without it a
swing at 2 Hz is lost."""

ATTACK, DECAY = 10.0, 0.5
"""Rates (1/s) at which the intensity of the arm's motion is tracked upwards and
downwards; chosen: a swing is seen in a tenth of a second, and for two after its end."""

MEAN = 1.0
"""Bandwidth (rad/s) of the filter for the slow mean of the centre of mass;
chosen, far below swings that the base cannot follow."""

# least divisor, of gains that are 0
SMALL = 1e-9


@immutable
class ArmMotion:
    """Filter state of the arm's motion: angular acceleration required of the base, slow
    mean of the centre of mass.
    """

    size: Annotated[
        Scalar,
        Unit(
            "rad/s^2", "angular acceleration that the arm's motion requires of the base"
        ),
    ]
    mean: Annotated[
        Vec3, Unit("m", "slow mean of the common centre of mass, base axes")
    ]


def update_arm_motion(
    memory: ArmMotion, com: Vec3, gravity: Scalar, dt: Scalar
) -> ArmMotion:
    """Filter state of the arm's motion one period later, from a fourth-order Taylor
    series of the centre of mass.
    """
    top = derivative(com, 4)
    size = divide(sqrt(top.x * top.x + top.y * top.y), gravity)
    # quick up and slow down: between two reversals of a swing the demand is small for a
    # moment
    rate = where(size > memory.size, ATTACK, DECAY) * dt
    h = derivative(com, 0)
    return ArmMotion(
        size=memory.size + rate * (size - memory.size),
        mean=as_data(memory.mean + (h - memory.mean) * (MEAN * dt)),
    )


def compensated_motion(memory: ArmMotion, h: list[Vec3]) -> list[Vec3]:
    """Centre-of-mass offset with derivatives, blended towards its slow mean while the
    arm moves fast.
    """
    left = 1.0 - minimum(1.0, divide(ARM_TURN, memory.size + SMALL))
    mean = [memory.mean]
    for each in h[:-1]:
        # a first-order filter's rate is its gap to the input, so derivatives need no
        # difference in time
        mean.append((each - mean[-1]) * MEAN)
    return [
        Vec3(a.x - (a.x - m.x) * left, a.y - (a.y - m.y) * left, a.z)
        for a, m in zip(h, mean, strict=True)
    ]
