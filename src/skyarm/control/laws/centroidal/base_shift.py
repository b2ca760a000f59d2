"""Shift of the base that keeps the tip in place along a previewed motion: bounded inverse of the tilted vehicle.

With y the sideways shift of the common centre of mass, a the reference's acceleration, d the steady force per mass, n
the specific thrust and l the height of the centre of mass above the tip, the attitude answers a + y'' - d and the tip
stays where y = (l / n) (a + y'' - d):

    y'' = (n / l) y + d - a.

One solution stays bounded. It obeys y' = -b y + v, where b and v follow backwards from the end of the preview, as
if d - a went on evenly there: b' = b^2 - n / l, v' = b v + d - a. From one instant to the one before it that is exact
for a mean n / l and an even change of d - a. The law integrates y; its higher derivatives come from the equation.

Joints that turn links back as the base tilts about their axis leave the lever of what they do not carry.
An arm above the base has l < 0 and zero dynamics that swing: there y'' = (n / |l|) y - (d - a), which agrees with the
solution for slow motions and passes the resonance.

Sources: Devasia, Chen, Paden 1996 (bounded inverse of a system whose zero dynamics are unstable); Zou, Devasia 1999
(the same from a finite preview); Bryson, Ho 1975, 7 (sweep of a linear boundary value problem).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Annotated, Any

from skyarm.algebra import ZERO3, ZERO3_DATA, Vec3
from skyarm.algebra.scalars import Scalar, absolute, cos, data, divide, maximum, minimum, sin, sqrt, total, where
from skyarm.algebra.scalars.taylor import Taylor, choose, inverse_root
from skyarm.control.blocks.attitude import Posture, derivative, near_angles, posture
from skyarm.control.blocks.select import vector_data
from skyarm.control.laws.centroidal.parameters import SHARES, CentroidalParameters
from skyarm.dynamics.kinematics import chain
from skyarm.records.immutable import immutable
from skyarm.records.units import Unit
from skyarm.reference.preview import Sample
from skyarm.vehicle.vehicle_records import Vehicle

LEAST = 0.02
"""Height (m) of a lever below which the shift falls in proportion to it, with the pace of this height."""

HELD = 0.02
"""Regularisation of the squared rotations by which joints take a tilt back."""

WEAK = 0.15
"""Lower bound of the specific thrust, as a share of gravity."""

STEEP = 0.75
"""Upper bound of the squared sine of a tilt, that of 60 degrees."""

TERMS = 4, 6
"""Terms of the series of sines for the first two preview samples, exact up to 1 and 3 rad from now (``NearAngle``)."""

TINY = 1e-9

Pair = tuple[Scalar, Scalar]
"""Components along the two horizontal principal directions of the arm."""


@immutable
class Shift:
    """Shift of the centre of mass, and its vertical acceleration as it was found one period before.

    Attributes:
        coming: mean vertical acceleration from each instant of the preview to the next, m/s^2.
    """

    place: Annotated[Vec3, Unit("m", "world axes, horizontal")]
    sinking: Annotated[tuple[Scalar, ...], Unit("", "vertical acceleration with two derivatives, SI")]
    secants: Annotated[tuple[Scalar, ...], Unit("", "thrust over its vertical part, at each instant of the preview")]
    coming: Annotated[tuple[Scalar, ...], Unit("m/s^2", "vertical acceleration from instant to instant of the preview")]
    first: Annotated[Scalar, Unit("s", "from then to the first instant of the preview")]


FIRST_SHIFT = Shift(
    place=ZERO3_DATA,
    sinking=(0.0,) * 3,
    secants=(1.0,) * (len(SHARES) + 1),
    coming=(0.0,) * len(SHARES),
    first=0.0,
)
"""Shift of a vehicle at rest."""


@immutable
class Acting:
    """Forces on the vehicle beside those of rotors and weight, world axes.

    Attributes:
        force: steady, N. rate: of it as it is foretold, N/s. drift: the rate that was not foretold, N/s.
        drag: of the rotors, N s/m.
    """

    force: Vec3
    rate: Vec3
    drift: Vec3
    drag: Scalar


@immutable(kw_only=False)
class Instant:
    """Reference at one instant of the preview.

    Attributes:
        time: from now, s. rise: vertical acceleration, m/s^2. asked: d - a along both directions, m/s^2.
        lever: height of the centre of mass above the tip, m.
    """

    time: Scalar
    rise: Scalar
    asked: Pair
    lever: Scalar


@immutable(kw_only=False)
class Directions:
    """Horizontal unit vector (world axes) along the arm's most turned axis, and levers of tilts that joints leave.

    Of a tilt that moves the centre of mass along that vector, and of one across it: a height h of the centre of mass
    above the tip has the lever ``left`` h + ``rest`` (m).
    """

    x: Scalar
    y: Scalar
    left: Pair
    rest: Pair

    def pair(self, v: Vec3) -> Pair:
        """Components of a vector along the two horizontal directions in which the arm differs."""
        return v.x * self.x + v.y * self.y, v.y * self.x - v.x * self.y

    def vector(self, pair: Pair, z: Scalar = 0) -> Vec3:
        """Vector (world axes) from its components along the two horizontal directions in which the arm differs."""
        a, b = pair
        return Vec3(a * self.x - b * self.y, a * self.y + b * self.x, z)


def directions(vehicle: Vehicle, level: Posture, yaw: Scalar) -> Directions:
    """Directions in which the arm differs: principal axes of the horizontal parts of the tip's joint axes."""
    carriers = [chain(vehicle, i) for i in range(vehicle.n)]
    axes = [_turning_axis(vehicle, level, i) for i in range(vehicle.n)]
    found = chain(vehicle, vehicle.frame().link)
    xx, xy, yy = _moments(axes[i] for i in found if i < vehicle.n)
    off, twice = xx - yy, 2.0 * xy
    size = sqrt(off * off + twice * twice + TINY)
    # the column of the projector on the first axis that is not near zero
    along = off > 0.0
    a, b = where(along, size + off, twice), where(along, twice, size - off)
    per = 1.0 / sqrt(a * a + b * b)
    a, b = a * per, b * per
    c, s = cos(yaw), sin(yaw)

    def left(joints: Sequence[int]) -> Pair:
        xx, xy, yy = _moments(axes[i] for i in joints)
        most = a * a * xx + 2.0 * a * b * xy + b * b * yy
        # a turn about the first axis moves the centre of mass across it
        return divide(HELD, maximum(xx + yy - most, 0.0) + HELD), divide(HELD, most + HELD)

    rest: list[Scalar] = [0.0, 0.0]
    for i, joints in enumerate(carriers):
        if not vehicle.links[i].joint.turns:
            continue
        height = (
            _others_height(vehicle, level, i, carriers) if i in found else -_branch_height(vehicle, level, i, carriers)
        )
        for k, (before, after) in enumerate(zip(left(joints[:-1]), left(joints), strict=True)):
            rest[k] = rest[k] + (before - after) * height
    return Directions(a * c - b * s, a * s + b * c, left(found), (rest[0], rest[1]))


