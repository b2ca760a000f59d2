"""Team law ``object_wrench``: the body's wrench shared in advance, and its pose and internal force controlled.

The members bear the wrench of the body's desired motion by shares without internal forces, and beside it a stated pull
T_d along the lines of the grasps; each compensates its part in advance. Slow integrals of the body's measured position
and attitude shift and turn all tip references together:

    xi' = k (x_d - x),   zeta' = k (rotation R -> R_d)   while the body is off its support.

Observers of members that hold one body stiffly fight: each compensates the pull of the others, so that the pull grows
by about 90 N/s for each metre that the grasps are misplaced, until a joint is at its limit. Here the observers forget
the internal part of the members' forces at the rate w. For two equal members of mass m, damping c, stiffness k with
observers of bandwidth w_o on a grasp of stiffness K, the internal mode is

    m p^3 + (c + m W) p^2 + (k + c W + K) p + k W + K w,   W = w_o + w,

and stable for every K and w >= 0 (Routh: W > w). An integral of the difference in the places of the tips, in the axes
of the body, removes the rest. All shifts pass (p + filter)^2, of which the members get value, rate and acceleration.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Annotated, cast

from skyarm.algebra import E_Z, ZERO3_DATA, Scalar, Scalars, Vec3
from skyarm.algebra.scalars import where
from skyarm.records.coerce import RecordError
from skyarm.records.immutable import immutable
from skyarm.records.leaves import Tree
from skyarm.records.units import Unit
from skyarm.world.team.team import Sharing, Team, TeamInputs, as_data, carry_of, shorten

FARTHEST, MOST = 0.3, 0.1
"""Largest shift (m, and rad) of all tips together, and of each against the others."""

LIFTED = 0.01
"""Desired height (m) above the start from which the pose of the body is corrected."""


@immutable
class TipShift:
    """Filtered shift of a tip's reference: value and rate, world axes."""

    offset: Annotated[Vec3, Unit("m", "shift of the tip's reference, world axes")] = ZERO3_DATA
    rate: Annotated[Vec3, Unit("m/s", "rate of the shift, world axes")] = ZERO3_DATA


@immutable
class WrenchMemory:
    """State of the law: integrals of pose and internal forces, filters, and forces under way from member to member.

    Attributes:
        inner: integral of each member's internal force, as a shift (m) in the axes of the body.
        late: forces of all members, newest first, as many as messages are late by.
    """

    place: Annotated[Vec3, Unit("m", "integral of the body's position error, world axes")] = ZERO3_DATA
    turn: Annotated[Vec3, Unit("rad", "integral of the body's attitude error, world axes")] = ZERO3_DATA
    inner: tuple[Vec3, ...]
    shifts: tuple[TipShift, ...]
    late: tuple[tuple[Vec3, ...], ...] = ()


