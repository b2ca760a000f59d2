"""Control allocation: body torque and thrust to squared rotor speeds, with priorities
at the rotors' limits.

Rotors that span all six directions of a wrench may give a force across body z besides.

Yaw torque next to roll and pitch: rotor i requires 0 <= t_i + p_i f + y_i u <= top_i
with t_i the squared speed that roll and pitch take, f the thrust, u the yaw torque.
Each is a lower and an upper bound of u, linear in f; u also stays between nothing and
its demand, or goes ``slack`` beyond. Where every lower bound is below every upper one a
yaw torque exists (Fourier-Motzkin elimination): an interval of f. It is never empty if
the thrust alone can make room for roll and pitch, because then u = 0 will do.

Source: Furrer et al. 2016 (RotorS), eq. (97)-(103) of the paper; the pseudo-inverse for
any number of rotors.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

from skyarm.algebra import ZERO3, Scalar, Scalars, Vec3, inner_product, ldl_solve, sums
from skyarm.algebra.scalars import (
    absolute,
    add,
    divide,
    logical_and,
    maximum,
    minimum,
    mul,
    sqrt,
    sub,
    where,
)
from skyarm.dynamics.actuators.rotor import push
from skyarm.records.coerce import concrete
from skyarm.records.immutable import immutable, positional
from skyarm.records.units import Unit
from skyarm.vehicle import Vehicle

SMALL = 1e-9
"""Least squared speed per N m of yaw in the bounds, relative to the largest, and least
difference of two slopes."""

ENDLESS = 1e100
"""Thrust (N) larger than any bound."""


@positional
class Bound:
    """Two parallel linear bounds of the yaw torque as a function of the thrust, N m."""

    low: Scalar
    high: Scalar
    slope: Scalar


def yaw_bounds(
    taken: Sequence[Scalar],
    per_newton: Sequence[Scalar],
    per_turn: Sequence[Scalar],
    highest: Sequence[Scalar],
    yaw: Scalar,
    slack: Scalar,
) -> list[Bound]:
    """Linear bounds of the yaw torque from the demanded torque and from the limits of
    each rotor.

    Args:
        taken: squared speeds for roll and pitch, (rad/s)^2.
        per_newton: squared speed of each rotor per N of thrust.
        per_turn: squared speed of each rotor per N m of yaw torque.
        highest: largest squared speeds.
        yaw: demanded yaw torque, N m.
        slack: N m, by which it may be missed beyond nothing.
    """
    largest: Scalar = 0.0
    for each in per_turn:
        largest = maximum(largest, absolute(each))
    least = mul(SMALL, largest)
    bounds = [Bound(minimum(0.0, sub(yaw, slack)), maximum(0.0, add(yaw, slack)), 0.0)]
    for value, slope, turning, top in zip(
        taken, per_newton, per_turn, highest, strict=True
    ):
        # a rotor without a share in yaw bounds nothing: its bounds are very wide
        by = where(absolute(turning) > least, turning, least)
        a, b = divide(0.0 - value, by), divide(top - value, by)
        # division by a negative slope exchanges lower and upper bound
        rising = by > 0.0
        bounds.append(
            Bound(where(rising, a, b), where(rising, b, a), 0.0 - divide(slope, by))
        )
    return bounds


def nearest_thrust(bounds: Sequence[Bound], thrust: Scalar) -> Scalar:
    """Thrust (N) nearest to the demanded one for which some yaw torque lies within all
    bounds.
    """
    low: Scalar = -ENDLESS
    high: Scalar = ENDLESS
    for i, under in enumerate(bounds):
        for j, over in enumerate(bounds):
            if i == j:
                continue
            # under.low + under.slope f <= over.high + over.slope f
            steeper, room = sub(under.slope, over.slope), sub(over.high, under.low)
            # alike but for rounding: the edge of parallel bounds would be any thrust
            alike = mul(SMALL, absolute(under.slope))
            edge = divide(room, where(absolute(steeper) > alike, steeper, 1.0))
            high = minimum(high, where(steeper > alike, edge, high))
            low = maximum(low, where(steeper < 0.0 - alike, edge, low))
    return minimum(maximum(thrust, low), high)


def nearest_yaw(bounds: Sequence[Bound], thrust: Scalar, yaw: Scalar) -> Scalar:
    """Yaw torque (N m) nearest to the demanded one within all bounds at a given
    thrust.
    """
    # all bounds hold at one yaw torque at least, so that their order does not matter
    for each in bounds:
        moved = mul(each.slope, thrust)
        yaw = minimum(maximum(yaw, add(each.low, moved)), add(each.high, moved))
    return yaw


POLICIES = ("clip", "priority", "thrust_before_yaw")

LARGEST = 1e100
"""Thrust (N) or torque (N m) per squared speed ((rad/s)^2) beyond which the squares of
their sums overflow."""


AXES = (
    "roll torque",
    "pitch torque",
    "yaw torque",
    "thrust",
    "force along x",
    "force along y",
)
"""Names of the rows of an allocation matrix."""


class AllocationError(ValueError):
    """Error: the rotors cannot produce independent torques and thrust."""


@immutable
class Mixer:
    """Control allocation: matrix from body torque and thrust to squared rotor speeds,
    and policy at the rotors' limits.

    Attributes:
        inverse: one row of four per rotor, (rad/s)^2 per N m or N.
        highest: largest squared speed of each rotor, (rad/s)^2.
        policy: "clip" takes sqrt(max(0, w^2)) as RotorS does (the motor limits the
            speed later); "priority" keeps roll and pitch torque, then thrust, then yaw
            within the rotors' limits, where thrust makes room for roll and pitch; with
            "thrust_before_yaw" yaw torque does so first (:func:`yaw_bounds`).
        yaw_slack: N m, by which "thrust_before_yaw" may turn beyond no yaw torque, or
            beyond the demanded one, to keep the thrust.
        across: one row of two per rotor for the force along body x and y, (rad/s)^2 per
            N; empty where rotors are not asked for one. ``inverse`` then gives none.
    """

    inverse: Annotated[
        tuple[Scalars, ...],
        Unit(
            "(rad/s)^2 per N m or N",
            "squared rotor speeds per torque about x, y, z and thrust, a row for each"
            " rotor; by the rotors",
        ),
    ]
    highest: Annotated[
        Scalars,
        Unit(
            "(rad/s)^2",
            "largest squared speed of each rotor",
            infinite=True,
            bound=True,
        ),
    ]
    policy: str = "clip"
    yaw_slack: Annotated[
        Scalar, Unit("N m", "yaw torque that may be given up to keep the thrust")
    ] = 0.0
    across: Annotated[
        tuple[Scalars, ...],
        Unit(
            "(rad/s)^2 per N",
            "squared rotor speeds per force along body x and y, a row for each rotor;"
            " by the rotors",
        ),
    ] = ()


def allocation_matrix(vehicle: Vehicle, sideways: bool = False) -> list[list[Scalar]]:
    """Matrix from squared rotor speeds to body torque and thrust; with ``sideways`` to
    the whole wrench.

    ``sideways`` adds the rows of force along body x and y.
    """
    columns = []
    for rotor in vehicle.rotors:
        force = rotor.axis * rotor.thrust_coefficient
        # the drag of a rotor turns the body against its direction
        drag = rotor.axis * mul(
            mul(-rotor.direction, rotor.moment_coefficient), rotor.thrust_coefficient
        )
        columns.append(
            (
                *(rotor.position.cross(force) + drag),
                force.z,
                *((force.x, force.y) if sideways else ()),
            )
        )
    return [[column[row] for column in columns] for row in range(6 if sideways else 4)]


def make_mixer(
    vehicle: Vehicle,
    policy: str = "clip",
    sideways: bool = False,
    yaw_slack: Scalar = 0.0,
) -> Mixer:
    """Make the control allocation from the Moore-Penrose inverse of the allocation
    matrix.

    Args:
        vehicle: model of the law; its rotors are allocated.
        policy: at the rotors' limits: "clip", "priority" or "thrust_before_yaw"
            (:class:`Mixer`).
        sideways: True if the rotors also give a force across body z.
        yaw_slack: yaw torque that "thrust_before_yaw" may give up to keep the thrust, N
            m.

    Raises:
        AllocationError: unknown policy, the rotors do not span torque and thrust (rank
            below 4; for ``sideways`` below 6), or, for "priority", a rotor has no share
            in the thrust.
    """
    if policy not in POLICIES:
        raise AllocationError(
            f"mixer policy = {policy!r}: must be one of {list(POLICIES)}"
        )
    # A^T (A A^T)^-1, since A has independent rows and the Gram matrix is small
    A = allocation_matrix(vehicle, sideways)
    _require_rank(vehicle, A)
    gram = [[inner_product(a, b) for b in A] for a in A]
    size = len(A)
    inverse_gram = [
        ldl_solve(gram, [1 if i == j else 0 for i in range(size)]) for j in range(size)
    ]
    rows = tuple(
        tuple(
            inner_product([A[k][rotor] for k in range(size)], inverse_gram[j])
            for j in range(size)
        )
        for rotor in range(len(vehicle.rotors))
    )
    if policy != "clip":
        _require_thrust_shares(vehicle, [row[3] for row in rows])
    highest = tuple(push(rotor, rotor.max_speed) for rotor in vehicle.rotors)
    across = tuple(row[4:] for row in rows) if sideways else ()
    inverse = tuple(row[:4] for row in rows)
    return Mixer(
        inverse=inverse,
        highest=highest,
        policy=policy,
        yaw_slack=yaw_slack,
        across=across,
    )


def _require_rank(vehicle: Vehicle, A: list[list[Scalar]]) -> None:
    """Refuse rotors that cannot give independent torques about three axes and thrust,
    or a full wrench.
    """
    if not concrete(*(entry for row in A for entry in row)):
        return
    import numpy as np

    # reshaped, because without rotors the rows are empty
    matrix = np.array(A, dtype=float).reshape(len(A), len(vehicle.rotors))
    for rotor, column in zip(
        vehicle.rotors, np.abs(matrix).max(axis=0, initial=0.0), strict=True
    ):
        # written so that NaN is refused, too
        if not column < LARGEST:
            raise AllocationError(
                f"vehicle '{vehicle.name}': rotors[{rotor.name}] gives {column:.3g} N"
                f" or N m per (rad/s)^2: must be below {LARGEST:g}; check its"
                " thrust_coefficient and position"
            )
    # rows are scaled to unit length, because torque and thrust have different units
    lengths = np.linalg.norm(matrix, axis=1, keepdims=True)
    scaled = matrix / np.where(lengths > 0.0, lengths, 1.0)
    # 1e-6: far above rounding, far below the share of any real rotor
    rank = int(np.linalg.matrix_rank(scaled, tol=1e-6))
    if rank < len(A):
        # an axis is lost where the others' rows span its own
        lost = [
            AXES[i]
            for i in range(len(A))
            if np.linalg.matrix_rank(np.delete(scaled, i, axis=0), tol=1e-6) == rank
        ]
        raise AllocationError(
            f"vehicle '{vehicle.name}': allocation of {len(vehicle.rotors)} rotors has"
            f" rank {rank}: must be {len(A)}; no {', '.join(lost or AXES[: len(A)])} of"
            " its own; check rotor positions, axes and directions: skyarm check names"
            " rotors whose other direction would do"
        )


def _require_thrust_shares(vehicle: Vehicle, per_newton: Sequence[Scalar]) -> None:
    """Refuse prioritised control allocation if the allocated speed of some rotor does
    not increase with thrust.
    """
    if not concrete(*per_newton):
        return
    for rotor, value in zip(vehicle.rotors, per_newton, strict=True):
        # priorities divide by these shares, so rounding is no share
        if value <= 1e-6 * max(per_newton):
            raise AllocationError(
                f"vehicle '{vehicle.name}': rotors[{rotor.name}] takes {value:.3g}"
                " (rad/s)^2 per N of thrust: must be positive for a mixer policy with"
                " priorities; use 'clip' or change the rotor's axis"
            )


def mix(
    mixer: Mixer, torque: Vec3, thrust: Scalar, across: Vec3 = ZERO3
) -> tuple[Scalars, Scalars]:
    """Rotor speeds (rad/s) for a body torque (N m), a thrust (N) and a sideways force
    (N).

    A policy with priorities gives of the force across body z the largest share that
    torque and thrust leave room for.

    Args:
        mixer: control allocation of :func:`make_mixer`.
        torque: body torque, N m, body axes.
        thrust: thrust along body z, N.
        across: force across body z, N, body axes.

    Returns:
        The commanded speeds and the squared speeds of torque and thrust before any
        limit.
    """
    raw = tuple(inner_product(row, [*torque, thrust]) for row in mixer.inverse)
    allowed = _prioritize(mixer, torque, thrust) if mixer.policy != "clip" else raw
    if mixer.across:
        side = [inner_product(row, [across.x, across.y]) for row in mixer.across]
        allowed = _with_side(mixer, raw, allowed, side)
    # below 0 without priorities, or by rounding: a rotor cannot give it and stops
    return tuple(sqrt(maximum(value, 0.0)) for value in allowed), raw


def _prioritize(mixer: Mixer, torque: Vec3, thrust: Scalar) -> Scalars:
    """Squared rotor speeds within their limits: roll and pitch torque first, then
    thrust, yaw torque last.

    1. Roll and pitch are scaled down together if no thrust at all leaves room for
    them. 2. Thrust moves just enough to leave that room. 3. Yaw takes the largest share
    of what remains.
    """
    per_newton = [row[3] for row in mixer.inverse]
    per_turn = [row[2] for row in mixer.inverse]
    tilt = [add(mul(row[0], torque.x), mul(row[1], torque.y)) for row in mixer.inverse]
    share = _tilt_share(tilt, per_newton, mixer.highest)
    # one share for roll and pitch keeps the axis of their torque
    tilt = [mul(each, share) for each in tilt]

    def with_thrust(force: Scalar) -> list[Scalar]:
        return [
            add(mul(each, force), turn)
            for each, turn in zip(per_newton, tilt, strict=True)
        ]

    if mixer.policy == "thrust_before_yaw":
        room = yaw_bounds(
            tilt, per_newton, per_turn, mixer.highest, torque.z, mixer.yaw_slack
        )
        nearest = nearest_thrust(room, thrust)
        turn = nearest_yaw(room, nearest, torque.z)
        fixed = with_thrust(nearest)
        yaw = [mul(each, turn) for each in per_turn]
    else:
        low, high = _thrust_range(tilt, per_newton, mixer.highest)
        fixed = with_thrust(minimum(maximum(thrust, low), high))
        yaw = [mul(each, torque.z) for each in per_turn]
        yaw_share = _largest_share(fixed, yaw, mixer.highest)
        yaw = [mul(each, yaw_share) for each in yaw]
    # clipped again, because shares and sums are rounded
    rows = zip(fixed, yaw, mixer.highest, strict=True)
    return tuple(minimum(maximum(add(a, b), 0.0), top) for a, b, top in rows)


def _tilt_share(
    tilt: Sequence[Scalar], per_newton: Sequence[Scalar], highest: Sequence[Scalar]
) -> Scalar:
    """Largest share (0 to 1) of the roll and pitch torque for which some thrust is
    within all rotors' limits.

    Rotor i requires thrust >= -s d_i and rotor j for thrust <= e_j - s d_j, with d =
    tilt / per_newton and e = highest / per_newton: every j must agree with the least
    d_i (Fourier-Motzkin elimination of the thrust).
    """
    d = [divide(value, slope) for value, slope in zip(tilt, per_newton, strict=True)]
    e = [divide(top, slope) for top, slope in zip(highest, per_newton, strict=True)]
    share: Scalar = 1.0
    least = d[0]
    for each in d[1:]:
        least = minimum(least, each)
    for each, top in zip(d, e, strict=True):
        # the rotor with the least d bounds the thrust from below
        spread = sub(each, least)
        share = minimum(share, where(spread > 0.0, divide(top, spread), share))
    return share


def _thrust_range(
    tilt: Sequence[Scalar], per_newton: Sequence[Scalar], highest: Sequence[Scalar]
) -> tuple[Scalar, Scalar]:
    """Smallest and largest thrust (N) at which given roll and pitch torques stay within
    all rotors' limits.
    """
    rows = zip(tilt, per_newton, highest, strict=True)
    ranges = (
        (divide(0.0 - value, slope), divide(top - value, slope))
        for value, slope, top in rows
    )
    low, high = next(ranges)
    for at_zero, at_top in ranges:
        low, high = maximum(low, at_zero), minimum(high, at_top)
    return low, high


def _largest_share(
    fixed: Sequence[Scalar], changes: Sequence[Scalar], highest: Sequence[Scalar]
) -> Scalar:
    """Largest share of a change of the squared rotor speeds that stays within their
    limits, 0 to 1.
    """
    share: Scalar = 1.0
    for value, change, top in zip(fixed, changes, highest, strict=True):
        # an unchanged rotor divides by 0: where() drops that quotient
        up, down = divide(top - value, change), divide(0.0 - value, change)
        limit = where(change > 0.0, up, where(change < 0.0, down, share))
        share = minimum(share, maximum(limit, 0.0))
    return share


def _with_side(
    mixer: Mixer,
    raw: Sequence[Scalar],
    allowed: Sequence[Scalar],
    side: Sequence[Scalar],
) -> Scalars:
    """Squared rotor speeds with the largest share of a sideways force that fits the
    rotors' limits.

    It may be what brings torque and thrust (``raw``) within the limits; where no share
    of it does, it takes what room is left beside what the limits leave of them
    (``allowed``).
    """
    if mixer.policy == "clip":
        return sums(raw, side)
    low: Scalar = 0.0
    high: Scalar = 1.0
    for value, change, top in zip(raw, side, mixer.highest, strict=True):
        to_zero, to_top = divide(0.0 - value, change), divide(top - value, change)
        inside = logical_and(value >= 0.0, value <= top)
        low = maximum(
            low,
            where(
                change > 0.0,
                to_zero,
                # 2 is beyond every share: a rotor that no share can bring inside
                where(change < 0.0, to_top, where(inside, 0.0, 2.0)),
            ),
        )
        high = minimum(
            high, where(change > 0.0, to_top, where(change < 0.0, to_zero, 1.0))
        )
    left = _largest_share(allowed, side, mixer.highest)
    fits = low <= high
    rows = zip(raw, allowed, side, mixer.highest, strict=True)
    return tuple(
        minimum(
            where(fits, add(value, mul(high, change)), add(limited, mul(left, change))),
            top,
        )
        for value, limited, change, top in rows
    )
