"""Options of the centroidal law: default values, ranges, adaptation to the vehicle,
checks.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from collections.abc import Set as AbstractSet
from typing import Any, NoReturn

import numpy as np

from skyarm.control.controller import ControllerError, LawOptions, OptionRanges
from skyarm.control.laws.centroidal.contact import options as contact
from skyarm.control.laws.centroidal.noise_estimate import noise_share
from skyarm.control.laws.centroidal.parameters import SHARES
from skyarm.control.laws.centroidal.tilting import options as tilting
from skyarm.dynamics import mass_matrix_at_rest
from skyarm.dynamics.kinematics import chain, jacobian_columns
from skyarm.records.files import errors_as, must_be_one_of, number, shown
from skyarm.vehicle import BASE, Vehicle

GAINS: Mapping[str, tuple[float, ...]] = {
    "base": (22.0, 8.5, 205.0, 22.5),
    "yaw": (30.0, 9.0),
    "arm": (900.0, 60.0),
    "tip": (700.0, 53.0),
    "observer": (27.0, 31.0, 34.0, 60.0),
}
"""Gains on accelerations: base (kp, kv, KR, Kw), yaw (KR, Kw), arm and tip (kp, kd);
bandwidths of the observer, rad/s.

They were chosen under noise and one period of delay on perturbed plants.
"""

OPTIONS: OptionRanges = {
    "bandwidth": (1.0, 0.01, 10.0),
    "tilt": (1.2, 1e-3, 10.0),
    "reach": (0.12, 1e-3, 1e3),
    "damping": (0.03, 1e-6, 1e3),
    "posture": (1e-4, 1e-9, 1e3),
    "preview": (0.6, 0.0, 2.0),
    "shift_rate": (3.0, 0.0, 1e3),
    "force_trend": (20.0, 0.0, 1e3),
    "accelerometer": ((40.0, 8.0), 0.0, 1e3),
    "lag": ((0.02, 0.012), 0.0, math.inf),
    "adaptation": (2.0, 0.0, 5.0),
}
"""Default value and range of each option; see :class:`CentroidalParameters`."""

_NUMBERS = {**OPTIONS, **contact.OPTIONS, **tilting.OPTIONS}

VALUES: LawOptions = {
    **GAINS,
    **{name: value for name, (value, *_) in _NUMBERS.items()},
}
"""Default value of each option. ``bandwidth`` scales all gains."""

RANGES: Mapping[str, tuple[float, float]] = {
    name: (low, high)
    for name, (value, low, high) in _NUMBERS.items()
    if type(value) is not bool and high < math.inf
}
"""Ranges of the options that are not gains; gains are at least 0."""

ENTRIES = tuple(VALUES)
"""Names of the options of the centroidal law."""

PERIODS = (1e-5, 10.0)
"""Shortest and longest period (s) of control and of reference samples."""

OLDEST = 100
"""Largest known delay (control periods); each one is a step of the model in the
compiled law."""

ARM = 0.3
"""Length (m) of the arm for which the gains were chosen."""

SHORTEST = 0.01
"""Least arm length (m) that gains are scaled with; an arm whose tip sits on its first
joint has none."""


def arm_length(vehicle: Vehicle) -> float:
    """Length (m) of the arm along its links, from its first joint to the tip; sliding
    joints are at zero.
    """
    frame = vehicle.frame()
    total = math.hypot(*map(float, frame.position))
    index = frame.link
    while index != BASE and vehicle.moving[index].parent != BASE:
        total += math.hypot(*map(float, vehicle.moving[index].joint.position))
        index = vehicle.moving[index].parent
    return total


def fit_gains(
    gains: LawOptions,
    given: AbstractSet[str],
    mode: str,
    vehicle: Vehicle,
    *,
    presses: bool,
    carries: bool,
) -> dict[str, Any]:
    """Default options scaled to the vehicle, except those that the user gave; fewer for
    contact or carried loads.
    """
    # the rate of a noisy force turns the attitude, which swings about the tracker's
    # pole on motors that are slower
    fitted: dict[str, Any] = {
        "force_trend": gains["force_trend"] * math.sqrt(noise_share(vehicle))
    }
    if carries:
        heard, velocity = gains["accelerometer"]
        fitted["accelerometer"] = heard * CARRYING, velocity
    if mode == "tip" and vehicle.end_effector:
        # both go with the root of the arm's length: the preview is as long as its
        # pendulum swings, and small errors of height fold a longer arm that hangs
        # straight. A damping that grows as the length costs a hover's accuracy under
        # noise two thirds, one that grows as its root a tenth to a third; both hold it
        longer = math.sqrt(max(arm_length(vehicle), SHORTEST) / ARM)
        fitted |= {name: gains[name] * longer for name in ("damping", "preview")}
        if not presses:
            kp, kd = gains["tip"]
            room = slide_room(vehicle)
            if math.isfinite(room):
                kd *= SLIDING
            if not carries:
                light = tip_lightness(vehicle)
                kp /= min(light, LIGHTEST)
                force, torque, joints, pose = gains["observer"]
                fitted["observer"] = force, torque, joints * min(light, QUICKEST), pose
                fitted["reach"] = min(gains["reach"], room)
            fitted["tip"] = kp, kd
    return {name: value for name, value in fitted.items() if name not in given}


def preview_of(
    gains: LawOptions, mode: str, late: float, *, given: bool
) -> float | None:
    """Length (s) of the reference preview, at least such that its first sample is
    always in the future; None for none.

    Args:
        gains: the law's options.
        mode: "tip" or "joint".
        late: s, from a published sample to the next, and further as commands are known
            to be late.
        given: whether the user has set it.
    """
    preview = gains["preview"]
    least = late / SHARES[0]
    # in joint mode no tip is foreseen
    if mode != "tip" or not preview:
        return None
    # equal but for rounding is enough
    if preview < least * (1.0 - 1e-9):
        if given:
            refuse(
                "preview",
                preview,
                f"0, or at least {least:g} s, {1.0 / SHARES[0]:g} times the sum of the"
                " reference's period and the delay of commands",
            )
        # a preview longer than the option allows is not made up: the law flies without
        # one
        return least if least <= OPTIONS["preview"][2] else None
    return float(preview)


CARRYING = 0.75
"""Factor on the accelerometer's bandwidth for a vehicle that picks up loads. A box that
stands holds the tip, and the arm buckles under a force that is pressed on it. Of 256
flights that pick a box 15 lost it with 1."""


SLIDING = 1.6
"""Factor on the tip's damping for an arm with sliding joints between limits. Of 200
wrong plants of an octocopter 45 were lost with 1, 9 with 1.6, 4 with 2.1, which shakes
the rotors by a fifth more.

