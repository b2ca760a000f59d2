"""The centroidal law ready to fly."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from skyarm import dynamics
from skyarm.algebra import ZERO3, Mat3, Vec3
from skyarm.algebra.scalars import minimum
from skyarm.control.blocks.attitude import BaseGains
from skyarm.control.blocks.disturbance_observer import AccelerometerGains, ObserverGains, first_observed
from skyarm.control.blocks.extrapolation import Channel
from skyarm.control.blocks.prediction import BelievedAir
from skyarm.control.blocks.select import data
from skyarm.control.controller import Controller, ControllerError, all_applied
from skyarm.control.laws.centroidal.adaptation import adaptation_gains
from skyarm.control.laws.centroidal.admittance import admittance_gains
from skyarm.control.laws.centroidal.demands import first_following, pushes_across
from skyarm.control.laws.centroidal.force_trend import trend_gains
from skyarm.control.laws.centroidal.gust_shift import GustMemory, gust_gains
from skyarm.control.laws.centroidal.interaction import interaction_gains
from skyarm.control.laws.centroidal.joint_room import ends_of
from skyarm.control.laws.centroidal.lag_estimate import LagGains, stride_of
from skyarm.control.laws.centroidal.law import CentroidalMemory, PartMemories, centroidal
from skyarm.control.laws.centroidal.load import load_gains
from skyarm.control.laws.centroidal.parameters import (
    MODES,
    CenterGains,
    CentroidalParameters,
    Observation,
    Parts,
    RotorGains,
    ShiftGains,
    SidewaysGains,
    TipGains,
    at_shares,
)
from skyarm.control.laws.centroidal.presets import (
    ENTRIES,
    PERIODS,
    PRESETS,
    check_entry,
    damping_share,
    must_act,
    name_of,
    number_within,
    one_of,
    periods_of,
)
from skyarm.control.model import JointGains, Model
from skyarm.control.vectored_layer import pairs_model, with_tilting
from skyarm.dynamics.actuators import AllocationError, Command, Mixer, make_mixer
from skyarm.dynamics.actuators.hover import hover_trim
from skyarm.records.files import shown
from skyarm.vehicle.vehicle_records import Vehicle

__all__ = ["ENTRIES", "make_centroidal"]


def make_centroidal(
    model: Model,
    *,
    mode: str = "joint",
    preset: str = "robust",
    delay: float = 0.0,
    control_period: float = 0.005,
    reference_period: float = 0.02,
    tip_mass_limit: float = 0.2,
    admittance: Mapping[str, Any] | None = None,
    **changes: Any,
) -> Controller:
    """The centroidal law for any vehicle.

    The presets were chosen on the Hummingbird with its arm of 0.3 m: the lengths (reach, damping, shift_limit) are
    that arm's, and "stiff" needs motors about as fast as its (12.5 ms up, 25 ms down).

    Args:
        model: what it believes.
        mode: "joint" (base and joints on their references) or "tip" (the tip on its reference).
        preset: a key of ``PRESETS``.
        delay: known age of the measurement, s, a whole number of control periods.
        control_period: s.
        reference_period: between published samples, s.
        tip_mass_limit: kg.
        admittance: ``mass``, ``damping``, ``stiffness`` along three axes, with which the tip gives way to forces;
            ``normal`` for axes of a surface, ``threshold`` (N) above which a force counts.
        changes: entries of the preset to replace.

    Raises:
        ControllerError: an unknown mode or preset, an option out of its range, no end effector, or ``sideways`` for
            rotors that do not span torque and force in all directions.
        AllocationError: the rotors do not span torque and thrust.
    """
    one_of("mode", mode, MODES)
    one_of("preset", preset, sorted(PRESETS))
    gains = {**PRESETS[preset], **{name: check_entry(name, value) for name, value in changes.items()}}
    must_act(changes, gains, mode)
    periods, vehicle, sideways = periods_of(delay, control_period), model.vehicle, gains["sideways"] > 0.0
    if sideways and vehicle.tilts:
        known: dict[str, Any] = {"mode": mode, "preset": preset, "delay": delay, "control_period": control_period}
        known |= {"reference_period": reference_period, "tip_mass_limit": tip_mass_limit, "admittance": admittance}
        return with_tilting(make_centroidal(pairs_model(model), **known, **changes), model)
    if preset in ("adaptive", "gusts") and mode == "tip" and vehicle.end_effector and "damping" not in changes:
        gains["damping"] *= damping_share(vehicle)
    if (mode == "tip" or changes.get("adaptation")) and not vehicle.end_effector:
        raise ControllerError(f"model.vehicle = {vehicle.name!r}: has no end_effector, which mode 'tip' must have")
    kp, kv, kr, kw = gains["base"]
    yaw_kr, yaw_kw = gains["yaw"]
    (stiffness, damping), sensor = gains["arm"], gains["force_sensor"]
    (force, velocity), late = gains["accelerometer"], gains["lag"]
    # the observer finds a force late by its two poles and the known delay
    lead = periods * control_period + 2.0 / max(gains["observer"][2] * gains["bandwidth"], 1.0)
    others = {"interaction": any(gains["interaction"]), "load": gains["load"] > 0.0}
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
        center=CenterGains(
            tilt=gains["tilt"],
            floor=0.15 * vehicle.mass * model.gravity + 1e-3,
            approach=gains["approach"] or None,
            arm_turn=(gains["arm_turn"] or None) if vehicle.n else None,
            low_thrust=gains["low_thrust"] or None,
            sideways=SidewaysGains(
                share=gains["sideways"], attitude=gains["attitude"] if any(gains["attitude"]) else None
            )
            if sideways
            else None,
        ),
        joint_gains=JointGains(stiffness=(stiffness,) * vehicle.n, damping=(damping,) * vehicle.n),
        joint_ends=ends_of(vehicle) if gains["joint_limits"] and any(map(any, ends_of(vehicle))) else (),
        tip=TipGains(
            **dict(zip(("position", "velocity"), gains["tip"], strict=True)),
            **{name: gains[name] for name in ("reach", "damping", "posture", "shift_rate", "shift_limit")},
            shift=ShiftGains(
                bandwidth=gains["shift_bandwidth"],
                swing_rate=(gains["swing_rate"] or None) if vehicle.n else None,
                path_rate=(gains["path_rate"] or None) if vehicle.n else None,
                gust=gust_gains(gains["gust_shift"], vehicle, model.gravity) if gains["gust_shift"] else None,
            )
            if gains["shift_bandwidth"] > 0.0 and mode == "tip"
            else None,
        ),
        observer=ObserverGains(**dict(zip(("force", "torque", "joints", "pose"), gains["observer"], strict=True))),
        observation=Observation(
            accelerometer=AccelerometerGains(force=force, velocity=velocity)
            if _both("accelerometer", (force, velocity), "bandwidths")
            else None,
            air=_air(vehicle, gains["hull_drag"], gains["wind"]),
            measured_rates=gains["measured_rates"],
        ),
        rotors=RotorGains(
            lag_inversion=gains["lag_inversion"],
            trim_rate=gains["trim_rate"],
            leads_thrust=gains["thrust_lead"],
            pushes_across=pushes_across(vehicle) and not sideways,
        ),
        delay_periods=periods,
        reference_period=number_within("reference_period", reference_period, *PERIODS),
        continuation=gains["continuation"],
        parts=Parts(
            lag=LagGains(base=late[0], joints=late[1], stride=stride_of(control_period))
            if _both("lag", late, "lengths")
            else None,
            interaction=interaction_gains(gains["interaction"], mode, vehicle, sensor and admittance is None),
            admittance=admittance_gains(admittance, mode, vehicle, sensor, lead, others),
            load=load_gains(gains["load"], vehicle),
            trend=trend_gains(gains["force_trend"], float(vehicle.mass)) if gains["force_trend"] > 0.0 else None,
            adaptation=adaptation_gains(vehicle, gains, number_within("tip_mass_limit", tip_mass_limit, 0.0, 1e3)),
        ),
    )
    if gains["bandwidth"] != 1.0:
        par = at_shares(par, gains["bandwidth"], gains["bandwidth"])
    memory = first_memory(par, periods)
    return Controller(name=name_of(mode, preset), law=centroidal, par=par, memory=memory, keeps_tip=mode == "tip")


def _mixer(vehicle: Vehicle, sideways: bool, yaw_slack: float, asked: bool) -> Mixer:
    """Allocation; ``yaw_slack`` in rad/s^2 of the vehicle with its joints at zero.

    A preset flies rotors that allow no priorities without them; a slack that was ``asked`` for is refused there.
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
        if asked and yaw_slack:
            raise ControllerError(f"controller.yaw_slack = {shown(yaw_slack)}: must be 0 here: {error}") from None
        return make_mixer(vehicle)