@immutable
class ObjectWrench(Sharing):
    """Law that shares the wrench of a body and controls its pose and the internal forces of the members."""

    pose_gain: Annotated[
        Scalar,
        Unit(
            "1/s",
            "rate at which the error of the body's pose shifts all tips",
            low=0.0,
            effect="higher values remove a misplaced grasp sooner and swing with the members' loops",
        ),
    ] = 0.3
    blind: Annotated[
        Scalar,
        Unit(
            "1/s",
            "rate at which observers forget internal forces",
            low=0.0,
            effect="higher values leave less internal force and tolerate less delay of messages",
        ),
    ] = 10.0
    blind_moments: Annotated[
        Scalar,
        Unit(
            "1/s",
            "rate at which observers forget moments between tip and body, of fixed grasps",
            low=0.0,
            effect="higher values leave less moment in a fixed grasp",
        ),
    ] = 0.0
    pull_gain: Annotated[
        Scalar,
        Unit(
            "m/(N s)",
            "rate at which an internal force moves the tips apart",
            low=0.0,
            effect="higher values remove an internal force sooner and oscillate without blind observers",
        ),
    ] = 0.02
    swing: Annotated[
        Scalar,
        Unit(
            "s",
            "shift of all tips per error of the body's velocity, of bodies on cables",
            low=0.0,
            effect="higher values damp the swing sooner and shift the members more",
        ),
    ] = 0.0
    filter: Annotated[Scalar, Unit("rad/s", "bandwidth of the filter of all shifts", low=0.0, strict=True)] = 10.0
    delay: Annotated[
        float,
        Unit("s", "age of the other members' forces, a whole number of control periods", low=0.0, high=1.0, fixed=True),
    ] = 0.0

    def require_members(self, names: Collection[str], period: float) -> None:
        """Refuse members as the base class does, and messages that are late by no whole number of periods (s)."""
        Team.require_members(self, names, period)
        if abs(round(self.delay / period) * period - self.delay) > 1e-9:
            raise RecordError(f"delay = {self.delay:g}: must be a whole number of control periods of {period:g} s")

    def first(self, period: float) -> WrenchMemory:
        """Initial state of the law: nothing shifted."""
        still = (ZERO3_DATA,) * len(self.members)
        late = (still,) * round(self.delay / period)
        return WrenchMemory(inner=still, shifts=(TipShift(),) * len(still), late=late)

    def lead(self, own: Tree, inputs: TeamInputs, dt: float) -> tuple[WrenchMemory, tuple[Scalars, ...]]:
        """Next state of the law, and to each member its part of the load and the shift of its tip."""
        own = cast("WrenchMemory", own)
        assert self.motion is not None
        desired, R = inputs.desired, inputs.desired.R
        share, arms = self.fraction(inputs.time), self.arms(R)
        forces = [f * share for f in self.load(desired, inputs.gravity, self.internal_force)]
        set_point = self.internal(forces, arms)
        late = (tuple(map(as_data, inputs.forces)), *own.late)
        excess = self._excess(late, set_point, arms, inputs.holding)
        height = desired.position.z - self.motion.z.derivatives(0.0)[0]
        flies = where(self.motion.lift > 0.0, height, 1.0) > LIFTED  # what hangs from the start has no support
        rate = where(flies, self.pose_gain * dt, 0.0)
        place = shorten(own.place + (desired.position - inputs.body.position) * rate, FARTHEST)
        turn = shorten(own.turn + self.turn_error(inputs.body.rotation, R) * rate, FARTHEST)
        missing, spin = desired.velocity - inputs.body.velocity, E_Z * (desired.rate.z - inputs.body.turning.z)
        slip = Vec3(missing.x, missing.y, 0.0)
        step = 0.5 * self.pull_gain * dt
        inner = [shorten(q + R.apply_T(e) * step, MOST) for q, e in zip(own.inner, excess, strict=True)]
        shifts, carries = [], []
        rows = zip(forces, arms, inner, excess, own.shifts, inputs.moments, strict=True)
        for force, arm, q, e, shift, moment in rows:
            target = place + turn.cross(arm) + R.apply(q) + (slip + spin.cross(arm)) * self.swing
            w = self.filter
            bend = (target - shift.offset) * (w * w) - shift.rate * (2.0 * w)
            speed = shift.rate + bend * dt
            moved = TipShift(offset=as_data(shift.offset + speed * dt), rate=as_data(speed))
            shifts.append(moved)
            moves = (moved.offset, moved.rate, bend)
            forgotten = e * self.blind, moment * (-self.blind_moments * inputs.holding)
            carries.append(carry_of(inputs.holding, share, moves, -force, forgotten))
        following = WrenchMemory(
            place=as_data(place),
            turn=as_data(turn),
            inner=tuple(map(as_data, inner)),
            shifts=tuple(shifts),
            late=late[: len(own.late)],
        )
        return following, tuple(carries)

    def _excess(
        self, late: Sequence[Sequence[Vec3]], set_point: Sequence[Vec3], arms: Sequence[Vec3], holding: Scalar
    ) -> list[Vec3]:
        """Desired internal force of each member (N) less its estimated one; zero before the body is held."""
        rows = zip(set_point, self.internal(late[-1], arms), strict=True)
        return [(desired - f) * holding for desired, f in rows]
