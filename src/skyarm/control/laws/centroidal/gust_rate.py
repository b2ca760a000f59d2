"""Gusts: force on the base, as opposed to forces on the arm; the law is quicker by its share.

An attitude loop alone follows a force that changes late by its damping over its stiffness, 0.1 s: more than observer,
rotors and arm together. An accelerometer gives the force's rate r, and the planned attitude turns with it. A rate that
is steep for the rotors' torque is followed less, r / sqrt(1 + (|r| / steep)^2).

A force on the tip (a load, a push) or a joint that is stuck must not lead so: the arm's own acceleration is in it, and
both rate and accelerometer would close a loop through an unknown load. Such a force also turns the base or loads the
joints, a gust does neither. With t^2 the squares of the rates of observed torque and efforts over the arm's length,
means of both divided by 1 + (r^2 + t^2) / steep^2, and steep^2 added to t^2's for each joint at its limit,

    share = max(0, 1 - 3 E t^2 / (E r^2 + faint^2))

(r horizontal) is 1 in gusts and 0 where the tip is pushed; ``faint`` is for the noise of calm air. While rotors are at
their limits torques are not observed, and the means are held. The share weighs all that is for gusts alone: the
accelerometer in the observer, the attitude's stiffness, rate and shift; the last two are for what the trend does not
predict.

Gusts that come and go are not worth a shift of the base: for a force that decays with the rate a the least integral of
tip^2 shifts by (p - a) / (p + a) of what a lasting force asks for. The shift's filter is slower in proportion to
1 + 6 share E r^2 / steep^2; a step is too short to count.
"""

from __future__ import annotations

import dataclasses
from typing import Annotated

from skyarm.algebra import ZERO3_DATA, Vec3
from skyarm.algebra.scalars import Scalar, data, divide, maximum, mul, sqrt
from skyarm.control.blocks.filters import low_pass_share
from skyarm.control.blocks.select import vector_data
from skyarm.control.laws.centroidal.parameters import CentroidalParameters
from skyarm.control.laws.centroidal.part import Part, Step
from skyarm.control.laws.centroidal.presets import PRESETS_ARM, SHORTEST, arm_length, noise_share
from skyarm.records.immutable import immutable
from skyarm.records.units import Unit
from skyarm.vehicle.vehicle_records import Vehicle

FASTER = 2.0
"""Bandwidth of the rate's filter over the accelerometer's, whose noise passes."""

# half and twice of a constant, tip in mm in turbulence of 6 m/s / wind steps of 3 N / with 0.2 kg untold, by ``fly`` of
# tests/control/measure_gusts.py with seeds 921 to 923; as they are: 42.4 / 15.3 / 5.7
FORGET = 1.5
"""Forgetting rate of the mean squares, 1/s: little depends on it (42.5 / 15.2 / 5.7 and 42.4 / 15.6 / 5.8)."""

FAINT, STEEP = 0.3, 7.0
"""Rates of the force per mass, m/s^3, that are too small to tell, and too steep for the rotors.

Little depends on the first one (42.5 / 15.3 / 5.8 and 42.4 / 15.1 / 5.8), which keeps noise of calm air from being a
gust; of the second one 43.0 / 17.0 / 5.7 and 42.6 / 13.5 / 5.8.
"""

DOUBT = 3.0
"""Weight of the arm's mean square; that of a force on a hanging tip is as large as the force's.

It trades gusts for an unknown load: 41.6 / 13.8 / 6.1 and 44.1 / 17.5 / 5.6.
"""

STIFFER = 0.5
"""Growth of the attitude's stiffness in gusts, with motors as quick as those that the presets were chosen on; none with
motors slower by a third: a heavy arm on motors of 40 ms was lost in turbulence with a growth of 0.23."""

CALMER = 6.0
"""Growth of the shift's time constant where gusts are as steep as rotors can follow.

It trades steps for turbulence: 43.9 / 14.5 / 5.7 and 40.9 / 16.6 / 5.7.
"""