def _both(name: str, pair: tuple[float, float], unit: str) -> bool:
    """Return True if an option of two numbers is used: both are above 0."""
    first, second = pair
    if (first > 0.0) != (second > 0.0):
        raise ControllerError(f"controller.{name} = {shown(pair)}: must be two {unit} above 0, or twice 0")
    return first > 0.0


def _air(vehicle: Vehicle, hull: bool, wind: tuple[float, float, float]) -> BelievedAir | None:
    """Model of the air; None for still air and no hull."""
    if hull and not any(vehicle.drag.area):
        raise ControllerError(
            f"controller.hull_drag = true: model.vehicle = {vehicle.name!r} must have a drag.area, which it has not"
        )
    return BelievedAir(wind=Vec3(*wind) if any(wind) else ZERO3, hull=hull) if hull or any(wind) else None


def first_memory(par: CentroidalParameters, delay_periods: int) -> CentroidalMemory:
    """Memory before the first step: a level hover with the joints at zero, as the model sees it."""
    model, vehicle, moves = par.model, par.model.vehicle, par.tip.shift
    trim = hover_trim(vehicle, (0.0,) * vehicle.n, model.gravity)
    speeds = tuple(data(minimum(w, r.max_speed)) for w, r in zip(trim.speeds, vehicle.rotors, strict=True))
    zero = Vec3(0.0, 0.0, 0.0)
    standing = Command(rotor_speeds=speeds, efforts=tuple(data(effort) for effort in trim.efforts))
    return CentroidalMemory(
        started=0.0,
        age=0.0,
        channels=(Channel(),) * (4 + vehicle.n),
        observed=first_observed(vehicle.n, speeds, par.observation.accelerometer is not None),
        sent=(standing,) * (delay_periods + 1),
        applied=all_applied(vehicle.n),
        free=(1.0,) * (1 + vehicle.n),
        slow_force=zero,
        gust=() if moves is None or moves.gust is None else GustMemory(rate=zero),
        trim=(0.0,) * len(speeds),
        following=first_following(par),
        parts=PartMemories(**{name: part.start(vehicle.n) for name, part in par.parts.present()}),
    )
