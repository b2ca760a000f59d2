"""Replay of a measured flight for ``skyarm studio --vehicle``, with delays and offsets
identified with the vehicle.
"""

from __future__ import annotations

import dataclasses
from pathlib import Path

from skyarm.cli.arguments import require_within
from skyarm.cli.lines import say
from skyarm.cli.output import tell
from skyarm.flight_data.flight_data import load_flight
from skyarm.identify.identified_file import read_surroundings
from skyarm.identify.identified_parts import IdentifiedSurroundings
from skyarm.identify.identified_report import NUMBERS
from skyarm.identify.isolate_fault import find_faults
from skyarm.identify.measured_motion import joints_in_order
from skyarm.identify.open_loop import OpenLoopFlight
from skyarm.records.files import one_line, shown
from skyarm.vehicle.vehicle_files import load_vehicle
from skyarm.view.studio.replay import HORIZONS, PredictionReplay


def replay_of(
    flight: str, vehicle: str, horizon: float, delay: float | None, columns: str | None
) -> PredictionReplay:
    """Read a flight, a vehicle, and the delays and offsets identified with it, and
    predict the flight.
    """
    require_within("--horizon", horizon, *HORIZONS)
    model = load_vehicle(vehicle)
    flown = joints_in_order(load_flight(flight, columns), model)
    about = IdentifiedSurroundings(delay=float(flown.facts.get("command_delay", 0.0)))
    full = 0.0
    beside = Path(vehicle).parent / NUMBERS
    if Path(vehicle).is_file() and beside.is_file():
        of, about_it, volts = read_surroundings(beside, flown.name)
        # delays and offsets belong to the vehicle with which they were found
        if of == model.name:
            about, full = about_it, volts
            tell(f"delays and offsets: {beside}")
        else:
            say(
                f"{beside}: is not used: it is of {shown(of)}, and the vehicle is"
                f" {shown(model.name)}"
            )
    if delay is not None:
        require_within("--delay", delay, 0.0, 1.0)
        about = dataclasses.replace(about, delay=delay)
    predicted = OpenLoopFlight(
        flown, model, about, gravity=flown.gravity, full_voltage=full
    )
    faults = [
        f"{each.channel}: {each.finding}"
        for each in find_faults(flown, model, isolate=False)
    ]
    count = f"{len(faults)} fault{'s' if len(faults) > 1 else ''}"
    warning = one_line(f"{flown.name}: {count}: {'; '.join(faults)}") if faults else ""
    if warning:
        say(f"warning: {warning}")
    return PredictionReplay(
        flown.name, model, predicted.measured, predicted.over, horizon, warning
    )
