"""Team law ``leader_follower``: the leader flies its path, followers yield along the
line of the grasps.

A follower has its own path, the plan of the body and the force that it estimates at its
tip; it receives no message. Along the line of its grasp, outward from the middle of
all, its tip is a virtual body between the path and the pull T beyond its part of the
body's planned weight:

    M s'' + D s' + K s = -(T - T_d).

Across that line it stays on its path. Nobody compensates the load in advance: every
observer finds its part of it.
Sources: Tagliabue, Kamel, Siegwart, Nieto 2017 (followers by admittance on an estimated
force).
"""

from __future__ import annotations

from collections.abc import Collection
from typing import Annotated, cast

from skyarm.algebra import Scalar, Scalars
from skyarm.algebra.scalars import absolute, clip, data, divide, where
from skyarm.records.coerce import RecordError
from skyarm.records.files import must_be_one_of, shown
from skyarm.records.immutable import immutable
from skyarm.records.leaves import Tree
from skyarm.records.units import Unit, nonnegative, positive
from skyarm.reference.carry import Carry
from skyarm.world.team.team import Sharing, TeamInputs, weight_of

FARTHEST = 0.1
"""Largest yield (m) of a follower."""


@immutable
class Yielding:
    """State of a follower's virtual body: displacement outward from the path, and its
    rate.
    """

    offset: Annotated[
        Scalar, Unit("m", "displacement of a follower's tip outward from its path")
    ] = 0.0
    rate: Annotated[Scalar, Unit("m/s", "rate of that displacement")] = 0.0


@immutable
class LeaderFollower(Sharing):
    """Law whose followers yield to the pull along the line of the grasps, without
    messages.

    Attributes:
        leader: name of the leader; empty for the first member.
    """

    leader: str = ""
    virtual_mass: Annotated[
        Scalar,
        positive(
            "kg",
            "mass of a follower's virtual body",
            effect="higher values yield later and follow less noise",
        ),
    ] = 2.0
    damping: Annotated[
        Scalar,
        nonnegative(
            "N s/m",
            "damping of the virtual body",
            effect="higher values yield more slowly and swing less",
        ),
    ] = 60.0
    stiffness: Annotated[
        Scalar,
        nonnegative(
            "N/m",
            "stiffness of the virtual body",
            effect="higher values leave more pull",
        ),
    ] = 20.0

    def require_members(self, names: Collection[str], period: float) -> None:
        """Refuse members as the base class does, and a leader that is none of them."""
        Sharing.require_members(self, names, period)
        members = [each.agent for each in self.members]
        if self.leader and self.leader not in members:
            raise RecordError(
                f"leader = {shown(self.leader)}: {must_be_one_of(members, self.leader)}"
            )

    def first(self, period: float) -> tuple[Yielding, ...]:
        """Initial state of the law: no follower has yielded."""
        return (Yielding(),) * len(self.members)

    def lead(
        self, own: Tree, inputs: TeamInputs, dt: float
    ) -> tuple[tuple[Yielding, ...], tuple[Scalars, ...]]:
        """Next state of the law, and the shift of each follower's tip."""
        own = cast("tuple[Yielding, ...]", own)
        leader = self.leader or self.members[0].agent
        share = self.fraction(inputs.time)
        arms = self.arms(inputs.desired.R)
        loads = self.shares(*weight_of(self, inputs.desired, inputs.gravity), arms)
        after = []
        carries = []
        pulls = self.along(self.desired_tensions(inputs.time), arms)
        masses = self.masses_moved(share)
        # D / 2 M, the bandwidth of a body that is critically damped
        settling = divide(0.5 * self.damping, self.virtual_mass)
        rows = zip(
            self.members,
            own,
            self.outward(arms),
            inputs.forces,
            loads,
            pulls,
            masses,
            strict=True,
        )
        for member, body, line, force, load, pull, mass in rows:
            bend: Scalar = 0.0
            moved = body
            if member.agent != leader:
                excess = (force - load * share - pull).dot(line) * inputs.holding
                pushed = (
                    -excess - self.damping * body.rate - self.stiffness * body.offset
                )
                bend = divide(pushed, self.virtual_mass)
                # at the bound the tip rests
                free = absolute(body.offset + (body.rate + bend * dt) * dt) < FARTHEST
                # where it is free the bend is unchanged: the rate may take the new one
                bend = where(free, bend, 0.0)
                rate = where(free, body.rate + bend * dt, 0.0)
                moved = Yielding(
                    offset=data(clip(body.offset + rate * dt, -FARTHEST, FARTHEST)),
                    rate=data(rate),
                )
            after.append(moved)
            carry = Carry(
                held=inputs.holding,
                offset=line * moved.offset,
                offset_rate=line * moved.rate,
                offset_acceleration=line * bend,
                settling=settling,
                mass=mass * inputs.holding,
            )
            carries.append(carry.numbers)
        return tuple(after), tuple(carries)
