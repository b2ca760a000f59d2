"""What ``skyarm run`` prints of its flight. Imports little: a short flight ends sooner than a library loads."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from rich.console import Group, RenderableType
from rich.text import Text

from skyarm.cli.terminal_chart import chart
from skyarm.cli.terminal_tables import add, shown, table_of
from skyarm.files import printable
from skyarm.log.grasp_periods import GraspPeriod
from skyarm.log.phase_timeouts import timed_out
from skyarm.metrics.path_distance import path_distance
from skyarm.metrics.windows import Windows, windows_of
from skyarm.simulate import Log

LABELS = {"position": "position, m", "joints": "joints, rad or m", "tip": "tip, m"}

BESIDE = {"lag": "governor's lag, s", "base_to_path": "base to its path, m", "tip_to_path": "tip to its path, m"}
"""What stands beside the errors of a flight with a governor."""


def episode(log: Log) -> RenderableType:
    """How an episode ended, what flew, and its errors against the continuous reference."""
    name, status, end = log.info["scenario"], log.status, log.info["end_time"]
    title = f"{name}: {status} at {end:g} s" + (f": {log.info['cause']}" if log.info["cause"] else "")
    heads = Text(printable(title), style="bold"), Text(printable(flown(log)))
    if not log.time.size:
        return Group(*heads)
    steady = steady_window(log)
    table = table_of("error (continuous)", f"mean, {steady}", f"max, {steady}", "max, whole flight")
    for what, found in errors(log).items():
        add(table, LABELS[what], *("-" if value is None else shown(value, 4) for value in found.values()))
    for what, found in beside_errors(log).items():
        add(table, BESIDE[what], *("-" if value is None else shown(value, 4) for value in found.values()))
    lags = [lag_words(log)] if log.lag_found.size else []
    beneath = (*lags, *contact_lines(log), *grasp_lines(log), *phase_lines(log), *log.shortfall.lines)
    return Group(*heads, table, *(Text(printable(line)) for line in beneath))


def phase_lines(log: Log) -> list[str]:
    """When the phases of a task that waits were done, and which of them by their timeout, in one line."""
    late = timed_out(log)
    ends = [
        f"{name} {'-' if end is None else f'{end:g} s'}{' (timeout)' if number in late else ''}"
        for number, (name, end) in enumerate(log.phase_ends)
    ]
    return [f"phases done: {', '.join(ends)}"] if ends else []


def contact_lines(log: Log) -> list[str]:
    """What touched what in words, a line for each pair."""
    return [
        f"{each['surface']} touched {each['point']} at {each['first_touch']:g} s: lost {each['losses']} times, "
        f"largest force {each['peak']:.3g} N"
        for each in contacts(log)
    ]


def contacts(log: Log) -> list[dict[str, Any]]:
    """Each pair that touched: time of the first touch, s, how often contact was lost, largest normal force, N."""
    pairs: dict[tuple[str, str], list[Any]] = {}
    for period in log.contact_periods:
        pairs.setdefault((period.surface, period.point), []).append(period)
    return [
        {
            "surface": surface,
            "point": point,
            "first_touch": periods[0].start,
            "losses": sum(each.end is not None for each in periods),
            "peak": max(each.peak for each in periods),
        }
        for (surface, point), periods in pairs.items()
    ]


def grasp_lines(log: Log) -> list[str]:
    """What each gripper held in words, a line for each grasp."""
    return [
        f"{each.gripper} took {each.held} at {each.start:g} s: {_ended(each)}, largest force {each.peak:.3g} N"
        for each in log.grasp_periods
    ]


def _ended(grasp: GraspPeriod) -> str:
    if grasp.end is None:
        return "holds it to the end"
    return f"{'gave way' if grasp.gave_way else 'let go'} at {grasp.end:g} s"


def lag_words(log: Log) -> str:
    """What the law found at the end of how late its loops act."""
    rotors, joints = 1e3 * log.lag_found[-1]
    return f"lag found at the end, beyond what the law was told: rotors {rotors:.1f} ms, joints {joints:.1f} ms"


def facts(log: Log) -> dict[str, Any]:
    """The same for a machine."""
    info = log.info
    named = ("scenario", "controller", "plant", "integrator", "seed", "duration", "end_time", "status", "cause")
    found = {name: info[name] for name in named} | {"vehicle": info["plant_vehicle"]}
    if not log.time.size:
        return found
    steady = steady_window(log)
    found |= {"steady_window_s": [steady.start, steady.stop], "errors_continuous": errors(log)}
    found |= dataclasses.asdict(log.shortfall)
    if log.lag_found.size:
        found["lag_found_s"] = log.lag_found[-1]
    if log.contact_force.size:
        found["contacts"] = contacts(log)
    if log.gripper_taken.size:
        found["grasps"] = [dataclasses.asdict(each) for each in log.grasp_periods]
    if log.phase.size:
        late = timed_out(log)
        found["phase_ends"] = [
            {"phase": name, "end": end, "timeout": number in late} for number, (name, end) in enumerate(log.phase_ends)
        ]
    beside = beside_errors(log)
    return found | ({"governor": beside} if beside else {})


def steady_window(log: Log) -> Any:
    """The window over which errors are summed up."""
    return Windows().of_flight(float(log.info["duration"]), windows_of(log)).steady


def errors(log: Log) -> dict[str, dict[str, float | None]]:
    """Position, joints and tip -> mean and largest norm of the error in the window, and largest of the whole flight.

    Against the continuous reference, as the metrics whose names end with ``_continuous``; None where nothing of the
    window was flown.
    """
    return _summed(log, error_norms(log))


def beside_errors(log: Log) -> dict[str, dict[str, float | None]]:
    """The same of a governor's lag, s, and of the distances of base and tip to the curves that they follow, m.

    Empty without a governor.
    """
    if not log.path_time.size or log.phase.size:
        return {}
    distances = {"lag": log.time - log.path_time, "base_to_path": path_distance(log.position, log.position_reference)}
    if not np.array_equal(log.tool, log.position):
        distances["tip_to_path"] = path_distance(log.tool, log.tool_reference)
    return _summed(log, distances)


def _summed(log: Log, quantities: dict[str, Any]) -> dict[str, dict[str, float | None]]:
    inside = steady_window(log).of(log)
    found: dict[str, dict[str, float | None]] = {}
    for what, error in quantities.items():
        mean, most = (float(error[inside].mean()), float(error[inside].max())) if inside.any() else (None, None)
        found[what] = {"mean": mean, "max": most, "max_whole_flight": float(error.max())}
    return found


def error_norms(log: Log) -> dict[str, Any]:
    """Position, joints and tip, as far as a vehicle has them -> (N,) norm of the error against the reference."""
    pairs = {"position": (log.position, log.position_reference)}
    if log.joints.shape[1]:
        pairs["joints"] = log.joints, log.joints_reference
    if not np.array_equal(log.tool, log.position):
        pairs["tip"] = log.tool, log.tool_reference
    return {what: np.linalg.norm(flown - wanted, axis=1) for what, (flown, wanted) in pairs.items()}


def error_chart(log: Log) -> list[str]:
    """Lines of a chart of the tip's error over time; of the position's where the vehicle has no arm."""
    found = error_norms(log) if log.time.size else {}
    if not found:
        return []
    what = "tip" if "tip" in found else "position"
    return ["", *chart(log.time, 1e3 * found[what], f"{what} error, mm"), ""]


MOST_NAMED = 3
"""Numbers changed in flight that are named; a record of many would fill the line."""


def flown(log: Log) -> str:
    """Law, plant, integrator, seed and plugins of a flight in words."""
    info = log.info
    plugins = info.get("plugins") or {}
    line = f"law {info['controller']} on {info['plant_vehicle']}, plant {info['plant']} ({info['integrator']}), seed "
    changes = (info.get("scenario_record") or {}).get("changes", ())
    made, paths = len(changes), dict.fromkeys(str(each["path"]) for each in changes if "path" in each)
    named = f" (of {', '.join(paths)})" if 0 < len(paths) <= MOST_NAMED else ""
    more = f", {made} change{'s' if made > 1 else ''} in flight{named}" if made else ""
    return line + str(info["seed"]) + more + (f", plugins {', '.join(sorted(plugins))}" if plugins else "")
