"""Construction of the centroidal law from its options."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Mapping
from typing import Any, TypeVar

from skyarm import dynamics
from skyarm.algebra import ZERO3_DATA, Mat3, Vec3
from skyarm.control.blocks.attitude import BaseGains
from skyarm.control.blocks.common import standing_command
from skyarm.control.blocks.disturbance_observer import AccelerometerGains, ObserverGains, first_observed
from skyarm.control.blocks.extrapolation import Channel
from skyarm.control.blocks.force_control import SENSING, require_thresholds
from skyarm.control.blocks.late_actuators import first_past
from skyarm.control.blocks.torque_scale import Tolerances
from skyarm.control.controller import Controller, ControllerError, all_applied
from skyarm.control.laws.centroidal import presets
from skyarm.control.laws.centroidal.adaptation import adaptation_gains
from skyarm.control.laws.centroidal.admittance import admittance_gains
from skyarm.control.laws.centroidal.force_trend import trend_gains
from skyarm.control.laws.centroidal.gust_rate import gust_rate_gains
from skyarm.control.laws.centroidal.interaction import Interaction
from skyarm.control.laws.centroidal.lag_estimate import LagGains, stride_of
from skyarm.control.laws.centroidal.law import CentroidalMemory, PartMemories, centroidal
from skyarm.control.laws.centroidal.load import load_gains
from skyarm.control.laws.centroidal.noise_estimate import NoiseGains
from skyarm.control.laws.centroidal.parameters import (
    MODES,
    CenterGains,
    CentroidalParameters,
    Parts,
    RotorGains,
    ShiftGains,
    SidewaysGains,
    TipGains,
    at_shares,
)
from skyarm.control.laws.centroidal.presets import (
    PERIODS,
    PRESETS,
    RETIRED,
    check_entry,
    fit_gains,
    must_act,
    name_of,
    number_within,
    periods_of,
    refuse,
    without_retired,
)
from skyarm.control.laws.centroidal.shift_motion import first_following, gust_gains
from skyarm.control.model import JointGains, Model
from skyarm.control.vectored_layer import pairs_model, with_tilting
from skyarm.dynamics.actuators import AllocationError, Mixer, make_mixer
from skyarm.vehicle.vehicle_records import Vehicle

ENTRIES = (*presets.ENTRIES, *RETIRED)
"""Names of options beside those of :func:`make_centroidal`'s signature."""

__all__ = ["ENTRIES", "make_centroidal"]

Gains = TypeVar("Gains")


