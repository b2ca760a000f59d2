"""Options of the centroidal law: defaults, ranges, presets, checks."""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping
from collections.abc import Set as AbstractSet
from typing import Any, NoReturn

import numpy as np

from skyarm.algebra import Mat3
from skyarm.control.controller import ControllerError
from skyarm.dynamics import mass_matrix
from skyarm.dynamics.kinematics import chain, jacobian_columns
from skyarm.records.files import errors_as, number, shown
from skyarm.vehicle.linkage import BASE
from skyarm.vehicle.vehicle_records import Vehicle

OPTIONS: Mapping[str, tuple[Any, float, float]] = {
    "pull": (5.0, 1e-3, 1e3),
    "tilt": (1.2, 1e-3, 10.0),
    "reach": (0.12, 1e-3, 1e3),
    "damping": (0.03, 1e-6, 1e3),
    "posture": (1e-4, 1e-9, 1e3),
    "trim_rate": (3.0, 0.0, 50.0),
    "adaptation": (0.6, 0.0, 5.0),
    "friction_adaptation": (2.0, 0.0, 5.0),
    "bandwidth": (1.0, 0.01, 10.0),
    "preview": (0.0, 0.0, 2.0),
    "gust_shift": (0.0, 0.0, 2.0),
    "gust_rate": (0.0, 0.0, 2.0),
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
    "velocity_noise": (0.0, 0.0, 1.0),
    "accelerometer": ((0.0, 0.0), 0.0, 1e3),
    "interaction": ((0.0, 0.0), 0.0, 1e3),
    "load": (0.0, 0.0, 1e3),
    "force_sensor": (False, 0.0, 1.0),
    "tolerances": ((0.0, 0.0), 0.0, 1.0),
    "lag_inversion": (0.1, 0.0, 1.0),
    "shift_rate": (3.0, 0.0, 1e3),
}
"""Options with the values of "robust", and the lowest and highest value; see :class:`CentroidalParameters`."""

COMMON: Mapping[str, Any] = {name: value for name, (value, *_) in OPTIONS.items()}

RANGES: Mapping[str, tuple[float, float]] = {
    name: (low, high) for name, (value, low, high) in OPTIONS.items() if type(value) is not bool and high < math.inf
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
    "preview": 0.6,
    "low_thrust": 0.8,
    "arm_turn": 20.0,
    "pull": 8.0,
    "approach": 2.0,
    "force_trend": 10.0,
    "yaw_slack": 5.0,
    "thrust_lead": True,
    "joint_limits": True,
    "lag": (0.02, 0.012),
    "velocity_noise": 0.0018,
}

