"""What ``skyarm run`` prints of its flight. Imports little: a short flight ends sooner than a library loads."""

from __future__ import annotations

import numpy as np
from rich.console import RenderableType
from rich.text import Text

from skyarm.cli.lines import printable
from skyarm.cli.tables import add, shown, table_of, titled
from skyarm.simulate import Log


def episode(log: Log) -> RenderableType:
    """How an episode ended, and its errors against the continuous reference."""
    name, status, end = log.info["scenario"], log.status, log.info["end_time"]
    title = f"{name}: {status} at {end:g} s" + (f": {log.info['cause']}" if log.info["cause"] else "")
    if not log.time.size:
        return Text(printable(title), style="bold")
    last = log.time >= 2.0 / 3.0 * log.time[-1]
    pairs = [("position, m", log.position - log.position_reference)]
    if log.joints.shape[1]:
        pairs.append(("joints, rad or m", log.joints - log.joints_reference))
    if not np.array_equal(log.tool, log.position):
        pairs.append(("end effector, m", log.tool - log.tool_reference))
    table = table_of("error", "mean, last third", "max, last third", "max, whole flight")
    for label, error in pairs:
        norm = np.linalg.norm(error, axis=1)
        add(table, label, *(shown(float(value), 4) for value in (norm[last].mean(), norm[last].max(), norm.max())))
    return titled(title, table)
