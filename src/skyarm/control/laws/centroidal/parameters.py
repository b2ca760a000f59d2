"""Constants of the centroidal law."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from skyarm.actuation import Mixer
from skyarm.control.blocks.air_drag import BelievedAir
from skyarm.control.blocks.attitude import BaseGains
from skyarm.control.blocks.disturbance_observer import ObserverGains
from skyarm.control.blocks.felt_acceleration import AccelerometerGains
from skyarm.control.blocks.force_trend import TrendGains
from skyarm.control.blocks.lag_estimate import LagGains
from skyarm.control.laws.centroidal.admittance_records import AdmittanceGains
from skyarm.control.laws.centroidal.interaction_records import InteractionGains
from skyarm.control.laws.centroidal.load_records import LoadGains
from skyarm.control.model import JointGains, Model
from skyarm.records.units import Unit
from skyarm.scalars import Scalar

MODES = ("joint", "tip")
MODE_ALIASES = {"ee": "tip"}


@dataclass(frozen=True, kw_only=True, slots=True)
class TipGains:
    """Of the tip mode.

    Attributes:
        position: 1/s^2. velocity: 1/s. Of the tip's error.
        reach: m; base errors beyond this length are followed by the tip, not made good by the arm.
        damping: m; singular values of the tip's Jacobian below this leave their direction to the link orientations.
            Over ``reach`` it weighs the references of sliding joints.
        posture: m; weight of the joints' own references, for motions that neither tip nor orientations fix.
        shift_rate: rad/s, of the filtered disturbance that the base's shift follows.
        shift_limit: m, largest length of the shift.
    """

    position: Annotated[Scalar, Unit("1/s^2", "of the tip")]
    velocity: Annotated[Scalar, Unit("1/s", "of the tip")]
    reach: Annotated[Scalar, Unit("m", "base errors beyond this are followed by the tip")]
    damping: Annotated[Scalar, Unit("m", "singular values below this leave their direction to the link orientations")]
    posture: Annotated[Scalar, Unit("m", "weight of the joints' own references")]
    shift_rate: Annotated[Scalar, Unit("rad/s", "filter of the disturbance that the base's shift follows")]
    shift_limit: Annotated[Scalar, Unit("m", "largest shift of the base")]


@dataclass(frozen=True, kw_only=True, slots=True)
class GustGains:
    """Of the base's shift for a force that changes.

    Attributes:
        pace: rad/s, of the shift where the force changes by much.
        size: N; changes well below it are followed at ``TipGains.shift_rate``.
    """

    pace: Annotated[Scalar, Unit("rad/s", "pace of the base's shift where the force changes by much", low=0.0)]
    size: Annotated[Scalar, Unit("N", "change of the force below which the base shifts slowly", low=0.0, strict=True)]


@dataclass(frozen=True, kw_only=True, slots=True)
class CentroidalParameters:
    """All constants of the centroidal law.

    Attributes:
        model: belief. mixer: of the model.
        mode: "joint" keeps base and joints on their references, "tip" the tip and the link orientations.
        base, joint_gains, tip, observer: gains; those of the joints on accelerations.
        delay_periods: age of the measurement in control periods.
        reference_period: s between published samples.
        continuation: 1 continues held samples to the present, 0 takes them as they were.
        lag_inversion: 0 commands the wanted rotor speed, 1 inverts the motor lag within one period.
        trim_rate: 1/s, of the correction of the rotors' mean squared speeds.
        measured_rates: 0 takes velocities from the observer, 1 from the sensors.
        tilt: largest tangent of the commanded tilt. thrust_floor: smallest commanded vertical force, N.
        adaptation: 1/s; rate of the load at the tip. tip_mass_limit: kg. adapts_load: False leaves it out.
        friction_adaptation: 1/s; rate of the joints' damping. damping_limits: lowest and highest of each, N m s/rad
            or N s/m. slow: squares of position and rate below which a joint teaches little, rad^2 and (rad/s)^2 or m^2
            and (m/s)^2. adapts_friction: False leaves it out.
        shift_bandwidth: rad/s, of the differentiators that give jerk and snap of the base's shift. moves_shift: False
            takes shift, drag and turned links as they stand, without their motion.
        gust: how the shift follows a force that changes; None for a filter of first order.
        swing_rate: 1/s, of the means by which the pace of the arm's swing is found. follows_swing: False shifts the
            base as each instant asks for.
        path_rate: 1/s, of the means by which the pace of the base's path is found. follows_path: False turns the base
            for its reference alone.
        low_thrust: share of the weight below which a vertical force turns the attitude less. softens_attitude: False
            leaves it out.
        arm_turn: rad/s^2, the most of angular acceleration that the base turns with to make good the arm's motion.
            limits_arm: False makes all of it good.
        sideways: share of the rotors' room beside hover that a force across body z may take at a level attitude; what
            is beyond tilts the base. uses_sideways: False leaves it out: all force is along body z.
        attitude: roll and pitch that sideways force holds in place of level, rad. holds_attitude: False holds level.
        approach: m/s^2, rate at which the velocity falls that a distant base comes back with. brakes: False leaves it
            to the gains.
        trend: how the rate of the observed force is found; None for a law that takes the force as it stands.
        leads_thrust: True commands rotors ahead of the planned force by what motors lag.
        ends: whether each joint has a lower and an upper limit that it is kept off; empty leaves it out.
        pushes_across: rotors push across body z, which the law does not use.
        arm_scaling: share of a rotor's squared speed in hover that joint accelerations leave free at both ends of its
            range. scales_arm: False gives the joints their accelerations whatever the rotors can.
        lag: how the bandwidth answers a lag that is found in flight; None for a law that trusts what it was told.
        accelerometer: bandwidths of its part in velocity and force; None for a law that does without one.
        air: wind and drag of the hull that are believed; None for still air and no hull.
        interaction: how the tip presses where the reference asks for it; None for a law of motions alone.
        load: how a load is learned while the reference says that one is held; None for a law that only observes it.
        admittance: how the tip gives way to forces from outside; None for a law that stands against them.
    """

    model: Model
    mixer: Mixer
    mode: str
    base: BaseGains
    joint_gains: JointGains
    tip: TipGains
    observer: ObserverGains
    delay_periods: int
    reference_period: Annotated[Scalar, Unit("s", "between samples of the reference")]
    continuation: Annotated[Scalar, Unit("", "0 to 1, share of the time since a reference sample that it is continued")]
    lag_inversion: Annotated[Scalar, Unit("", "0 to 1, share of the motor lag that commands invert")]
    trim_rate: Annotated[Scalar, Unit("1/s", "correction of the rotors' mean squared speeds")]
    measured_rates: Annotated[Scalar, Unit("", "0 velocities of the observer, 1 of the sensors")]
    tilt: Annotated[Scalar, Unit("", "largest tangent of the commanded tilt")]
    thrust_floor: Annotated[Scalar, Unit("N", "smallest commanded vertical force")]
    adaptation: Annotated[Scalar, Unit("1/s", "rate of the adapted tip mass")]
    tip_mass_limit: Annotated[Scalar, Unit("kg", "largest adapted tip mass")]
    adapts_load: bool
    friction_adaptation: Annotated[Scalar, Unit("1/s", "rate of the adapted damping of the joints")]
    damping_limits: Annotated[
        tuple[tuple[Scalar, Scalar], ...], Unit("N m s/rad or N s/m", "least and largest adapted damping of each joint")
    ]
    slow: Annotated[
        tuple[tuple[Scalar, Scalar], ...], Unit("", "squares of position and rate below which a joint teaches little")
    ]
    adapts_friction: bool
    shift_bandwidth: Annotated[Scalar, Unit("rad/s", "differentiators of the base's shift")] = 0.0
    moves_shift: bool = False
    gust: GustGains | None = None
    swing_rate: Annotated[Scalar, Unit("1/s", "rate of the adapted pace of the arm's swing")] = 0.0
    follows_swing: bool = False
    path_rate: Annotated[Scalar, Unit("1/s", "rate of the adapted pace of the base's path")] = 0.0
    follows_path: bool = False
    low_thrust: Annotated[Scalar, Unit("", "share of the weight below which a force turns the attitude less")] = 0.0
    softens_attitude: bool = False
    arm_turn: Annotated[Scalar, Unit("rad/s^2", "the most that the base turns with for the arm's motion")] = 0.0
    limits_arm: bool = False
    sideways: Annotated[Scalar, Unit("", "share of the rotors' room that a force at level attitude takes")] = 0.0
    uses_sideways: bool = False
    attitude: Annotated[tuple[Scalar, Scalar], Unit("rad", "roll and pitch that sideways force holds")] = (0.0, 0.0)
    holds_attitude: bool = False
    approach: Annotated[Scalar, Unit("m/s^2", "rate at which a base that comes back from afar slows down")] = 0.0
    brakes: bool = False
    trend: TrendGains | None = None
    leads_thrust: bool = False
    ends: tuple[tuple[bool, bool], ...] = ()
    pushes_across: bool = False
    arm_scaling: Annotated[Scalar, Unit("", "share of a rotor's hover that joint accelerations leave free")] = 0.0
    scales_arm: bool = False
    lag: LagGains | None = None
    accelerometer: AccelerometerGains | None = None
    air: BelievedAir | None = None
    interaction: InteractionGains | None = None
    load: LoadGains | None = None
    admittance: AdmittanceGains | None = None

    def choices(self) -> list[str]:
        """What is structure, in words."""
        adapted = ["adapted tip mass"] if self.adapts_load else []
        adapted += ["adapted friction"] if self.adapts_friction else []
        added = {
            "motion of the shift": self.moves_shift,
            "shift for gusts": self.gust is not None,
            "shift by the pace of the swing": self.follows_swing,
            "shift by the pace of the path": self.follows_path,
            "upright at low thrust": self.softens_attitude,
            "limited motion for the arm": self.limits_arm,
            "sideways force": self.uses_sideways,
            "held attitude": self.holds_attitude,
            "braking in time": self.brakes,
            "trend of the force": self.trend is not None,
            "thrust ahead of its plan": self.leads_thrust,
            "joints kept within their limits": bool(self.ends),
            "joints slowed where rotors do not reach": self.scales_arm,
            "bandwidth by the lag found": self.lag is not None,
            "force by the accelerometer": self.accelerometer is not None,
            "drag of the hull": self.air is not None and self.air.hull,
            "pressing on surfaces": self.interaction is not None,
            "learned load": self.load is not None,
            "moments of a learned load": self.load is not None and self.load.inertia is not None,
            "giving way to forces": self.admittance is not None,
            "believed wind": self.air is not None and type(self.air.wind.x) is not int,
        }
        adapted += [name for name, there in added.items() if there]
        return [f"mode '{self.mode}'", f"measurements {self.delay_periods} periods old", *adapted]
