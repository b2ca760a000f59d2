"""Team law ``decentralised``: members that know the desired motion and a force of their
own, without any message.

Member i moves its tip at v_i = v_d + K (f_d - f_i), with f_i the force that it exerts
on the body as it estimates, and f_d the desired pull outward and the weight m_i g of
its part, which it adapts until it bears that part:

    m_i' = -c_i g . (v_i - v_d)_z,   c_i = c times the member's virtual mass.

The sum of the parts becomes the mass of the body; who bears how much of it follows from
c_i and from the start. Nothing corrects the place of the body: a constant error of a
force estimate moves it on for ever. The velocity passes a low-pass, and the desired
force is compensated in advance.

Source: Thapa, Bai, Acosta 2018, "Cooperative aerial manipulation with force control and
attitude stabilization", whose members are kinematic.
"""

from __future__ import annotations

from typing import Annotated, cast

from skyarm.algebra import E_Z, Scalar, Scalars
from skyarm.algebra.scalars import data, maximum
from skyarm.records.immutable import immutable
from skyarm.records.leaves import Tree, as_data
from skyarm.records.units import Unit, nonnegative, positive
from skyarm.reference.carry import Carry
from skyarm.world.team.team import Sharing, TeamInputs, TipShift


@immutable
class MemberState(TipShift):
    """State of a member: shift of its tip from its path, rate of the shift, and adapted
    mass.
    """

    mass: Annotated[Scalar, Unit("kg", "adapted part of the body's mass")] = 0.0


@immutable
class Decentralised(Sharing):
    """Law by velocities from force errors and adapted masses, without messages."""

    gain: Annotated[
        Scalar,
        nonnegative(
            "m/(N s)",
            "velocity of a tip per error of its force",
            effect="higher values yield faster and swing on stiff grasps",
        ),
    ] = 0.002
    adaptation: Annotated[
        Scalar,
        nonnegative(
            "kg s^2/m^2",
            "rate of the adapted mass per velocity of the tip, divided by gravity",
            effect="higher values find the mass sooner and swing",
        ),
    ] = 40.0
    initial_mass: Annotated[
        Scalar,
        nonnegative(
            "kg",
            "part of the body's mass that each member supposes at first",
            begins=True,
        ),
    ] = 0.0
    filter: Annotated[
        Scalar,
        positive(
            "rad/s",
            "bandwidth of the velocity",
            effect="higher values react sooner and pass more noise",
        ),
    ] = 10.0

    def first(self, period: float) -> tuple[MemberState, ...]:
        """Initial state of the law: nothing shifted, the initial mass."""
        return (MemberState(mass=data(self.initial_mass)),) * len(self.members)

    def usual_mass(self, limit: Scalar) -> Scalar:
        """Virtual mass 1, whatever a member can bear: members have no messages to
        compare it.
        """
        return 1.0

    def lead(
        self, own: Tree, inputs: TeamInputs, dt: float
    ) -> tuple[tuple[MemberState, ...], tuple[Scalars, ...]]:
        """Next state of the law, and to each member its force and the shift of its
        tip.
        """
        own = cast("tuple[MemberState, ...]", own)
        share = self.fraction(inputs.time)
        pulls = self.along(
            self.desired_tensions(inputs.time), self.arms(inputs.desired.R)
        )
        after = []
        carries = []
        for member, state, pull, force in zip(
            self.members, own, pulls, inputs.forces, strict=True
        ):
            asking = pull + E_Z * (state.mass * inputs.gravity * share)
            bend = ((asking - force) * (self.gain * share) - state.rate) * self.filter
            rate = state.rate + bend * dt
            mass = (
                state.mass
                - self.adaptation * member.mass * inputs.gravity * dt * rate.z * share
            )
            moved = as_data(
                MemberState(
                    # by the new rate (semi-implicit Euler), as it is the tip's next one
                    offset=state.offset + rate * dt,
                    rate=rate,
                    # a negative part would ask the member to press the body down
                    mass=maximum(mass, 0.0),
                )
            )
            after.append(moved)
            holding = inputs.holding
            carry = Carry(
                held=holding,
                force=-asking * holding,
                offset=moved.offset,
                offset_rate=moved.rate,
                offset_acceleration=bend,
                settling=self.filter,
                mass=state.mass * share * holding,
            )
            carries.append(carry.numbers)
        return tuple(after), tuple(carries)
