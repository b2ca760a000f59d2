"""Time scaling of a reference: path time as a function of flight time; position offsets
of the reference.

A governor slows the *path parameter* s(t), with 0 <= ds/dt, and leaves the path as it
is. The reference that a law receives at flight time t is the commanded one at s(t);
its derivatives follow by the chain rule. The curve is one of uniform quintic B-splines:
four continuous derivatives, and a rate within the hull of the steps between control
points, so that points which do not fall make a time that never runs backwards.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated, Any

import numpy as np

from skyarm.algebra import Scalar, Scalars, Vec3
from skyarm.algebra.scalars import add, mul, where
from skyarm.algebra.scalars.taylor import Taylor
from skyarm.records.arrays import doubles
from skyarm.records.field_rules import accept_fields
from skyarm.records.immutable import immutable
from skyarm.records.units import Unit, positive
from skyarm.reference.signals import Derivatives
from skyarm.reference.splines import CARDINAL, ORDERS, minimum_snap, polynomial
from skyarm.reference.trajectory import JOINTS, VECTORS, Reference, Trajectory

PLANNED = (
    "must stay as it is where the reference has a governor, which has planned for it"
)
"""Text for messages about a number of a reference whose time law is planned."""

FEWEST = 6
"""Number of control points of one quintic polynomial."""


@immutable
class PathTime:
    """Time scaling of a reference: path time as a spline of flight time.

    Attributes:
        points: control points, s, none before the one ahead of it; the i-th belongs to
            the time (i - 2) step.
        step: time between control points, s.
    """

    points: Annotated[Scalars, Unit("s", "control points of the spline of path time")]
    step: Annotated[Scalar, positive("s", "time between control points")]

    def __post_init__(self) -> None:
        accept_fields(self, "path_time")
        if len(self.points) < FEWEST:
            raise ValueError(
                f"path_time.points: {len(self.points)}, must be at least {FEWEST}"
            )
        if np.any(np.diff(doubles(self.points)) < 0.0):
            raise ValueError(
                "path_time.points: must not fall, the time of a reference never runs"
                " backwards"
            )

    @property
    def duration(self) -> float:
        """Planned duration (s) of the time-scaled reference."""
        return float(self.step) * (len(self.points) - FEWEST + 1)

    def derivatives(self, t: Scalar) -> Derivatives:
        """Path time s and its derivatives up to d4s/dt4 at flight time t (s)."""
        points, step = doubles(self.points), float(self.step)
        # sums and products alone, so that every machine finds the same bits
        # before and after its plan the curve stays at its ends
        u = np.clip(doubles(t) / step, 0.0, float(len(points) - FEWEST + 1))
        piece = np.minimum(u.astype(int), len(points) - FEWEST)
        left = u - piece
        window = [points[piece + i] for i in range(FEWEST)]
        rows = [
            np.asarray(sum(w * p for w, p in zip(row, window, strict=True)) / 120.0)
            for row in CARDINAL
        ]
        return tuple(
            polynomial(rows, left, order) / step**order for order in range(ORDERS)
        )

    def check(self, duration: float, waits: bool) -> None:
        """Refuse a flight that the time scaling was not planned for.

        Args:
            duration: duration of the flight, s.
            waits: True if phases of the reference wait.

        Raises:
            ValueError: one line.
        """
        if waits:
            raise ValueError(
                "reference.governor: must be left out of a reference whose phases wait"
                " (until)"
            )
        # durations are sums of steps, which round
        if self.duration < duration - 1e-9:
            raise ValueError(
                f"reference.governor: was planned for {self.duration:g} s, the flight"
                f" lasts {duration:g} s; plan it anew (skyarm.govern)"
            )

    def instant_of(self, path_time: float) -> float:
        """Flight time (s) at which a given path time is reached; the planned end if it
        never is.
        """
        low, high = 0.0, self.duration
        if float(self.derivatives(high)[0]) < path_time:
            return high
        # 60 halvings bring any flight's length below the last bit of its times
        for _ in range(60):
            middle = 0.5 * (low + high)
            if float(self.derivatives(middle)[0]) < path_time:
                low = middle
            else:
                high = middle
        return high


def governed_reference(
    trajectory: Trajectory, path_time: PathTime, t: Scalar
) -> Reference:
    """Reference of a trajectory at flight time t (s) under a time scaling."""
    s = path_time.derivatives(t)
    return by_flight_time(trajectory.at(s[0]), s)


def by_flight_time(reference: Reference, s: Derivatives) -> Reference:
    """Convert a reference's derivatives by path time into derivatives by flight time.

    Source: chain rule of higher order, Faa di Bruno 1857.
    """
    r = reference
    rows = [
        _chain_rule(d, s)
        for d in zip(r.velocity, r.acceleration, r.jerk, r.snap, strict=True)
    ]
    vectors = [Vec3(*column) for column in zip(*rows, strict=True)]
    yaw_rate, yaw_acceleration, _, _ = _chain_rule(
        (r.yaw_rate, r.yaw_acceleration, 0, 0), s
    )
    joints = zip(
        r.joint_rates, r.joint_accelerations, r.joint_jerks, r.joint_snaps, strict=True
    )
    # without joints there are no rows to turn round
    moved = tuple(zip(*(_chain_rule(d, s) for d in joints), strict=True)) or ((),) * 4
    rates: dict[str, Any] = dict(
        zip((*VECTORS[1:], *JOINTS[1:]), (*vectors, *moved), strict=True)
    )
    return replace(r, **rates, yaw_rate=yaw_rate, yaw_acceleration=yaw_acceleration)


def _chain_rule(
    d: Sequence[Scalar], s: Derivatives
) -> tuple[Scalar, Scalar, Scalar, Scalar]:
    """First four derivatives of x(s(t)) by t, from those of x by s and of s by t."""
    # the formula of Faa di Bruno; twice is the square of the rate
    (d1, d2, d3, d4), (_, s1, s2, s3, s4) = d, s
    twice = s1 * s1
    return (
        mul(d1, s1),
        add(mul(d2, twice), mul(d1, s2)),
        add(add(mul(d3, twice * s1), mul(d2, 3.0 * s1 * s2)), mul(d1, s3)),
        add(
            add(mul(d4, twice * twice), mul(d3, 6.0 * twice * s2)),
            add(mul(d2, 3.0 * s2 * s2 + 4.0 * s1 * s3), mul(d1, s4)),
        ),
    )


def offset_reference(
    reference: Reference,
    offset: Vec3,
    returns: Sequence[tuple[float, float]],
    since: Scalar,
    time: Scalar,
) -> Reference:
    """Reference with base and tip shifted by an offset that decays to zero in return
    phases of the task.

    Args:
        reference: planned reference at ``time`` (s).
        offset: m, world axes.
        returns: beginning and end (s) of the phases in which the reference comes back.
        since: path time (s) at which the offset began; earlier return phases do not
            count.
        time: s, of the reference.
    """
    # factors, not differences: each return takes back what is left by then
    left = Taylor.of_derivatives(ONE)
    for begin, end in returns:
        gone = minimum_snap((begin, end), (0.0, 1.0)).derivatives(time)
        # a return that begins with the offset counts, up to rounding
        counts = begin >= since - 1e-9
        left = left * Taylor.of_derivatives(
            [one - where(counts, d, 0.0) for one, d in zip(ONE, gone, strict=True)]
        )
    moved = {
        name: getattr(reference, name) + offset * left.derivative(order)
        for order, name in enumerate(VECTORS)
    }
    tip = tuple(
        c + o * left.derivative(0) for c, o in zip(reference.tip, offset, strict=False)
    )
    return replace(reference, tip=tip, **moved)


ONE = (1.0, 0.0, 0.0, 0.0, 0.0)
"""The constant one with its first four derivatives."""
