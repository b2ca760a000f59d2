"""The exact law ready to fly: presets of its gains."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from skyarm.actuation import AllocationError, Command, Mixer, make_mixer
from skyarm.actuation.hover import hover_trim
from skyarm.algebra import Vec3
from skyarm.control.exact.law import exact
from skyarm.control.exact.memory import Channel, ExactMemory, data
from skyarm.control.exact.observer import first_observed
from skyarm.control.exact.parameters import MODES, BaseGains, ExactParameters, ObserverGains, TipGains
from skyarm.control.model import JointGains, Model
from skyarm.control.registry import Controller, ControllerError
from skyarm.files import number, shown
from skyarm.scalars import minimum
from skyarm.vehicle.records import Vehicle

COMMON: Mapping[str, Any] = {
    "pull": 5.0,
    "tilt": 1.2,
    "reach": 0.12,
    "damping": 0.03,
    "posture": 1e-4,
    "shift_limit": 0.2,
    "continuation": 1.0,
    "trim_rate": 3.0,
    "measured_rates": 0.0,
}
"""Limits and weights of both presets; see :class:`ExactParameters`, :class:`TipGains` and :class:`BaseGains`."""

PRESETS: Mapping[str, Mapping[str, Any]] = {
    "robust": {
        **COMMON,
        "base": (20.0, 8.0, 200.0, 22.0),
        "yaw": (30.0, 9.0),
        "arm": (900.0, 60.0),
        "tip": (700.0, 53.0),
        "observer": (25.0, 30.0, 34.0, 60.0),
        "lag_inversion": 0.1,
        "adaptation": 0.3,
        "shift_rate": 4.0,
    },
    "stiff": {
        **COMMON,
        "base": (30.0, 10.5, 500.0, 36.0),
        "yaw": (60.0, 14.0),
        "arm": (1600.0, 80.0),
        "tip": (1600.0, 80.0),
        "observer": (40.0, 60.0, 60.0, 1e6),
        "lag_inversion": 1.0,
        "adaptation": 0.0,
        "shift_rate": 12.0,
    },
}
"""Gains on accelerations: base (kp, kv, KR, Kw), yaw (KR, Kw), arm and tip (kp, kd); bandwidths of the observer, rad/s.