PRESETS: Mapping[str, Mapping[str, Any]] = {
    "robust": ROBUST,
    "adaptive": ADAPTIVE,
    "gusts": {
        **ADAPTIVE,
        "accelerometer": (30.0, 5.0),
        "velocity_noise": 0.0,
        "gust_shift": 0.7,
        "gust_rate": 1.0,
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

"robust" was chosen under noise and one period of delay on perturbed plants, "stiff" on perfect state; both survive
10 ms of unknown delay. "adaptive" has ten parts beyond "robust", each left out by 0 or False; "gusts" needs a
specific force. ``bandwidth`` scales all gains of a preset.
"""

ENTRIES = tuple(ROBUST)
"""Entries of a preset: each may be replaced as an option of the law."""

RETIRED = ("shift_bandwidth", "swing_rate", "path_rate")
"""Entries of version 0.3, which are read once more: ``preview`` does their work."""

PERIODS = (1e-5, 10.0)
"""Shortest and longest period, s, of control and of published samples."""

OLDEST = 100
"""Control periods: the largest known delay; each one is a step of the model in the compiled law."""

PRESETS_ARM = 0.3
"""m, length of the arm on which the presets were chosen."""

PRESETS_LAG = 0.5 * (0.0125 + 0.025)
"""s, mean time constant of the motors that the presets were chosen with."""

SHORTEST = 0.01
"""m, length that an arm is given at least; one whose tip sits on its first joint has none."""


def name_of(mode: str, preset: str) -> str:
    """Catalogue name of the law for a mode and preset; the preset "adaptive" has no suffix."""
    return f"centroidal_{mode}" if preset == "adaptive" else f"centroidal_{mode}_{preset}"


def without_preset(name: str) -> str:
    """Law name without a centroidal preset's suffix; other names unchanged."""
    for preset in PRESETS:
        if name in (name_of(mode, preset) for mode in ("joint", "tip")):
            return name.removesuffix(f"_{preset}")
    return name


def arm_length(vehicle: Vehicle) -> float:
    """Length of the arm from its first joint to the tip, m, along its links; sliding joints are at zero."""
    frame = vehicle.frame()
    total, index = math.hypot(*map(float, frame.position)), frame.link
    while index != BASE and vehicle.moving[index].parent != BASE:
        total += math.hypot(*map(float, vehicle.moving[index].joint.position))
        index = vehicle.moving[index].parent
    return total


def fit_gains(
    gains: Mapping[str, Any], given: AbstractSet[str], preset: str, mode: str, vehicle: Vehicle
) -> dict[str, Any]:
    """Entries of a preset that go with the vehicle, but for those that were given."""
    found: dict[str, Any] = {} if vehicle.n else {"arm_turn": 0.0}
    if preset in ("adaptive", "gusts") and mode == "tip" and vehicle.end_effector:
        # both go with the root of the arm's length: the preview is as long as its pendulum swings
        found |= {name: gains[name] * damping_share(vehicle) for name in ("damping", "preview")}
        if not any(gains["interaction"]):
            found["tip"] = gains["tip"][0], gains["tip"][1] * tip_damping_share(vehicle)
            if not gains["load"]:
                light, (force, torque, joints, pose) = tip_lightness(vehicle), gains["observer"]
                found["tip"] = found["tip"][0] / min(light, LIGHTEST), found["tip"][1]
                found["observer"] = force, torque, joints * min(light, QUICKEST), pose
                found["reach"] = min(gains["reach"], slide_room(vehicle))
    found["velocity_noise"] = gains["velocity_noise"] * noise_share(vehicle)
    return {name: value for name, value in found.items() if name not in given or name == "arm_turn"}


def damping_share(vehicle: Vehicle) -> float:
    """Scale of the presets' damping: root of the arm length over that of the vehicle the presets were tuned on.

    Small errors of height fold a longer arm that hangs straight. A damping that grows as the length costs a hover's
    accuracy under noise two thirds, one that grows as its root a tenth to a third; both hold the arm.
    """
    return math.sqrt(max(arm_length(vehicle), SHORTEST) / PRESETS_ARM)


SLIDING = 1.6
"""Of the tip's damping, of an arm with sliding joints between limits: of 200 wrong plants of an octocopter 45 were lost
with 1, 9 with 1.6, 4 with 2.1, which shakes the rotors by a fifth more."""


def tip_damping_share(vehicle: Vehicle) -> float:
    """Scale of the presets' damping of the tip: more for an arm with sliding joints between limits.

    A load that nobody told of acts on a sliding joint in full, without a lever. It divides both gains by the inertia it
    adds, and under the observer's integrator the loop swings beyond the limits.
    """
    return SLIDING if math.isfinite(slide_room(vehicle)) else 1.0


PRESETS_MOBILITY = 38.0
"""Mass of the vehicle over the tip's least inertia, of the vehicle that the presets were chosen on."""

LIGHTEST, QUICKEST = 1.6, 1.5
"""Most that a light tip takes from the stiffness, and gives to the bandwidth of the joints' observer: with both, of 400
wrong plants of a hexarotor with six joints 34 are lost, 121 without; of the octocopter 3 and 34. With
3 for 1.6 the hexarotor loses 37 and errs by a tenth more in turbulence of 6 m/s."""


def tip_lightness(vehicle: Vehicle) -> float:
    """Share, at least 1, by which the tip is lighter against its vehicle than the presets' tip.

    An unknown load goes with the vehicle's mass. It divides the gains by the tip's growth in inertia, which leaves the
    loop less damped under its observer's integrator: less stiffness and a faster observer keep it damped. The tip's
    mobility, with the base held and joints at zero, is the largest eigenvalue of J M^-1 J^T.

    Source: Khatib 1987 (operational-space inertia).
    """
    if not vehicle.n:
        return 1.0
    rest = (0.0,) * vehicle.n
    M = np.array(mass_matrix(vehicle, Mat3.identity(), rest), dtype=float)[6:, 6:]
    columns = jacobian_columns(vehicle, vehicle.frame(), rest)
    J = np.array([list(column.linear) for column in columns], dtype=float).T
    mobility = float(np.linalg.eigvalsh(J @ np.linalg.solve(M, J.T))[-1])
    return max(1.0, mobility * float(vehicle.mass) / PRESETS_MOBILITY)


def slide_room(vehicle: Vehicle) -> float:
    """Half of the shortest range of the sliding joints that carry the tip, m, not below the option's least.

    An arm cannot take back more of the base's error. A gripper's finger or another arm does not count.
    """
    joints = [vehicle.links[i].joint for i in chain(vehicle, vehicle.frame().link)]
    rooms = (0.5 * (float(j.upper) - float(j.lower)) for j in joints if not j.turns)
    return max(min(rooms, default=math.inf), OPTIONS["reach"][1])


def noise_share(vehicle: Vehicle) -> float:
    """Scale of the presets' velocity noise: mean time constants of the paper's motors over the slowest's, at most 1.

    Inverting the lag of a motor amplifies noise of the wanted speed by about its time constant over the period.
    """
    times = (0.5 * (float(rotor.time_constant_up) + float(rotor.time_constant_down)) for rotor in vehicle.rotors)
    return PRESETS_LAG / max(PRESETS_LAG, *times)


def refuse(name: str, value: Any, words: str) -> NoReturn:
    """Raise the one-line error for an option's value, with the allowed values."""
    raise ControllerError(f"controller.{name} = {shown(value)}: must be {words}")


def number_within(name: str, value: Any, low: float, high: float = math.inf) -> float:
    """Finite number between ``low`` and ``high`` from an option's value."""
    with errors_as(ControllerError):
        held = number(value, f"controller.{name}", low=low)
    return held if held <= high else refuse(name, value, f"at most {high:g}")


class DeprecatedOptionWarning(UserWarning):
    """An option of a law that the next version does not read."""


def without_retired(changes: Mapping[str, Any]) -> dict[str, Any]:
    """Options without those of the version before, with a warning in one line; a shift left out then stays out."""
    found = {name: value for name, value in changes.items() if name not in RETIRED}
    for name in RETIRED:
        if name in changes:
            value = number_within(name, changes[name], 0.0)
            words = f"controller.{name} = {shown(value)}: the next version does not read it; write preview, s"
            warnings.warn(words, DeprecatedOptionWarning, stacklevel=3)
    if changes.get("shift_bandwidth", 1.0) == 0.0:
        found.setdefault("preview", 0.0)
    return found


def check_entry(name: str, value: Any) -> Any:
    """Option value of a preset after a check of type and range.

    Raises:
        ControllerError: no such entry, another count, or something that is no such number.
    """
    if name not in ENTRIES:
        raise ControllerError(f"controller.{name}: must be one of {sorted(ENTRIES)}")
    example, limits = ROBUST[name], RANGES.get(name, (0.0, math.inf))
    if type(example) is bool:
        return value if type(value) is bool else refuse(name, value, "true or false")
    if type(example) is not tuple:
        return number_within(name, value, *limits)
    if type(value) not in (list, tuple) or len(value) != len(example):
        refuse(name, value, f"{len(example)} numbers")
    return tuple(number_within(f"{name}[{i}]", each, *limits) for i, each in enumerate(value))


def must_act(changes: Mapping[str, Any], gains: Mapping[str, Any], mode: str, admits: bool) -> None:
    """Reject options that have no effect because another option is missing."""
    if changes.get("gust_shift") and not gains["preview"]:
        refuse("gust_shift", changes["gust_shift"], "0 without preview")
    if changes.get("gust_shift") and mode != "tip":
        refuse("gust_shift", changes["gust_shift"], f"0 in mode {mode!r}")
    if changes.get("gust_rate") and not any(gains["accelerometer"]):
        refuse("gust_rate", changes["gust_rate"], "0 without an accelerometer")
    if gains["force_sensor"] and not (admits or any(gains["interaction"])):
        raise ControllerError("controller.force_sensor = true: must be false without interaction")
    if changes.get("velocity_noise") and any(gains["accelerometer"]):
        refuse("velocity_noise", changes["velocity_noise"], "0 with an accelerometer")
    if any(gains["tolerances"]) and not any(gains["interaction"]):
        refuse("tolerances", gains["tolerances"], "twice 0 without interaction")
    if any(gains["attitude"]) and not gains["sideways"]:
        refuse("attitude", gains["attitude"], "level without the option sideways")
    for name, unit in (("accelerometer", "bandwidths"), ("lag", "lengths")):
        if any(gains[name]) and not all(gains[name]):
            refuse(name, gains[name], f"two {unit} above 0, or twice 0")


def periods_of(delay: Any, control_period: Any, name: str = "delay") -> int:
    """Known delay, an option of that name, as a whole number of control periods.

    Raises:
        ControllerError: no whole number of them, too many, or a period that is none.
    """
    period = number_within("control_period", control_period, *PERIODS)
    seconds = number_within(name, delay, 0.0, OLDEST * period * (1.0 + 1e-9))
    periods = round(seconds / period)
    if abs(periods * period - seconds) > 1e-9:
        refuse(name, delay, f"a whole number of control periods of {period:g} s")
    return periods
