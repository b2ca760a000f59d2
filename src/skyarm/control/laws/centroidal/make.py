"""Construction of the centroidal law from its options."""

from __future__ import annotations

import math
from typing import Any

from skyarm import dynamics
from skyarm.algebra import ZERO3_DATA, Vec3
from skyarm.control.blocks.attitude import BaseGains
from skyarm.control.blocks.common import standing_command
from skyarm.control.blocks.disturbance_observer import (
    AccelerometerGains,
    ObserverGains,
    first_observed,
)
from skyarm.control.blocks.extrapolation import Channel
from skyarm.control.blocks.held_damping import doubted_dampings, joint_mobilities
from skyarm.control.blocks.late_actuators import first_past
from skyarm.control.controller import (
    Controller,
    ControllerError,
    LawOptions,
    all_applied,
)
from skyarm.control.laws.centroidal import options
from skyarm.control.laws.centroidal.adaptation import adaptation_gains
from skyarm.control.laws.centroidal.contact.options import contact_parts, must_act
from skyarm.control.laws.centroidal.demands import first_following
from skyarm.control.laws.centroidal.force_trend import trend_gains
from skyarm.control.laws.centroidal.lag_estimate import lag_gains
from skyarm.control.laws.centroidal.law import (
    CentroidalMemory,
    PartMemories,
    centroidal,
)
from skyarm.control.laws.centroidal.noise_estimate import (
    VELOCITY,
    NoiseGains,
    noise_share,
)
from skyarm.control.laws.centroidal.options import (
    PERIODS,
    VALUES,
    check_entry,
    fit_gains,
    must_be_whole,
    number_within,
    periods_of,
    preview_of,
    refuse,
)
from skyarm.control.laws.centroidal.parameters import (
    MODES,
    CenterGains,
    CentroidalParameters,
    Parts,
    TipGains,
    at_shares,
)
from skyarm.control.laws.centroidal.tilting.options import sideways_part
from skyarm.control.model import JointGains, Model
from skyarm.control.vectored_layer import pairs_model, with_tilting
from skyarm.dynamics.actuators import AllocationError, Mixer, make_mixer
from skyarm.vehicle import Vehicle

ENTRIES = options.ENTRIES
"""Names of the options that are not in the signature of :func:`make_centroidal`."""

__all__ = ["ENTRIES", "make_centroidal"]

YAW_SLACK = 5.0
"""Largest yaw acceleration error (rad/s^2) that keeping the thrust may cause, with the
joints at zero; chosen."""