"robust" was chosen under noise and one period of delay on perturbed plants, "stiff" on perfect state; both survive
10 ms of delay that they do not know.
"""


ENTRIES = tuple(PRESETS["robust"])
"""Entries of a preset: each may be replaced as an option of the law."""


def make_exact(
    model: Model,
    *,
    mode: str = "joint",
    preset: str = "robust",
    delay: float = 0.0,
    control_period: float = 0.005,
    reference_period: float = 0.02,
    tip_mass_limit: float = 0.2,
    **changes: Any,
) -> Controller:
    """The exact law for any vehicle.

    Args:
        model: what it believes.
        mode: "joint" (base and joints on their references) or "ee" (the tip on its reference).
        preset: a key of ``PRESETS``.
        delay: known age of the measurement, s, a whole number of control periods.
        control_period: s.
        reference_period: between published samples, s.
        tip_mass_limit: kg.
        changes: entries of the preset to replace.

    Raises:
        ControllerError: an unknown mode or preset, a delay that is no whole number of periods, or no end effector.
        AllocationError: the rotors do not span torque and thrust.
    """
    if mode not in MODES:
        raise ControllerError(f"controller.mode = {shown(mode)}: must be one of {list(MODES)}")
    if preset not in PRESETS:
        raise ControllerError(f"controller.preset = {shown(preset)}: must be one of {sorted(PRESETS)}")
    vehicle = model.vehicle
    if (mode == "ee" or changes.get("adaptation", 0.0)) and not vehicle.end_effector:
        raise ControllerError(f"model.vehicle = {vehicle.name!r}: has no end_effector, which mode 'ee' must have")
    periods = round(delay / control_period)
    if delay < 0.0 or abs(periods * control_period - delay) > 1e-9:
        raise ControllerError(
            f"controller.delay = {delay!r}: must be a whole number of control periods of {control_period:g} s"
        )
    gains = {**PRESETS[preset], **{name: _checked(name, value) for name, value in changes.items()}}
    # a task of the tip is what an unknown load at the tip spoils
    adaptation = gains["adaptation"] if "adaptation" in changes or (mode == "ee" and vehicle.n) else 0.0
    kp, kv, kr, kw = gains["base"]
    yaw_kr, yaw_kw = gains["yaw"]
    stiffness, damping = gains["arm"]
    par = ExactParameters(
        model=model,
        mixer=_mixer(vehicle),
        mode=mode,
        base=BaseGains(
            position=Vec3(kp, kp, kp),
            velocity=Vec3(kv, kv, kv),
            attitude=Vec3(kr, kr, yaw_kr),
            rate=Vec3(kw, kw, yaw_kw),
            pull=gains["pull"],
        ),
        joint_gains=JointGains(stiffness=(stiffness,) * vehicle.n, damping=(damping,) * vehicle.n),
        tip=TipGains(
            **dict(zip(("position", "velocity"), gains["tip"], strict=True)),
            reach=gains["reach"],
            damping=gains["damping"],
            posture=gains["posture"],
            shift_rate=gains["shift_rate"],
            shift_limit=gains["shift_limit"],
        ),
        observer=ObserverGains(**dict(zip(("force", "torque", "joints", "pose"), gains["observer"], strict=True))),
        delay_periods=periods,
        reference_period=reference_period,
        continuation=gains["continuation"],
        lag_inversion=gains["lag_inversion"],
        trim_rate=gains["trim_rate"],
        measured_rates=gains["measured_rates"],
        tilt=gains["tilt"],
        thrust_floor=0.15 * vehicle.mass * model.gravity + 1e-3,
        adaptation=adaptation,
        tip_mass_limit=tip_mass_limit,
        adapts=adaptation > 0.0,
    )
    return Controller(name=f"exact_{mode}", law=exact, par=par, memory=first_memory(model, periods))


def _checked(name: str, value: Any) -> Any:
    """A preset's entry of its own kind: numbers that are not negative.

    Raises:
        ControllerError: no such entry, another count, or something that is no such number.
    """
    if name not in ENTRIES:
        raise ControllerError(f"controller.{name}: must be one of {sorted(ENTRIES)}")
    example = PRESETS["robust"][name]
    if not isinstance(example, tuple):
        return number(value, f"controller.{name}", low=0.0)
    if not isinstance(value, (list, tuple)) or len(value) != len(example):
        raise ControllerError(f"controller.{name} = {shown(value)}: must be {len(example)} numbers")
    return tuple(number(each, f"controller.{name}[{i}]", low=0.0) for i, each in enumerate(value))


def _mixer(vehicle: Vehicle) -> Mixer:
    try:
        return make_mixer(vehicle, "priority")
    except AllocationError:
        return make_mixer(vehicle)


def first_memory(model: Model, delay_periods: int) -> ExactMemory:
    """Memory before the first step: a level hover with the joints at zero, as the model sees it."""
    vehicle = model.vehicle
    trim = hover_trim(vehicle, (0.0,) * vehicle.n, model.gravity)
    speeds = tuple(data(minimum(w, r.max_speed)) for w, r in zip(trim.speeds, vehicle.rotors, strict=True))
    zero = Vec3(0.0, 0.0, 0.0)
    standing = Command(rotor_speeds=speeds, efforts=tuple(data(effort) for effort in trim.efforts))
    return ExactMemory(
        started=0.0,
        age=0.0,
        channels=(Channel(),) * (4 + vehicle.n),
        observed=first_observed(vehicle.n, speeds),
        sent=(standing,) * (delay_periods + 1),
        free=(1.0,) * (1 + vehicle.n),
        slow_force=zero,
        trim=(0.0,) * len(speeds),
        tip_mass=0.0,
    )
