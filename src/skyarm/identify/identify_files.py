"""Identification of a vehicle from files of flights: reading on one clock, checks, and
the report.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from skyarm.flight_data.clocks import ClockOffset, align_poses, join_flights
from skyarm.flight_data.flight_data import PLACE, FlightData, load_flight
from skyarm.flight_data.quantities import GRAVITY
from skyarm.identify.identified_file import VOLTAGE
from skyarm.identify.identified_report import IdentifiedReport
from skyarm.identify.identify_flights import identify_aligned
from skyarm.identify.identify_windows import SearchOptions
from skyarm.identify.log_checks import LogFault
from skyarm.identify.logged_commands import as_samples
from skyarm.identify.measured_motion import joints_in_order
from skyarm.records.files import shown
from skyarm.records.immutable import immutable
from skyarm.vehicle import Vehicle


@immutable
class FlightFiles:
    """Input files of an identification: flights to fit, flights to predict, and the
    mapping of their columns.

    Attributes:
        fit: files of the flights that are fitted.
        held_out: files of flights to predict.
        join: file of the only flight by another computer.
        columns: mapping of the columns of all files but that.
    """

    fit: Sequence[str]
    held_out: Sequence[str] = ()
    join: str | None = None
    columns: str | None = None

    def read(
        self, start: Vehicle, progress: Callable[..., None]
    ) -> tuple[list[FlightData], list[FlightData], dict[str, ClockOffset]]:
        """Flights to fit and flights to predict on the gyroscope's clock, and clock
        offsets of poses by flight.

        Args:
            start: vehicle that gives the order of the joints.
            progress: called with (done, total, last), and without arguments at the end.

        Raises:
            ValueError: one line: a file that cannot be read, one of both kinds, or a
                measurement that is given twice.
        """
        fit = {Path(each).resolve() for each in self.fit}
        for each in self.held_out:
            if Path(each).resolve() in fit:
                raise ValueError(
                    f"--held-out = {shown(each)}: must not be among the flights of"
                    " the fit"
                )
        every = [*self.fit, *self.held_out]
        flights = list[FlightData]()
        clocks = dict[str, ClockOffset]()
        for i, file in enumerate(every):
            progress(i, len(every), f"read {Path(file).name}")
            flight, clock = align_poses(
                joints_in_order(load_flight(file, self.columns), start)
            )
            # the second computer's file is of the first flight, the only one with it
            if not i and self.join is not None:
                flight, clock = join_flights(
                    flight, joints_in_order(load_flight(self.join), start)
                )
            if clock is not None:
                clocks[flight.name] = clock
            flights.append(flight)
        progress()
        _require_measurements(flights)
        return flights[: len(self.fit)], flights[len(self.fit) :], clocks


def identify_files(
    files: FlightFiles,
    start: Vehicle,
    options: SearchOptions,
    *,
    gravity: float | None,
    despite_faults: bool,
    warn: Callable[[LogFault], object],
    progress: Callable[..., None],
) -> IdentifiedReport:
    """Identify a vehicle from files of flights.

    Args:
        files: files of flights.
        start: vehicle before.
        options: options of the search; the known numbers may hold the voltage of the
            rotors' data, V.
        gravity: m/s^2; None for that of the flights.
        despite_faults: warn of faults for which a flight is refused.
        warn: called with each fault.
        progress: called with (done, total, last) while files are read, then with
            ``last``, a line a step.

    Raises:
        ValueError: one line: a file that cannot be read, a fault, or options that do
            not fit the flights.
    """
    fitted, held_out, clocks = files.read(start, progress)
    known = {**_place([*fitted, *held_out], options.known), **options.known}
    given, faults = dict(known), list[LogFault]()
    full = given.pop(VOLTAGE, 0.0)
    if full and not any("voltage" in flight for flight in fitted):
        raise ValueError(
            f"--known {VOLTAGE} = {full:g}: must be left out: no flight measures the"
            " voltage"
        )
    felt = _gravity([*fitted, *held_out]) if gravity is None else gravity
    for flight in fitted:
        for begin, end in options.sections:
            if begin >= flight.end:
                raise ValueError(
                    f"--begin = {begin:g}: must be below {flight.end:g} s, the end of"
                    f" {flight.name}"
                )
            if end <= flight.start:
                raise ValueError(
                    f"--end = {end:g}: must be above {flight.start:g} s, the start of"
                    f" {flight.name}"
                )

    def report(fault: LogFault) -> None:
        faults.append(fault)
        warn(fault)

    identified = identify_aligned(
        fitted,
        start,
        dataclasses.replace(options, full_voltage=full, known=given, gravity=felt),
        report,
        despite_faults=despite_faults,
        held_out=held_out,
        progress=lambda words: progress(last=words),
    )
    counted = [
        each for each, counts in zip(fitted, identified.counted, strict=True) if counts
    ]
    # so that the report says how the commands were taken
    counted = [as_samples(each) for each in counted] if identified.sampled else counted
    return IdentifiedReport(
        found=identified,
        start=start,
        flights=counted,
        known=known,
        faults=faults,
        clocks=clocks,
    )


def _require_measurements(flights: Sequence[FlightData]) -> None:
    """Raise an error if the same measurement is given twice, also as a copied file."""
    measured = dict[bytes, str]()
    for flight in flights:
        if "gyro" in flight and flight["gyro"].time.size:
            rates = flight["gyro"].values.tobytes()
            if rates in measured:
                same = shown(measured[rates])
                raise ValueError(
                    f"flight = {shown(flight.file)}: must be another measurement than"
                    f" {same}"
                )
            measured[rates] = flight.file


def _place(
    flights: Sequence[FlightData], known: Mapping[str, float]
) -> dict[str, float]:
    """Place (m) of the inertial unit that all flights state, of the axes that are not
    ``known``.
    """
    places = [each.place for each in flights]
    if any(each != places[0] for each in places) and not set(PLACE) <= set(known):
        listed = ", ".join(f"{each.name} {[*each.place.values()]}" for each in flights)
        raise ValueError(
            f"--known {PLACE[0]}, .y, .z: are missing: the flights state several, m:"
            f" {listed}"
        )
    return {axis: value for axis, value in places[0].items() if axis not in known}


def _gravity(flights: Sequence[FlightData]) -> float:
    """Gravity (m/s^2) stated by the flights; the standard value if none states it."""
    # no mapping by name: two flights may have one
    stated = [each for each in flights if "gravity" in each.facts]
    if len({each.gravity for each in stated}) > 1:
        listed = ", ".join(f"{each.name} {each.gravity:g}" for each in stated)
        raise ValueError(
            f"--gravity: is missing: the flights state several, m/s^2: {listed}"
        )
    return stated[0].gravity if stated else GRAVITY
