"""Rate of the force of gusts: the attitude leads by it where the force acts on the base.

An attitude loop alone follows a force that changes late by its damping over its stiffness, 0.1 s: more than observer,
rotors and arm together. An accelerometer gives the force's rate r, and the planned attitude turns with it. A rate that
is steep for the rotors' torque is followed less, r / sqrt(1 + (|r| / steep)^2).

A force on the tip (a load, a push, a joint that is stuck) must not lead so: the tip's own angular acceleration is in
it, and its rate would close a loop through an unknown load. Such a force also turns the base, a gust does not. With
the observed torque's rate t over the arm's length, both limited as above, as mean squares of their horizontal parts,

    share = max(0, 1 - 2 E t^2 / (E r^2 + faint^2))

is 1 in gusts and 0 where the tip of a stretched arm is pushed (0.2 to 0.4 of a bent one, pushed at 4 rad/s); ``faint``
is for the noise of calm air.

Gusts that come and go are not worth a shift of the base: for a force that decays with the rate a the least integral of
tip^2 shifts by (p - a) / (p + a) of what a lasting force asks for. The shift's filter is slower in proportion to
1 + 6 share E r^2 / steep^2; a step is too short to count.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from skyarm.algebra import Vec3
from skyarm.algebra.scalars import Scalar, divide, maximum, sqrt
from skyarm.control.blocks.filters import low_pass_share
from skyarm.control.blocks.select import data, vector_data
from skyarm.control.laws.centroidal.parameters import CentroidalParameters
from skyarm.control.laws.centroidal.part import Part, Step
from skyarm.control.laws.centroidal.presets import PRESETS_ARM, SHORTEST, arm_length
from skyarm.records.units import Unit
from skyarm.vehicle.vehicle_records import Vehicle

FASTER = 2.0
"""Of the accelerometer's bandwidth: that of the rate's filter, which noise of the specific force passes."""

FORGET = 1.5
"""1/s, of the mean squares."""

FAINT, STEEP = 0.3, 7.0
"""m/s^3: rates of the force per mass that are too small to tell, and too steep for the rotors."""

DOUBT = 2.0
"""Weight of the torque's mean square: that of a force on the tip is as large as the force's."""

CALMER = 6.0
"""Growth of the shift's time constant where gusts are as steep as rotors can follow."""


@dataclass(frozen=True, kw_only=True, slots=True)
class GustRateGains(Part):
    """Constants of the rate of gusts: its share, the arm's length, and the rates between noise and saturation."""

    share: Annotated[Scalar, Unit("", "of the rate, by which the attitude leads")]
    length: Annotated[Scalar, Unit("m", "of the arm")]
    faint: Annotated[Scalar, Unit("N/s", "rate that is too small to tell")]
    steep: Annotated[Scalar, Unit("N/s", "rate that is too steep for the rotors")]

    def start(self, joints: int) -> GustRate:
        """Initial state of the rate of gusts: no force."""
        return GustRate(force=Vec3(0.0, 0.0, 0.0), pushing=0.0, turning=0.0)

    def adjust_reference(self, memory: GustRate, step: Step) -> GustRate:
        """Find the rate of the observed force, its share that acts on the base, and how gusty the air is."""
        after, rate = update_gust_rate(self, memory, step)
        share = gust_share(self, after)
        step.gust, step.change = share, rate * (share * self.share)
        step.rough = 1.0 + share * after.pushing * divide(CALMER, self.steep * self.steep)
        return after


@dataclass(frozen=True, kw_only=True, slots=True)
class GustRate:
    """Filter state of the rate of gusts: the force, and mean squares of its rate and of the torque's."""

    force: Annotated[Vec3, Unit("N", "filtered, world axes")]
    pushing: Annotated[Scalar, Unit("(N/s)^2", "mean square of the force's horizontal rate")]
    turning: Annotated[Scalar, Unit("(N/s)^2", "the same of a force at the tip that gives the torque")]


def gust_rate_gains(share: float, vehicle: Vehicle) -> GustRateGains:
    """Constants of the rate of gusts for a share of the rate and a vehicle."""
    mass, length = float(vehicle.mass), arm_length(vehicle) if vehicle.end_effector else PRESETS_ARM
    return GustRateGains(share=share, length=max(length, SHORTEST), faint=FAINT * mass, steep=STEEP * mass)


def update_gust_rate(gains: GustRateGains, memory: GustRate, step: Step) -> tuple[GustRate, Vec3]:
    """Filter state of the rate of gusts one period later, and the limited rate of the force, N/s, world axes."""
    per, before = divide(1.0, step.dt), step.memory.observed
    change = (step.observed.force - memory.force) * low_pass_share(_bandwidth(step.par), step.dt)
    rate = _limit(change * per, gains.steep)
    turn = _limit((step.observed.torque - before.torque) * divide(per, gains.length), gains.steep)
    share = low_pass_share(FORGET, step.dt)
    pushing = memory.pushing + share * (rate.x * rate.x + rate.y * rate.y - memory.pushing)
    turning = memory.turning + share * (turn.x * turn.x + turn.y * turn.y - memory.turning)
    return GustRate(force=vector_data(memory.force + change), pushing=data(pushing), turning=data(turning)), rate


def gust_share(gains: GustRateGains, memory: GustRate) -> Scalar:
    """Share of the observed force that acts on the base and is no noise, from 0 to 1."""
    doubt = divide(DOUBT * memory.turning, memory.pushing + gains.faint * gains.faint)
    return maximum(1.0 - doubt, 0.0)


def _limit(rate: Vec3, steep: Scalar) -> Vec3:
    """Rate of a force, smoothly limited to a size."""
    found: Vec3 = rate * divide(1.0, sqrt(1.0 + rate.dot(rate) * divide(1.0, steep * steep)))
    return found


def _bandwidth(par: CentroidalParameters) -> Scalar:
    """Bandwidth of the rate's filter, rad/s."""
    accelerometer = par.observer.accelerometer
    return FASTER * (par.observer.force if accelerometer is None else accelerometer.force)
