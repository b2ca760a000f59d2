"""Identify vehicles on one half of public flights and predict the other: a table of
docs/data/results_identification.md.

    python tests/identify/measure_real.py                   make real; ten minutes
    REAL_LOGS=FOLDER python tests/identify/measure_real.py  logs of a folder alone
    python tests/identify/measure_real.py --simulated       simulated flights only

real_flights.toml lists the logs: address, SHA-256, start vehicle, options. They are
fetched into out/real once, and none of a folder's. A folder may hold a list of its own
of that name, of logs without address and SHA-256. A log that is not there is named and
skipped.

Of the longest time in the air, at most 10 s before its middle are fitted, and as many
behind it are predicted. Errors are those of the body rate, which every log measures;
the standard error has all others, and the turns of the search. The range that holds 95
% of the errors of the fitted half should hold as many of the other half's: the
coverage. The search for a changed channel, which identify makes before, is left out: it
takes longer than all else.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import sys
import tomllib
import urllib.request
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

# the tests' own modules, when this is run as a program
sys.path.append(str(Path(__file__).parents[1]))

import numpy as np
from planted_flights import POSES, measured, planted

import skyarm
from skyarm.flight_data.clocks import align_poses
from skyarm.flight_data.flight_data import FlightData
from skyarm.flight_data.quantities import GRAVITY
from skyarm.identify.held_out import APART, WHOLE, ends_of, predict_held_out
from skyarm.identify.held_out_errors import HOLD, IDENTIFIED, SHORTEST, START, HeldOut
from skyarm.identify.identified_numbers import Identified
from skyarm.identify.identified_report import prediction_lines
from skyarm.identify.identify_windows import SearchOptions, identify_by_windows
from skyarm.identify.log_checks import check_log, require_no_refusal
from skyarm.identify.logged_commands import as_samples, commanded_speeds, flying_spans
from skyarm.identify.open_loop import OpenLoopPredictor, places_of
from skyarm.identify.windows import clock_step, on_clock
from skyarm.vehicle.vehicle_records import Vehicle
from support.measured_tables import print_table, progress
from support.vehicles import quadrotor

LIST = "real_flights.toml"
CACHE = Path(__file__).parents[2] / "out" / "real"
HALF, HORIZON, SHARE = 10.0, 0.5, 95.0
"""s, of each half at most; s, of the predictions; %, of errors that a range holds."""

HEADS = (
    "flight",
    "commands, Hz",
    ">each half, s",
    "search",
    ">start file, rad/s",
    ">hold, rad/s",
    ">identified, rad/s",
    ">coverage, %",
    ">better than hold up to, s",
)

Row = Mapping[str, Any]


def listed(folder: Path | None) -> tuple[list[Row], Mapping[str, Row]]:
    """Flights and vehicles of the list: the folder's own if it has one."""
    own = folder is not None and (folder / LIST).is_file()
    file = folder / LIST if own and folder else Path(__file__).with_name(LIST)
    content = tomllib.loads(file.read_text("utf-8"))
    return content["flights"], content["vehicles"]


def file_of(row: Row, folder: Path | None) -> Path:
    """Log of a row: in the folder that was given, in the cache, or fetched into it.

    Raises:
        ValueError: one line: it is not what the list says. OSError: it is not there, or
            cannot be fetched.
    """
    name = row.get("file", row["name"])
    file = (folder or CACHE) / name
    if folder is None and not file.is_file():
        with urllib.request.urlopen(row["url"], timeout=30) as answer:
            content = answer.read()
        _require_sum(row, content)
        CACHE.mkdir(parents=True, exist_ok=True)
        file.write_bytes(content)
        progress(f"{row['name']}: fetched from {row['url']}; licence: {row['licence']}")
    _require_sum(row, file.read_bytes())
    return file


def _require_sum(row: Row, content: bytes) -> None:
    found = hashlib.sha256(content).hexdigest()
    if row.get("sha256", found) != found:
        raise ValueError(f"sha256 = {found}: must be {row['sha256']}: fetch it anew")


def vehicle_of(name: str, vehicles: Mapping[str, Row]) -> Vehicle:
    """Start vehicle of the list: a rigid quadrotor whose thrust lifts it at its
    ``hover`` signal.
    """
    numbers = dict(vehicles[name])
    if "like" in numbers:
        numbers = {**vehicles[numbers.pop("like")], **numbers}
    mass, inertia, places, hover = (
        numbers.pop(each) for each in ("mass", "inertia", "places", "hover")
    )
    thrust = mass * GRAVITY / len(places) / (hover * numbers["max_speed"]) ** 2
    return quadrotor(name, mass, inertia, places, thrust_coefficient=thrust, **numbers)


def halves(flight: FlightData, start: Vehicle) -> tuple[FlightData, FlightData]:
    """Parts before and behind the middle of the longest time in the air."""
    spans = flying_spans(commanded_speeds(flight, start), start) or [
        (flight.start, flight.end)
    ]
    begin, end = max(spans, key=lambda each: each[1] - each[0])
    middle, half = 0.5 * (begin + end), min(HALF, 0.5 * (end - begin))
    return flight.section(middle - half, middle), flight.section(middle, middle + half)


