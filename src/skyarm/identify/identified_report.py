"""Report of an identified vehicle: parameters with intervals, correlations, and errors
of predicted flights.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path

import numpy as np

from skyarm.flight_data.clocks import ClockOffset
from skyarm.flight_data.flight_data import FlightData
from skyarm.flight_data.series import rates_note
from skyarm.identify.held_out_errors import (
    HOLD,
    IDENTIFIED,
    PAST,
    START,
    HeldOut,
    table_horizons,
)
from skyarm.identify.identified_file import VOLTAGE, identified_file
from skyarm.identify.identified_numbers import (
    APART,
    GIVEN,
    NOT_SHOWN,
    Identified,
    IdentifiedNumber,
)
from skyarm.identify.log_checks import LogFault
from skyarm.identify.logged_commands import period_note
from skyarm.records.files import printable
from skyarm.records.immutable import immutable
from skyarm.records.text_tables import Row, aligned_lines, shown_number
from skyarm.vehicle import Vehicle
from skyarm.view.pages import Facts

VEHICLE, NUMBERS, TABLE, FIGURE = (
    "vehicle.toml",
    "identified.json",
    "prediction.csv",
    "prediction.png",
)
"""File names: vehicle, all parameters, prediction errors, and figure."""

CLOSE, MOST = 0.9, 12
"""Correlation above which two parameters are reported, as either interval would be 2.3
times narrower if the other one were known; and largest number of such lines, chosen."""

WIDENED = 1.5
"""Factor of widening, for disagreeing flights or an absent channel, above which an
interval's widening is reported."""

LISTED = 4
"""Number of flights in a heading, and of parameters blurred by an absent channel, that
are listed."""

HEADS = ("", "value", "95 % interval", "start", "unit")


@immutable(eq=False)
class IdentifiedReport:
    """Results of an identification from flight files, and their report.

    Attributes:
        found: identified vehicle.
        start: vehicle before.
        flights: flights of the fit, without those of which no part counts.
        known: numbers that were not searched, and the voltage of the rotors' data, by
            name.
        faults: faults of which was warned.
        clocks: offset of each flight whose pose was moved to the gyro's clock.
    """

    found: Identified
    start: Vehicle
    flights: Sequence[FlightData]
    known: Mapping[str, float]
    faults: Sequence[LogFault]
    clocks: Mapping[str, ClockOffset]

    def lines(self) -> list[str]:
        """Text lines of the report: title, parameter table and remarks."""
        identified, flights = self.found, self.flights
        names = _few_names([each.name for each in flights])
        rows = [HEADS, *map(_row, identified.numbers)]
        # units stand to the left, which the table would push to the right
        wide = max(len(each[-1]) for each in rows)
        lines = [f"{self.start.name} from {names}: {identified.seconds:.3g} s"]
        lines += [
            line.rstrip()
            for line in aligned_lines(
                [(*each[:-1], each[-1].ljust(wide)) for each in rows]
            )
        ]
        lines += _apart_lines(identified.numbers)
        lines.append(GIVEN)
        if not identified.settled:
            lines.append(
                "the search did not settle: do not rely on these numbers; intervals"
                " hold its last moves alone"
            )
        apart = ", ".join(
            f"{each.name} {each.widened:.2g}"
            for each in identified.numbers
            if each.widened > WIDENED
        )
        if apart:
            lines.append(
                "flights disagree; intervals are wider than their noise explains,"
                f" times: {apart}"
            )
        lines += [
            _absent_line(channel, costs) for channel, costs in identified.absent.items()
        ]
        shares = ", ".join(
            f"{row} {share:.0%}" for row, share in identified.explained.items()
        )
        lines.append(f"explained beyond noise: {shares}")
        pairs = correlated_pairs(identified)
        lines += [
            f"hard to separate: {a} and {b}, correlation {r:+.3f}"
            for a, b, r in pairs[:MOST]
        ]
        if len(pairs) > MOST:
            lines.append(
                f"pairs with a correlation beyond {CLOSE:g} that are not shown:"
                f" {len(pairs) - MOST}"
            )
        lines += [f"{each.name}: {note}" for each in flights for note in each.notes]
        for each in flights:
            # 1e-9: fewer than two samples have a rate of 0
            clock = 1.0 / max(each["gyro"].rate, 1e-9)
            lines += filter(
                None, (period_note(each, self.start), rates_note(each, clock))
            )
        if VOLTAGE not in self.known and any("voltage" in each for each in flights):
            lines.append(
                "voltage: is measured and not used: state that of the rotors' data,"
                f" --known {VOLTAGE}=VALUE"
            )
        if any("rotor_speeds" in each for each in flights):
            lines.append(
                "rotor_speeds: are measured and not used: to use them, map them as"
                " rotor_speed_commands"
            )
        return [printable(line) for line in lines]

    def document(self) -> Facts:
        """All parameters as plain data; null for a value that the flights do not
        identify.
        """
        identified = self.found
        unknown = dict.fromkeys(("value", "low", "high"))
        return {
            "start": self.start.name,
            "flights": [
                {"name": each.name, "file": each.file, "notes": each.notes}
                for each in self.flights
            ],
            "clocks": self.clocks,
            "faults": [
                {"severity": each.severity, "text": each.words} for each in self.faults
            ],
            "seconds": identified.seconds,
            "period": identified.period,
            "settled": identified.settled,
            "numbers": [
                asdict(each) | ({} if each.is_known else unknown)
                for each in identified.numbers
            ],
            "given": GIVEN,
            "known": self.known,
            "correlation": identified.correlation,
            "surroundings": identified.surroundings,
            "explained": identified.explained,
            "deviation": identified.deviation,
            "absent": identified.absent,
        } | ({} if identified.held_out is None else {"held_out": identified.held_out})

    def vehicle_file(self) -> str:
        """Text of the vehicle file."""
        numbers = {name: value for name, value in self.known.items() if name != VOLTAGE}
        return identified_file(
            self.found,
            self.start,
            [Path(each.file).name for each in self.flights],
            numbers,
        )


