"""What ``skyarm run`` prints of its flight. Imports little: a short flight ends sooner than a library loads."""

from __future__ import annotations

import numpy as np
from rich.console import Group, RenderableType
from rich.text import Text

from skyarm.cli.terminal_tables import add, shown, table_of
from skyarm.files import printable
from skyarm.metrics.windows import Windows, windows_of
from skyarm.simulate import Log


def episode(log: Log) -> RenderableType:
    """How an episode ended, what flew, and its errors against the continuous reference."""
    name, status, end = log.info["scenario"], log.status, log.info["end_time"]
    title = f"{name}: {status} at {end:g} s" + (f": {log.info['cause']}" if log.info["cause"] else "")
    heads = Text(printable(title), style="bold"), Text(printable(flown(log)))
    if not log.time.size:
        return Group(*heads)
    steady = Windows().of_flight(float(log.info["duration"]), windows_of(log)).steady
    inside = steady.of(log)
    pairs = [("position, m", log.position - log.position_reference)]
    if log.joints.shape[1]:
        pairs.append(("joints, rad or m", log.joints - log.joints_reference))
    if not np.array_equal(log.tool, log.position):
        pairs.append(("tip, m", log.tool - log.tool_reference))
    table = table_of("error", f"mean, {steady}", f"max, {steady}", "max, whole flight")
    for label, error in pairs:
        norm = np.linalg.norm(error, axis=1)
        seen = [shown(float(each), 4) for each in (norm[inside].mean(), norm[inside].max())] if inside.any() else "--"
        add(table, label, *seen, shown(float(norm.max()), 4))
    return Group(*heads, table)


def flown(log: Log) -> str:
    """Law, plant, integrator, seed and plugins of a flight in words."""
    info = log.info
    plugins = info.get("plugins") or {}
    line = f"law {info['controller']} on {info['plant_vehicle']}, plant {info['plant']} ({info['integrator']}), seed "
    made = len((info.get("scenario_record") or {}).get("changes", ()))
    more = f", {made} change{'s' if made > 1 else ''} in flight" if made else ""
    return line + str(info["seed"]) + more + (f", plugins {', '.join(sorted(plugins))}" if plugins else "")