def sizes(found: Identified, start: Vehicle, flight: FlightData) -> np.ndarray:
    """Errors (K,) of the body rate, rad/s, of single predictions of a flight by the
    identified vehicle.
    """
    step = clock_step([flight], start)
    step = SHORTEST / np.ceil(SHORTEST / step - 1e-9)
    clock = on_clock(flight, start, step)
    loop = OpenLoopPredictor(
        found.vehicle,
        found.surroundings,
        [flight],
        [clock],
        flight.gravity,
        [found.surroundings.thrust],
    )
    windows = loop.windows([places_of(clock, start, max(1, round(APART / step)))])
    (ends,) = ends_of(loop, windows, [HORIZON], loop.begins(windows.windows))
    left = ends.measured - (ends.off * WHOLE[..., None, :]).sum(axis=1)
    return np.linalg.norm(left[-1], axis=1)


def covered(
    found: Identified, start: Vehicle, fitted: FlightData, other: FlightData
) -> float:
    """Share (%) of the other half's errors within the range that holds most of the
    fitted half's.
    """
    range_of_fit = np.percentile(sizes(found, start, fitted), SHARE)
    return 100.0 * float((sizes(found, start, other) <= range_of_fit).mean())


def helps(held_out: HeldOut) -> float:
    """Longest horizon (s) up to which the identified vehicle predicts the body rate
    better than holding; 0 if none.
    """
    last = 0.0
    for own, hold in zip(
        held_out.errors[IDENTIFIED], held_out.errors[HOLD], strict=True
    ):
        if not own.rate < hold.rate:
            break
        last = own.horizon
    return last


def told(name: str, line: str) -> None:
    """Show a line on a flight on the standard error."""
    progress(f"{name}: {line}")


def judge(
    name: str,
    flight: FlightData,
    start: Vehicle,
    rate: float,
    options: Mapping[str, Any],
) -> list[str]:
    """Row of the table: identify one half, predict the other.

    Raises:
        ValueError: one line: the product refuses the log.
    """
    fitted, other = (align_poses(each)[0] for each in halves(flight, start))
    faults = [fault for each in (fitted, other) for fault in check_log(each, start)]
    require_no_refusal(faults)
    search = SearchOptions(**options)
    found = identify_by_windows([fitted], start, search, partial(told, name))
    if found.sampled:
        fitted, other = as_samples(fitted), as_samples(other)
    held_out = predict_held_out(found, start, [other], search, seen=[fitted])
    for line in (*(each.words for each in faults), *prediction_lines(held_out)):
        told(name, line)
    errors = {
        each: next(row.rate for row in rows if row.horizon == HORIZON)
        for each, rows in held_out.errors.items()
    }
    return [
        name,
        f"{rate:.0f}",
        f"{fitted.duration:.0f}",
        "settled" if found.settled else "did not settle",
        *(f"{errors[each]:.2f}" for each in (START, HOLD, IDENTIFIED)),
        f"{covered(found, start, fitted, other):.0f}",
        f"{longest:g}" if (longest := helps(held_out)) else "never",
    ]


def refused(name: str, rate: float, cause: str) -> list[str]:
    """Row of a log that the product refuses, whose cause is told on the standard
    error.
    """
    progress(f"{name}: refused: {cause}")
    return [name, f"{rate:.0f}", "", "refused", *[""] * 5]


SIMULATED: Mapping[str, tuple[str, Sequence[str]]] = {
    "simulated, good sensors": ("low", POSES),
    "simulated, poor sensors": ("high", POSES),
}
"""Name of a row -> noise, and channels that are left out: those that a real log of the
table lacks."""


def simulated() -> Iterator[list[str]]:
    """Rows of a simulated quadrotor whose start file is 20 to 30 % off."""
    for name, (noise, without) in SIMULATED.items():
        case = planted("quad", 0, seconds=30.0)
        yield judge(name, measured(case, noise, without), case.start, 500.0, {})


def real(folder: Path | None, only: str, failed: list[str]) -> Iterator[list[str]]:
    """Rows of the logs that are there; the names of those that are not what they must
    be are added to ``failed``.
    """
    flights, vehicles = listed(folder)
    for row in flights:
        name = row["name"]
        if only not in name:
            continue
        try:
            file = file_of(row, folder)
        except OSError as error:
            progress(f"{name}: skipped: {error}")
            continue
        except ValueError as error:
            progress(f"{name}: {error}")
            failed.append(name)
            continue
        start = vehicle_of(row["vehicle"], vehicles)
        try:
            yield judge(
                name,
                skyarm.load_flight(file),
                start,
                row["rate"],
                row.get("options", {}),
            )
        except ValueError as error:
            yield refused(name, row["rate"], str(error))


def rows_of(given: argparse.Namespace, failed: list[str]) -> Iterable[list[str]]:
    """All rows that were asked for."""
    folder = os.environ.get("REAL_LOGS")
    if not given.real:
        yield from simulated()
    if not given.simulated:
        yield from real(Path(folder) if folder else None, given.only, failed)


def main(words: Sequence[str] | None = None) -> int:
    """Print the table; 1 if a log is not what the list says."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--simulated", action="store_true", help="simulated flights only"
    )
    parser.add_argument("--real", action="store_true", help="real flights only")
    parser.add_argument(
        "--only",
        default="",
        metavar="WORDS",
        help="real flights with these words in their names",
    )
    given, failed = parser.parse_args(words), list[str]()
    rows = iter(rows_of(given, failed))
    first = next(rows, None)
    if first is None:
        print(
            "skipped: none of the logs is there"
            if not failed
            else f"refused: {', '.join(failed)}"
        )
    else:
        print_table(HEADS, (row for part in ([first], rows) for row in part))
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