@immutable
class GustRateGains(Part):
    """Constants of the rate of gusts: its share, the arm's length, and the rates between noise and saturation."""

    share: Annotated[Scalar, Unit("", "of the rate, by which the attitude leads")]
    stiffer: Annotated[Scalar, Unit("", "growth of the attitude's stiffness in gusts")]
    length: Annotated[Scalar, Unit("m", "of the arm")]
    levers: Annotated[tuple[Scalar, ...], Unit("1/m or 1", "of the tip's force per effort of each joint")]
    faint: Annotated[Scalar, Unit("N/s", "rate that is too small to tell")]
    steep: Annotated[Scalar, Unit("N/s", "rate that is too steep for the rotors")]

    def start(self, joints: int) -> GustRate:
        """Initial state of the rate of gusts: no force."""
        return GustRate(force=ZERO3_DATA, pushing=0.0, turning=0.0)

    def adjust_gains(self, memory: GustRate, par: CentroidalParameters, dt: Scalar) -> CentroidalParameters:
        """Weigh the accelerometer by the share of gusts, and stiffen the attitude."""
        share, k, accelerometer = gust_share(self, memory), par.base.attitude, par.observer.accelerometer
        if accelerometer is None:
            return par
        more = 1.0 + share * self.stiffer
        heard = dataclasses.replace(accelerometer, share=share)
        return dataclasses.replace(
            par,
            base=dataclasses.replace(par.base, attitude=Vec3(k.x * more, k.y * more, k.z)),
            observer=dataclasses.replace(par.observer, accelerometer=heard),
        )

    def adjust_reference(self, memory: GustRate, step: Step) -> GustRate:
        """Find the rate of the observed force, its share that acts on the base, and how gusty the air is."""
        after, rate = update_gust_rate(self, memory, step)
        share = gust_share(self, after)
        step.gust = mul(step.gust, share)
        step.change = rate * (step.gust * self.share)
        step.rough = 1.0 + share * after.pushing * divide(CALMER, self.steep * self.steep)
        return after


@immutable
class GustRate:
    """Filter state of the rate of gusts: the force, and mean squares of its rate and of the arm's."""

    force: Annotated[Vec3, Unit("N", "filtered, world axes")]
    pushing: Annotated[Scalar, Unit("(N/s)^2", "mean square of the force's horizontal rate")]
    turning: Annotated[Scalar, Unit("(N/s)^2", "the same of forces at the tip that give torque and efforts")]


def gust_rate_gains(share: float, vehicle: Vehicle) -> GustRateGains:
    """Constants of the rate of gusts for a share of the rate and a vehicle."""
    mass, length = float(vehicle.mass), arm_length(vehicle) if vehicle.end_effector else PRESETS_ARM
    length, joints = max(length, SHORTEST), [link.joint for link in vehicle.links]
    return GustRateGains(
        share=share,
        stiffer=STIFFER * max(0.0, 4.0 * noise_share(vehicle) - 3.0),
        length=length,
        # the inertia of a gear's motor is in the efforts found, with noise of its rate
        levers=tuple(0.0 if float(j.armature) > 0.0 else 1.0 / length if j.turns else 1.0 for j in joints),
        faint=FAINT * mass,
        steep=STEEP * mass,
    )


def update_gust_rate(gains: GustRateGains, memory: GustRate, step: Step) -> tuple[GustRate, Vec3]:
    """Filter state of the rate of gusts one period later, and the limited rate of the force, N/s, world axes."""
    per, seen, before = divide(1.0, step.dt), step.observed, step.memory.observed
    most, (rotors, *joints) = gains.steep * gains.steep, step.memory.free
    change = (seen.force - memory.force) * low_pass_share(_bandwidth(step.par), step.dt)
    rate = change * per
    push, turn = rate.dot(rate), (seen.torque - before.torque) * divide(per, gains.length)
    square, stopped = turn.x * turn.x + turn.y * turn.y, 0.0 * rotors
    for lever, now, last, free in zip(gains.levers, seen.efforts, before.efforts, joints, strict=True):
        bend = (now - last) * (per * lever)
        square, stopped = square + bend * bend, stopped + (1.0 - free) * most
    both = divide(1.0, 1.0 + divide(push + square, most))
    share = low_pass_share(FORGET, step.dt) * rotors
    pushing = memory.pushing + share * ((rate.x * rate.x + rate.y * rate.y) * both - memory.pushing)
    turning = memory.turning + share * (square * both + stopped - memory.turning)
    rate = rate * divide(1.0, sqrt(1.0 + divide(push, most)))
    return GustRate(force=vector_data(memory.force + change), pushing=data(pushing), turning=data(turning)), rate


def gust_share(gains: GustRateGains, memory: GustRate) -> Scalar:
    """Share of the observed force that acts on the base and is no noise, from 0 to 1."""
    doubt = divide(DOUBT * memory.turning, memory.pushing + gains.faint * gains.faint)
    return maximum(1.0 - doubt, 0.0)


def _bandwidth(par: CentroidalParameters) -> Scalar:
    """Bandwidth of the rate's filter, rad/s."""
    accelerometer = par.observer.accelerometer
    return FASTER * (par.observer.force if accelerometer is None else accelerometer.force)
