"""Plausibility of vehicle parameters: implausible known ones are errors, identified
ones faults or warnings.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from skyarm.flight_data.flight_data import FlightData
from skyarm.identify.identified_numbers import Identified
from skyarm.identify.log_checks import (
    REFUSED,
    SHORTEST_FLIGHT,
    WARNED,
    Found,
    LogFault,
    faults_of,
)
from skyarm.identify.logged_commands import commanded_speeds, slowest_lag
from skyarm.records.arrays import norm
from skyarm.vehicle import Vehicle

FAR_OFF, IMPOSSIBLE = 4.0, 8.0
"""Factors between an estimate and its start value above which it is doubted, and above
which a firm one is refused.

Units that are mixed up are off by 9.55 (rpm), 9.81 (g) and more.
"""

FIRM_NUMBERS = (
    "rotors.thrust_coefficient",
    "base.inertia.xx",
    "base.inertia.yy",
    "base.inertia.zz",
)
"""Parameters known within a factor of 8 from drawing and scale, which a wrong mass
scales alike."""

DOUBTED = (
    *FIRM_NUMBERS,
    "rotors.moment_coefficient",
    "rotors.time_constant_up",
    "rotors.time_constant_down",
)
"""Positive parameters that are compared with their start values."""

ALL_OFF = 1.45
"""Mean factor on the firm parameters, all to one side, above which the mass is
doubted."""

LONGEST_DELAY, SHORT = 0.06, 5.0
"""Longest dead time (s) of commands and accelerometer above which a clock is wrong
rather than a loop slow; duration (s) below which a flight may be too short for its
commands to explain it."""

DEAD_TIMES = ("delay", "joint_delay")
"""Parameters that no clock allows to be negative."""

BLIND = 0.02
"""Explained fraction of the rotation's variance below which the commands explain
nothing."""

ASIDE, TURNED = 0.5, 0.2
"""Largest plausible deviation of a centre of mass from the drawing: in units of the
rotors' distance from the base, and about a joint (rad)."""

FULL, HIGHEST = "rotors.thrust_at_100_percent", 0.95
"""Parameter of the thrust at full signal, and fraction of full speed that some commands
must reach for a reliable value: a tenth of the thrust lies beyond it."""

LENGTHS = ("base.com.", "place.", "rotors.drag_height")
"""Prefixes of parameters that are lengths from the base or from a hub."""

TIMES = (
    *DEAD_TIMES,
    "accelerometer_delay",
    "rotors.time_constant_up",
    "rotors.time_constant_down",
)
"""Parameters that a flight must exceed in duration, in addition to the latencies of
servos."""


def require_possible_numbers(
    start: Vehicle, known: Mapping[str, float], prefix: str
) -> None:
    """Raise an error if known parameters are implausible for a vehicle of a given mass
    and size.

    The size is the largest of the rotors' distance, the radius of gyration and the
    distance of the centre of mass, so that a start's own numbers are always possible.

    Args:
        start: vehicle with its total mass.
        known: known numbers by name.
        prefix: beginning of a number's name in the error.

    Raises:
        ValueError: one line: the number, its value and what is allowed.
    """
    base = start.base
    mass = float(start.mass)
    moments = [float(getattr(base.inertia, axis)) for axis in ("xx", "yy", "zz")]
    places = [base.com, *(each.position for each in start.rotors)]
    size = max(
        math.sqrt(max(moments) / mass),
        *(math.hypot(*map(float, each)) for each in places),
    )
    longest = max(slowest_lag(start), SHORTEST_FLIGHT)
    # the factor at which found numbers are doubted bounds given ones, too
    for name, value in known.items():
        if name.startswith("base.inertia."):
            most = FAR_OFF * mass * size**2
            unit = "kg m^2"
            why = f"{FAR_OFF:g} times the mass times the square of {size:.3g} m"
        elif name.startswith(LENGTHS):
            most = FAR_OFF * size
            unit = "m"
            why = f"{FAR_OFF:g} times the vehicle's size, {size:.3g} m"
        elif name in TIMES or name.endswith(".latency"):
            most = longest
            unit = "s"
            why = "the shortest flight that counts"
        elif name.startswith("links.") and name.endswith(".mass"):
            most = mass
            unit = "kg"
            why = "the total mass"
        else:
            continue
        if abs(value) > most:
            raise ValueError(
                f"{prefix}{name} = {value:g}: must be at most {most:.3g} {unit} in"
                f" size, {why}"
            )


def doubtful_numbers(
    found: Identified, start: Vehicle, file: str, flights: Sequence[FlightData] = ()
) -> tuple[LogFault, ...]:
    """Faults of identified parameters: values far from the start vehicle's, or a model
    that explains no motion.

    Args:
        found: identified vehicle.
        start: vehicle before.
        file: file of the flight, for the messages.
        flights: flights of the fit, whose commands a thrust curve is compared with.
    """
    rows = [
        *_far_numbers(found),
        *_by_geometry(found, start),
        *_beyond_commands(found, start, flights),
    ]
    return tuple(faults_of(file, rows))


