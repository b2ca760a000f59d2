"""Report of the delays and lags of one flight log: the nominal model that they refer
to, table and notes.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

from skyarm.algebra import Sym3
from skyarm.flight_data.quantities import GRAVITY
from skyarm.identify.loop_lags import Estimated, Lag, LoopLags
from skyarm.log.flight_log import Log
from skyarm.log.flown_scenario import written_at
from skyarm.records.files import printable
from skyarm.records.files.toml import toml_key
from skyarm.records.text_tables import Row, aligned_lines
from skyarm.vehicle import Body, Vehicle
from skyarm.vehicle.vehicle_files import load_vehicle

HEADS = ("", "delay and lag", "delay", "up", "down", "over model", "explained")


def nominal_model(
    log: Log, vehicle: str | None, gravity: float | None
) -> tuple[Vehicle, float]:
    """Vehicle and gravity (m/s^2) against which delays and lags of a log are
    identified.

    Args:
        log: log of one flight.
        vehicle: name or file; None for the model of the log's law.
        gravity: m/s^2; None for the log's, or 9.81.

    Raises:
        ValueError: one line: neither a vehicle nor a log that holds its scenario.
    """
    if vehicle is not None:
        flown = float(log.info.get("plant_gravity", GRAVITY))
        return load_vehicle(vehicle), flown if gravity is None else gravity
    if not log.info.get("scenario_record"):
        raise ValueError(
            "--vehicle: is missing; the log does not say which vehicle flew (with"
            " --lags, for its lags alone)"
        )
    model = log.scenario.agent.model
    return _solid(model.vehicle), float(model.gravity) if gravity is None else gravity


def _solid(vehicle: Vehicle) -> Vehicle:
    """Vehicle prepared for simulation: planar bodies get their largest moment of
    inertia about every axis.
    """

    def whole(body: Body) -> Body:
        if not body.planar:
            return body
        # a planar law's model has one moment of inertia, and no body to be flown
        most = max(float(getattr(body.inertia, axis)) for axis in ("xx", "yy", "zz"))
        return replace(body, inertia=Sym3(most, most, most), planar=False)

    links = tuple(replace(each, body=whole(each.body)) for each in vehicle.links)
    return replace(vehicle, base=whole(vehicle.base), links=links)


def stated_delays(log: Log) -> dict[str, float | None]:
    """Delays of commands and measurements in the log's scenario, s; None where it
    states none.
    """
    delays = written_at(log.info, "delays") or {}
    return {
        name: float(delays[name]) if name in delays else None
        for name in ("command", "measurement")
    }


def every_lag(found: LoopLags) -> list[Lag]:
    """Identified lags of the rotors, then of each joint."""
    return [found.rotors, *found.joints]


PHYSICS_STEP = 0.001
"""Physics step (s) of usual scenarios, of which a command delay is a multiple."""


def lag_tables(found: LoopLags, measured: float = 0.0) -> str:
    """TOML tables of the identified delays, rotor time constants and joint drives;
    empty if none was identified.

    Args:
        found: delays and lags in a log.
        measured: additional nominal measurement delay, s, of logs with true rates.
    """
    lines: list[str] = []
    rotors = found.rotors
    if rotors.is_known:
        periods = round((measured + rotors.delay.value) / found.period)
        lines += [
            "# scenario: what the plant has, in whole physics steps",
            "[delays]",
            (
                "command ="
                f" {round(rotors.delay.value / PHYSICS_STEP) * PHYSICS_STEP:.3f} "
                f" {_from(rotors.delay)}"
            ),
            "",
            (
                "# what a law may be given, as an option of its law: centroidal, and"
                " others"
            ),
            f"# controller.delay = {periods * found.period:.6g}",
            f"# controller.delay_periods = {periods}",
            "",
            "# vehicle file, each of [[rotors]]",
            f"# time_constant_up = {rotors.up.value:.4f}  {_from(rotors.up)}",
            f"# time_constant_down = {rotors.down.value:.4f}  {_from(rotors.down)}",
            "",
        ]
    for joint in found.joints:
        # a lag that its interval does not tell from none is none; where delay and lag
        # are one, it stands for both
        lagging = (
            joint.up.low > PHYSICS_STEP
            if joint.apart
            else joint.together.low > found.period
        )
        if joint.is_known and lagging:
            beside = f"beside a delay of {1e3 * joint.delay.value:.1f} ms"
            lines += [
                f"[plant.drives.{toml_key(joint.name)}]",
                'kind = "lagged_torque"',
                f"time_constant = {joint.up.value:.4f}  {_from(joint.up)}; {beside}",
                "",
            ]
    return "\n".join(lines)


def _from(time: Estimated) -> str:
    return f"# {1e3 * time.low:.2f} to {1e3 * time.high:.2f} ms"


def lag_lines(
    title: str, found: LoopLags, stated: Mapping[str, float | None]
) -> list[str]:
    """Lines of the report of delays and lags, ms, with 95 % confidence intervals; the
    first is the title.

    Args:
        title: names of log and vehicle.
        found: delays and lags.
        stated: delays of the scenario, s, of :func:`stated_delays`.
    """
    rows = [HEADS, *map(_row, every_lag(found))]
    return [title, *aligned_lines(rows), *map(printable, _notes(found, stated))]


def _row(lag: Lag) -> Row:
    if not lag.is_known:
        return (lag.name, "not known", "", "", "", "", f"{lag.explained:.0%}")
    factors = " ".join(
        f"{each:.2f}" for each in dict.fromkeys(lag.factor) if not math.isnan(each)
    )
    cells = map(_cell, (lag.together, lag.delay, lag.up, lag.down))
    return (lag.name, *cells, factors or "-", f"{lag.explained:.0%}")


def _cell(time: Estimated) -> str:
    """Format an identified time in milliseconds with its 95 % confidence interval."""
    return f"{1e3 * time.value:.1f} ({1e3 * time.low:.1f}-{1e3 * time.high:.1f})"


def _notes(lags: LoopLags, stated: Mapping[str, float | None]) -> list[str]:
    """Notes on how to read the identified delays and lags."""
    lines = [
        "ms, with the interval of 95 %; 'delay and lag': both together, as a small"
        " swing meets them."
    ]
    lines += [
        f"{each.name}: not known: {each.reason}"
        for each in every_lag(lags)
        if not each.is_known
    ]
    lines += [f"{name}: not asked: {reason}" for name, reason in lags.left_out.items()]
    vague = [
        each.name
        for each in every_lag(lags)
        if each.is_known and not each.apart and each.together.low > 0.0
    ]
    if vague:
        who = ", ".join(vague)
        lines.append(
            f"{who}: delay and lag cannot be told apart in this flight; trust what they"
            " are together"
        )
    if stated["command"] is None:
        lines.append(
            "The delay runs from a command to the logged rates: if the log holds them"
            " as they were received,"
        )
        lines.append(
            "their age is in it, and what passes through the loop shows the sum of both"
            " only."
        )
    else:
        delays = ", ".join(
            f"{name} {1e3 * (value or 0.0):g} ms" for name, value in stated.items()
        )
        lines.append(
            "The log holds the true state: delays are of commands alone. The scenario"
            f" states: {delays}."
        )
    return lines
