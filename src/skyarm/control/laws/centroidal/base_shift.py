"""Base shift that keeps the tip in place along a previewed motion: bounded solution of
the unstable tilt dynamics.

With y the sideways shift of the common centre of mass, a the reference's acceleration,
d the steady force per mass, n the specific thrust and l the height of the centre of
mass above the tip, the attitude answers a + y'' - d and the tip stays where y = (l / n)
(a + y'' - d):

    y'' = (n / l) y + d - a.

One solution stays bounded. It obeys y' = -b y + v, where b and v follow backwards from
the end of the preview, as if d - a went on evenly there: b' = b^2 - n / l, v' = b v +
d - a. From one instant to the one before it that is exact for a mean n / l and an even
change of d - a. The law integrates y; its higher derivatives come from the equation.

Joints that turn links back as the base tilts leave a share of d - a: that of the way of
the tip against the centre of mass. It turns with the heading: at each instant of the
preview by the yaw of that instant, and now with the yaw's derivatives. An arm above the
base has l < 0 and zero dynamics that swing: there y'' = (n / |l|) y - (d - a), which
agrees with the solution for slow motions and passes the resonance.

Sources: Devasia, Chen, Paden 1996 (bounded inverse of a system whose zero dynamics are
unstable); Zou, Devasia 1999 (the same from a finite preview); Bryson, Ho 1975, 7 (sweep
of a linear boundary value problem).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Annotated

from skyarm.algebra import ZERO3, ZERO3_DATA, Scalar, Scalars, Vec3
from skyarm.algebra.scalars import (
    absolute,
    add,
    cos,
    data,
    divide,
    maximum,
    minimum,
    sin,
    sqrt,
    sub,
)
from skyarm.algebra.scalars.taylor import Taylor, choose, inverse_root
from skyarm.control.blocks.attitude import Posture, derivative, posture, vector_series
from skyarm.control.blocks.center_of_mass import axes
from skyarm.control.laws.centroidal.parameters import (
    SHARES,
    CentroidalParameters,
    TipGains,
)
from skyarm.control.laws.centroidal.tip_tasks import joints_of_turns, tip_columns
from skyarm.dynamics.kinematics import chain, link_poses, parallel
from skyarm.records.immutable import immutable
from skyarm.records.leaves import as_data
from skyarm.records.units import Unit
from skyarm.reference.preview import Sample
from skyarm.vehicle import BASE, Vehicle

LEAST = 0.02
"""Least length (m) of the pendulum; the shift of an arm of parallel axes falls with a
smaller height above the tip. Chosen: at 2 cm it falls at sqrt(g / l) = 22 1/s, and
the loop of the attitude has 14."""

HELD = 0.02
"""Regularisation of the squared joint rotations by which an arm of parallel axes
compensates a tilt of the base; chosen: 2 % of the tilt are left about one axis."""

WEAK = 0.15
"""Lower bound of the specific thrust, as a fraction of gravity: that of the law's least
vertical force."""

STEEP = 0.75
"""Upper bound of the squared sine of a tilt, that of 60 degrees, chosen: the secant is
2 there, and has no bound beyond."""

# under a root, so that equal moments leave no 0 / 0
TINY = 1e-9


@immutable
class Shift:
    """State of the base shift: centre-of-mass shift, and the vertical acceleration that
    it caused one period before.

    Attributes:
        coming: mean vertical acceleration from each instant of the preview to the next,
            m/s^2.
    """

    place: Annotated[
        Vec3, Unit("m", "desired position of the shifted base, world axes, horizontal")
    ]
    sinking: Annotated[
        Scalars, Unit("", "desired vertical acceleration with two derivatives")
    ]
    secants: Annotated[
        Scalars,
        Unit("", "thrust over its vertical part at each instant of the preview"),
    ]
    coming: Annotated[
        Scalars,
        Unit("m/s^2", "desired vertical acceleration at each instant of the preview"),
    ]
    first: Annotated[Scalar, Unit("s", "time to the first instant of the preview")]


FIRST_SHIFT = Shift(
    place=ZERO3_DATA,
    sinking=(0.0,) * 3,
    secants=(1.0,) * (len(SHARES) + 1),
    coming=(0.0,) * len(SHARES),
    first=0.0,
)
"""Initial state of the base shift: a vehicle at rest."""


@immutable
class Acting:
    """Forces on the vehicle in addition to rotor thrust and weight, world axes.

    Attributes:
        force: steady force, N. rate: its predicted rate, N/s. drag: hub drag of the
            rotors, N s/m.
    """

    force: Vec3
    rate: Vec3
    drag: Scalar


@immutable(kw_only=False)
class PreviewInstant:
    """Reference at one instant of the preview.

    Attributes:
        time: time from now, s. rise: vertical acceleration, m/s^2.
        force: part of d - a that joints leave, horizontal, world axes, m/s^2.
        lever: height of the centre of mass above the tip, m.
    """

    time: Scalar
    rise: Scalar
    force: Vec3
    lever: Scalar


@immutable(kw_only=False)
class TiltShares:
    """Part of a base tilt that joints do not compensate: [[m + x, y - s], [y + s, m -
    x]] on horizontal vectors.

    Attributes:
        mean: m, mean of all directions. x, y: deviations from it at heading 0. skew: s.
        length: whether they are lengths (m), by which the centre of mass must shift for
            a tilt of 1 rad, and not fractions of its height above the tip.
    """

    mean: Scalar
    x: Scalar
    y: Scalar
    skew: Scalar = 0
    length: bool = False

    def left(self, v: Vec3, yaw: Scalar) -> Vec3:
        """Part of a horizontal vector (world axes, or its series) that joints do not
        compensate at a heading (rad).
        """
        ahead, aside = cos(yaw), sin(yaw)
        # shares are a tensor of second order: it turns by the double angle
        c, s = ahead * ahead - aside * aside, 2.0 * ahead * aside
        x, y = c * self.x - s * self.y, s * self.x + c * self.y
        across, along = (
            (sub(y, self.skew), add(y, self.skew)) if self.length else (y, y)
        )
        return Vec3(
            v.x * (x + self.mean) + v.y * across,
            v.x * along + v.y * (-x + self.mean),
            0,
        )

    def over(self, height: Scalar, size: Scalar) -> Scalar:
        """Factor on the part for a pendulum of a size (m), with the centre of mass a
        height (m) above the tip.
        """
        return divide(1.0 if self.length else height, size)


def tilt_shares(
    vehicle: Vehicle, gains: TipGains, joints: Sequence[Scalar], level: Posture
) -> TiltShares:
    """Part of the tip's way in a base tilt that remains when joints turn the links
    back.

    The way is that of the tip against the centre of mass. An arm whose axes all are
    parallel turns back as a whole, or not at all: of it a fraction remains.
    """
    if all(
        link.parent == BASE or parallel(vehicle.links[link.parent].joint, link.joint)
        for link in vehicle.links
    ):
        return _shares_of_moments(vehicle, level)
    poses = link_poses(vehicle, joints, summed=True)
    arm = derivative(level.tip, 0) - derivative(level.com, 0)
    directions, columns = axes(vehicle, poses), tip_columns(vehicle, joints, poses)
    ways = []
    # of a thrust along x, and along y
    for tilt in (Vec3(0, 1, 0), Vec3(-1, 0, 0)):
        way = tilt.cross(arm)
        still = joints_of_turns(
            vehicle, gains, directions, [-tilt] * vehicle.n, vehicle.zeros
        )
        for column, turn in zip(columns, still, strict=True):
            way = way + column * turn
        ways.append(way)
    # as a matrix: its mean, the two parts that turn with the axes, its skew
    (ahead, aside), half = ways, -0.5
    mean = ahead.x + aside.y
    x = ahead.x - aside.y
    y = ahead.y + aside.x
    skew = ahead.y - aside.x
    return TiltShares(half * mean, half * x, half * y, half * skew, length=True)


def _shares_of_moments(vehicle: Vehicle, level: Posture) -> TiltShares:
    """Fraction of a base tilt that an arm of parallel axes leaves, from the second
    moments of the axes.

    A turn about the axis with the largest moment moves the centre of mass across it.
    """
    xx: Scalar = 0.0
    xy: Scalar = 0.0
    yy: Scalar = 0.0
    for i in chain(vehicle, vehicle.frame().link):
        axis = _turning_axis(vehicle, level, i)
        xx, xy, yy = xx + axis.x * axis.x, xy + axis.x * axis.y, yy + axis.y * axis.y
    trace, off, twice = xx + yy, xx - yy, 2.0 * xy
    size = sqrt(off * off + twice * twice + TINY)
    # damped least squares leave this much along each principal direction
    along, across = (
        divide(HELD, maximum(0.5 * moment, 0.0) + HELD)
        for moment in (trace - size, trace + size)
    )
    half = divide(0.5 * (along - across), size)
    return TiltShares(0.5 * (along + across), half * off, half * twice)


def _turning_axis(vehicle: Vehicle, level: Posture, i: int) -> Vec3:
    """Rotation axis of a joint in base axes; zero for a prismatic joint."""
    joint = vehicle.links[i].joint
    return (
        Vec3(*(derivative(row, 0).dot(joint.axis) for row in level.links[i].R.rows))
        if joint.turns
        else ZERO3
    )


def coming_levers(
    vehicle: Vehicle, samples: Sequence[Sequence[Sample]]
) -> list[Scalar]:
    """Heights (m) of the centre of mass above the tip at the five previewed reference
    samples, two approximated.

    A posture costs as much as the rest of the work for a sample, and those two count
    less than the others.
    """
    levels = [
        posture(vehicle, [Taylor.constant(q, 0) for q, _, _ in samples[k][4:]], 0)
        for k in (0, 1, 3)
    ]
    one, two, four = (
        derivative(at.com, 0).z - derivative(at.tip, 0).z for at in levels
    )
    return [one, two, 0.5 * (two + four), four, four]


@immutable(kw_only=False)
class PreviewInterval:
    """Bounded base shift y over a preview interval: y' = -b y + v at the start, and
    coefficients of y at the end.

    Attributes:
        b: 1/s. v: m/s. time: time from the first to the second one, s.
        cosh, sinh: factors of y and y' (s) at the first one, in y at the second one.
            forced: m, by the force.
    """

    b: Scalar
    v: Vec3
    time: Scalar = 0
    cosh: Scalar = 0
    sinh: Scalar = 0
    forced: Vec3 = ZERO3


def bounded_sweep(
    rows: Sequence[PreviewInstant], thrusts: Sequence[Scalar]
) -> list[PreviewInterval]:
    """Bounded base shift at each instant of the preview, by a backward sweep from its
    end.

    Args:
        rows: reference from now on.
        thrusts: mean specific thrust from each instant to the next, and at the last
            one, m/s^2.
    """
    sizes = [_size(row.lever) for row in rows]
    b = sqrt(divide(thrusts[-1], sizes[-1]))
    per = divide(-1.0, b)
    v = rows[-1].force * per
    if len(rows) > 1:
        # as if the force went on as it has changed last
        now, then = rows[-2:]
        v = v + (then.force - now.force) * divide(per, b * (then.time - now.time))
    line = [PreviewInterval(b, v)]
    for i in range(len(rows) - 2, -1, -1):
        now, then = rows[i], rows[i + 1]
        h = then.time - now.time
        pace = divide(2.0 * thrusts[i], sizes[i] + sizes[i + 1])
        z = pace * (h * h)
        # cosh and sinh of h sqrt(pace) by series: no root, no division by one near 0
        cosh = 1.0 + z * (0.5 + z * (1.0 / 24.0 + z / 720.0))
        sinh = h * (1.0 + z * (1.0 / 6.0 + z * (1.0 / 120.0 + z / 5040.0)))
        left = divide(1.0, cosh + b * sinh)
        # of the mean and of the change of the force over the interval, in the place at
        # its end
        mean = h * h * (0.5 + z * (1.0 / 24.0 + z / 720.0))
        change = h * h * (1.0 / 12.0 + z / 80.0)
        asked, turn = (now.force + then.force) * 0.5, then.force - now.force
        forced = asked * mean - turn * change
        v = (v - forced * b - asked * sinh + turn * ((h / 24.0) * z)) * left
        b = (pace * sinh + b * cosh) * left
        line.append(PreviewInterval(b, v, h, cosh, sinh, forced))
    return line[::-1]


def coming_thrusts(
    rows: Sequence[PreviewInstant], line: Sequence[PreviewInterval], y: Vec3
) -> tuple[Scalars, ...]:
    """Vertical accelerations (m/s^2) of the shifted centre of mass along the preview,
    and secants of the tilt.

    A lever l that is turned by y to the side is less high by about y^2 / 2 l.
    """
    rates, secants = [], []
    for row, here in zip(rows, line, strict=True):
        speed = here.v - y * here.b
        per = divide(1.0, _size(row.lever))
        secants.append(_secant(y, per))
        rates.append(y.dot(speed) * (-row.lever * per * per * secants[-1]))
        y = y * here.cosh + speed * here.sinh + here.forced
    sinks = tuple(
        divide(b - a, here.time)
        for a, b, here in zip(rates, rates[1:], line, strict=False)
    )
    return sinks, tuple(secants)


def _secant(y: Vec3, per: Scalar) -> Scalar:
    """Secant 1 / cos of the tilt of a lever whose end is displaced by ``y``; ``per``:
    inverse length of the lever.
    """
    side = y * per
    square = side.dot(side)
    least = (
        choose(square < STEEP, square, STEEP)
        if isinstance(square, Taylor)
        else minimum(square, STEEP)
    )
    return inverse_root(1.0 - least)


def _size(height: Scalar) -> Scalar:
    return maximum(absolute(height), LEAST)


def bounded_shift(
    par: CentroidalParameters,
    shift: Shift,
    base: Sequence[Vec3],
    yaw: Taylor,
    joints: Sequence[Taylor],
    level: Posture,
    acting: Acting,
    ahead: Sequence[tuple[Scalar, Sequence[Sample]]],
    dt: Scalar,
) -> tuple[list[Vec3], Shift]:
    """First to fourth derivative of the shift of the centre of mass (m, world axes),
    and its state one period later.

    Args:
        par: constants of the law.
        shift: now.
        base: its reference, value to fourth derivative.
        yaw: rad, series of second order at least.
        joints: their references, rad or m.
        level: posture of the references on a level base, fourth-order series.
        acting: forces beside those of rotors and weight.
        ahead: times from now (s) and samples of the reference then.
        dt: s.
    """
    vehicle, gravity = par.model.vehicle, par.model.gravity
    shares = tilt_shares(vehicle, par.tip, [q.derivative(0) for q in joints], level)
    per_mass = divide(1.0, vehicle.mass)
    push, rate = acting.force * per_mass, acting.rate * per_mass
    slow = acting.drag * per_mass
    lever = Taylor.of_derivatives(
        [derivative(level.com, k).z - derivative(level.tip, k).z for k in range(3)]
    )

    def instant(
        time: Scalar,
        velocity: Vec3,
        acceleration: Vec3,
        heading: Scalar,
        height: Scalar,
    ) -> PreviewInstant:
        asked = push + rate * time - velocity * slow - acceleration
        return PreviewInstant(
            time,
            acceleration.z,
            shares.left(asked, heading) * shares.over(height, _size(height)),
            height,
        )

    height = lever.derivative(0)
    rows = [instant(0, base[1], base[2], yaw.derivative(0), height)]
    levers = coming_levers(vehicle, [sample for _, sample in ahead]) if ahead else []
    for (time, sample), other in zip(ahead, levers, strict=True):
        velocity, acceleration = (
            Vec3(*(each[k] for each in sample[:3])) for k in (1, 2)
        )
        rows.append(instant(time, velocity, acceleration, sample[3][0], other))
    now = Vec3(shift.place.x, shift.place.y, 0)
    still = gravity - push.z
    floor, sinks = WEAK * gravity, shift.sinking
    up = Taylor(
        (
            base[2].z + still + sinks[0],
            base[3].z - rate.z + sinks[1],
            0.5 * (base[4].z + sinks[2]),
        )
    )
    # in free fall no tilt gives a force to the side, so the thrust is bounded from
    # below
    up = choose(up > floor, up, floor)
    size = choose(lever > 0.0, lever, -lever)
    size = choose(size > LEAST, size, LEAST)
    line = bounded_sweep(
        rows,
        _thrusts(rows, still, floor, _later(shift, rows, dt) if ahead else FIRST_SHIFT),
    )
    b, per = line[0].b, 1.0 / size
    per0 = per.derivative(0)
    asked = (
        push - base[1] * slow - base[2],
        rate - base[2] * slow - base[3],
        -(base[3] * slow + base[4]),
    )
    series = vector_series(asked) * (per if shares.length else lever * per)
    left = shares.left(series, yaw.truncate(2))
    force = [derivative(left, k) for k in range(3)]
    velocity = line[0].v - now * b
    # one instant alone has no change of the force to sweep over: its rate now stands
    # for it
    if not ahead:
        velocity = velocity - force[1] * divide(1.0, b * b)
    steep = _secant(now, per0) * up.derivative(0) * per0
    second = now * steep + force[0]
    turned = vector_series((now, velocity, second))
    k0, k1, k2 = ((up * per * _secant(turned, per)).derivative(k) for k in range(3))
    third = now * k1 + velocity * k0 + force[1]
    fourth = now * k2 + velocity * (2.0 * k1) + second * k0 + force[2]
    going = now + velocity * dt + second * (0.5 * dt * dt)
    lowered = -height * per0 * per0 * _secant(now, per0)
    # half the square of the shift, first to fourth derivative
    squares = (
        now.dot(velocity),
        velocity.dot(velocity) + now.dot(second),
        3.0 * velocity.dot(second) + now.dot(third),
        3.0 * second.dot(second) + 4.0 * velocity.dot(third) + now.dot(fourth),
    )
    moved = [
        Vec3(y.x, y.y, lowered * z)
        for y, z in zip((velocity, second, third, fourth), squares, strict=True)
    ]
    coming, secants = (
        coming_thrusts(rows, line, now) if ahead else (shift.coming, shift.secants)
    )
    after = Shift(
        place=as_data(going),
        sinking=tuple(data(each.z) for each in moved[1:]),
        secants=secants,
        coming=coming,
        first=rows[1].time if ahead else shift.first,
    )
    return moved, after


def _later(shift: Shift, rows: Sequence[PreviewInstant], dt: Scalar) -> Shift:
    """State of the base's offset, its values along the preview interpolated at the
    times of this control period.
    """
    late = rows[1].time - shift.first + dt
    shares = [divide(late, then.time - now.time) for now, then in pairwise(rows[1:])]
    now, *secants = shift.secants
    return replace(
        shift,
        secants=(now, *_towards_next(secants, shares)),
        coming=tuple(_towards_next(shift.coming, shares)),
    )


def _towards_next(values: Sequence[Scalar], shares: Sequence[Scalar]) -> list[Scalar]:
    moved = [
        a + (b - a) * share
        for a, b, share in zip(values, values[1:], shares, strict=False)
    ]
    return [*moved, values[-1]]


def _thrusts(
    rows: Sequence[PreviewInstant], still: Scalar, floor: Scalar, shift: Shift
) -> list[Scalar]:
    """Mean thrust per mass (m/s^2) between preview instants, and at the last one;
    ``still``: value in hover.

    ``floor`` is the least that a thrust along the vertical counts as, m/s^2.
    """
    rises = [
        0.5 * (now.rise + then.rise) + sink
        for now, then, sink in zip(rows, rows[1:], shift.coming, strict=False)
    ]
    ups = [maximum(still + rise, floor) for rise in (*rises, rows[-1].rise)]
    secants = [
        *(
            0.5 * (a + b)
            for a, b in zip(shift.secants, shift.secants[1:], strict=False)
        ),
        shift.secants[-1],
    ]
    return [up * secant for up, secant in zip(ups, secants, strict=False)]