def make_centroidal(
    model: Model,
    *,
    mode: str = "joint",
    preset: str = "robust",
    delay: float = 0.0,
    age: float | None = None,
    control_period: float = 0.005,
    reference_period: float = 0.02,
    tip_mass_limit: float = 0.2,
    admittance: Mapping[str, Any] | None = None,
    **changes: Any,
) -> Controller:
    """Make the centroidal law for any vehicle.

    The presets were chosen on the Hummingbird with its arm of 0.3 m: the lengths (reach, damping) are that arm's, and
    "stiff" needs motors about as fast as its (12.5 ms up, 25 ms down).

    ``delay`` is the known delay from a command to its measurement, s, a whole number of control periods, and ``age``
    what of it is the measurement's; None for all. By the rest, a delay of the commands, the reference is ahead.
    ``reference_period`` is the time between published samples, s; ``tip_mass_limit`` in kg; ``changes`` replace entries
    of the preset.

    Raises:
        ControllerError: an unknown mode or preset, an option out of its range, no end effector, or ``sideways`` for
            rotors that do not span torque and force in all directions.
        AllocationError: the rotors do not span torque and thrust.
    """
    for name, word, words in (("mode", mode, MODES), ("preset", preset, sorted(PRESETS))):
        if type(word) is not str or word not in words:
            refuse(name, word, f"one of {list(words)}")
    changes = without_retired(changes)
    gains = {**PRESETS[preset], **{name: check_entry(name, value) for name, value in changes.items()}}
    must_act(changes, gains, mode, admittance is not None)
    periods, sideways, whole = periods_of(delay, control_period), gains["sideways"] > 0.0, model
    turns_rotors = sideways and bool(model.vehicle.tilts)
    model = pairs_model(model) if turns_rotors else model
    vehicle, leads = model.vehicle, mode == "tip" and model.vehicle.n > 0
    gains |= fit_gains(gains, set(changes), preset, mode, vehicle)
    if (mode == "tip" or changes.get("adaptation")) and not vehicle.end_effector:
        raise ControllerError(f"model.vehicle = {vehicle.name!r}: has no end_effector, which mode 'tip' must have")
    ahead = 0 if age is None else periods - periods_of(age, control_period, "age")
    if ahead < 0:
        refuse("age", age, f"at most delay, {delay:g} s")
    # the observer finds a force late by its two poles and the known delay
    lead = periods * control_period + 2.0 / max(gains["observer"][2] * gains["bandwidth"], 1.0)
    kp, kv, kr, kw = gains["base"]
    yaw_kr, yaw_kw = gains["yaw"]
    ends = ends_of(vehicle)
    # whatever has no limit turns as far as its arm buckles; what presses on purpose is not to be stiff
    loose = any(link.joint.turns and not any(end) for link, end in zip(vehicle.links, ends, strict=True))
    bounded, presses = gains["joint_limits"] and (loose or any(map(any, ends))), any(gains["interaction"])
    par = CentroidalParameters(
        model=model,
        mixer=_mixer(vehicle, sideways, gains["yaw_slack"], "yaw_slack" in changes),
        mode=mode,
        base=BaseGains(
            position=Vec3(kp, kp, kp),
            velocity=Vec3(kv, kv, kv),
            attitude=Vec3(kr, kr, yaw_kr),
            rate=Vec3(kw, kw, yaw_kw),
            pull=gains["pull"],
        ),
        center=_of_options(
            CenterGains,
            gains,
            floor=0.15 * vehicle.mass * model.gravity + 1e-3,
            sideways=SidewaysGains(
                share=gains["sideways"], attitude=gains["attitude"] if any(gains["attitude"]) else None
            )
            if sideways
            else None,
        ),
        joint_gains=JointGains(**_row("stiffness damping", ((each,) * vehicle.n for each in gains["arm"]))),
        joint_ends=ends if bounded else (),
        braces=bounded and loose and not presses,
        tip=_of_options(
            TipGains,
            gains,
            **_row("position velocity", gains["tip"]),
            shift=_of_options(
                ShiftGains,
                gains,
                gust=gust_gains(gains["gust_shift"], vehicle, model.gravity) if gains["gust_shift"] else None,
            )
            if gains["preview"] and mode == "tip"
            else None,
        ),
        observer=ObserverGains(
            **_row("force torque joints pose", gains["observer"]),
            accelerometer=AccelerometerGains(**_row("force velocity", gains["accelerometer"]))
            if any(gains["accelerometer"])
            else None,
        ),
        rotors=_of_options(
            RotorGains,
            gains,
            leads_thrust=gains["thrust_lead"],
        ),
        delay_periods=periods,
        lead_periods=ahead,
        reference_period=number_within("reference_period", reference_period, *PERIODS),
        parts=Parts(
            lag=LagGains(**_row("base joints", gains["lag"]), stride=stride_of(control_period))
            if any(gains["lag"])
            else None,
            noise=NoiseGains(density=gains["velocity_noise"])
            if gains["velocity_noise"] and not any(gains["accelerometer"])
            else None,
            interaction=_interaction(gains, leads, vehicle) if any(gains["interaction"]) else None,
            admittance=None if admittance is None else admittance_gains(admittance, gains, leads, lead),
            load=load_gains(gains["load"], vehicle) if gains["load"] else None,
            trend=trend_gains(gains["force_trend"], float(vehicle.mass)) if gains["force_trend"] else None,
            gusts=gust_rate_gains(gains["gust_rate"], vehicle)
            if gains["gust_rate"] and any(gains["accelerometer"])
            else None,
            adaptation=adaptation_gains(vehicle, gains, number_within("tip_mass_limit", tip_mass_limit, 0.0, 1e3)),
        ),
    )
    if gains["bandwidth"] != 1.0:
        par = at_shares(par, gains["bandwidth"], gains["bandwidth"])
    memory = first_memory(par, periods)
    found = Controller(name=name_of(mode, preset), law=centroidal, par=par, memory=memory, keeps_tip=mode == "tip")
    return with_tilting(found, whole) if turns_rotors else found


