"""Fastest decay rates of joint friction and fastest motions at joint stops, which limit
integration steps.

The damping of a stop is proportional to depth and speed: how fast it moves a joint
depends on the flight, and so does the number of steps of an interval in which a joint
may meet its stop.

The mass matrix is our own, for MuJoCo's plant too: its numbers choose how long a step
is, no force comes from them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from skyarm.algebra import Scalar
from skyarm.algebra.scalars import (
    absolute,
    divide,
    floor,
    maximum,
    minimum,
    sqrt,
    where,
)
from skyarm.dynamics import State
from skyarm.dynamics.array_front import mass_matrix
from skyarm.dynamics.workspace import nearest_to_zero
from skyarm.plant.largest_step import FRICTION_STEP
from skyarm.records.arrays import Array, float_array
from skyarm.records.coerce import concrete
from skyarm.records.leaves import leaves
from skyarm.vehicle import Joint, Vehicle, VehicleError
from skyarm.vehicle.mobility import of_mirrored
from skyarm.world.component import MOST_STEPS

SAMPLES = 64
"""Number of arm configurations that are evaluated; the effective inertia of a joint
changes with the others' angles. Of shipped vehicles 4096 find a decay at most 1.4 %
faster."""

FASTEST = 1e4
"""Fastest decay rate, 1/s. A faster friction would need over 70 integration steps per
control period of 5 ms."""

REACH = {"revolute": math.pi, "prismatic": 1.0}
"""Distance from zero (rad or m) up to which a joint is evaluated, if its limits allow
it."""


def friction_rate(vehicle: Vehicle) -> float:
    """Largest decay rate (1/s) by joint friction: largest eigenvalue of inverse inertia
    times joint damping.

    D holds damping plus the slope of the smooth Coulomb law at rest, its steepest
    place. Joints are looked at within their limits. Zero without friction, or where the
    numbers are not concrete.

    Raises:
        VehicleError: friction so stiff that no explicit integrator can afford it; names
            the joint and the field.
    """
    joints = vehicle.joints
    # symbols of a batch have no eigenvalues: its lanes are checked one by one
    if not joints or not _is_concrete(vehicle):
        return 0.0
    D = np.array([float(j.damping) + _steepest(j) for j in joints])
    # no friction needs no mass matrix
    if not D.any():
        return 0.0
    if not np.all(np.isfinite(D)):
        # argmin of truth values: the first joint that is not finite
        raise VehicleError(_blame(joints[int(np.argmin(np.isfinite(D)))], math.inf))
    # D^1/2 A D^1/2 has the eigenvalues of A D and is symmetric
    rate, mode = fastest_mode(vehicle, np.sqrt(D))
    if rate > FASTEST:
        raise VehicleError(_blame(joints[int(np.argmax(np.abs(mode)))], rate))
    return rate


def _is_concrete(vehicle: Vehicle) -> bool:
    """True if masses and joints of a vehicle are plain numbers, not symbols."""
    return concrete(*leaves((vehicle.base, vehicle.links)))


def fastest_mode(vehicle: Vehicle, root: Array) -> tuple[float, Array]:
    """Largest joint decay rate (1/s) over sampled arm configurations, and its
    eigenvector.
    """
    none = 0.0, np.zeros(vehicle.n)
    try:
        with np.errstate(all="ignore"):
            # similar to the inverse times D, but symmetric
            rates, modes = np.linalg.eigh(
                root[:, None]
                * np.linalg.inv(_masses(vehicle))[:, 6:, 6:]
                * root[None, :]
            )
    except np.linalg.LinAlgError:
        # masses so far apart that rounding makes M singular: such a flight ends as
        # diverged
        return none
    fastest = rates[:, -1]
    worst = int(np.argmax(fastest))
    return (
        (float(fastest[worst]), modes[worst, :, -1])
        if np.all(np.isfinite(fastest))
        else none
    )


def _masses(vehicle: Vehicle) -> Array:
    """Mass matrices (SAMPLES + 1, 6 + n, 6 + n) of a vehicle at the sampled joint
    positions.
    """
    still = np.array([1.0, 0.0, 0.0, 0.0])
    return mass_matrix(vehicle, np.zeros(3), still, _configurations(vehicle.joints))


def _steepest(joint: Joint) -> float:
    """Slope of the smoothed Coulomb friction law at zero rate, N m s/rad or N s/m."""
    return float(joint.coulomb) / float(joint.coulomb_rate)


def _configurations(joints: tuple[Joint, ...]) -> Array:
    """Sampled joint positions (SAMPLES + 1, n) within limits, beginning with those
    nearest to zero.
    """
    middle = np.array([nearest_to_zero(j) for j in joints])
    reach = np.array([REACH[j.kind] for j in joints])
    low = np.maximum(middle - reach, [float(j.lower) for j in joints])
    high = np.minimum(middle + reach, [float(j.upper) for j in joints])
    # a fixed seed: a vehicle always takes the same steps
    anywhere = np.random.default_rng(0).uniform(low, high, (SAMPLES, len(joints)))
    return np.concatenate([middle[None], anywhere])


def _blame(joint: Joint, rate: float) -> str:
    """Error message about a joint with too stiff friction: joint, field and remedy."""
    field, remedy = "damping", "lower damping, or state the armature"
    # the larger of both slopes is the one to lower
    if _steepest(joint) > joint.damping:
        field = "coulomb"
        remedy = "raise coulomb_rate or lower coulomb, or state the armature"
    return (
        f"joints[{joint.name}].{field} = {getattr(joint, field)!r}: joint friction"
        f" decays at {rate:.9g} 1/s: must be at most {FASTEST:g}; {remedy}"
    )


STOP_STEP = 1.05
"""Largest product of a stop's natural frequency (rad/s) and an RK4 step. Within a stop
the method is stable to 2.78, but a step that enters or leaves it sees the bend of its
force at four instants only. An elastic touch keeps its energy to 8 % (measured); at 2.2
it gained 63 % at worst."""

STIFFEST = 3e4
"""Highest natural frequency (rad/s) of a stop; a stiffer one would need over 140
integration steps per control period of 5 ms."""


def joint_rate(vehicle: Vehicle) -> float:
    """Fastest rate (1/s) of joint friction and joint stops, which limits the
    integration step.

    Raises:
        VehicleError: friction or stops so stiff that no explicit integrator can afford
            them; names joint and field.
    """
    # one number for both: a stop's frequency as the decay rate of the same step
    return max(
        friction_rate(vehicle), stop_frequency(vehicle) * (FRICTION_STEP / STOP_STEP)
    )


def stop_frequency(vehicle: Vehicle) -> float:
    """Highest natural frequency (rad/s) of the joints pressed against their stops, or
    decay rate of the stops' damping.

    Zero without stops, or where the numbers are not concrete.
    """
    joints = vehicle.joints
    if not any(joint.has_stops for joint in joints) or not _is_concrete(vehicle):
        return 0.0
    stiffness, damping = (
        np.array([of(joint) for joint in joints]) for of in (_stiffness, _damping)
    )
    squared, mode = fastest_mode(vehicle, np.sqrt(stiffness))
    decay, other = fastest_mode(vehicle, np.sqrt(damping))
    frequency = math.sqrt(squared)
    if max(frequency, decay) > STIFFEST:
        field, worst = (
            ("stop_stiffness", mode) if frequency >= decay else ("stop_damping", other)
        )
        # the joint that moves most in the fastest mode is the one to change
        joint = joints[int(np.argmax(np.abs(worst)))]
        raise VehicleError(
            f"joints[{joint.name}].{field} = {getattr(joint, field)!r}: a stop this"
            f" stiff moves the joint at {max(frequency, decay):.9g} rad/s: must be at"
            f" most {STIFFEST:g}; lower {field}, or state the armature"
        )
    return max(frequency, decay)


def _stiffness(joint: Joint) -> float:
    return float(joint.stop_stiffness) if joint.has_stops else 0.0


def _damping(joint: Joint) -> float:
    """Damping (N m s/rad or N s/m) of a joint's end stop under the full effort of the
    drive.
    """
    effort = float(joint.effort_limit)
    return (
        # at rest the full effort presses the joint so deep that k depth is this effort
        effort * float(joint.stop_damping)
        if joint.has_stops and math.isfinite(effort)
        else 0.0
    )


TOUCH_STEP = 0.5
"""Largest product of the fastest rate at a stop that a joint may meet and a Runge-Kutta
step: the speeds after 400 drawn impacts were then within 1.7 % of the approach
(measured); at ``STOP_STEP`` some were 6 % off."""

HELD_TOUCH_STEP = 0.07
"""The same product of methods of first order in damping."""

JointNumbers = tuple[tuple[float, float], ...]
"""Largest mobility, 1/(kg m^2) or 1/kg, and largest acceleration by drives, rad/s^2 or
m/s^2, of each joint."""


def stop_numbers(vehicle: Vehicle) -> JointNumbers:
    """Largest mobility and acceleration of each joint (:func:`joint_numbers`); () of a
    vehicle without stops.
    """
    return (
        joint_numbers(vehicle)
        if any(joint.has_stops for joint in vehicle.joints)
        else ()
    )


def joint_numbers(vehicle: Vehicle) -> JointNumbers:
    """Largest mobility and acceleration of each joint, rounded up to powers of two.

    Rounded, vehicles of nearly equal masses share a program. The acceleration is that
    by the largest efforts of all drives. () where the numbers are not concrete, or
    masses too far apart.
    """
    if not _is_concrete(vehicle):
        return ()
    efforts = float_array(joint.effort_limit for joint in vehicle.joints)
    # an unlimited effort has no largest acceleration: the speed of now counts alone
    efforts[np.isinf(efforts)] = 0.0
    try:
        with np.errstate(all="ignore"):
            mobility = np.abs(np.linalg.inv(_masses(vehicle))[:, 6:, 6:])
            rows = np.stack([np.einsum("sii->si", mobility), mobility @ efforts]).max(
                axis=1
            )
            # the sampled configurations are no mirror images: mirrored joints get one
            # number
            rows = of_mirrored(rows, mobility)
            # powers of two: nearly equal vehicles share one compiled program
            most = np.exp2(np.ceil(np.log2(rows))).T.tolist()
    except np.linalg.LinAlgError:
        return ()
    return (
        tuple((each, driven) for each, driven in most)
        if np.all(np.isfinite(most))
        else ()
    )


def stop_rate(
    vehicle: Vehicle, numbers: JointNumbers, state: State, seconds: Scalar
) -> Scalar:
    """Fastest rate (1/s) at the stops that joints may meet within ``seconds``; 0 if
    none can be met.

    At a stop k d (1 + c v) the spring has the frequency sqrt(k / m (1 + c v)). Without
    a spring m v dv = -k c d v dd: an approach at v ends at a depth d with d^2 = 2 m v /
    (k c), where the damping has the rate k c d / m, the root of 2 k c v / m. On the way
    back it may be faster than a step bears, but the stop never pulls: that moves the
    joint at no more than 1 / c. Several joints' squares add up.
    """
    square: Scalar = 0.0
    # numbers are () where they are not known: no stop counts then
    rows = zip(vehicle.links, numbers, state.joints, state.joint_rates, strict=False)
    for link, (mobility, acceleration), q, qd in rows:
        joint = link.joint
        if joint.has_stops:
            # the fastest that the drives can make the joint until the end of the
            # interval
            speed = absolute(qd) + acceleration * seconds
            # the same bound on the way decides whether a stop can be met
            near = maximum(q - joint.upper, joint.lower - q) + speed * seconds > 0.0
            # 1 + 2 c v is no less than 1 + c v of the spring nor 2 c v of the damping
            # alone
            stiffness = joint.stop_stiffness * (1.0 + 2.0 * joint.stop_damping * speed)
            square = square + where(near, mobility * stiffness, 0.0)
    return sqrt(square)


def friction_bound(
    vehicles: Sequence[Vehicle], numbers: Sequence[JointNumbers]
) -> Scalar:
    """Bound (1/s) of the vehicles' :func:`friction_rate`: largest trace of inverse
    inertia times joint damping.
    """
    largest: Scalar = 0.0
    for vehicle, own in zip(vehicles, numbers, strict=True):
        rate: Scalar = 0.0
        # own is () where the numbers are not known, and bounds nothing then
        for joint, (mobility, _) in zip(vehicle.joints, own, strict=False):
            # a trace bounds the largest eigenvalue, and needs no matrix in the program
            rate = rate + mobility * (
                joint.damping + divide(joint.coulomb, joint.coulomb_rate)
            )
        largest = maximum(largest, rate)
    return largest


def touch_steps(
    vehicles: Sequence[Vehicle],
    stops: Sequence[JointNumbers],
    states: Sequence[State],
    seconds: Scalar,
    largest: float,
) -> Scalar:
    """Number of integration steps that joints need at the stops that they may meet
    within ``seconds``, or 0.

    ``largest`` is the largest product of a rate and a step.
    """
    rate: Scalar = 0.0
    for vehicle, numbers, state in zip(vehicles, stops, states, strict=True):
        rate = maximum(rate, stop_rate(vehicle, numbers, state, seconds))
    # minus the floor of the negative is the ceiling, which scalars do not have
    # less 1e-9: a quotient that is whole up to rounding takes no step more
    return minimum(-floor(1e-9 - rate * seconds * (1.0 / largest)), float(MOST_STEPS))
