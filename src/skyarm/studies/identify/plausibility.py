"""Plausibility of identified numbers: what no vehicle has, and what the fit itself contradicts."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from skyarm.flight_data.flight_data import FlightData
from skyarm.studies.identify.channel_scales import REFUSED, WARNED, Found
from skyarm.studies.identify.data_faults import Fault, faults_of
from skyarm.studies.identify.identified_numbers import Identified
from skyarm.studies.identify.logged_commands import commanded_speeds, time_constants
from skyarm.studies.identify.stretches import SHORTEST
from skyarm.vehicle.vehicle_records import Vehicle

FAR, IMPOSSIBLE = 4.0, 8.0
"""Times by which a number that a flight shows may be off the start before it is doubted; and a firm one is refused.

Units that are mixed up are off by 9.55 (rpm), 9.81 (g) and more.
"""

FIRM = ("rotors.thrust_coefficient", "base.inertia.xx", "base.inertia.yy", "base.inertia.zz")
"""Numbers that drawing and scale tell better than by a factor of 8."""

DOUBTED = (*FIRM, "rotors.moment_coefficient", "rotors.time_constant_up", "rotors.time_constant_down")
"""Numbers above 0 that are compared with those of the start."""

LONGEST_DELAY = 0.06
"""s, dead time of commands and delay of an accelerometer beyond which a clock is wrong rather than a loop slow."""

DEAD_TIMES = ("delay", "joint_delay")
"""Numbers that no clock lets be negative."""

BLIND, BRIEF = 0.02, 5.0
"""Share of the rotation's variance below which the commands explain nothing; s, of a flight that is too short to."""


ASIDE = 0.5
"""Of the rotors' distance from the base: what a centre of mass may be off the drawing's before it is doubted."""

FULL, HIGHEST = "rotors.thrust_at_100_percent", 0.95
"""Thrust at full signal, and share of the full speed that some commands must reach for it to be more than a guess."""


LENGTHS = ("base.com.", "place.", "rotors.drag_height")
"""Begins of the names of lengths from the base or from a hub."""

TIMES = (*DEAD_TIMES, "accelerometer_delay", "rotors.time_constant_up", "rotors.time_constant_down")
"""Numbers that a stretch must be longer than, beside the latencies of servos."""


def require_possible_numbers(start: Vehicle, known: Mapping[str, float], prefix: str) -> None:
    """Check that known numbers are ones that a vehicle of this mass and size may have.

    The size is the largest of the rotors' distance, the radius of gyration and the distance of the centre of mass, so
    that a start's own numbers are always possible.

    Args:
        start: vehicle with its total mass.
        known: by name.
        prefix: of a number's name in the error.

    Raises:
        ValueError: one line: the number, its value and what is allowed.
    """
    base, mass = start.base, float(start.mass)
    moments = [float(getattr(base.inertia, axis)) for axis in ("xx", "yy", "zz")]
    places = [base.com, *(each.position for each in start.rotors)]
    size = max(math.sqrt(max(moments) / mass), *(math.hypot(*map(float, each)) for each in places))
    longest = float(time_constants(start.rotors).max(initial=SHORTEST))
    for name, value in known.items():
        if name.startswith("base.inertia."):
            most, unit, why = FAR * mass * size**2, "kg m^2", f"{FAR:g} times the mass times the square of {size:.3g} m"
        elif name.startswith(LENGTHS):
            most, unit, why = FAR * size, "m", f"{FAR:g} times the vehicle's size, {size:.3g} m"
        elif name in TIMES or name.endswith(".latency"):
            most, unit, why = longest, "s", "the shortest flight that counts"
        elif name.startswith("links.") and name.endswith(".mass"):
            most, unit, why = mass, "kg", "the total mass"
        else:
            continue
        if abs(value) > most:
            raise ValueError(f"{prefix}{name} = {value:g}: must be at most {most:.3g} {unit} in size, {why}")


def implausible_numbers(
    found: Identified, start: Vehicle, file: str, flights: Sequence[FlightData] = ()
) -> tuple[Fault, ...]:
    """Faults that show in the numbers only: far from the start vehicle, or of a model that explains nothing.

    Args:
        found: identified vehicle.
        start: vehicle before.
        file: of the flight, for the messages.
        flights: of the fit, whose commands a thrust curve is compared with.
    """
    faults = [*_implausible(found), *_distant_centres(found, start), *_beyond_commands(found, start, flights)]
    return tuple(faults_of(faults, file))


def _distant_centres(found: Identified, start: Vehicle) -> Iterator[Found]:
    """Yield centres of mass that lie outside of what a drawing can be wrong by."""
    arm = max(math.hypot(*map(float, each.position)) for each in start.rotors)
    for each in found.numbers:
        if not each.name.startswith("base.com.") or not each.is_known:
            continue
        off = abs(each.value - each.start)
        if off > ASIDE * arm and not each.low <= each.start <= each.high:
            finding = f"is {1e3 * each.value:.3g} mm, {off / arm:.2g} of the rotors' distance off the start vehicle's"
            yield WARNED, each.name, finding, "try --drag-height, check the accelerometer's place and the clocks"


def _beyond_commands(found: Identified, start: Vehicle, flights: Sequence[FlightData]) -> Iterator[Found]:
    """Yield the thrust at full signal where no command comes near it."""
    full = float(start.rotors[0].max_speed)
    if not any(each.name == FULL and each.is_known for each in found.numbers):
        return
    every = [commanded_speeds(each, start).values for each in flights]
    most = max((float(np.quantile(each, 0.999)) for each in every), default=full) / full
    if most < HIGHEST:
        finding = f"is extrapolated: commands reach {100.0 * most:.2g} % of the full speed"
        yield WARNED, FULL, finding, "fly with more thrust, or do not rely on it"


def _implausible(found: Identified) -> Iterator[Found]:
    """Yield the faults of identified numbers."""
    shares = [share for row, share in found.explained.items() if row.startswith("rate.")]
    if shares and max(shares) < BLIND:
        finding = f"explain {100.0 * max(*shares, 0.0):.1g} % of the rotation in {found.seconds:.3g} s of flight"
        remedy = "check their order, clock and units, and the vehicle"
        yield REFUSED, "rotor commands", finding, remedy if found.seconds > BRIEF else f"fly for longer, or {remedy}"
    for each in found.numbers:
        if not each.is_known:
            continue
        if (each.name in DEAD_TIMES or each.name.endswith(".latency")) and each.high < 0.0:
            finding = f"is {1e3 * each.value:.3g} ms: motion before its command"
            yield WARNED, each.name, finding, "commands and sensors are not on one clock"
        if each.name in (*DEAD_TIMES, "accelerometer_delay") and abs(each.value) > LONGEST_DELAY:
            finding = f"is {each.value:.3g} s, longer than any loop's"
            yield REFUSED, each.name, finding, "check the clocks of commands and sensors"
        elif each.name in DOUBTED and each.start > 0.0:
            times = max(each.value / each.start, each.start / max(each.value, 1e-300))
            if times > FAR:
                finding = f"is {each.value:.4g} {each.unit}, {each.value / each.start:.3g} times the start vehicle's"
                severity = REFUSED if times > IMPOSSIBLE and each.name in FIRM else WARNED
                yield severity, each.name, finding, "check the channels' units, and mass and numbers of the vehicle"
