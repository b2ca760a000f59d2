"""Limits on references and commands in the safety layer, and the joint-limit barrier.

Reference: a wrapper sees neither the law's attitude loop nor its gains, but it may move
the reference. With the law taken for a = stiffness e_p + damping e_v + a_ref, the
errors and a_ref are scaled together, which keeps the balance of pull and brake, so that
commanded tilt, climb and speed stay bounded; a reference within the limits passes as it
is, bit for bit.

Commands: rotor speeds are brought within the rotors' limits with thrust, roll and pitch
before yaw, whatever mixer the law has. The joint barrier bounds the acceleration that a
torque would cause by the model.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from skyarm import dynamics
from skyarm.algebra import (
    ZERO3,
    ZERO3_DATA,
    Mat3,
    Scalar,
    Scalars,
    Vec3,
    differences,
    inner_product,
    ldl_solve,
    sums,
)
from skyarm.algebra.scalars import (
    absolute,
    add,
    clip,
    divide,
    logical_or,
    maximum,
    minimum,
    mul,
    sqrt,
    sub,
    tan,
    where,
)
from skyarm.control.blocks.prediction import calm_wrench
from skyarm.control.model import Model
from skyarm.control.safety.limits import Limits
from skyarm.dynamics.actuators import (
    AllocationError,
    Command,
    Mixer,
    allocation_matrix,
    make_mixer,
    mix,
)
from skyarm.dynamics.actuators.drive import friction
from skyarm.reference import Reference
from skyarm.sensing.measurement import Measurement

TINY = 1e-9
"""Small number added to the length (m, m/s or m/s^2) of a vector to avoid division by
zero."""


def govern_base(
    reference: Reference,
    measurement: Measurement,
    *,
    limits: Limits,
    stiffness: Scalar,
    damping: Scalar,
    gravity: Scalar,
) -> Reference:
    """Reference whose position, velocity and acceleration are limited relative to the
    measurement.

    1. No faster than ``speed``. 2. A position error pulls no harder than that speed
    brakes. 3. The acceleration asked stays within ``climb`` and, level, within
    tan(tilt) times the specific force along the vertical. 4. Errors within ``step`` and
    ``step_speed`` pass all the same: a stiff law bounds its own answer to those. 5. A
    planned centre of mass and a preview move with the base.
    """
    v_d = _limit_length(reference.velocity, limits.speed)
    off = reference.position - measurement.position
    pull = _limit_length(off, divide(mul(limits.speed, damping), stiffness))
    brake = v_d - measurement.velocity
    asked = pull * stiffness + brake * damping + reference.acceleration
    rise = minimum(1.0, divide(limits.climb, absolute(asked.z) + TINY))
    room = mul(tan(limits.tilt), add(gravity, mul(rise, asked.z)))
    level = minimum(
        1.0, divide(room, sqrt(asked.x * asked.x + asked.y * asked.y) + TINY)
    )
    least = minimum(1.0, divide(limits.step, pull.norm() + TINY))
    least = minimum(least, divide(limits.step_speed, brake.norm() + TINY))
    level, rise = maximum(level, least), maximum(rise, least)
    shares = Vec3(level, level, rise)
    # what has become shorter was beyond a limit
    far = pull.norm() < off.norm()
    fast = v_d.norm() < reference.velocity.norm()
    bound = [logical_or(logical_or(share < 1.0, far), fast) for share in shares]

    def where_bound(new: Vec3, old: Vec3) -> Vec3:
        return Vec3(*(where(c, a, b) for c, a, b in zip(bound, new, old, strict=True)))

    governed = replace(
        reference,
        position=where_bound(
            measurement.position + pull.hadamard(shares), reference.position
        ),
        velocity=where_bound(
            measurement.velocity + brake.hadamard(shares), reference.velocity
        ),
        acceleration=where_bound(
            reference.acceleration.hadamard(shares), reference.acceleration
        ),
        # a reference that moves with the measurement has no higher derivatives
        jerk=where_bound(ZERO3_DATA, reference.jerk),
        snap=where_bound(ZERO3_DATA, reference.snap),
    )
    if not (reference.center or reference.ahead):
        return governed
    pairs = zip(_base_motion(governed), _base_motion(reference), strict=True)
    changes = [after - before for after, before in pairs]
    # numbers of a preview go signal by signal, those of a centre of mass derivative by
    # derivative
    others = (0,) * (3 * (1 + len(reference.joints)))
    sample = [
        *(change for axis in zip(*changes[:3], strict=True) for change in axis),
        *others,
    ]
    return replace(
        governed,
        center=reference.center
        and sums(reference.center, [each for change in changes for each in change]),
        ahead=sums(reference.ahead, sample * (len(reference.ahead) // len(sample))),
    )


def _base_motion(reference: Reference) -> tuple[Vec3, ...]:
    """Position of the base and its first four derivatives."""
    return (
        reference.position,
        reference.velocity,
        reference.acceleration,
        reference.jerk,
        reference.snap,
    )


def _limit_length(v: Vec3, longest: Scalar) -> Vec3:
    """Vector clipped to the length ``longest``; bitwise unchanged if it is shorter."""
    length = v.norm()
    share = divide(longest, length + TINY)
    return Vec3(*(where(length > longest, mul(c, share), c) for c in v))


def govern_joints(
    reference: Reference,
    before: Sequence[Scalar],
    ramping: Sequence[Scalar],
    speeds: Sequence[Scalar],
    steps: Sequence[Scalar],
    dt: Scalar,
    *,
    model: Model,
    limits: Limits,
) -> tuple[Reference, Scalars]:
    """Joint references clipped to joint limits, and limited in rate after a jump by
    more than ``steps``.

    Args:
        reference: wanted.
        before: rad or m, where the governed references stood one period ago.
        ramping: 1 for a joint whose reference was on its way.
        speeds: rad/s or m/s, on the way.
        steps: rad or m; a gap up to this is closed at once, unless it is what is left
            of a longer one.
        dt: s.
        model: joint limits.
        limits: margins, and the largest rate of a reference.

    Returns:
        The reference, and for each joint 1 if it is on its way.
    """
    at: list[Scalar] = []
    slowed: list[Scalar] = []
    rates: list[Scalar] = []
    on_way: list[Scalar] = []
    for desired, rate, old, ramp, joint, speed, free, most, margin in zip(
        reference.joints,
        reference.joint_rates,
        before,
        ramping,
        model.vehicle.joints,
        speeds,
        steps,
        limits.joint_speed,
        limits.joint_margin,
        strict=True,
    ):
        # the barrier acts from one margin on: a reference at two is tracked without it
        low, high = add(joint.lower, 2.0 * margin), sub(joint.upper, 2.0 * margin)
        target = clip(desired, low, high)
        step = mul(speed, dt)
        gap = sub(target, old)
        slow = absolute(gap) > where(ramp > 0.5, step, maximum(step, free))
        outside = logical_or(desired < low, desired > high)
        at.append(where(slow, add(old, clip(gap, 0.0 - step, step)), target))
        on_way.append(where(slow, 1.0, 0.0))
        slowed.append(logical_or(slow, outside))
        moving = where(gap > 0.0, speed, 0.0 - speed)
        rates.append(
            where(slow, moving, where(outside, 0.0, clip(rate, 0.0 - most, most)))
        )

    def still(values: Sequence[Scalar]) -> Scalars:
        # a reference may come without its higher derivatives
        return tuple(
            where(slow, 0.0, value) for slow, value in zip(slowed, values, strict=False)
        )

    governed = replace(
        reference,
        joints=tuple(at),
        joint_rates=tuple(rates),
        joint_accelerations=still(reference.joint_accelerations),
        joint_jerks=still(reference.joint_jerks),
        joint_snaps=still(reference.joint_snaps),
    )
    return governed, tuple(on_way)


def with_priorities(model: Model, mixer: Mixer) -> Mixer:
    """Return the mixer with priorities (roll and pitch torque first) if the rotors
    allow it, else unchanged.

    A law that ranks demands already, in whatever order, keeps its own.
    """
    if mixer.policy != "clip":
        return mixer
    try:
        make_mixer(model.vehicle, "priority")
    except AllocationError:
        return mixer
    return replace(mixer, policy="priority")


def reachable(model: Model, mixer: Mixer, speeds: Sequence[Scalar]) -> Scalars:
    """Rotor speeds reallocated from their torque and thrust where one exceeds its
    limit, else unchanged.

    A law that commands more than it needs, to undo the motors' lag, may command such
    speeds with any mixer.
    """
    beyond: Scalar = False
    for speed, top in zip(speeds, mixer.highest, strict=True):
        beyond = logical_or(beyond, speed > sqrt(top))
    sideways = bool(mixer.across)
    squares = [speed * speed for speed in speeds]
    pushes = [
        inner_product(row, squares)
        for row in allocation_matrix(model.vehicle, sideways)
    ]
    # rows of the sideways force exist only where the mixer has them
    across = Vec3(pushes[4], pushes[5], 0) if sideways else ZERO3
    again, _ = mix(mixer, Vec3(*pushes[:3]), pushes[3], across)
    return tuple(
        where(beyond, new, old) for new, old in zip(again, speeds, strict=True)
    )


def limit_slew(
    command: Command,
    last: Command,
    started: Scalar,
    rotor_slew: Scalar,
    effort_slew: Sequence[Scalar],
    dt: Scalar,
) -> Command:
    """Command whose change since the last command is limited in rate; the first command
    is unlimited.
    """

    def near(value: Scalar, before: Scalar, slew: Scalar) -> Scalar:
        step = mul(slew, dt)
        return where(
            started > 0.5, clip(value, sub(before, step), add(before, step)), value
        )

    return Command(
        rotor_speeds=tuple(
            near(w, old, rotor_slew)
            for w, old in zip(command.rotor_speeds, last.rotor_speeds, strict=True)
        ),
        efforts=tuple(
            near(t, old, slew)
            for t, old, slew in zip(
                command.efforts, last.efforts, effort_slew, strict=True
            )
        ),
    )


def apply_joint_barrier(
    model: Model, limits: Limits, measurement: Measurement, efforts: Sequence[Scalar]
) -> Scalars:
    """Joint efforts corrected by a control barrier function so that no joint reaches
    its limits.

    With d the distance to a limit (less the margin) and k the pole, d'' + 2 k d' + k^2
    d >= 0 bounds the acceleration towards it; 4 k (speed - rate) bounds it near the
    largest speed. The model says which accelerations the efforts and the rotors'
    present thrust cause; to a joint whose own is out of bounds its entry of M_free
    (bounded - caused) is added, with M_free the inertia of the joints on a floating
    base: enough, and more if others may move.

    Source: Ames et al. 2019, "Control barrier functions: theory and applications",
    exponential barrier of degree two.
    """
    caused = _accelerations(model, measurement, efforts)
    allowed = _within_barrier(model, limits, measurement, caused)
    added = floating_inertia_times(
        model, measurement.joints, differences(allowed, caused)
    )
    # other joints keep their torques: where a drive is dead the model is wrong about
    # what they cause
    return tuple(
        where(logical_or(bounded < qdd, bounded > qdd), add(tau, more), tau)
        for bounded, qdd, tau, more in zip(allowed, caused, efforts, added, strict=True)
    )


def _accelerations(
    model: Model, measurement: Measurement, efforts: Sequence[Scalar]
) -> Scalars:
    """Joint accelerations of the model, friction included, at the measured rotor speeds
    in calm air.
    """
    rates = measurement.joint_rates
    total = calm_wrench(model.vehicle, measurement.rotor_speeds)
    rows = zip(model.vehicle.joints, efforts, rates, strict=True)
    # dry friction at the measured rate, too: it is what acts, where a law that gives it
    # back takes the reference's
    torques = tuple(sub(effort, friction(joint, qd, qd)) for joint, effort, qd in rows)
    return dynamics.forward_dynamics(
        model.vehicle, measurement.joints, measurement.rate, rates, total, torques
    )[1]


def _within_barrier(
    model: Model, limits: Limits, measurement: Measurement, caused: Sequence[Scalar]
) -> list[Scalar]:
    """Joint accelerations clipped to the bounds of the joint-limit barrier."""
    bounded: list[Scalar] = []
    k = limits.joint_pole
    for q, rate, qdd, joint, speed, margin in zip(
        measurement.joints,
        measurement.joint_rates,
        caused,
        model.vehicle.joints,
        limits.joint_speed,
        limits.joint_margin,
        strict=True,
    ):
        damp = mul(2.0 * k, rate)
        square = k * k
        above = sub(sub(joint.upper, margin), q)
        below = sub(add(joint.lower, margin), q)
        # ends of the range by a double pole k, the speed limit by a pole 4 k
        top = minimum(sub(mul(square, above), damp), mul(4.0 * k, sub(speed, rate)))
        bottom = maximum(
            sub(mul(square, below), damp), mul(4.0 * k, sub(0.0 - speed, rate))
        )
        bounded.append(clip(qdd, bottom, top))
    return bounded


def floating_inertia_times(
    model: Model, joints: Sequence[Scalar], change: Sequence[Scalar]
) -> list[Scalar]:
    """Joint torques for a ``change`` of joint accelerations on a free-floating base.

    [M_bb M_bj; M_jb M_jj] [a; change] = [0; torque].
    """
    M = dynamics.mass_matrix(model.vehicle, Mat3.identity(), joints)
    pushed = [inner_product(row[6:], change) for row in M[:6]]
    base = ldl_solve([row[:6] for row in M[:6]], [0.0 - value for value in pushed])
    return [
        add(inner_product(row[:6], base), inner_product(row[6:], change))
        for row in M[6:]
    ]


def within_efforts(limits: Limits, efforts: Sequence[Scalar]) -> Scalars:
    """Efforts clipped to their limits; NaN stays NaN."""
    return tuple(
        clip(effort, 0.0 - most, most)
        for effort, most in zip(efforts, limits.effort, strict=True)
    )