ERRORS = {"position": "m", "velocity": "m/s", "attitude": "rad", "rate": "rad/s"}
"""Error of a prediction over a horizon -> unit."""

STEPS = {"specific_force": "m/s^2", "angular_acceleration": "rad/s^2"}
"""Error of a prediction of one step -> unit."""

TABLE_HEAD = ",".join(
    (
        "horizon_s",
        "predictor",
        "predictions",
        *(f"{name}_{unit.replace('/', '_')}" for name, unit in ERRORS.items()),
    )
)
"""First line of the table of prediction errors."""


def prediction_lines(held_out: HeldOut) -> list[str]:
    """Title, table and remarks of the predictions of held-out flights."""
    rows = [("horizon", *ERRORS, "predictions")]
    wide = max(map(len, held_out.errors))
    for k in table_horizons(held_out):
        for i, (name, errors) in enumerate(held_out.errors.items()):
            cells = (
                (getattr(errors[k], field), unit) for field, unit in ERRORS.items()
            )
            words = [
                f"{shown_number(value)} {unit}" if math.isfinite(value) else "-"
                for value, unit in cells
            ]
            first = "" if i else f"{errors[k].horizon:g} s"
            rows.append((f"{first:<7} {name:<{wide}}", *words, str(errors[k].begins)))
    lines = [
        printable(f"held out: {_few_names(held_out.flights)}: errors of predictions"),
        *aligned_lines(rows),
    ]
    for field, unit in STEPS.items():
        step = (
            f"one step of {1e3 * held_out.period:.3g} ms: {field.replace('_', ' ')},"
            f" {unit}"
        )
        sizes = (
            f"{name} {shown_number(getattr(each, field))}"
            for name, each in held_out.one_step.items()
        )
        lines.append(f"{step}: {', '.join(sizes)}")
    lines.append(
        f"Root mean squares; one step of '{HOLD}': the spread of what is measured about"
        " its mean."
    )
    if PAST in held_out.errors:
        lines += [
            (
                f"'{IDENTIFIED}', '{START}': from the state and the commands. '{PAST}':"
                " disturbances estimated until"
            ),
            (
                "the begin go on, and the model counts beside holding as much as is"
                " best in the flights of the fit."
            ),
        ]
    worse = _worse_than_holding(held_out)
    if worse:
        lines.append(f"'{IDENTIFIED}' is worse than '{HOLD}': {'; '.join(worse)}")
    return [*lines, *map(printable, held_out.notes)]