def _far_numbers(identified: Identified) -> Iterator[Found]:
    """Yield identified parameters far from the start vehicle's, and commands that
    explain no motion.
    """
    shares = [
        share for row, share in identified.explained.items() if row.startswith("rate.")
    ]
    if shares and max(shares) < BLIND:
        finding = (
            f"explain {100.0 * max(*shares, 0.0):.1g} % of the rotation in"
            f" {identified.seconds:.3g} s of flight"
        )
        remedy = "check their order, clock and units, and the vehicle"
        yield (
            REFUSED,
            "rotor commands",
            finding,
            remedy if identified.seconds > SHORT else f"fly for longer, or {remedy}",
        )
    ratios = dict[str, float]()
    for each in (each for each in identified.numbers if each.is_known):
        if (
            each.name in DEAD_TIMES or each.name.endswith(".latency")
        ) and each.high < 0.0:
            finding = f"is {1e3 * each.value:.3g} ms: motion before its command"
            yield (
                WARNED,
                each.name,
                finding,
                "commands and sensors are not on one clock",
            )
        if (
            each.name in (*DEAD_TIMES, "accelerometer_delay")
            and abs(each.value) > LONGEST_DELAY
        ):
            finding = f"is {each.value:.3g} s, longer than any loop's"
            yield (
                REFUSED,
                each.name,
                finding,
                "check the clocks of commands and sensors",
            )
        elif each.name in DOUBTED and each.start > 0.0:
            # 1e-300, so that a value of 0 is far off, too, and has a logarithm
            ratios[each.name] = max(each.value, 1e-300) / each.start
            times = max(ratios[each.name], 1.0 / ratios[each.name])
            if times > FAR_OFF:
                finding = (
                    f"is {each.value:.4g} {each.unit}, {each.value / each.start:.3g}"
                    " times the start vehicle's"
                )
                severity = (
                    REFUSED
                    if times > IMPOSSIBLE and each.name in FIRM_NUMBERS
                    else WARNED
                )
                yield (
                    severity,
                    each.name,
                    finding,
                    "check the channels' units, and mass and numbers of the vehicle",
                )
    # a mass scales them all alike, so it is looked for in their ratios' logarithms
    logs = np.log([ratios[name] for name in FIRM_NUMBERS if name in ratios])
    # one number that is far off is no mass
    alike = (
        float(np.median(logs))
        if len(logs) == len(FIRM_NUMBERS) and np.ptp(np.sign(logs)) == 0.0
        else 0.0
    )
    if abs(alike) > math.log(ALL_OFF):
        finding = (
            f"thrust and inertia are {math.exp(alike):.3g} times the start vehicle's"
            " alike, as by its mass"
        )
        yield (
            WARNED,
            "mass",
            finding,
            "weigh the vehicle: a flight shows forces per mass only",
        )


def _by_geometry(identified: Identified, start: Vehicle) -> Iterator[Found]:
    """Yield implausible centres of mass: far from the drawing, or rotated about a
    joint.
    """
    arm = max(math.hypot(*map(float, each.position)) for each in start.rotors)
    numbers = {each.name: each for each in identified.numbers if each.is_known}
    for each in (numbers[name] for name in numbers if name.startswith("base.com.")):
        off = abs(each.value - each.start)
        # an interval that holds the start says nothing against it
        if off > ASIDE * arm and not each.low <= each.start <= each.high:
            finding = (
                f"is {1e3 * each.value:.3g} mm, {off / arm:.2g} of the rotors' distance"
                " off the start vehicle's"
            )
            yield (
                WARNED,
                each.name,
                finding,
                "try --drag-height, check the accelerometer's place and the clocks",
            )
    for link in start.links:
        centre = [numbers.get(f"links.{link.name}.com.{axis}") for axis in "xyz"]
        if not link.joint.turns or not all(centre):
            continue
        at, was, about = (
            np.array(each, dtype=float)
            for each in (
                [c.value for c in centre if c],
                [c.start for c in centre if c],
                [*link.joint.axis],
            )
        )
        # angle from one to the other about the axis, without their parts along it
        turn = math.atan2(
            float(about @ np.cross(was, at)),
            float(was @ at - (about @ was) * (about @ at)),
        )
        # half an interval as an angle, at its distance from the axis, which may be 0
        half = max(0.5 * (c.high - c.low) for c in centre if c) / max(
            norm(np.cross(about, was)), 1e-9
        )
        if abs(turn) > TURNED + half:
            finding = (
                f"zero of {link.joint.name} looks {abs(turn):.2g} rad off, or the"
                " drawing: the centre of mass of "
            )
            finding += f"{link.name} is turned by that about the joint"
            yield (
                WARNED,
                "joint_positions",
                finding,
                "check the encoder's zero against the drawing",
            )


def _beyond_commands(
    identified: Identified, start: Vehicle, flights: Sequence[FlightData]
) -> Iterator[Found]:
    """Yield a warning if the thrust at full signal is extrapolated beyond the flown
    commands.
    """
    # the thrust curve is one for all rotors, and so is its full speed
    full = float(start.rotors[0].max_speed)
    if not any(each.name == FULL and each.is_known for each in identified.numbers):
        return
    # a quantile, because a single row may be a spike
    every = [commanded_speeds(each, start).values for each in flights]
    most = max((float(np.quantile(each, 0.999)) for each in every), default=full) / full
    if most < HIGHEST:
        finding = (
            f"is extrapolated: commands reach {100.0 * most:.2g} % of the full speed"
        )
        yield WARNED, FULL, finding, "fly with more thrust, or do not rely on it"