def _turning_axis(vehicle: Vehicle, level: Posture, i: int) -> Vec3:
    """Axis about which a joint turns, base axes; zero of a sliding one."""
    joint = vehicle.links[i].joint
    return Vec3(*(derivative(row, 0).dot(joint.axis) for row in level.links[i].R.rows)) if joint.turns else ZERO3


def _moments(axes: Iterable[Vec3]) -> tuple[Scalar, Scalar, Scalar]:
    """Sums of x^2, x y and y^2 of vectors."""
    xx: Scalar = 0.0
    xy: Scalar = 0.0
    yy: Scalar = 0.0
    for axis in axes:
        xx, xy, yy = xx + axis.x * axis.x, xy + axis.x * axis.y, yy + axis.y * axis.y
    return xx, xy, yy


def _height(vehicle: Vehicle, level: Posture, links: Iterable[int], above: Scalar) -> Scalar:
    """Sum of the links' heights above a height, weighted by their share of the vehicle's mass, m."""
    total: Scalar = 0.0
    for i in links:
        body, pose = vehicle.links[i].body, level.links[i]
        place = derivative(pose.p, 0).z + derivative(pose.R.rows[2], 0).dot(body.com)
        total = total + divide(body.mass, vehicle.mass) * (place - above)
    return total


def _branch_height(vehicle: Vehicle, level: Posture, i: int, carriers: Sequence[Sequence[int]]) -> Scalar:
    """Weighted height above a joint of the links that it carries, m."""
    links = (k for k, joints in enumerate(carriers) if i in joints)
    return _height(vehicle, level, links, derivative(level.links[i].p, 0).z)