def _worse_than_holding(held_out: HeldOut) -> list[str]:
    """Names of quantities and horizons for which the identified vehicle predicts worse
    than constant velocity.
    """
    own, hold = (held_out.one_step[name] for name in (IDENTIFIED, HOLD))
    worse = [
        f"{field.replace('_', ' ')} over {1e3 * held_out.period:.3g} ms"
        for field in STEPS
        if getattr(own, field) > getattr(hold, field)
    ]
    pairs = [
        (held_out.errors[IDENTIFIED][k], held_out.errors[HOLD][k])
        for k in table_horizons(held_out)
    ]
    for field in ERRORS:
        horizons = [
            f"{a.horizon:g}" for a, b in pairs if getattr(a, field) > getattr(b, field)
        ]
        worse += [f"{field} after {', '.join(horizons)} s"] if horizons else []
    return worse


def prediction_csv(held_out: HeldOut) -> str:
    """Prediction errors as CSV text, a row for each horizon and predictor."""
    lines = [TABLE_HEAD]
    for k, horizon in enumerate(held_out.horizons):
        for name, errors in held_out.errors.items():
            sizes = (f"{getattr(errors[k], field):.6g}" for field in ERRORS)
            lines.append(
                ",".join((f"{horizon:g}", name, str(errors[k].begins), *sizes))
            )
    return "\n".join(lines) + "\n"


LEGEND = {
    IDENTIFIED: "identified vehicle",
    PAST: "identified, with the flight's past",
    START: "start vehicle",
    HOLD: "velocity and rate held",
}
"""Predictor -> its name in a figure."""


def prediction_png(held_out: HeldOut) -> bytes:
    """PNG figure of the prediction errors of position and attitude over the horizon."""
    from skyarm.view.figures.prediction_figure import PredictionCurve, prediction_figure
    from skyarm.view.figures.style import DPI, image_bytes

    curves = {
        LEGEND[name]: PredictionCurve(
            [each.position for each in errors], [each.attitude for each in errors]
        )
        for name, errors in held_out.errors.items()
    }
    return image_bytes(prediction_figure(held_out.horizons, curves), dpi=DPI)


def _few_names(names: Sequence[str]) -> str:
    """Text with the names of a few flights, and how many more there are."""
    more = len(names) - LISTED
    return ", ".join(names[:LISTED]) + (f" and {more} more" if more > 0 else "")


def _row(number: IdentifiedNumber) -> Row:
    start = shown_number(number.start, 4)
    if not number.is_known:
        reason = (
            f"{NOT_SHOWN} (*)" if number.reason.startswith(APART) else number.reason
        )
        return (number.name, "", reason, start, number.unit)
    low, high = shown_number(number.low, 4), shown_number(number.high, 4)
    return (
        number.name,
        shown_number(number.value, 4),
        f"{low} to {high}",
        start,
        number.unit,
    )


def _absent_line(channel: str, costs: Mapping[str, float]) -> str:
    """Text line on the parameters whose intervals an unlogged channel would narrow
    most, and by how much.
    """
    most = sorted(
        (name for name in costs if costs[name] > WIDENED), key=lambda name: -costs[name]
    )
    if not most:
        return (
            f"{channel}: not logged; no interval would be narrower by more than"
            f" {WIDENED:g} times with it"
        )
    listed = ", ".join(f"{name} {costs[name]:.2g}" for name in most[:LISTED])
    more = f" and {len(most) - LISTED} more" if len(most) > LISTED else ""
    beside = "one of motion capture" if channel in ("pose", "position") else "them"
    return (
        f"{channel}: not logged; intervals are wider than with {beside}, times about:"
        f" {listed}{more}"
    )


def _apart_lines(numbers: Sequence[IdentifiedNumber]) -> list[str]:
    """Text lines on parameters that are identifiable only together with another one,
    grouped by that other one.
    """
    beside = dict[str, list[str]]()
    for each in numbers:
        if each.reason.startswith(APART):
            beside.setdefault(each.reason.removeprefix(APART), []).append(each.name)
    return [
        f"(*) known only together with {name}: {', '.join(names)}"
        for name, names in beside.items()
    ]


def correlated_pairs(found: Identified) -> list[tuple[str, str, float]]:
    """Pairs of parameters with strongly correlated errors, of which one at least is
    identified, the strongest first.
    """
    # above the diagonal, as pairs have no order
    strong = np.argwhere(np.triu(np.abs(found.correlation) > CLOSE, 1))
    rows = [
        (found.numbers[i], found.numbers[j], float(found.correlation[i, j]))
        for i, j in strong
    ]
    pairs = [(a.name, b.name, r) for a, b, r in rows if a.is_known or b.is_known]
    return sorted(pairs, key=lambda each: -abs(each[2]))
