"""Report of an identified vehicle: numbers with intervals, correlations, and errors of predicted held-out flights."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import fields

import numpy as np

from skyarm.cli.output import Facts, Lines, Row, aligned_lines, heading, plain, shown_number
from skyarm.flight_data.clocks import ClockOffset
from skyarm.flight_data.flight_data import FlightData
from skyarm.flight_data.series import rates_note
from skyarm.records.files import printable
from skyarm.studies.identify.data_faults import Fault
from skyarm.studies.identify.held_out import HOLD, IDENTIFIED, PAST, START, HeldOut, table_horizons
from skyarm.studies.identify.identified_numbers import APART, GIVEN, NOT_SHOWN, IdentifiedNumber
from skyarm.studies.identify.identify_vehicle import Identified
from skyarm.studies.identify.open_loop import HorizonErrors
from skyarm.studies.identify.stretches import joint_rates_note, period_note
from skyarm.vehicle.vehicle_records import Vehicle

VEHICLE, NUMBERS, TABLE, FIGURE = "vehicle.toml", "identified.json", "prediction.csv", "prediction.png"
"""Names of the file of the vehicle, of all numbers, and of the errors of predictions."""

CLOSE, MOST = 0.9, 12
"""Correlation from which two numbers are named; lines of them at most."""

WIDENED = 1.5
"""Times by which an interval is wider as flights disagree, from which it is said."""

LISTED = 4
"""Flights that a heading names."""

HEADS = ("", "value", "95 % interval", "start", "unit")


def report_lines(found: Identified, start: Vehicle, flights: Sequence[FlightData]) -> Lines:
    """Heading, table and remarks of an identified vehicle."""
    names = _few_names([each.name for each in flights])
    lines: Lines = [heading(f"{start.name} from {names}: {found.seconds:.3g} s")]
    rows = [HEADS, *map(_row, found.numbers)]
    wide = max(len(each[-1]) for each in rows)
    lines += [line.rstrip() for line in aligned_lines([(*each[:-1], each[-1].ljust(wide)) for each in rows])]
    lines += _apart_lines(found.numbers)
    lines.append(GIVEN)
    if not found.settled:
        lines.append("the search did not settle: do not rely on these numbers; intervals hold its last moves alone")
    apart = ", ".join(f"{each.name} {each.widened:.2g}" for each in found.numbers if each.widened > WIDENED)
    if apart:
        lines.append(f"flights disagree; intervals are wider than their noise explains, times: {apart}")
    shares = ", ".join(f"{row} {share:.0%}" for row, share in found.explained.items())
    lines.append(f"explained one step ahead: {shares}")
    pairs = correlated_pairs(found)
    lines += [f"hard to separate: {a} and {b}, correlation {r:+.3f}" for a, b, r in pairs[:MOST]]
    if len(pairs) > MOST:
        lines.append(f"and {len(pairs) - MOST} more pairs with a correlation beyond {CLOSE:g}")
    lines += [f"{each.name}: {note}" for each in flights for note in each.notes]
    for each in flights:
        clock = 1.0 / max(each["gyro"].rate, 1e-9)
        lines += filter(None, (period_note(each, start), joint_rates_note(each), rates_note(each, clock)))
    return [printable(line) if isinstance(line, str) else line for line in lines]


def prediction_lines(held_out: HeldOut) -> Lines:
    """Heading, table and remarks of the predictions of held-out flights."""
    rows: list[Row] = [("horizon", "position", "velocity", "attitude", "rate", "predictions")]
    wide = max(map(len, held_out.errors))
    for k in table_horizons(held_out):
        for i, (name, errors) in enumerate(held_out.errors.items()):
            each = errors[k]
            cells = ((each.position, "m"), (each.velocity, "m/s"), (each.attitude, "rad"), (each.rate, "rad/s"))
            words = [f"{shown_number(value)} {unit}" if math.isfinite(value) else "-" for value, unit in cells]
            first = "" if i else f"{each.horizon:g} s"
            rows.append((f"{first:<7} {name:<{wide}}", *words, str(each.begins)))
    lines: Lines = [heading(f"held out: {_few_names(held_out.flights)}: errors of predictions")]
    lines += aligned_lines(rows)
    force, turning = (
        ", ".join(f"{name} {shown_number(getattr(each, field))}" for name, each in held_out.one_step.items())
        for field in ("specific_force", "angular_acceleration")
    )
    lines.append(f"one step of {1e3 * held_out.period:.3g} ms: specific force, m/s^2: {force}")
    lines.append(f"one step of {1e3 * held_out.period:.3g} ms: angular acceleration, rad/s^2: {turning}")
    lines.append(f"Root mean squares; one step of '{HOLD}': the spread of what is measured about its mean.")
    if PAST in held_out.errors:
        lines.append(
            f"'{IDENTIFIED}', '{START}': from the state and the commands. '{PAST}': disturbances estimated until"
        )
        lines.append(
            "the begin go on, and the model counts beside holding as much as is best in the flights of the fit."
        )
    worse = _worse_than_holding(held_out)
    if worse:
        lines.append(f"'{IDENTIFIED}' is worse than '{HOLD}': {'; '.join(worse)}")
    return [*lines, *(printable(note) for note in held_out.notes)]


def _worse_than_holding(held_out: HeldOut) -> list[str]:
    """Quantities, each with its horizon, that the identified vehicle predicts worse than holding does."""
    own, held = (held_out.one_step[name] for name in (IDENTIFIED, HOLD))
    found = [
        f"{field.replace('_', ' ')} over {1e3 * held_out.period:.3g} ms"
        for field in ("specific_force", "angular_acceleration")
        if getattr(own, field) > getattr(held, field)
    ]
    pairs = [(held_out.errors[IDENTIFIED][k], held_out.errors[HOLD][k]) for k in table_horizons(held_out)]
    for field in ("position", "velocity", "attitude", "rate"):
        horizons = [f"{a.horizon:g}" for a, b in pairs if getattr(a, field) > getattr(b, field)]
        found += [f"{field} after {', '.join(horizons)} s"] if horizons else []
    return found


def prediction_csv(held_out: HeldOut) -> str:
    """Errors over each horizon as a table of text, a row for each horizon and predictor."""
    names = [each.name for each in fields(HorizonErrors)][1:]
    lines = [TABLE_HEAD]
    for k, horizon in enumerate(held_out.horizons):
        for name, errors in held_out.errors.items():
            values = [getattr(errors[k], each) for each in names[1:]]
            lines.append(",".join((f"{horizon:g}", name, str(errors[k].begins), *(f"{each:.6g}" for each in values))))
    return "\n".join(lines) + "\n"


UNITS = ("position_m", "velocity_m_s", "attitude_rad", "rate_rad_s")
"""Columns of errors of the table of predictions, in the order of the fields."""

TABLE_HEAD = ",".join(("horizon_s", "predictor", "predictions", *UNITS))
"""First line of the table of predictions."""


LEGEND = {
    IDENTIFIED: "identified vehicle",
    PAST: "identified, with the flight's past",
    START: "start vehicle",
    HOLD: "velocity and rate held",
}
"""Predictor -> its name in a figure."""


def prediction_png(held_out: HeldOut) -> bytes:
    """Figure of the errors of position and attitude over the horizon."""
    from skyarm.view.figures.prediction_figure import PredictionCurve, prediction_figure
    from skyarm.view.figures.style import DPI, image_bytes

    curves = {
        LEGEND[name]: PredictionCurve([each.position for each in errors], [each.attitude for each in errors])
        for name, errors in held_out.errors.items()
    }
    return image_bytes(prediction_figure(held_out.horizons, curves), dpi=DPI)


def _few_names(names: Sequence[str]) -> str:
    """Names of a few flights, and how many more there are."""
    more = len(names) - LISTED
    return ", ".join(names[:LISTED]) + (f" and {more} more" if more > 0 else "")


def _row(number: IdentifiedNumber) -> Row:
    start = shown_number(number.start, 4)
    if not number.is_known:
        reason = f"{NOT_SHOWN} (*)" if number.reason.startswith(APART) else number.reason
        return (number.name, "", reason, start, number.unit)
    low, high = shown_number(number.low, 4), shown_number(number.high, 4)
    return (number.name, shown_number(number.value, 4), f"{low} to {high}", start, number.unit)


def _apart_lines(numbers: Sequence[IdentifiedNumber]) -> list[str]:
    """Numbers that show beside another one only, a line for each of those."""
    beside = dict[str, list[str]]()
    for each in numbers:
        if each.reason.startswith(APART):
            beside.setdefault(each.reason.removeprefix(APART), []).append(each.name)
    return [f"(*) shown beside {name} only: {', '.join(names)}" for name, names in beside.items()]


def correlated_pairs(found: Identified) -> list[tuple[str, str, float]]:
    """Pairs of numbers, of which the flights show one at least, whose errors go together, the strongest first."""
    names, pairs = [each.name for each in found.numbers], list[tuple[str, str, float]]()
    for i, j in zip(*np.nonzero(np.triu(np.abs(found.correlation) > CLOSE, 1)), strict=True):
        if found.numbers[i].is_known or found.numbers[j].is_known:
            pairs.append((names[i], names[j], float(found.correlation[i, j])))
    return sorted(pairs, key=lambda each: -abs(each[2]))


def document_of(
    found: Identified,
    start: Vehicle,
    flights: Sequence[FlightData],
    known: Mapping[str, float],
    faults: Sequence[Fault],
    held_out: HeldOut | None,
    clocks: Mapping[str, ClockOffset],
) -> Facts:
    """All numbers of an identification, for JSON; a value that the flights do not show is null.

    Args:
        found: identified vehicle.
        start: vehicle before.
        flights: of the fit.
        known: numbers that were not searched.
        faults: of the flights.
        held_out: predictions of others.
        clocks: of each flight whose pose was moved to the gyro's clock.
    """
    unknown = dict.fromkeys(("value", "low", "high"))
    return {
        "start": start.name,
        "flights": [{"name": each.name, "file": each.file, "notes": each.notes} for each in flights],
        "clocks": clocks,
        "faults": [{"severity": each.severity, "text": each.words} for each in faults],
        "seconds": found.seconds,
        "period": found.period,
        "settled": found.settled,
        "numbers": [plain(each) | ({} if each.is_known else unknown) for each in found.numbers],
        "given": GIVEN,
        "known": known,
        "correlation": found.correlation,
        "surroundings": found.surroundings,
        "explained": found.explained,
        "deviation": found.deviation,
    } | ({} if held_out is None else {"held_out": held_out})