def _others_height(vehicle: Vehicle, level: Posture, i: int, carriers: Sequence[Sequence[int]]) -> Scalar:
    """Weighted height above a joint of base and links that it does not carry, m."""
    above, base = derivative(level.links[i].p, 0).z, vehicle.base
    links = (k for k, joints in enumerate(carriers) if i not in joints)
    return divide(base.mass, vehicle.mass) * (base.com.z - above) + _height(vehicle, level, links, above)


def lever_of(vehicle: Vehicle, joints: Sequence[Scalar]) -> Scalar:
    """Height of a level vehicle's centre of mass above its tip, m."""
    at = posture(vehicle, [Taylor.constant(q, 0) for q in joints], 0)
    return derivative(at.com, 0).z - derivative(at.tip, 0).z


def coming_levers(vehicle: Vehicle, joints: Sequence[Scalar], samples: Sequence[Sequence[Sample]]) -> list[Scalar]:
    """Levers (m) at the samples to come: of the third the mean of its neighbours', of the last that of the one before.

    A posture costs as much as the rest of the work for a sample, and those two count less than the others. The first
    two are near the present references of the ``joints``.
    """
    first, second, _, fourth, _ = ([q for q, _, _ in sample[4:]] for sample in samples)
    pairs = zip((first, second), TERMS, strict=True)
    near = (lever_of(vehicle, near_angles(vehicle, joints, each, terms)) for each, terms in pairs)
    one, two, four = (*near, lever_of(vehicle, fourth))
    return [one, two, 0.5 * (two + four), four, four]


@immutable(kw_only=False)
class Stretch:
    """Solution between two instants of the preview: y' = -b y + v at the first one, and the motion to the second one.

    Attributes:
        b: 1/s. v: m/s. time: from the first to the second one, s.
        cosh, sinh: of y and y' (s) at the first one, in y at the second one. forced: m, of it by d - a.
    """

    b: Scalar
    v: Pair
    time: Scalar = 0
    cosh: Scalar = 0
    sinh: Scalar = 0
    forced: Pair = (0, 0)


def bounded_sweep(rows: Sequence[Instant], gains: Sequence[Pair], thrusts: Sequence[Scalar]) -> list[Stretch]:
    """Bounded solution at each instant of the preview, from its end backwards.

    Args:
        rows: reference from now on.
        gains: at each instant, of d - a in both directions.
        thrusts: mean specific thrust from each instant to the next, and at the last one, m/s^2.
    """
    sizes = [_size(row.lever) for row in rows]
    force = [[g * each for g, each in zip(gain, row.asked, strict=True)] for gain, row in zip(gains, rows, strict=True)]
    b = sqrt(divide(thrusts[-1], sizes[-1]))
    per = divide(-1.0, b)
    v = [per * each for each in force[-1]]
    if len(rows) > 1:
        # as if the force went on as it has changed last
        last = divide(per, b * (rows[-1].time - rows[-2].time))
        v = [each + (then - now) * last for each, now, then in zip(v, force[-2], force[-1], strict=True)]
    found = [Stretch(b, (v[0], v[1]))]
    for i in range(len(rows) - 2, -1, -1):
        now, then = rows[i], rows[i + 1]
        h = then.time - now.time
        pace = divide(2.0 * thrusts[i], sizes[i] + sizes[i + 1])
        z = pace * (h * h)
        cosh = 1.0 + z * (0.5 + z * (1.0 / 24.0 + z / 720.0))
        sinh = h * (1.0 + z * (1.0 / 6.0 + z * (1.0 / 120.0 + z / 5040.0)))
        left = divide(1.0, cosh + b * sinh)
        # of the mean and of the change of the force over the interval, in the place at its end
        mean, change = h * h * (0.5 + z * (1.0 / 24.0 + z / 720.0)), h * h * (1.0 / 12.0 + z / 80.0)
        forced = []
        for k in (0, 1):
            asked = 0.5 * (force[i][k] + force[i + 1][k])
            turn = force[i + 1][k] - force[i][k]
            forced.append(mean * asked - change * turn)
            v[k] = (v[k] - b * forced[k] - sinh * asked + (h / 24.0) * z * turn) * left
        b = (pace * sinh + b * cosh) * left
        found.append(Stretch(b, (v[0], v[1]), h, cosh, sinh, (forced[0], forced[1])))
    return found[::-1]


