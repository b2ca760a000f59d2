"""Identification from measured flights: logging faults, parameter search, plausibility
and predictions.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

from skyarm.flight_data.clocks import align_poses
from skyarm.flight_data.flight_data import FlightData
from skyarm.flight_data.quantities import GRAVITY
from skyarm.identify.held_out import predict_held_out
from skyarm.identify.identified_numbers import Identified
from skyarm.identify.identify_windows import WHOLE, SearchOptions, identify_by_windows
from skyarm.identify.isolate_fault import find_faults
from skyarm.identify.log_checks import (
    WARNED,
    LogFault,
    faults_of,
    require_no_refusal,
)
from skyarm.identify.logged_commands import as_samples
from skyarm.identify.possible_numbers import doubtful_numbers, require_possible_numbers
from skyarm.identify.unknowns import second_moments_of
from skyarm.records.files import number
from skyarm.vehicle import Vehicle

TOTAL = "mass"
"""Known number that is not estimated: mass (kg) of the whole vehicle."""

MOMENTS = ("base.inertia.xx", "base.inertia.yy", "base.inertia.zz")
"""Known numbers that must be given together, since sums of them are estimated."""

FLAT = 1e-6
"""Least second moment of mass over the sum of the moments; that of a flat plate is 0
and has no logarithm."""


def identify_flights(
    flights: Sequence[FlightData],
    start: Vehicle,
    *,
    held_out: Sequence[FlightData] = (),
    curve: bool = False,
    drag_height: bool = False,
    full_voltage: float = 0.0,
    sections: Sequence[tuple[float, float]] = (),
    known: Mapping[str, float] | None = None,
    gravity: float = GRAVITY,
    despite_faults: bool = False,
    progress: Callable[[str], None] | None = None,
) -> Identified:
    """Identify the parameters of a vehicle from measured flights of
    :func:`skyarm.load_flight`.

    Poses of another clock are moved to the gyro's
    (:func:`skyarm.flight_data.clocks.align_poses`).

    Args:
        flights: flights with gyro, accelerometer and rotor commands; of an arm,
            positions of the joints.
        start: vehicle with what is known before: data sheet, drawing, total mass.
        held_out: flights that are predicted and not fitted.
        curve: find a thrust curve in place of the start's times a factor.
        drag_height: the rotors' hub drag acts at a height of its own.
        full_voltage: V, at which the start's thrust holds; 0 leaves the battery's
            voltage out.
        sections: (begin, end), s, of each flight that count; by default all in which
            the vehicle flies.
        known: numbers that are not searched, by name; ``mass`` is that of the whole
            vehicle, kg.
        gravity: m/s^2.
        despite_faults: warn of faults for which a flight is refused.
        progress: called with one line a step of the search.

    Returns:
        Numbers with 95 % intervals or the reason why the flights do not show them, the
        vehicle, and the predictions.

    Raises:
        ValueError: one line: a fault of a flight, one that does not fit the vehicle, or
            SciPy is missing.
    """
    start, given = known_of_search(start, known or {}, "known.")
    return identify_aligned(
        [align_poses(each)[0] for each in flights],
        start,
        SearchOptions(
            curve=curve,
            drag_height=drag_height,
            full_voltage=full_voltage,
            sections=sections,
            known=given,
            gravity=gravity,
        ),
        # five calls up stands the line that called this function
        lambda fault: warnings.warn(fault.words, UserWarning, stacklevel=5),
        despite_faults=despite_faults,
        held_out=[align_poses(each)[0] for each in held_out],
        progress=progress,
    )


def identify_aligned(
    flights: Sequence[FlightData],
    start: Vehicle,
    options: SearchOptions,
    warn: Callable[[LogFault], object],
    *,
    despite_faults: bool,
    held_out: Sequence[FlightData],
    progress: Callable[[str], None] | None,
) -> Identified:
    """Identify a vehicle from flights whose clocks agree; the arguments are those of
    :func:`identify_flights`.

    The start has the total mass that a scale tells. ``warn`` is called with each fault
    of the flights, then with each of the numbers that hardly any vehicle has.
    """

    def report(faults: Sequence[LogFault]) -> None:
        require_no_refusal(() if despite_faults else faults)
        for fault in faults:
            warn(fault)

    tell = progress or (lambda words: None)
    tell("look for faults")
    # faults outside the parts that count do no harm
    parts = [
        each.section(*part) for each in flights for part in options.sections
    ] or flights
    report(
        [fault for each in (*parts, *held_out) for fault in find_faults(each, start)]
    )
    identified = identify_by_windows(flights, start, options, progress)
    finding = f"no part counts: nowhere {WHOLE:g} s in the air without a gap"
    remedy = "leave it out, or fly longer"
    for flight, counts in zip(flights, identified.counted, strict=False):
        if not counts:
            report(faults_of(flight.file, [(WARNED, "time", finding, remedy)]))
    report(doubtful_numbers(identified, start, flights[0].file, flights))
    if not held_out:
        return identified
    if identified.sampled:
        flights, held_out = (
            [as_samples(each) for each in every] for every in (flights, held_out)
        )
    tell("predict the held-out flights")
    return replace(
        identified,
        held_out=predict_held_out(identified, start, held_out, options, seen=flights),
    )


def known_of_search(
    start: Vehicle, known: Mapping[str, float], prefix: str
) -> tuple[Vehicle, dict[str, float]]:
    """Start vehicle of a known total mass, and the other known parameters in the form
    that the search uses.

    The three moments of inertia of the base become the second moments of mass that are
    searched.

    Args:
        start: vehicle.
        known: numbers by name.
        prefix: beginning of a number's name in an error.

    Raises:
        ValueError: one line: a number that no such vehicle has.
    """
    given = dict(known)
    if TOTAL in given:
        start = weigh_vehicle(start, given.pop(TOTAL), f"{prefix}{TOTAL}")
    require_possible_numbers(start, given, prefix)
    if not any(name in given for name in MOMENTS):
        return start, given
    for name in MOMENTS:
        if name not in given:
            raise ValueError(
                f"{prefix}{name}: is missing: {', '.join(MOMENTS)} must be given"
                " together"
            )
    moments = [
        number(given.pop(name), f"{prefix}{name}", low=0.0, strict=True)
        for name in MOMENTS
    ]
    for name, axis, moment, second in zip(
        MOMENTS, "xyz", moments, second_moments_of(*moments), strict=True
    ):
        if second < -FLAT * sum(moments):
            others = sum(moments) - moment
            raise ValueError(
                f"{prefix}{name} = {moment:g}: must be below the sum of the other two,"
                f" {others:g}"
            )
        # rounding may put that of a plate, which is 0, below it
        given[f"base.second_moment.{axis}"] = max(second, FLAT * sum(moments))
    return start, given


def weigh_vehicle(vehicle: Vehicle, mass: float, name: str) -> Vehicle:
    """Vehicle with another total mass (kg), adjusted at its base; an error of a mass
    too small begins with ``name``.
    """
    carried = float(vehicle.mass) - float(vehicle.base.mass)
    number(mass, name, low=0.0, strict=True)
    number(
        mass - carried,
        f"{name}, less {carried:g} kg of the links",
        low=0.0,
        strict=True,
    )
    return replace(vehicle, base=replace(vehicle.base, mass=mass - carried))
