"""Presets of the centroidal law, and the ranges of their entries.

Options of the centroidal law, refused by name and value where they make no sense.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from skyarm.algebra import Vec3
from skyarm.control.controller import ControllerError
from skyarm.records.files import number, shown
from skyarm.vehicle.linkage import BASE
from skyarm.vehicle.vehicle_records import Vehicle

OPTIONS: Mapping[str, tuple[Any, float, float]] = {
    "pull": (5.0, 1e-3, 1e3),
    "tilt": (1.2, 1e-3, 10.0),
    "reach": (0.12, 1e-3, 1e3),
    "damping": (0.03, 1e-6, 1e3),
    "posture": (1e-4, 1e-9, 1e3),
    "shift_limit": (0.2, 1e-6, 1e3),
    "continuation": (1.0, 0.0, 1.0),
    "trim_rate": (3.0, 0.0, 50.0),
    "measured_rates": (0.0, 0.0, 1.0),
    "adaptation": (0.6, 0.0, 5.0),
    "friction_adaptation": (2.0, 0.0, 5.0),
    "bandwidth": (1.0, 0.01, 10.0),
    "shift_bandwidth": (0.0, 0.0, 1e3),
    "gust_shift": (0.0, 0.0, 2.0),
    "swing_rate": (0.0, 0.0, 50.0),
    "path_rate": (0.0, 0.0, 50.0),
    "low_thrust": (0.0, 0.0, 1.0),
    "arm_turn": (0.0, 0.0, 1e6),
    "sideways": (0.0, 0.0, 1.0),
    "attitude": ((0.0, 0.0), -1.0, 1.0),
    "approach": (0.0, 0.0, 1e3),
    "force_trend": (0.0, 0.0, 1e3),
    "yaw_slack": (0.0, 0.0, 1e6),
    "thrust_lead": (False, 0.0, 1.0),
    "joint_limits": (False, 0.0, 1.0),
    "lag": ((0.0, 0.0), 0.0, math.inf),
    "accelerometer": ((0.0, 0.0), 0.0, 1e3),
    "hull_drag": (False, 0.0, 1.0),
    "wind": ((0.0, 0.0, 0.0), -100.0, 100.0),
    "interaction": ((0.0, 0.0), 0.0, 1e3),
    "load": (0.0, 0.0, 1e3),
    "force_sensor": (False, 0.0, 1.0),
    "lag_inversion": (0.1, 0.0, 1.0),
    "shift_rate": (3.0, 0.0, 1e3),
}
"""Options with the values of "robust", and the lowest and highest value; see :class:`CentroidalParameters`."""

COMMON: Mapping[str, Any] = {name: value for name, (value, *_) in OPTIONS.items()}

RANGES: Mapping[str, tuple[float, float]] = {
    name: (low, high) for name, (value, low, high) in OPTIONS.items() if not isinstance(value, bool) and high < math.inf
}
"""Of entries that are numbers; the others are gains, at least 0."""

ROBUST: Mapping[str, Any] = {
    **COMMON,
    "base": (22.0, 8.5, 205.0, 22.5),
    "yaw": (30.0, 9.0),
    "arm": (900.0, 60.0),
    "tip": (700.0, 53.0),
    "observer": (27.0, 31.0, 34.0, 60.0),
}

ADAPTIVE: Mapping[str, Any] = {
    **ROBUST,
    "shift_bandwidth": 60.0,
    "swing_rate": 2.0,
    "path_rate": 2.0,
    "low_thrust": 0.8,
    "arm_turn": 20.0,
    "pull": 8.0,
    "approach": 2.0,
    "shift_limit": 0.4,
    "force_trend": 10.0,
    "yaw_slack": 5.0,
    "thrust_lead": True,
    "joint_limits": True,
    "lag": (0.02, 0.012),
}

PRESETS: Mapping[str, Mapping[str, Any]] = {
    "robust": ROBUST,
    "adaptive": ADAPTIVE,
    "gusts": {
        **ADAPTIVE,
        "base": (22.0, 8.5, 240.0, 24.4),
        "tip": (900.0, 60.0),
        "reach": 0.25,
        "lag_inversion": 0.25,
        "accelerometer": (40.0, 5.0),
        "gust_shift": 0.7,
    },
    "stiff": {
        **COMMON,
        "base": (30.0, 10.5, 500.0, 36.0),
        "yaw": (60.0, 14.0),
        "arm": (1600.0, 80.0),
        "tip": (1600.0, 80.0),
        "observer": (40.0, 60.0, 60.0, 1e6),
        "lag_inversion": 1.0,
        "shift_rate": 12.0,
    },
}
"""Gains on accelerations: base (kp, kv, KR, Kw), yaw (KR, Kw), arm and tip (kp, kd); bandwidths of the observer, rad/s.