def make_centroidal(
    model: Model,
    *,
    mode: str = "joint",
    delay: float = 0.0,
    age: float | None = None,
    control_period: float = 0.005,
    reference_period: float = 0.02,
    tip_mass_limit: float = 0.2,
    admittance: LawOptions | None = None,
    **changes: Any,
) -> Controller:
    """Make the centroidal law for any vehicle.

    The gains were chosen on the Hummingbird with its arm of 0.3 m: the lengths (reach,
    damping) are that arm's.

    ``delay`` is the known delay from a command to its measurement, s, a whole number of
    control periods, and ``age`` what of it is the measurement's; None for all. By the
    rest, a delay of the commands, the reference is ahead. ``reference_period`` is the
    time between published samples, s; ``tip_mass_limit`` in kg; ``changes`` are gains
    and options in place of :data:`~skyarm.control.laws.centroidal.options.VALUES`.

    Raises:
        ControllerError: an unknown mode or option, one out of its range, no end
            effector, or ``sideways`` for rotors that do not span torque and force in
            all directions.
        AllocationError: the rotors do not span torque and thrust.
    """
    if type(mode) is not str or mode not in MODES:
        refuse("mode", mode, f"one of {list(MODES)}")
    gains = {
        **VALUES,
        **{name: check_entry(name, value) for name, value in changes.items()},
    }
    must_act(gains, admittance)
    sideways = sideways_part(gains)
    must_be_whole(gains)
    presses, carries = any(gains["interaction"]), bool(gains["load"])
    periods = periods_of(delay, control_period)
    whole = model
    turns_rotors = sideways is not None and bool(model.vehicle.tilts)
    model = pairs_model(model) if turns_rotors else model
    vehicle, leads = model.vehicle, mode == "tip" and model.vehicle.n > 0
    gains |= fit_gains(
        gains, set(changes), mode, vehicle, presses=presses, carries=carries
    )
    if mode == "tip" and not vehicle.end_effector:
        lacks = "has no end_effector, which mode 'tip' must have"
        raise ControllerError(
            f"model.vehicle = {vehicle.name!r}: {lacks}{vehicle.tip_cure}"
        )
    if changes.get("adaptation") and not vehicle.end_effector:
        refuse(
            "adaptation",
            gains["adaptation"],
            f"0: {vehicle.name!r} has no end_effector{vehicle.tip_cure}",
        )
    if changes.get("adaptation") and carries:
        refuse(
            "adaptation",
            gains["adaptation"],
            "0 with load, which is what the tip's load is estimated by",
        )
    most = number_within("tip_mass_limit", tip_mass_limit, 0.0, 1e3)
    if changes.get("adaptation") and not most:
        refuse(
            "tip_mass_limit", most, f"above 0 with adaptation = {gains['adaptation']:g}"
        )
    ahead = 0 if age is None else periods - periods_of(age, control_period, "age")
    if ahead < 0:
        refuse("age", age, f"at most delay, {delay:g} s")
    force, torque, joints, pose = gains["observer"]
    # the observer finds a force late by its two poles and the known delay
    lead = periods * control_period + 2.0 / max(
        # an observer that is nearly off would give a lead of seconds
        joints * gains["bandwidth"],
        1.0,
    )
    published = number_within("reference_period", reference_period, *PERIODS)
    kp, kv, kr, kw = gains["base"]
    yaw_kr, yaw_kw = gains["yaw"]
    stiffness, damping = gains["arm"]
    tip_kp, tip_kd = gains["tip"]
    heard, velocity = gains["accelerometer"]
    mobilities = joint_mobilities(vehicle, control_period)
    ends, hears = ends_of(vehicle), any(gains["accelerometer"])
    # whatever has no limit turns as far as its arm buckles; what presses on purpose is
    # not to be stiff
    loose = any(
        link.joint.turns and not any(end)
        for link, end in zip(vehicle.links, ends, strict=True)
    )
    par = CentroidalParameters(
        model=model,
        mobilities=mobilities,
        mixer=_mixer(vehicle, sideways is not None),
        mode=mode,
        base=BaseGains(
            position=Vec3(kp, kp, kp),
            velocity=Vec3(kv, kv, kv),
            attitude=Vec3(kr, kr, yaw_kr),
            rate=Vec3(kw, kw, yaw_kw),
        ),
        center=CenterGains(
            tilt=gains["tilt"],
            # the attitude is that of this force, which must not vanish without gravity
            # either; 0.15 of the weight is chosen
            floor=0.15 * vehicle.mass * model.gravity + 1e-3,
            sideways=sideways,
        ),
        joint_gains=JointGains(
            stiffness=(stiffness,) * vehicle.n, damping=(damping,) * vehicle.n
        ),
        joint_ends=ends,
        braces=loose and bool(vehicle.end_effector) and not presses,
        tip=TipGains(
            position=tip_kp,
            velocity=tip_kd,
            reach=gains["reach"],
            damping=gains["damping"],
            posture=gains["posture"],
            shift_rate=gains["shift_rate"],
            preview=preview_of(
                gains,
                mode,
                published + ahead * control_period,
                given="preview" in changes,
            ),
        ),
        observer=ObserverGains(
            force=force,
            torque=torque,
            joints=joints,
            pose=pose,
            accelerometer=(
                AccelerometerGains(force=heard, velocity=velocity) if hears else None
            ),
        ),
        delay_periods=periods,
        lead_periods=ahead,
        reference_period=published,
        parts=Parts(
            lag=(
                lag_gains(gains["lag"], control_period, periods)
                if any(gains["lag"])
                else None
            ),
            noise=NoiseGains(density=VELOCITY * noise_share(vehicle), hears=hears),
            **contact_parts(
                gains, admittance, vehicle, leads=leads, lead=lead, periods=periods
            ),
            trend=(
                trend_gains(gains["force_trend"], float(vehicle.mass))
                if gains["force_trend"]
                else None
            ),
            adaptation=adaptation_gains(
                vehicle,
                0.0 if carries else gains["adaptation"],
                most,
                periods,
                damping,
                doubted_dampings(vehicle, mobilities, control_period),
            ),
        ),
    )
    if gains["bandwidth"] != 1.0:
        par = at_shares(par, gains["bandwidth"], gains["bandwidth"])
    memory = first_memory(par, periods)
    controller = Controller(
        name=f"centroidal_{mode}",
        law=centroidal,
        par=par,
        memory=memory,
        keeps_tip=mode == "tip",
    )
    return with_tilting(controller, whole) if turns_rotors else controller


def ends_of(vehicle: Vehicle) -> tuple[tuple[bool, bool], ...]:
    """Two flags for each joint of a vehicle: True if it has a lower limit, True if it
    has an upper one.
    """
    return tuple(
        (math.isfinite(float(joint.lower)), math.isfinite(float(joint.upper)))
        for joint in vehicle.joints
    )


def _mixer(vehicle: Vehicle, sideways: bool) -> Mixer:
    """Mixer of the centroidal law: thrust takes priority over yaw torque where the
    rotors allow priorities.
    """
    slack = YAW_SLACK * float(dynamics.mass_matrix_at_rest(vehicle)[5][5])
    try:
        return make_mixer(vehicle, "thrust_before_yaw", sideways, slack)
    except AllocationError as error:
        if sideways:
            raise ControllerError(f"controller.sideways: {error}") from None
        # rotors that priorities do not fit are clipped
        return make_mixer(vehicle)


def first_memory(par: CentroidalParameters, delay_periods: int) -> CentroidalMemory:
    """Initial internal state of the centroidal law: level hover of the model with all
    joints at zero.
    """
    model, vehicle = par.model, par.model.vehicle
    standing = standing_command(model)
    speeds = standing.rotor_speeds
    parts = {name: part.start(vehicle.n) for name, part in par.parts.present()}
    return CentroidalMemory(
        started=0.0,
        age=0.0,
        channels=(Channel(),) * (4 + vehicle.n),
        observed=first_observed(
            vehicle.n, speeds, par.observer.accelerometer is not None
        ),
        sent=standing,
        past=first_past(
            standing,
            # the lag estimate reads further back than the known delay
            delay_periods + 1 + (len(parts["lag"].past) if "lag" in parts else 0),
        ),
        applied=all_applied(vehicle.n),
        free=(1.0,) * (1 + vehicle.n),
        slow_force=ZERO3_DATA,
        trim=(0.0,) * len(speeds),
        following=first_following(par),
        parts=PartMemories(**parts),
    )
