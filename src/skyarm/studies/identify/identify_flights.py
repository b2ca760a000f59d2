"""Vehicle parameters from measured flights as they were read: faults, stretches, search, plausibility."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence

from skyarm.flight_data.clocks import align_poses
from skyarm.flight_data.flight_data import FlightData
from skyarm.studies.identify.data_faults import Fault, find_faults, require_no_refusal
from skyarm.studies.identify.identify_vehicle import Identified, identify_vehicle
from skyarm.studies.identify.plausibility import implausible_numbers
from skyarm.studies.identify.stretches import stretches_of_flights
from skyarm.vehicle.vehicle_records import Vehicle


def identify_flights(
    flights: Sequence[FlightData],
    start: Vehicle,
    *,
    curve: bool = False,
    full_voltage: float = 0.0,
    sections: Sequence[tuple[float, float]] = (),
    known: Mapping[str, float] | None = None,
    despite_faults: bool = False,
    progress: Callable[[str], None] | None = None,
) -> Identified:
    """Identify the parameters of a vehicle from measured flights of :func:`skyarm.load_flight`.

    Poses of another clock are moved to the gyro's (:func:`skyarm.flight_data.clocks.align_poses`).

    Args:
        flights: with gyro, accelerometer and rotor commands; of an arm, positions of the joints.
        start: vehicle with what is known before: data sheet, drawing, total mass.
        curve: find a thrust curve in place of the start's times a factor.
        full_voltage: V, at which the start's thrust holds; 0 leaves the battery's voltage out.
        sections: (begin, end), s, of each flight that count; by default all in which the vehicle flies.
        known: numbers that are not searched, by name.
        despite_faults: warn of faults for which a flight is refused.
        progress: called with one line a step of the search.

    Returns:
        Numbers with 95 % intervals or the reason why the flights do not show them, and the vehicle.

    Raises:
        ValueError: one line: a fault of a flight, one that does not fit the vehicle, or SciPy is missing.
    """
    flights = [align_poses(each)[0] for each in flights]
    parts = [each.section(*part) for each in flights for part in sections] if sections else flights
    _report([fault for each in parts for fault in find_faults(each, start)], despite_faults)
    cut = stretches_of_flights(flights, start, full_voltage=full_voltage, sections=sections) if flights else []
    stretches = [each for part in cut for each in part]
    found = identify_vehicle(stretches, start, curve=curve, known=known, progress=progress)
    _report(implausible_numbers(found, start, flights[0].file, stretches), despite_faults)
    return found


def _report(faults: Sequence[Fault], despite_faults: bool) -> None:
    """Warn of faults; raise an error for one for which a flight is refused."""
    require_no_refusal(() if despite_faults else faults)
    for fault in faults:
        warnings.warn(fault.words, UserWarning, stacklevel=3)
