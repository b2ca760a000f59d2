"""Constants of the exact law."""

from __future__ import annotations

from dataclasses import dataclass

from skyarm.actuation import Mixer
from skyarm.algebra import Vec3
from skyarm.control.model import JointGains, Model
from skyarm.scalars import Scalar

MODES = ("joint", "ee")


@dataclass(frozen=True, kw_only=True, slots=True)
class BaseGains:
    """Gains on accelerations.

    Attributes:
        position: 1/s^2. velocity: 1/s. Of the centre of mass, world axes.
        attitude: 1/s^2. rate: 1/s. Body axes.
        pull: m/s^2, the most that errors of the centre of mass can ask for.
    """

    position: Vec3
    velocity: Vec3
    attitude: Vec3
    rate: Vec3
    pull: Scalar


@dataclass(frozen=True, kw_only=True, slots=True)
class ObserverGains:
    """Bandwidths, rad/s: of the disturbance on the base's force, its torque, the joints; of the filter of the pose."""

    force: Scalar
    torque: Scalar
    joints: Scalar
    pose: Scalar


@dataclass(frozen=True, kw_only=True, slots=True)
class TipGains:
    """Of the EE-exact mode.

    Attributes:
        position: 1/s^2. velocity: 1/s. Of the tip's error.
        reach: m; base errors beyond this length are followed by the tip, not made good by the arm.
        damping: m; singular values of the tip's Jacobian below this leave their direction to the link orientations.
            Over ``reach`` it weighs the references of sliding joints.
        posture: m; weight of the joints' own references, for motions that neither tip nor orientations fix.
        shift_rate: rad/s, of the filtered disturbance that the base's shift follows.
        shift_limit: m, largest length of the shift.
    """

    position: Scalar
    velocity: Scalar
    reach: Scalar
    damping: Scalar
    posture: Scalar
    shift_rate: Scalar
    shift_limit: Scalar


@dataclass(frozen=True, kw_only=True, slots=True)
class ExactParameters:
    """All constants of the exact law.

    Attributes:
        model: belief. mixer: of the model.
        mode: "joint" keeps base and joints on their references, "ee" the tip and the link orientations.
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
    """

    model: Model
    mixer: Mixer
    mode: str
    base: BaseGains
    joint_gains: JointGains
    tip: TipGains
    observer: ObserverGains
    delay_periods: int
    reference_period: Scalar
    continuation: Scalar
    lag_inversion: Scalar
    trim_rate: Scalar
    measured_rates: Scalar
    tilt: Scalar
    thrust_floor: Scalar
    adaptation: Scalar
    tip_mass_limit: Scalar
    adapts_load: bool
    friction_adaptation: Scalar
    damping_limits: tuple[tuple[Scalar, Scalar], ...]
    slow: tuple[tuple[Scalar, Scalar], ...]
    adapts_friction: bool

    def choices(self) -> list[str]:
        """What is structure, in words."""
        adapted = ["adapted tip mass"] if self.adapts_load else []
        adapted += ["adapted friction"] if self.adapts_friction else []
        return [f"mode '{self.mode}'", f"measurements {self.delay_periods} periods old", *adapted]
