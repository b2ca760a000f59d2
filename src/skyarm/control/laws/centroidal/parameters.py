"""Constants of the centroidal law, and the base class of its optional parts.

A part is a record of constants with any of the functions of :class:`OptionalPart`; its
memory is its own record, which the law keeps. A part that is left out is not in the
law's program at all. Nothing that a part is given is changed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated, Any, TypeVar

from skyarm.algebra import Scalar, Scalars, Vec3
from skyarm.algebra.scalars import clip, divide, maximum, mul, sqrt, total
from skyarm.control.blocks.attitude import BaseGains
from skyarm.control.blocks.disturbance_observer import ObserverGains
from skyarm.control.blocks.held_damping import doubted_dampings, joint_mobilities
from skyarm.control.blocks.prediction import Disturbance
from skyarm.control.laws.centroidal.step_records import (
    AccelerationDemand,
    Effect,
    ObserverOutput,
    ReferenceMotion,
    RotorPart,
    Timing,
)
from skyarm.control.model import JointGains, Model
from skyarm.dynamics import State
from skyarm.dynamics.actuators import Mixer
from skyarm.dynamics.kinematics import jacobian_columns
from skyarm.records.immutable import field_if_any, immutable
from skyarm.records.leaves import Dataclass, parts
from skyarm.records.units import Unit
from skyarm.reference import Reference
from skyarm.sensing.measurement import Measurement
from skyarm.vehicle import Vehicle

Gains = TypeVar("Gains", bound=Dataclass)

MODES = ("joint", "tip")

FOLLOWING = 2
"""Number of future reference samples, one and two periods after the held one, from
which derivatives are computed."""

SHARES = (0.125, 0.25, 0.4375, 0.6875, 1.0)
"""Times of the reference samples for the base shift, as fractions of the preview:
denser where they count more."""


LATEST = 0.02
"""Command delay (s), known and estimated, from which the joints are no longer
braced: with 20 ms braces lost the loop in upward wind, 154 mm off instead of 51."""

BRACES, QUICKER = (0.05, 9.0, 3.2), (0.15, 3.0, 2.0)
"""Upward force over the weight from which the joints' damping grows, its growth with
the force, and its largest factor. The same of their observer's bandwidth with an
accelerometer, where a tenth of the thrust is too little to tell."""

OWN = ("lag", "noise", "trend", "adaptation")
"""Names of the optional parts that also work without contact."""

BENT = 3.0
"""Joint levers over ``damping`` at which half of the bracing is left; chosen."""


@immutable
class CenterGains:
    """Bounds of the desired force on the centre of mass; ``sideways``: constants of
    sideways rotor force, or None.
    """

    tilt: Annotated[
        Scalar,
        Unit(
            "",
            "tangent of the largest commanded tilt",
            effect=(
                "higher values fight stronger wind and leave less thrust for the height"
            ),
        ),
    ]
    floor: Annotated[Scalar, Unit("N", "smallest commanded vertical force")]
    sideways: RotorPart | None


@immutable
class TipGains:
    """Gains of tip control, and constants of the base offset that keeps the tip in
    place.

    ``damping`` over ``reach`` weighs the references of sliding joints; without a
    ``preview`` the base does not shift.
    """

    position: Annotated[
        Scalar,
        Unit(
            "1/s^2",
            "acceleration per position error of the tip",
            effect=(
                "higher values correct tip errors faster, amplify noise and tolerate"
                " less delay"
            ),
        ),
    ]
    velocity: Annotated[
        Scalar,
        Unit(
            "1/s",
            "acceleration per velocity error of the tip",
            effect="higher values damp the tip more and amplify noise of the rates",
        ),
    ]
    reach: Annotated[
        Scalar,
        Unit(
            "m",
            "base error beyond which the tip follows the base instead of its reference",
            effect=(
                "higher values hold the tip for larger base errors and stretch the arm"
                " more"
            ),
        ),
    ]
    damping: Annotated[
        Scalar,
        Unit(
            "m",
            "singular value of the tip's Jacobian below which link orientations take"
            " over",
            effect=(
                "higher values move more calmly near a stretched arm and hold the tip"
                " less there"
            ),
        ),
    ]
    posture: Annotated[
        Scalar,
        Unit(
            "m",
            "weight of the joints' own references",
            effect="higher values keep the posture and hold the tip less",
        ),
    ]
    shift_rate: Annotated[
        Scalar,
        Unit(
            "rad/s", "bandwidth of the filter of the disturbance that shifts the base"
        ),
    ]
    preview: (
        Annotated[
            Scalar,
            Unit("s", "time of the reference's preview by which the base shifts"),
        ]
        | None
    ) = None


class OptionalPart:
    """Base class of an optional part of the centroidal law, whose methods change
    nothing.
    """

    __slots__ = ()

    def start(self, joints: int) -> Any:
        """Initial internal state of an optional part of the law, for a vehicle with the
        given number of joints.
        """
        return ()

    def adjust_gains(
        self, memory: Any, par: CentroidalParameters, dt: Scalar
    ) -> CentroidalParameters:
        """Constants of the law for this control step, as changed by an optional
        part.
        """
        return par

    def feedforward(
        self,
        memory: Any,
        par: CentroidalParameters,
        reference: Reference,
        motion: ReferenceMotion,
    ) -> tuple[Disturbance, Disturbance] | None:
        """Disturbance that a part compensates beside the observer: in the period before
        the measurement, and now.
        """
        return None

    def affect(self, memory: Any, step: Step, effect: Effect) -> tuple[Any, Effect]:
        """Next state of an optional part, and the control step's reference and
        disturbance as changed by the part.
        """
        return memory, effect

    def learn(self, memory: Any, effect: Effect, demand: AccelerationDemand) -> Any:
        """State of an optional part at the end of a control step, updated from the
        computed demand.
        """
        return memory


@immutable
class Parts:
    """Optional parts of the centroidal law (lag estimate, contact ...) in order of
    execution; None disables a part.
    """

    lag: OptionalPart | None = None
    noise: OptionalPart | None = None
    interaction: OptionalPart | None = None
    admittance: OptionalPart | None = None
    load: OptionalPart | None = None
    carrying: OptionalPart | None = field_if_any(default=None)
    trend: OptionalPart | None = None
    adaptation: OptionalPart | None = None

    def present(self) -> list[tuple[str, OptionalPart]]:
        """Names and constants of the enabled optional parts of the centroidal law."""
        return [(name, part) for name, part in parts(self).items() if part is not None]

    def touching(self) -> list[tuple[str, OptionalPart]]:
        """Names and constants of the enabled parts for contact, load and admittance."""
        return [(name, part) for name, part in self.present() if name not in OWN]


@immutable
class CentroidalParameters:
    """Constants of the centroidal law.

    Attributes:
        mode: "joint" keeps base and joints on their references, "tip" the tip and the
            links.
        joint_gains: on accelerations.
        mobilities: joint accelerations per effort where friction is quick
            (:mod:`skyarm.control.blocks.held_damping`).
        joint_ends: whether each joint has a lower and an upper limit that it is kept
            off; empty without joints.
        braces: stiffer and better damped joints where a force pushes a straight arm
            from below.
        delay_periods: known delay from a command to its measurement, in control
            periods.
        lead_periods: part of it that is not the measurement's age, by which the
            reference is ahead.
    """

    model: Model
    mixer: Mixer
    mode: str
    base: BaseGains
    center: CenterGains
    joint_gains: JointGains
    mobilities: Annotated[
        Scalars,
        Unit(
            "1/(kg m^2) or 1/kg",
            "acceleration per effort, of joints with quick friction",
        ),
    ]
    joint_ends: tuple[tuple[bool, bool], ...]
    braces: bool = False
    tip: TipGains
    observer: ObserverGains
    delay_periods: int
    lead_periods: int = 0
    reference_period: Annotated[Scalar, Unit("s", "time between reference samples")]
    parts: Parts

    def refit(
        self, memory: Any, model: Model, control_period: float
    ) -> tuple[CentroidalParameters, Any]:
        """Mobilities and doubted damping of the law, after a change of its ``model``;
        ``control_period`` in s.
        """
        vehicle = model.vehicle
        mobilities = joint_mobilities(model.vehicle, control_period)
        par = replace(self, mobilities=mobilities)
        gains: Any = self.parts.adaptation
        if gains is None:
            return par, memory
        gains = gains.doubting(
            vehicle, doubted_dampings(vehicle, mobilities, control_period)
        )
        # anew: what was learned is a difference from the former model
        begun = replace(memory.parts, adaptation=gains.start(vehicle.n))
        parts = replace(self.parts, adaptation=gains)
        return replace(par, parts=parts), replace(memory, parts=begun)

    @property
    def preview(self) -> Scalars:
        """Lead times (s) of the future reference samples that the law uses; empty
        without a preview.
        """
        following = tuple((k + 1.0) * self.reference_period for k in range(FOLLOWING))
        horizon = self.tip.preview
        return (
            following
            if horizon is None
            else (*following, *(share * horizon for share in SHARES))
        )


@immutable
class Step:
    """Inputs of one control step, as passed to the optional parts of the centroidal
    law.

    Attributes:
        par: constants of this step. dt: s. vehicle: the model without what optional
            parts know of a load.
        memory: :class:`skyarm.control.laws.centroidal.law.CentroidalMemory`, one period
            earlier.
        state: when a command of this step acts.
    """

    par: CentroidalParameters
    vehicle: Vehicle
    memory: Any
    measurement: Measurement
    reference: Reference
    dt: Scalar
    timing: Timing
    motion: ReferenceMotion
    seen: ObserverOutput
    state: State

    @property
    def holds(self) -> Scalars:
        """Grasp flag of reference or gripper, above 0.5 while the tip holds a load;
        empty without a flag.
        """
        return self.reference.load or self.measurement.holds


def at_shares(
    par: CentroidalParameters, rotors: Scalar, joints: Scalar
) -> CentroidalParameters:
    """Constants of the law with the bandwidths of rotor loops and joint loops
    multiplied by given factors.

    Stiffnesses go with the square of the bandwidth, dampings and observers with the
    bandwidth.
    """
    once, twice = rotors * rotors, joints * joints
    observer = _times(par.observer, force=rotors, torque=rotors, joints=joints)
    if observer.accelerometer is not None:
        observer = replace(
            observer, accelerometer=_times(observer.accelerometer, force=rotors)
        )
    return replace(
        par,
        base=_times(
            par.base, position=once, velocity=rotors, attitude=once, rate=rotors
        ),
        joint_gains=_times(par.joint_gains, stiffness=twice, damping=joints),
        tip=_times(par.tip, position=twice, velocity=joints),
        observer=observer,
    )


def with_joint_damping(
    par: CentroidalParameters, dampings: Sequence[Scalar]
) -> CentroidalParameters:
    """Constants of the law with the damping (N m s/rad or N s/m) of each of its model's
    joints replaced.
    """
    vehicle = par.model.vehicle
    links = tuple(
        replace(link, joint=replace(link.joint, damping=damping))
        for link, damping in zip(vehicle.links, dampings, strict=True)
    )
    model = replace(par.model, vehicle=replace(vehicle, links=links))
    return replace(par, model=model)


def brace_joints(
    par: CentroidalParameters, force: Vec3, joints: Sequence[Scalar], late: Scalar
) -> CentroidalParameters:
    """Constants of the law with stiffer and better damped joints under an observed
    upward force (N, world axes).

    A force ``F`` that pushes a hanging arm of length ``l`` from below takes the
    stiffness ``F l`` from its joints, and what the observer finds of that is late: the
    arm buckles where ``F l`` exceeds the stiffness of its loop. Of a law that measures
    the specific force the joints' observer is wider, too. That of other laws is not, as
    it would swing with an upward wind: on estimated rates 13 of 5000 wrong plants were
    lost. Stiffness grows with the power 1.5 of the damping: with its square 1 of 3000
    was lost under such a wind.

    A bent arm has levers by which its joints hold the tip up, and does not buckle:
    braced, it knocks at what it is set down on, and two of three flights of
    ``pick_and_carry`` miss their box.
    """
    vehicle = par.model.vehicle
    share = divide(force.z, vehicle.mass * par.model.gravity)
    levers = [
        column.linear.z for column in jacobian_columns(vehicle, vehicle.frame(), joints)
    ]
    bend = BENT * BENT * (par.tip.damping * par.tip.damping)
    straight = divide(bend, total([bend, *(mul(lever, lever) for lever in levers)]))
    room = maximum(1.0 - late * (1.0 / LATEST), 0.0) * straight
    damping, quicker = (
        1.0 + room * clip((share - least) * growth, 0.0, most - 1.0)
        for least, growth, most in (BRACES, QUICKER)
    )
    # a load at the tip that nobody knows of divides both gains: the loop is to stay
    # damped under its integrator
    stiffness = damping * sqrt(damping)
    observer = (
        par.observer
        if par.observer.accelerometer is None
        else _times(par.observer, joints=quicker)
    )
    return replace(
        par,
        joint_gains=_times(par.joint_gains, stiffness=stiffness, damping=damping),
        tip=_times(par.tip, position=stiffness, velocity=damping),
        observer=observer,
    )


def _times(gains: Gains, **shares: Scalar) -> Gains:
    """Dataclass of gains with the named fields multiplied by factors."""
    values = {name: getattr(gains, name) for name in shares}
    scaled = {
        name: (
            tuple(each * share for each in values[name])
            if type(values[name]) is tuple
            else values[name] * share
        )
        for name, share in shares.items()
    }
    return replace(gains, **scaled)