"robust" was chosen under noise and one period of delay on perturbed plants, "stiff" on perfect state, where base and
joints are off by half as much as with "adaptive", but not the tip along a path; both survive 10 ms of delay that they
do not know. "adaptive" has the gains of "robust" and eleven parts more, each left out by 0 or
False: motion of the base's shift, the pace of the arm's swing and of the path, an attitude towards upright at low
thrust, a limit of what the base does for the arm, braking in time, the trend of the force, thrust before yaw, thrust
ahead of the motors, joints kept off their limits, and a bandwidth by the lag that it finds (s beyond 2 ms that leave
half of it, of the rotors' and the joints' loops). "gusts" is for measurements with a specific
force; docs/centroidal_law.md#gusts has its numbers, also on seeds that it was not chosen on.
``bandwidth`` scales all gains of a preset.
"""

ENTRIES = tuple(PRESETS["robust"])
"""Entries of a preset: each may be replaced as an option of the law."""

PERIODS = (1e-5, 10.0)
"""Shortest and longest period, s, of control and of published samples."""


def name_of(mode: str, preset: str) -> str:
    """Name of the law, that of the catalogue's preset: "adaptive" is the one that is not named."""
    return f"centroidal_{mode}" if preset == "adaptive" else f"centroidal_{mode}_{preset}"


def without_preset(name: str) -> str:
    """The name of a law as all presets of the centroidal law have it in a mode; any other law's as it stands."""
    for preset in PRESETS:
        if name in (name_of(mode, preset) for mode in ("joint", "tip")):
            return name.removesuffix(f"_{preset}")
    return name


OLDEST = 100
"""Control periods: the largest known delay; each one is a step of the model in the compiled law."""


PRESETS_ARM = 0.3
"""m, length of the arm on which the presets were chosen."""

SHORTEST = 0.01
"""m, length that an arm is given at least; one whose tip sits on its first joint has none."""


def arm_length(vehicle: Vehicle) -> float:
    """Length of the arm from its first joint to the tip, m, along its links; what slides is at zero."""
    frame = vehicle.frame()
    total, index = _size(frame.position), frame.link
    while index != BASE and vehicle.moving[index].parent != BASE:
        total += _size(vehicle.moving[index].joint.position)
        index = vehicle.moving[index].parent
    return total


def damping_share(vehicle: Vehicle) -> float:
    """Share of the presets' damping for a vehicle's arm: the root of its length over theirs.

    A longer arm that hangs straight takes small errors of height for calls to fold: 44 N that push the tip of a vehicle
    of 12 kg up and down drove its arm of 0.81 m to 0.5 m of error. A damping that grows as the length costs a hover's
    accuracy under noise two thirds, one that grows as its root a tenth to a third, and both hold the arm.
    """
    return math.sqrt(max(arm_length(vehicle), SHORTEST) / PRESETS_ARM)


def _size(offset: Vec3) -> float:
    return math.hypot(*(float(c) for c in offset))


def one_of(name: str, value: Any, words: Sequence[str]) -> None:
    """Refuse what is none of some words."""
    if not isinstance(value, str) or value not in words:
        raise ControllerError(f"controller.{name} = {shown(value)}: must be one of {list(words)}")


def number_within(name: str, value: Any, low: float, high: float = math.inf) -> float:
    """A finite number from ``low`` to ``high``."""
    try:
        held = number(value, f"controller.{name}", low=low)
    except ValueError as error:
        raise ControllerError(str(error)) from None
    if held > high:
        raise ControllerError(f"controller.{name} = {shown(value)}: must be at most {high:g}")
    return held


def check_entry(name: str, value: Any) -> Any:
    """A preset's entry of its own kind, within its range.

    Raises:
        ControllerError: no such entry, another count, or something that is no such number.
    """
    if name not in ENTRIES:
        raise ControllerError(f"controller.{name}: must be one of {sorted(ENTRIES)}")
    example = PRESETS["robust"][name]
    if isinstance(example, bool):
        if not isinstance(value, bool):
            raise ControllerError(f"controller.{name} = {shown(value)}: must be true or false")
        return value
    if not isinstance(example, tuple):
        return number_within(name, value, *RANGES[name])
    if not isinstance(value, (list, tuple)) or len(value) != len(example):
        raise ControllerError(f"controller.{name} = {shown(value)}: must be {len(example)} numbers")
    limits = RANGES.get(name, (0.0, math.inf))
    return tuple(number_within(f"{name}[{i}]", each, *limits) for i, each in enumerate(value))


def must_act(changes: Mapping[str, Any], gains: Mapping[str, Any], mode: str) -> None:
    """Refuse options that need others, without which they do nothing."""
    for name in ("gust_shift", "swing_rate", "path_rate"):
        allowed = "" if gains["shift_bandwidth"] > 0.0 else "0 without shift_bandwidth"
        if name == "gust_shift" and mode != "tip":
            allowed = allowed or f"0 in mode {mode!r}"
        if changes.get(name) and allowed:
            raise ControllerError(f"controller.{name} = {shown(changes[name])}: must be {allowed}")
    if any(gains["attitude"]) and not gains["sideways"]:
        at = f"controller.attitude = {shown(gains['attitude'])}"
        raise ControllerError(f"{at}: must be level without the option sideways")


def periods_of(delay: Any, control_period: Any) -> int:
    """Control periods of a known delay.

    Raises:
        ControllerError: no whole number of them, too many, or a period that is none.
    """
    period = number_within("control_period", control_period, *PERIODS)
    seconds = number_within("delay", delay, 0.0, OLDEST * period * (1.0 + 1e-9))
    periods = round(seconds / period)
    if abs(periods * period - seconds) > 1e-9:
        raise ControllerError(
            f"controller.delay = {shown(delay)}: must be a whole number of control periods of {period:g} s"
        )
    return periods