def _interaction(gains: Mapping[str, Any], leads: bool, vehicle: Vehicle) -> Interaction:
    """Constants of contact force control from the law's options."""
    require_thresholds(gains["interaction"], leads)
    touch, lost = gains["interaction"]
    geared = any(float(link.joint.armature) > 0.0 for link in vehicle.links)
    return Interaction(
        touch=touch,
        lost=lost,
        sensing=SENSING if gains["force_sensor"] else None,
        tolerances=Tolerances(**_row("torques masses", gains["tolerances"])) if any(gains["tolerances"]) else None,
        geared=geared,
    )


def ends_of(vehicle: Vehicle) -> tuple[tuple[bool, bool], ...]:
    """For each joint of a vehicle: true if it has a lower limit, true if it has an upper one."""
    joints = (link.joint for link in vehicle.links)
    return tuple((math.isfinite(float(joint.lower)), math.isfinite(float(joint.upper))) for joint in joints)


def _of_options(kind: type[Gains], gains: Mapping[str, Any], **others: Any) -> Gains:
    """Dataclass of constants filled from equally named options; 0 for an optional constant becomes None."""
    for field in dataclasses.fields(kind):  # type: ignore[arg-type]
        if field.name in gains and field.name not in others:
            others[field.name] = (gains[field.name] or None) if "None" in str(field.type) else gains[field.name]
    return kind(**others)


def _row(names: str, values: Iterable[Any]) -> dict[str, Any]:
    """Dictionary of gain values by name, from names separated by spaces."""
    return dict(zip(names.split(), values, strict=True))


def _mixer(vehicle: Vehicle, sideways: bool, yaw_slack: float, given: bool) -> Mixer:
    """Mixer of the centroidal law; ``yaw_slack`` is a yaw acceleration in rad/s^2 with the joints at zero.

    Rotors that allow no priorities fly a preset without a slack; one that is ``given`` is refused there.
    """
    policy, slack = "priority", 0.0
    if yaw_slack:
        policy, M = "thrust_before_yaw", dynamics.mass_matrix(vehicle, Mat3.identity(), (0.0,) * vehicle.n)
        slack = yaw_slack * float(M[5][5])
    try:
        return make_mixer(vehicle, policy, sideways, slack)
    except AllocationError as error:
        if sideways:
            raise ControllerError(f"controller.sideways: {error}") from None
        if given and yaw_slack:
            refuse("yaw_slack", yaw_slack, f"0 here: {error}")
        return make_mixer(vehicle)


def first_memory(par: CentroidalParameters, delay_periods: int) -> CentroidalMemory:
    """Initial internal state of the centroidal law: level hover of the model with all joints at zero."""
    model, vehicle = par.model, par.model.vehicle
    standing = standing_command(model)
    speeds, lag = standing.rotor_speeds, par.parts.lag
    parts = {name: part.start(vehicle.n) for name, part in par.parts.present()}
    return CentroidalMemory(
        started=0.0,
        age=0.0,
        channels=(Channel(),) * (4 + vehicle.n),
        observed=first_observed(vehicle.n, speeds, par.observer.accelerometer is not None),
        sent=(standing,) * (delay_periods + 1),
        past=() if lag is None else first_past(standing, delay_periods + 1 + len(parts["lag"].past)),
        applied=all_applied(vehicle.n),
        free=(1.0,) * (1 + vehicle.n),
        slow_force=ZERO3_DATA,
        trim=(0.0,) * len(speeds),
        following=first_following(par),
        parts=PartMemories(**parts),
    )