def coming_thrusts(rows: Sequence[Instant], line: Sequence[Stretch], y: Pair) -> tuple[tuple[Scalar, ...], ...]:
    """Vertical acceleration of the shift from instant to instant (m/s^2), and secants of its tilt at each instant.

    A lever l that is turned by y to the side is less high by about y^2 / 2 l.
    """
    places, rates, secants = list(y), [], []
    for row, here in zip(rows, line, strict=True):
        speeds = [v - here.b * place for v, place in zip(here.v, places, strict=True)]
        per = divide(1.0, _size(row.lever))
        secant = _secant(places, per)
        secants.append(secant)
        rates.append((places[0] * speeds[0] + places[1] * speeds[1]) * (-row.lever * per * per * secant))
        places = [
            here.cosh * place + here.sinh * speed + more
            for place, speed, more in zip(places, speeds, here.forced, strict=True)
        ]
    sinks = tuple(divide(b - a, here.time) for a, b, here in zip(rates, rates[1:], line, strict=False))
    return sinks, tuple(secants)


def _secant(places: Sequence[Any], per: Any) -> Any:
    """Ratio 1 / cos of the tilt of a lever whose end is displaced horizontally, as a share ``per`` of its length."""
    a, b = (place * per for place in places)
    return inverse_root(1.0 - _at_most(a * a + b * b))


def _at_most(square: Any) -> Any:
    return choose(square < STEEP, square, STEEP) if isinstance(square, Taylor) else minimum(square, STEEP)


def _size(height: Scalar) -> Scalar:
    return maximum(absolute(height), LEAST)


def bounded_shift(
    par: CentroidalParameters,
    shift: Shift,
    base: Sequence[Vec3],
    yaw: Scalar,
    level: Posture,
    acting: Acting,
    ahead: Sequence[tuple[Scalar, Sequence[Sample]]],
    dt: Scalar,
    joints: Sequence[Scalar] = (),
) -> tuple[list[Vec3], Vec3, Shift]:
    """Rate to fourth derivative of the centre of mass's shift (m, world axes), and the shift one period later.

    Between them what the drift adds to the acceleration, m/s^2: nobody knew of it, so that the attitude that keeps the
    tip does not have it, and its own derivatives would require more torque than rotors have.

    Args:
        par: of the law.
        shift: now.
        base: its reference, value to fourth derivative.
        yaw: rad.
        level: posture of the references on a level base, fourth-order series.
        acting: forces beside those of rotors and weight.
        ahead: times from now (s) and samples of the reference then.
        dt: s.
        joints: references now; needed with ``ahead``.
    """
    vehicle, gravity = par.model.vehicle, par.model.gravity
    at, per_mass = directions(vehicle, level, yaw), divide(1.0, vehicle.mass)
    push, rate, drift = (each * per_mass for each in (acting.force, acting.rate, acting.drift))
    slow = acting.drag * per_mass
    lever = Taylor.of_derivatives([derivative(level.com, k).z - derivative(level.tip, k).z for k in range(3)])

    def instant(time: Scalar, velocity: Vec3, acceleration: Vec3, height: Scalar) -> Instant:
        return Instant(time, acceleration.z, at.pair(push + rate * time - velocity * slow - acceleration), height)

    height = lever.derivative(0)
    rows = [instant(0, base[1], base[2], height)]
    levers = coming_levers(vehicle, joints, [sample for _, sample in ahead]) if ahead else []
    for (time, sample), other in zip(ahead, levers, strict=True):
        velocity, acceleration = (Vec3(*(each[k] for each in sample[:3])) for k in (1, 2))
        rows.append(instant(time, velocity, acceleration, other))
    now, still = at.pair(shift.place), gravity - push.z
    asked_next, asked_after = at.pair(rate - base[2] * slow - base[3]), at.pair((base[3] * slow + base[4]) * -0.5)
    off = [Taylor(each) for each in zip(rows[0].asked, asked_next, asked_after, strict=True)]
    floor = WEAK * gravity
    sinks = shift.sinking
    up = Taylor((base[2].z + still + sinks[0], base[3].z - rate.z + sinks[1], 0.5 * (base[4].z + sinks[2])))
    up = choose(up > floor, up, floor)
    size = choose(lever > 0.0, lever, -lever)
    size = choose(size > LEAST, size, LEAST)
    gains = [_gains(at, row.lever) for row in rows]
    line = bounded_sweep(rows, gains, _thrusts(rows, still, floor, _later(shift, rows, dt) if ahead else FIRST_SHIFT))
    b, per = line[0].b, 1.0 / size
    per0 = per.derivative(0)
    level_pace = up.derivative(0) * per0
    factors = [(lever * share + rest) * per for share, rest in zip(at.left, at.rest, strict=True)]
    forces = [[(f * factor).derivative(k) for k in range(3)] for f, factor in zip(off, factors, strict=True)]
    speeds = [
        v - b * y if ahead else v - b * y - divide(f[1], b * b) for y, v, f in zip(now, line[0].v, forces, strict=True)
    ]
    steep = _secant(now, per0) * level_pace
    seconds = [steep * y + f[0] for y, f in zip(now, forces, strict=True)]
    turned = [Taylor.of_derivatives(each) for each in zip(now, speeds, seconds, strict=True)]
    k0, k1, k2 = ((up * per * _secant(turned, per)).derivative(k) for k in range(3))
    found = [
        (first, second, k1 * y + k0 * first + f1, k2 * y + 2.0 * k1 * first + k0 * second + f2)
        for y, first, second, (_, f1, f2) in zip(now, speeds, seconds, forces, strict=True)
    ]
    moved = [at.vector(pair) for pair in zip(*found, strict=True)]
    going = shift.place + moved[0] * dt + moved[1] * (0.5 * dt * dt)
    lowered = -height * per0 * per0 * _secant(now, per0)
    heights = [lowered * each for each in _halved_square((now[0], *found[0]), (now[1], *found[1]))]
    moved = [Vec3(each.x, each.y, z) for each, z in zip(moved, heights, strict=True)]
    coming, secants = coming_thrusts(rows, line, now) if ahead else (shift.coming, shift.secants)
    share = divide(-1.0, b)
    drifts = [gain * each * share for gain, each in zip(gains[0], at.pair(drift), strict=True)]
    sinking = tuple(map(data, heights[1:]))
    first = rows[1].time if ahead else shift.first
    after = Shift(place=vector_data(going), sinking=sinking, secants=secants, coming=coming, first=first)
    return moved, at.vector((drifts[0], drifts[1])), after


