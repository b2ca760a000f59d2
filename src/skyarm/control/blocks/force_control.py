"""Contact force control of an arm's tip along the estimated normal n of a surface.

The disturbance observer takes a surface for a disturbance; a law that compensated it
would push against its own push. Along n the *desired* force therefore replaces the
observed one: the joints give it, the base carries it.

Per period: the tip's force f (:mod:`skyarm.control.blocks.tip_force`); contact, which
begins above ``touch`` and ends when f.n stays below ``lost`` for ``loss_time`` or,
after full force, the tip goes in faster than ``escape`` for ``escape_time``; a share g
that rises in ``rise`` and, where contact is lost, falls in ``fall`` seconds; the order
o = g (f_d + i) with the bounded integral i' = k (f_d - f.n), still unless g = 1, and
not growing at limits of actuators; and the shift s of the reference along n, by which
the base comes to the surface, follows it and returns. The base also carries (1 - g) f.n
while the ramp runs: it must answer an impact.

Friction holds a resting tip with any force within its cone, which joints and rotors
balance. Near their limits the law compensates less of the force across n, and friction
takes the difference. A force beyond the cone is that of a wall beside the tip, as of a
hole, and would grow with its own compensation: only ``cone`` times the normal force is
compensated. Compensation of what holds a resting tip off its reference integrates that
error until friction breaks or the rotors have no yaw torque left: while the reference
stands, only ``standing`` times the normal force is compensated, and more over
``starting`` seconds of a motion that is slow.

Contact outlasts the push. In a release the order falls as slowly as it rose, and as it
falls the tip follows its reference out again: let go at once, a tip springs back while
the base still leans, and jabs. Until the tip's force is below ``lost`` for
``loss_time``, whatever its direction, it is none that the joints compensate: it stores
no force in what holds it.

What slides or turns away bears less than f_d, and would be driven to any speed. Where
the tip goes in faster than 0.8 of the speed of its approach, the force that the
integral looks for falls by f_d for each ``again`` of the excess, the order down to
none, and from that whole speed on the reference takes over what is more: less would
answer what is only pushed into a hole. A tip that leaves its reference behind is
through the surface.

A tip that grips is in contact for as long as the reference says; f_d may have either
sign, and the normal may be the radius of an arc (:class:`DesiredContact`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated

from skyarm.algebra import ZERO3_DATA, Scalar, Vec3
from skyarm.algebra.scalars import (
    absolute,
    clip,
    divide,
    logical_and,
    logical_not,
    logical_or,
    maximum,
    minimum,
    sqrt,
    where,
)
from skyarm.control.blocks.filters import low_pass_share
from skyarm.control.blocks.prediction import Disturbance, no_disturbance
from skyarm.control.blocks.tip_force import ForceErrors, TipLevers, tip_force
from skyarm.control.blocks.torque_scale import Tolerances, TorqueScale
from skyarm.control.controller import ControllerError
from skyarm.dynamics.kinematics import out_of_axis
from skyarm.records.files import shown
from skyarm.records.immutable import immutable
from skyarm.records.leaves import as_data
from skyarm.records.units import Unit
from skyarm.reference.tip_motion import STRONGEST

YIELDING = 0.8
"""Fraction of the approach speed above which a pressed surface counts as yielding:
doors are slower, boxes faster."""

PRESSED = 0.75
"""Threshold of the contact history flag above which the full contact force has been
commanded: amid its values of 0.5 for a touch and 1."""


def interact(
    gains: InteractionGains,
    memory: InteractionMemory,
    wanted: DesiredContact,
    observed: Disturbance,
    at: TipLevers,
    into: Scalar,
    load: Scalar,
    dt: Scalar,
    felt: Vec3 | None = None,
    moving: Scalar = 1,
) -> tuple[InteractionMemory, Pressing]:
    """Step of the contact force controller: next controller state, and force command
    for the control law.

    Args:
        gains: constants.
        memory: one period earlier.
        wanted: desired contact.
        observed: disturbance.
        at: levers at its time.
        into: speed of the tip into the surface, m/s.
        load: largest share of its limit of the last command of a joint or rotor.
        dt: s.
        felt: N, force at the tip measured by a sensor, world axes; it decides on
            contact and drives the integral.
        moving: 0 where the reference has stood along the surface, 1 where it slides.
    """
    n, asked = wanted.normal, wanted.requests_contact
    force = tip_force(gains.errors, at, observed - memory.bias)
    measured = force if felt is None else felt
    along = n.dot(measured)
    # faster than its reference: what gives way slowly takes the reference along
    ahead = into + minimum(memory.shift_rate, 0.0)
    touching, losing = touches(
        gains, memory, asked, where(asked, along, _size(measured)), ahead, dt
    )
    # a ramp begins with an impact, in which any tip goes in: a full force shows what
    # yields
    yields = where(
        memory.share < 1.0,
        0.0,
        # after a touch the tip comes with ``again`` at most, however fast it came first
        maximum(into - YIELDING * minimum(wanted.speed, gains.again), 0.0),
    )
    relieved = clip(
        (load - gains.relief_start) / (gains.relief_end - gains.relief_start), 0.0, 1.0
    )
    if wanted.grips:
        touching = maximum(touching, wanted.grip)
        losing = losing * (1.0 - wanted.grip)
        yields = yields * (1.0 - wanted.grip)
    pressed = where(asked, touching, 0.0)
    share = ramp_share(gains, memory.share, pressed, touching, dt)
    borne = along + wanted.force * divide(yields, gains.again)
    integral = integrate_force_error(
        gains,
        memory.integral,
        wanted.force,
        borne,
        pressed,
        share,
        relieved,
        dt,
        wanted.grips,
    )
    # released, the order falls in proportion to the ramp: as slowly as it rose
    # once the ramp has ended, its order is 0 too: 0 over 1e-9, no division by 0
    left = memory.order * divide(share, maximum(memory.share, 1e-9))
    order = where(asked, share * (wanted.force + integral), left)
    normal_force = n.dot(force)
    most = gains.standing + (gains.cone - gains.standing) * moving
    cone = most * maximum(maximum(order, normal_force), 0.0)
    # the cone cuts the size and keeps the direction, as friction acts against the slip
    within = minimum(divide(cone, _size(force - n * normal_force)), 1.0)
    compensated = (1.0 - gains.relief * relieved) * within
    if wanted.grips:
        compensated = where(wanted.grip > 0.5, gains.yielding, compensated)
    presses = logical_or(touching > 0.5, share > 0.0)
    free = where(logical_or(presses, memory.touching > 0.5), 0.0, memory.free + dt)
    engaged = where(presses, 1.0, 0.0)
    shift = normal_shift(gains, memory, asked, pressed, share, wanted.speed, dt, yields)
    # found: half for a touch while the force still rises, whole at the full force
    after = replace(
        memory,
        touching=touching,
        losing=losing,
        share=share,
        order=order,
        integral=integral,
        found=where(
            asked, maximum(memory.found, where(share < 1.0, 0.5, 1.0) * touching), 0.0
        ),
        shift=shift[0],
        shift_rate=shift[1],
        reached=where(asked, where(pressed > 0.5, shift[0], memory.reached), 0.0),
        free=free,
        met=maximum(memory.met, touching),
        bias=update_bias(gains, memory.bias, observed, force, asked, free, dt),
        force=as_data(force),
        felt=memory.felt if felt is None else as_data(felt),
    )
    pressing = Pressing(
        n=n,
        share=share,
        damping=where(
            logical_and(ahead > gains.escape, memory.found > PRESSED),
            gains.catching,
            gains.damping,
        ),
        engaged=engaged,
        shift=shift,
        asked=asked,
        order=order,
        beyond=touching * (1.0 - share) * normal_force,
        force=force,
        kept=compensated,
    )
    return after, pressing


def touches(
    gains: InteractionGains,
    memory: InteractionMemory,
    asked: Scalar,
    force: Scalar,
    into: Scalar,
    dt: Scalar,
) -> tuple[Scalar, Scalar]:
    """Contact detection with hysteresis: contact (1 or 0), and progress (0 to 1)
    towards the loss of contact.

    ``force`` is that along the normal while contact is asked for, after it the size of
    the tip's force, N; ``into`` the tip's speed into the surface ahead of its
    reference, m/s.
    """
    was = memory.touching > 0.5
    weak = where(force < gains.lost, dt / gains.loss_time, 0.0)
    through = where(
        logical_and(into > gains.escape, memory.found > PRESSED),
        dt / gains.escape_time,
        0.0,
    )
    step = maximum(weak, through)
    losing = where(logical_and(was, step > 0.0), memory.losing + step, 0.0)
    # the force at a tip that still goes in, soon after a loss, is a remainder in the
    # observer or a sensor's filter
    begins = logical_and(
        force > gains.touch,
        logical_or(into < gains.escape, memory.free > gains.rebound),
    )
    # a sum of periods is not exactly their number times one
    touching = where(
        was,
        where(losing > 1.0 - 1e-9, 0.0, 1.0),
        where(logical_and(asked, begins), 1.0, 0.0),
    )
    return touching, losing


def ramp_share(
    gains: InteractionGains,
    share: Scalar,
    pressed: Scalar,
    touching: Scalar,
    dt: Scalar,
) -> Scalar:
    """Ramp (0 to 1) of the commanded contact force: slow rise in contact, slow release,
    fast fall without contact.
    """
    down = dt / where(touching > 0.5, gains.rise, gains.fall)
    return clip(share + where(pressed > 0.5, dt / gains.rise, -down), 0.0, 1.0)


def integrate_force_error(
    gains: InteractionGains,
    integral: Scalar,
    wanted: Scalar,
    along: Scalar,
    touching: Scalar,
    share: Scalar,
    relieved: Scalar,
    dt: Scalar,
    signed: bool = False,
) -> Scalar:
    """Bounded integral (N) of the contact force error: constant during the force ramp,
    zero without contact.

    With ``relieved`` (0 to 1, at an actuator's limit) the order does not grow.
    """
    most = (
        gains.integral_share * (absolute(wanted) if signed else wanted)
        + gains.integral_least
    )
    step = where(share < 1.0, 0.0, gains.integral * dt) * (wanted - along)
    # at a limit the order may still shrink: only its growth would wind up
    step = where(step * (wanted + integral) > 0.0, step * (1.0 - relieved), step)
    return where(
        # down to no order at all, as for what gives way; upwards only by the bound
        touching > 0.5,
        clip(integral + step, -maximum(most, wanted), most),
        0.0,
    )


def normal_shift(
    gains: InteractionGains,
    memory: InteractionMemory,
    asked: Scalar,
    touching: Scalar,
    share: Scalar,
    speed: Scalar,
    dt: Scalar,
    yields: Scalar = 0.0,
) -> tuple[Scalar, Scalar, Scalar]:
    """Offset of the reference along a surface normal, with two derivatives: to
    approach, follow or leave a surface.

    ``share`` is the ramp of the force, ``speed`` that of the approach, ``yields`` the
    excess of the tip's speed into what gives way, m/s.
    """
    s, rate, w = memory.shift, memory.shift_rate, gains.follow
    # a surface that was met is near, and is not to be struck on the way back
    speed = where(memory.found > 0.0, minimum(speed, gains.again), speed)
    # against the normal, into the surface, until it is taken for gone
    coming = where(s > memory.reached - gains.furthest, -speed, 0.0)
    # critically damped, so that neither return nor following swings past its goal
    back = -(w * w) * s - 2.0 * w * rate
    # ``yields`` counts from 0.8 of the speed on, what the reference takes over from all
    # of it
    follow = (w * w) * memory.gap - 2.0 * w * (
        rate + maximum(yields - (1.0 - YIELDING) * speed, 0.0)
    )
    free = where(asked, gains.coming * (coming - rate), back + (follow - back) * share)
    limit = gains.follow_limit
    acceleration = clip(where(touching > 0.5, follow, free), -limit, limit)
    moved = rate + acceleration * dt
    # the mean of both rates: exact, as the acceleration is constant over the period
    return s + (rate + moved) * (0.5 * dt), moved, acceleration


def update_bias(
    gains: InteractionGains,
    bias: Disturbance,
    d: Disturbance,
    force: Vec3,
    asked: Scalar,
    free: Scalar,
    dt: Scalar,
) -> Disturbance:
    """Low-pass estimate of the disturbance without contact; during contact only the
    base force is updated.

    ``d`` is the observed disturbance, ``force`` the tip's part of it (N, world axes)
    beyond the bias, ``free`` the time since the last contact, s.
    """
    learns = logical_and(logical_not(asked), free > gains.rest)
    share = where(learns, low_pass_share(gains.bias_rate, dt), 0.0)
    wind = where(learns, share, where(asked, low_pass_share(gains.wind_rate, dt), 0.0))
    # in contact the tip's force is in the disturbance: the rest of it on the base is
    # wind
    unexplained = replace(d, force=d.force - force * where(learns, 0.0, 1.0))
    return bias.blend_towards(unexplained, share, wind)


def contact_cleared(gains: InteractionGains, memory: InteractionMemory) -> Scalar:
    """Flag of 1 if contact ended long enough ago that the observed disturbance is free
    of it, else 0.

    Also 0 while a force as large as that of a contact acts at the tip, such as that of
    a hole's wall on a peg.
    """
    quiet = memory.force.dot(memory.force) < gains.touch * gains.touch
    return where(logical_and(memory.free > gains.rest, quiet), 1.0, 0.0)


def _size(force: Vec3) -> Scalar:
    """Magnitude (N) of a force, never exactly zero."""
    return sqrt(force.dot(force) + 1e-12)


@immutable
class Pressing:
    """Output of the contact force controller: force command, reference offset and tip
    damping.

    Attributes:
        n: out of the surface. share: 0 free, 1 pressing. damping: 1/s, of the tip along
            n where it presses.
        engaged: 1 while the order replaces the observed force. shift: m, m/s and m/s^2
            along n.
        order: N, along n. beyond: N, that the base carries along n in addition.
        force: N, the tip's as observed, world axes.
        kept: 0 to 1, of the observed force across n that is compensated. asked: whether
            contact is requested.
    """

    n: Vec3
    share: Scalar
    damping: Scalar
    engaged: Scalar
    shift: tuple[Scalar, Scalar, Scalar]
    order: Scalar
    beyond: Scalar
    force: Vec3
    kept: Scalar
    asked: Scalar = False

    def with_order(
        self, d: Disturbance, then: TipLevers, now: TipLevers
    ) -> Disturbance:
        """Disturbance with the observed contact force replaced by the commanded force
        along the normal.
        """
        across = self.force - self.n * self.n.dot(self.force)
        joint_force = across * self.kept + self.n * self.order
        borne = joint_force + self.n * self.beyond
        # the joints give the order; what is beyond it the base carries alone
        base = replace(
            now.disturbance(borne), efforts=now.disturbance(joint_force).efforts
        )
        return d + (base - then.disturbance(self.force)) * self.engaged


SENSING = 60.0
"""Bandwidth (rad/s) of the force sensor's filter, above that of the observers and below
that of the contact."""


SensorBandwidth = Annotated[
    Scalar,
    Unit(
        "rad/s",
        "bandwidth of the filter of the force sensor",
        effect="lower values pass less sensor noise and add lag",
    ),
]
"""Bandwidth of a force sensor's filter, as constants of several parts declare it."""


@immutable
class InteractionGains:
    """Constants of the contact force controller.

    The defaults are chosen. ``catching`` is the damping of the free tip by default
    (option ``tip``): a tip that breaks through is braked by all of it.
    """

    touch: Annotated[
        Scalar,
        Unit(
            "N",
            "normal force above which the tip is in contact",
            effect="higher values ignore noise and wind, and detect contact later",
        ),
    ]
    lost: Annotated[
        Scalar,
        Unit(
            "N",
            "normal force below which contact is lost after loss_time",
            effect="lower values keep contact through a weak push",
        ),
    ]
    errors: ForceErrors = ForceErrors()
    loss_time: Annotated[
        Scalar,
        Unit(
            "s",
            "time below the force threshold lost until contact is lost",
            effect="longer times ride over short gaps and notice a lost surface later",
        ),
    ] = 0.04
    escape: Annotated[
        Scalar,
        Unit(
            "m/s",
            "speed into the surface above which the surface counts as gone",
            effect=(
                "lower values stop a tip that breaks through sooner, and soft surfaces"
                " trigger it"
            ),
        ),
    ] = 0.1
    escape_time: Annotated[
        Scalar, Unit("s", "time above the speed escape until contact is lost")
    ] = 0.015
    rebound: Annotated[
        Scalar,
        Unit(
            "s",
            "time after the end of a push in which a returning tip is not in contact",
        ),
    ] = 0.05
    rise: Annotated[
        Scalar,
        Unit(
            "s",
            "rise time of the commanded force, and of its decrease to zero",
            effect="longer times press more gently and later",
        ),
    ] = 0.15
    fall: Annotated[
        Scalar, Unit("s", "ramp-down time of the force after contact is lost")
    ] = 0.02
    integral: Annotated[
        Scalar,
        Unit(
            "1/s",
            "integral gain of the force error",
            effect=(
                "higher values reach the commanded force sooner and bounce more with"
                " delay"
            ),
        ),
    ] = 4.0
    integral_share: Annotated[
        Scalar,
        Unit(
            "",
            "fraction of the commanded force that the integral may add",
            effect="higher values correct larger force errors and overshoot more",
        ),
    ] = 0.5
    integral_least: Annotated[
        Scalar,
        Unit("N", "force that the integral may add to any command, however small"),
    ] = 0.3
    damping: Annotated[
        Scalar,
        Unit(
            "1/s",
            "damping of the tip along the normal in contact",
            effect="higher values bounce less and follow a moving surface later",
        ),
    ] = 20.0
    catching: Annotated[
        Scalar,
        Unit(
            "1/s",
            "damping of a tip that breaks through the surface",
            effect="higher values stop it in a shorter way",
        ),
    ] = 53.0
    bias_rate: Annotated[
        Scalar,
        Unit(
            "rad/s",
            "bandwidth of the filter of the tip force observed in free motion",
            effect=(
                "higher values follow a drifting bias faster and absorb a slow contact"
            ),
        ),
    ] = 0.5
    wind_rate: Annotated[
        Scalar,
        Unit(
            "rad/s", "bandwidth of the filter of the base force that is not the tip's"
        ),
    ] = 1.0
    rest: Annotated[
        Scalar,
        Unit(
            "s", "time after contact before loads, friction and lag are estimated again"
        ),
    ] = 0.5
    follow: Annotated[
        Scalar,
        Unit(
            "rad/s",
            "bandwidth of the base that follows the surface",
            effect=(
                "higher values follow a moving surface better and react more to"
                " estimation errors"
            ),
        ),
    ] = 3.5
    coming: Annotated[
        Scalar, Unit("1/s", "rate at which the base takes the approach speed")
    ] = 8.0
    follow_limit: Annotated[
        Scalar,
        Unit(
            "m/s^2",
            "acceleration at which the base's motion along the normal saturates",
        ),
    ] = 4.0
    relief_start: Annotated[
        Scalar,
        Unit(
            "",
            "fraction of an actuator limit above which friction compensation is"
            " reduced",
        ),
    ] = 0.9
    relief_end: Annotated[
        Scalar,
        Unit("", "fraction of an actuator limit at which its reduction is complete"),
    ] = 1.0
    relief: Annotated[
        Scalar,
        Unit(
            "",
            "largest reduction of friction compensation, 0 to 1 of the observed"
            " friction",
        ),
    ] = 0.2
    cone: Annotated[
        Scalar,
        Unit(
            "",
            "largest friction compensated across the normal, as a fraction of the"
            " normal force",
            effect=(
                "higher values slide on rougher surfaces and slip away on smooth ones"
            ),
        ),
    ] = 1.0
    standing: Annotated[
        Scalar, Unit("", "the same fraction while the reference stands still")
    ] = 0.25
    starting: Annotated[
        Scalar, Unit("s", "ramp time from standing to cone in a slow motion")
    ] = 2.0
    yielding: Annotated[
        Scalar,
        Unit(
            "",
            "fraction of the observed tangential force that is followed while a tip"
            " grips, 0 to 1",
            effect=(
                "higher values yield more to a door or valve whose path differs from"
                " the reference"
            ),
        ),
    ] = 0.7
    tilting: Annotated[
        Scalar,
        Unit(
            "1/s",
            "rate at which a slide corrects the surface normal",
            effect=(
                "higher values follow a curved surface better and pass more noise of"
                " the force"
            ),
        ),
    ] = 1.0
    again: Annotated[
        Scalar,
        Unit(
            "m/s",
            "highest speed of the tip on its return to a lost surface",
            bound=True,
        ),
    ] = 0.1
    sensing: SensorBandwidth | None = None
    furthest: Annotated[
        Scalar, Unit("m", "longest search distance of the base beyond its last contact")
    ] = 0.5
    tolerances: Tolerances | None = None


@immutable
class InteractionMemory:
    """State of the contact force controller: contact flags, force integral, reference
    offset, disturbance bias.
    """

    touching: Annotated[
        Scalar, Unit("", "1 while the tip is in a requested contact")
    ] = 0.0
    losing: Annotated[Scalar, Unit("", "progress towards lost contact, 0 to 1")] = 0.0
    share: Annotated[
        Scalar, Unit("", "fraction of the desired force that is commanded, 0 to 1")
    ] = 0.0
    order: Annotated[Scalar, Unit("N", "commanded force along the normal")] = 0.0
    integral: Annotated[Scalar, Unit("N", "integral part of the commanded force")] = 0.0
    found: Annotated[
        Scalar,
        Unit(
            "",
            "0.5 once the push has met its surface, 1 once the full force was reached",
        ),
    ] = 0.0
    shift: Annotated[
        Scalar, Unit("m", "displacement of the reference along the normal")
    ] = 0.0
    shift_rate: Annotated[
        Scalar, Unit("m/s", "rate of the reference's displacement along the normal")
    ] = 0.0
    reached: Annotated[
        Scalar,
        Unit("m", "displacement of the reference at the last contact of this push"),
    ] = 0.0
    free: Annotated[
        Scalar, Unit("s", "time since the command of the last contact ended")
    ] = 0.0
    met: Annotated[Scalar, Unit("", "1 from the first contact of the flight on")] = 0.0
    gap: Annotated[
        Scalar,
        Unit("m", "distance of the tip from its shifted reference along the normal"),
    ] = 0.0
    bias: Disturbance
    force: Annotated[Vec3, Unit("N", "estimated force at the tip, world axes")] = (
        ZERO3_DATA
    )
    lean: Annotated[
        Vec3,
        Unit(
            "", "tilt of the surface normal against the model, estimated while sliding"
        ),
    ] = ZERO3_DATA
    moving: Annotated[
        Scalar,
        Unit(
            "",
            "fraction of a slide along the surface that the reference has begun, 0"
            " to 1",
        ),
    ] = 0.0
    felt: Annotated[
        Vec3 | tuple[()],
        Unit("N", "filtered reading of the force sensor at the tip, world axes"),
    ] = ()
    scale: TorqueScale | tuple[()] = ()


@immutable
class DesiredContact:
    """Desired contact: force (N), approach speed (m/s) and unit normal out of the
    surface, world axes.

    Attributes:
        grip: 1 while the tip grips; a structural 0 where it never does.
        pivot: m, on the axis of the tip's arc then. axis: its unit vector; None for a
            fixed normal.
    """

    force: Scalar
    speed: Scalar
    normal: Vec3
    grip: Scalar = 0
    pivot: Vec3 | None = None
    axis: Vec3 | None = None

    @property
    def grips(self) -> bool:
        """True if the flight's reference can request a grip, which is known before
        compilation.
        """
        return type(self.grip) is not int

    @property
    def requests_contact(self) -> Scalar:
        """True while the reference requests that the tip presses or grips."""
        pushing: Scalar = self.force > 0.0
        return logical_or(pushing, self.grip > 0.5) if self.grips else pushing

    @property
    def presses(self) -> Scalar:
        """True while the reference requests that the tip presses on a surface without
        gripping.
        """
        pushing: Scalar = self.force > 0.0
        return logical_and(pushing, self.grip < 0.5) if self.grips else pushing

    def about_the_pivot(self, tip: Vec3) -> DesiredContact:
        """Desired contact whose normal, while gripping, points from the axis of the
        tip's arc to the tip.
        """
        if self.pivot is None or self.axis is None:
            return self
        out = out_of_axis(tip, self.pivot, self.axis, self.grip > 0.5, self.normal)
        return replace(self, normal=out)


def require_thresholds(
    thresholds: tuple[float, float],
    leads: bool,
    mode: str = "tip",
    *,
    optional: bool = True,
) -> None:
    """Reject invalid contact force thresholds (N), or contact control by a law that
    does not control the tip.

    Args:
        thresholds: forces of contact and of its loss, N.
        leads: whether the law controls the tip.
        mode: mode of the law that does, for the message.
        optional: whether twice 0 means a law without contact.

    Raises:
        ControllerError: one line.
    """
    touch, lost = thresholds
    at = f"controller.interaction = {shown(thresholds)}"
    if not touch > lost > 0.0:
        off = ", or twice 0" if optional else ""
        raise ControllerError(
            f"{at}: must be two forces above 0, the second below the first{off}"
        )
    if touch > STRONGEST:
        raise ControllerError(f"{at}: must be at most {STRONGEST:g} N")
    if not leads:
        raise ControllerError(
            f"{at}: must be twice 0 but in mode '{mode}' with joints that press"
        )


def first_interaction(joints: int, sensor: bool = False) -> InteractionMemory:
    """Initial state of the contact force controller: free flight."""
    return InteractionMemory(
        bias=no_disturbance(joints), felt=ZERO3_DATA if sensor else ()
    )


def wanted_of(push: Sequence[Scalar]) -> DesiredContact:
    """Desired contact from the values in a reference's field ``push``."""
    force, speed, *normal = push[:5]
    # a reference is as long as what it may request: force, speed and normal, then the
    # grip, then the axis of an arc; an int keeps the grip out of the program
    grip = where(push[5] > 0.5, 1.0, 0.0) if len(push) > 5 else 0
    pivot, axis = (Vec3(*push[6:9]), Vec3(*push[9:])) if len(push) > 6 else (None, None)
    return DesiredContact(
        force=force,
        speed=speed,
        normal=Vec3(*normal),
        grip=grip,
        pivot=pivot,
        axis=axis,
    )
