"""Memory of the centroidal law."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from skyarm.actuation import Command
from skyarm.algebra import Vec3
from skyarm.control.blocks.disturbance import Disturbance
from skyarm.control.blocks.disturbance_observer import Observed
from skyarm.control.blocks.extrapolation import Channel
from skyarm.control.blocks.lag_estimate import LagMemory
from skyarm.control.laws.centroidal.admittance_records import AdmittanceMemory
from skyarm.control.laws.centroidal.demands import Following
from skyarm.control.laws.centroidal.gust_shift import GustMemory
from skyarm.control.laws.centroidal.interaction_records import InteractionMemory
from skyarm.control.laws.centroidal.load_records import LoadMemory
from skyarm.records.units import Unit
from skyarm.scalars import Scalar


@dataclass(frozen=True, kw_only=True, slots=True)
class Regressor:
    """Regressor of one joint from the planned motion: torque of 1 kg at the tip (N m/kg), position (rad or m), rate."""

    load: Annotated[Scalar, Unit("N m/kg or N/kg", "effort of 1 kg at the tip in the planned motion, late")]
    place: Annotated[Scalar, Unit("rad or m", "planned position, late")]
    rate: Annotated[Scalar, Unit("rad/s or m/s", "planned rate, late")]


@dataclass(frozen=True, kw_only=True, slots=True)
class JointLearned:
    """Estimates of one joint, and the filtered signals that they are found by.

    Attributes:
        damping: beyond the model's, N m s/rad or N s/m.
        level, slope: of the observer's effort what is constant, N m or N, and what goes with the position, per rad or
            m. once, twice: planned signals after one and two stages of the observer's lag.
        moving, off: mean squares of the planned rate and of what the joint's own is off.
    """

    damping: Annotated[Scalar, Unit("N m s/rad or N s/m", "adapted")]
    level: Annotated[Scalar, Unit("N m or N", "constant part of the observer's effort")]
    slope: Annotated[Scalar, Unit("", "per rad or m, part of the observer's effort that goes with the position")]
    once: Regressor
    twice: Regressor
    moving: Annotated[Scalar, Unit("(rad/s)^2 or (m/s)^2", "mean square of the planned rate")]
    off: Annotated[Scalar, Unit("(rad/s)^2 or (m/s)^2", "mean square of what the rate is off")]


@dataclass(frozen=True, kw_only=True, slots=True)
class Learned:
    """Slow estimates (tip mass, joint friction) and the feed-forward they give, applied in the next period.

    Attributes:
        tip_mass: kg, beyond the model's. joints: of each.
        feedforward: force, torque and efforts of the estimates, taken as a known disturbance.
    """

    tip_mass: Annotated[Scalar, Unit("kg", "adapted")]
    joints: tuple[JointLearned, ...]
    feedforward: Disturbance


@dataclass(frozen=True, kw_only=True, slots=True)
class CentroidalMemory:
    """State of the law between two steps.

    Attributes:
        started: 0 before the first measurement.
        age: s since the held reference sample appeared. channels: its signals: x, y, z, yaw, joints.
        observed: of the observer.
        sent: the last commands, oldest first, one more than the delay has periods.
        applied: 1 for the rotors and each joint whose last command was applied unchanged.
        free: 1 while no actuator was at its limit.
        slow_force: the observer's force, slowly filtered, N. gust: its rate; empty without the shift for gusts.
        trim: added to the squared speeds that the mixer asks for, (rad/s)^2.
        learned: of a load at the tip and of friction.
        following: of the demands. lag: of the lag's estimate; empty without it. interaction: of pressing on surfaces;
            empty without it. load: of the learned load; empty without it. admittance: of giving way; empty without it.
    """

    started: Annotated[Scalar, Unit("", "0 before the first measurement")]
    age: Annotated[Scalar, Unit("s", "since the held reference sample appeared")]
    channels: tuple[Channel, ...]
    observed: Observed
    sent: tuple[Command, ...]
    applied: Annotated[tuple[Scalar, ...], Unit("", "1 for rotors and joints whose last command was applied unchanged")]
    free: Annotated[tuple[Scalar, ...], Unit("", "1 for base and joints whose actuators are not at their limit")]
    slow_force: Annotated[Vec3, Unit("N", "the observer's force, slowly filtered")]
    trim: Annotated[tuple[Scalar, ...], Unit("(rad/s)^2", "added to the squared speeds that the mixer asks for")]
    learned: Learned
    gust: GustMemory | tuple[()] = ()
    following: Following = Following()
    lag: LagMemory | tuple[()] = ()
    interaction: InteractionMemory | tuple[()] = ()
    load: LoadMemory | tuple[()] = ()
    admittance: AdmittanceMemory | tuple[()] = ()