def _later(shift: Shift, rows: Sequence[Instant], dt: Scalar) -> Shift:
    """Shift whose numbers along the preview are those of the instants of now, which go on from sample to sample."""
    late = rows[1].time - shift.first + dt
    shares = [divide(late, then.time - now.time) for now, then in pairwise(rows[1:])]
    now, *secants = shift.secants
    return replace(
        shift, secants=(now, *_towards_next(secants, shares)), coming=tuple(_towards_next(shift.coming, shares))
    )


def _towards_next(values: Sequence[Scalar], shares: Sequence[Scalar]) -> list[Scalar]:
    moved = [a + (b - a) * share for a, b, share in zip(values, values[1:], shares, strict=False)]
    return [*moved, values[-1]]


def _halved_square(*rows: Sequence[Scalar]) -> list[Scalar]:
    """First to fourth derivative of half the square of a vector whose rows are value to fourth derivative."""
    each = [(y * v, v * v + y * a, 3.0 * v * a + y * j, 3.0 * a * a + 4.0 * v * j + y * s) for y, v, a, j, s in rows]
    return [total(column) for column in zip(*each, strict=True)]


def _gains(at: Directions, lever: Scalar) -> Pair:
    """Lever of the tilts in each direction, as joints leave it, over the size of a level vehicle's lever."""
    per = divide(1.0, _size(lever))
    a, b = ((lever * share + rest) * per for share, rest in zip(at.left, at.rest, strict=True))
    return a, b


def _thrusts(rows: Sequence[Instant], still: Scalar, floor: Scalar, shift: Shift) -> list[Scalar]:
    """Mean specific thrust from each instant to the next, and at the last one, m/s^2; ``still`` that at rest."""
    rises = [0.5 * (now.rise + then.rise) + sink for now, then, sink in zip(rows, rows[1:], shift.coming, strict=False)]
    ups = [maximum(still + rise, floor) for rise in (*rises, rows[-1].rise)]
    secants = [*(0.5 * (a + b) for a, b in zip(shift.secants, shift.secants[1:], strict=False)), shift.secants[-1]]
    return [up * secant for up, secant in zip(ups, secants, strict=False)]
