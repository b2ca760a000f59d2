"""Immutable records that the stages of the centroidal law's control step exchange."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Protocol

from skyarm.algebra import E_Z, ZERO3, Mat3, Scalar, Scalars, Vec3
from skyarm.algebra.scalars import maximum, mul
from skyarm.algebra.scalars.taylor import Taylor
from skyarm.control.blocks.disturbance_observer import Observed, ObserverCorrections
from skyarm.control.blocks.force_control import Pressing
from skyarm.control.blocks.late_actuators import Past
from skyarm.control.blocks.prediction import Actuation, Disturbance
from skyarm.dynamics.actuators import Mixer
from skyarm.records.immutable import immutable
from skyarm.reference.preview import Sample


@immutable
class Timing:
    """Delay of the command of this step, and modelled rotor speeds and joint efforts
    before the measurement.

    Attributes:
        late: estimated delay of the commands, s. lead: the same with the commands'
            known delay.
        age: periods from the measurement to when the command acts.
        past: modelled past of the actuators. acted: mean actuation over the period
            before the measurement.
    """

    late: Scalar = 0
    lead: Scalar = 0
    age: Scalar = 0
    past: Past
    acted: Actuation


@immutable
class ReferenceMotion:
    """Reference motion at the instant at which a command of this step acts.

    Attributes:
        signals: x, y, z, yaw and the joints, series in time.
        ahead: samples to come, each with its time from then, s.
        center: planned centre of mass, value to fourth derivative, m, world axes; empty
            without a plan.
    """

    signals: Sequence[Taylor]
    ahead: Sequence[tuple[Scalar, Sequence[Sample]]] = ()
    center: list[Vec3] | tuple[()] = ()


@immutable
class ObserverOutput:
    """Observer output: state and disturbance at the measurement's time, and corrections
    of the prediction.

    Attributes:
        observed: observer state at the measurement's time. corrections: its
            corrections of the model by that measurement.
        alone: observed disturbance with the adapted feed-forward. unknown: the same
            with what the mixer omits.
    """

    observed: Observed
    corrections: ObserverCorrections
    alone: Disturbance
    unknown: Disturbance


@immutable
class Effect:
    """Changes of a control step due to tip contact: shifted reference, compensated
    disturbance, stopped adaptation.

    Attributes:
        signals: shifted signals of the reference. ahead: shifted samples to come, each
            with its time from then, s.
        unknown: compensated disturbance.
        force: external force that the posture follows, N, world axes.
        learns, isolated: 1 where base and joints, and the lag, may be adapted, 0 in
            contact.
        external: 1 while a force on the tip is part of the observed disturbance.
            pressing: the push; None without one.
        links: bandwidth of each link's orientation over the tip's; () for 1.
        force_rate: rate of a force that is compensated in advance, N/s, world axes.
        forgets: part of the observed disturbance that the observer drops in this step;
            None for none.
    """

    signals: Sequence[Taylor]
    unknown: Disturbance
    force: Vec3
    learns: Scalar = 1
    isolated: Scalar = 1.0
    external: Scalar = 0
    pressing: Pressing | None = None
    links: Scalars = ()
    forgets: Disturbance | None = None
    force_rate: Vec3 = ZERO3
    ahead: Sequence[tuple[Scalar, Sequence[Sample]]] = ()

    def isolating(self, share: Scalar, never: Scalar = 0.0) -> Effect:
        """Changes of a control step, with adaptation also stopped where ``share`` is 0
        because of an external force.

        ``never`` is 1 where none was there in this flight: the lag is estimated.
        """
        isolated = mul(self.isolated, maximum(share, never))
        return replace(self, learns=mul(self.learns, share), isolated=isolated)


class RotorForce:
    """Rotor force that can be achieved at an attitude; in this base class thrust along
    body z alone.
    """

    __slots__ = ()

    def leaning(self, force: Vec3, yaw: Taylor) -> Vec3:
        """Part of a desired force (series, N, world axes) along which the vehicle
        tilts: the whole in this class.
        """
        return force

    def achievable(self, force: Sequence[Vec3], R: Mat3, w: Vec3) -> Vec3:
        """Force (N, world axes) that the rotors can give at this attitude, or its first
        derivative (N/s).

        ``force`` is the desired one, with its derivative for that of the result.
        """
        b3: Vec3 = R.column(2)
        along = force[0].dot(b3)
        pushed: Vec3 = b3 * along
        if len(force) > 1:
            b3d = R.apply(w.cross(E_Z))
            pushed = b3 * (force[1].dot(b3) + force[0].dot(b3d)) + b3d * along
        return pushed

    def across(self, R: Mat3, force: Vec3) -> Vec3:
        """Components of an achievable force across body z (N, body axes): none in this
        base class.
        """
        return ZERO3


class RotorPart(Protocol):
    """Interface (typing.Protocol) of the constants for rotors that can also push across
    body z.
    """

    def rotor_force(self, mixer: Mixer, com: Vec3, weight: Scalar) -> RotorForce:
        """Force that the rotors give, with the centre of mass at ``com`` (m, base axes)
        and the weight in N.
        """


@immutable
class Planned:
    """Planned motion without tracking errors: attitude, accelerations and joint
    signals.

    Attributes:
        R: R_WB, quasi-static attitude. rate, alpha: its angular velocity and
            acceleration, base axes.
        proper: acceleration of the base origin less gravity, m/s^2, base axes.
        joints: signals, series in time.
    """

    R: Mat3
    rate: Vec3
    alpha: Vec3
    proper: Vec3
    joints: tuple[Taylor, ...]


@immutable
class AccelerationDemand:
    """Desired thrust, angular acceleration and joint accelerations of one control step.

    Attributes:
        thrust: N, along body z. across: N, body axes.
        alpha: angular acceleration, body axes, rad/s^2. joints: accelerations.
        planned: motion without errors.
        force_rate: N/s, body axes, of the planned force.
        missed: m, of the tip from its reference, world axes.
    """

    thrust: Scalar
    alpha: Vec3
    joints: Scalars
    planned: Planned
    across: Vec3 = ZERO3
    force_rate: Vec3 = ZERO3
    missed: Vec3 = ZERO3