A load that nobody told of acts on a sliding joint in full, without a lever. It divides
both gains by the inertia it adds, and under the observer's integrator the loop swings
beyond the limits.
"""


MOBILITY = 38.0
"""Ratio of vehicle mass to least tip inertia, for the vehicle for which the gains were
chosen."""

LIGHTEST, QUICKEST = 1.6, 1.5
"""Largest factors by which a light tip divides the stiffness, and multiplies the joint
observer's bandwidth. With both, of 400 wrong plants of a hexarotor with six joints 34
are lost, 121 without; of the octocopter 3 and 34. With 3 for 1.6 the hexarotor loses 37
and errs by a tenth more in turbulence of 6 m/s."""


def tip_lightness(vehicle: Vehicle) -> float:
    """Ratio of vehicle mass to tip inertia, relative to the vehicle for which the gains
    were chosen; at least 1.

    An unknown load goes with the vehicle's mass. It divides the gains by the tip's
    growth in inertia, which leaves the loop less damped under its observer's
    integrator: less stiffness and a faster observer keep it damped. The tip's mobility,
    with the base held and joints at zero, is the largest eigenvalue of J M^-1 J^T.

    Source: Khatib 1987 (operational-space inertia).
    """
    if not vehicle.n:
        return 1.0
    M = np.array(mass_matrix_at_rest(vehicle), dtype=float)[6:, 6:]
    columns = jacobian_columns(vehicle, vehicle.frame(), vehicle.zeros)
    J = np.array([list(column.linear) for column in columns], dtype=float).T
    mobility = float(np.linalg.eigvalsh(J @ np.linalg.solve(M, J.T))[-1])
    return max(1.0, mobility * float(vehicle.mass) / MOBILITY)


def slide_room(vehicle: Vehicle) -> float:
    """Half of the shortest range (m) of the sliding joints between base and tip, at
    least the option's lower bound.

    An arm cannot take back more of the base's error. A gripper's finger or another arm
    does not count.
    """
    joints = [vehicle.links[i].joint for i in chain(vehicle, vehicle.frame().link)]
    rooms = (0.5 * (float(j.upper) - float(j.lower)) for j in joints if not j.turns)
    return max(min(rooms, default=math.inf), OPTIONS["reach"][1])


def refuse(name: str, value: object, words: str) -> NoReturn:
    """Raise the one-line error for an option's value, with the allowed values."""
    raise ControllerError(f"controller.{name} = {shown(value)}: must be {words}")


def number_within(
    name: str, value: object, low: float, high: float = math.inf
) -> float:
    """Finite number between ``low`` and ``high`` from an option's value."""
    with errors_as(ControllerError):
        numeric = number(value, f"controller.{name}", low=low)
    return numeric if numeric <= high else refuse(name, value, f"at most {high:g}")


def check_entry(name: str, value: Any) -> float | tuple[float, ...]:
    """Value of an option after a check of type and range.

    Raises:
        ControllerError: no such option, another count, or something that is no such
            number.
    """
    if name not in ENTRIES:
        raise ControllerError(
            f"controller.{name}: {must_be_one_of(sorted(ENTRIES), name)}"
        )
    example = VALUES[name]
    limits = RANGES.get(name, (0.0, math.inf))
    if type(example) is bool:
        return value if type(value) is bool else refuse(name, value, "true or false")
    if type(example) is not tuple:
        return number_within(name, value, *limits)
    if type(value) not in (list, tuple) or len(value) != len(example):
        refuse(name, value, f"{len(example)} numbers")
    return tuple(
        number_within(f"{name}[{i}]", each, *limits) for i, each in enumerate(value)
    )


def must_be_whole(gains: LawOptions) -> None:
    """Reject an option of two numbers of which only one is 0."""
    for name, unit in (("accelerometer", "bandwidths"), ("lag", "lengths")):
        if any(gains[name]) and not all(gains[name]):
            refuse(name, gains[name], f"two {unit} above 0, or twice 0")


def periods_of(delay: Any, control_period: Any, name: str = "delay") -> int:
    """Known delay, given in seconds by an option, as a whole number of control periods.

    Raises:
        ControllerError: no whole number of them, too many, or a period that is none.
    """
    period = number_within("control_period", control_period, *PERIODS)
    seconds = number_within(name, delay, 0.0, OLDEST * period * (1.0 + 1e-9))
    periods = round(seconds / period)
    # the quotient rounds, and a nanosecond is no delay
    if abs(periods * period - seconds) > 1e-9:
        refuse(
            name,
            delay,
            f"a whole number of control periods of {period:g} s; left out, it is that"
            " of [delays]",
        )
    return periods
