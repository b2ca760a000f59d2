"""Layouts for programs that show logs: which panels there are and which of a flight's fields they plot.

Foxglove and Lichtblick open the JSON file (Layouts, Import from file), PlotJuggler the XML file (Layout, Load). Both
name topics of an MCAP file or a ROS 1 bag as :mod:`skyarm.log.ros.topics` writes them, for the joints and rotors of one
vehicle.
"""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

from skyarm.log.flight_log import Log
from skyarm.log.log_columns import SETPOINT, columns
from skyarm.log.ros.scene import MOVING_TOPIC, WORLD, WORLD_TOPIC, WorldMarkers
from skyarm.log.ros.topics import FLIGHT_TOPIC
from skyarm.records.files import write_atomically

FOXGLOVE, PLOTJUGGLER = "foxglove.json", "plotjuggler.xml"
"""Names of the files."""

COLORS = ("#1f77b4", "#ff7f0e", "#2ca02c", "#d62728", "#9467bd", "#8c564b", "#e377c2", "#7f7f7f")

PLOTS = {
    "position, m": ("position", "position_reference", "estimate.position"),
    "tip, m": ("tool", "tool_reference"),
    "joints, rad or m": ("joints", "joints_reference", "estimate.joints"),
    "joint efforts, N m or N": ("efforts",),
    "rotor speeds, rad/s": ("rotor_speeds",),
    "wind, N": ("wind_force",),
    "contact, N": ("contact_force", "contact_friction"),
}
"""Title of a plot -> the log's arrays in it."""

SETPOINTS = "joint setpoints"
"""Title of the commands to joints that take no torque, before their unit: angles and rates have plots of their own."""

METRICS = {"errors, m and rad": ("position_error", "joint_error", "tip_error"), "tilt, rad": ("tilt",)}
"""Title of a plot -> topics below /metrics in it."""

Plot = tuple[str, list[tuple[str, str]]]
"""Title, and (topic, field) of each curve."""


def plots(log: Log) -> list[Plot]:
    """Plots of both layouts; a plot without curves, of a vehicle without joints, is left out."""
    by_array: dict[str, list[tuple[str, str]]] = {}
    for each in columns(log):
        told = each.array == "efforts" and each.name.startswith(SETPOINT)
        group = f"{SETPOINTS}, {each.unit}".rstrip(", ") if told else each.array
        by_array.setdefault(group, []).append((FLIGHT_TOPIC, each.name))
    found = [
        (title, [curve for array in arrays for curve in by_array.get(array, ())]) for title, arrays in PLOTS.items()
    ]
    found += [(group, curves) for group, curves in by_array.items() if group.startswith(SETPOINTS)]
    found += [(title, [(f"/metrics/{name}", "data") for name in names]) for title, names in METRICS.items()]
    return [(title, curves) for title, curves in found if curves]


def write_layouts(log: Log, folder: str | os.PathLike[str]) -> list[Path]:
    """Write both layouts for a log's vehicle into a folder."""
    shown = plots(log)
    return [
        write_atomically(
            Path(folder, FOXGLOVE), (json.dumps(foxglove(shown, world_of(log)), indent=2) + "\n").encode()
        ),
        write_atomically(Path(folder, PLOTJUGGLER), plotjuggler(shown).encode()),
    ]


def world_of(log: Log) -> tuple[str, ...]:
    """Topics that hold the shapes of a log's world."""
    markers = WorldMarkers(log)
    return (WORLD_TOPIC,) * bool(markers.still()) + (MOVING_TOPIC,) * markers.moves


def foxglove(shown: Sequence[Plot], world: Sequence[str] = ()) -> dict[str, Any]:
    """Layout of Foxglove and Lichtblick: the vehicle on the left, plots in two columns beside it.

    Args:
        shown: the plots.
        world: topics of the world's shapes.
    """
    panels: dict[str, Any] = {"3D!vehicle": _scene(world)}
    for k, (title, curves) in enumerate(shown):
        panels[f"Plot!{k}"] = {
            "title": title,
            "paths": [
                {"value": f"{topic}.{name}", "label": name, "enabled": True, "timestampMethod": "receiveTime"}
                for topic, name in curves
            ],
            "xAxisVal": "timestamp",
            "showXAxisLabels": True,
            "showYAxisLabels": True,
            "showLegend": True,
            "legendDisplay": "floating",
            "isSynced": True,
        }
    names = [f"Plot!{k}" for k in range(len(shown))]
    half = (len(names) + 1) // 2
    beside = _split("row", [_split("column", names[:half]), _split("column", names[half:])])
    return {
        "configById": panels,
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": {"speed": 1},
        "layout": {"first": "3D!vehicle", "second": beside, "direction": "row", "splitPercentage": 40},
    }


def _scene(world: Sequence[str]) -> dict[str, Any]:
    """The panel that draws the vehicle, its reference and its world, seen from 4 m away."""
    drawn = (*world, "/vehicle", "/reference/base", "/reference/tip", "/tip")
    camera = {
        "perspective": True,
        "distance": 4,
        "phi": 65,
        "thetaOffset": 40,
        "target": [0, 0, 1],
        "targetOffset": [0, 0, 0],
        "targetOrientation": [0, 0, 0, 1],
        "fovy": 45,
        "near": 0.05,
        "far": 500,
    }
    grid = {"layerId": "foxglove.Grid", "instanceId": "grid", "visible": True, "frameId": WORLD, "order": 1}
    lines = {
        "size": 10,
        "divisions": 10,
        "lineWidth": 1,
        "color": "#808080",
        "position": [0, 0, 0],
        "rotation": [0, 0, 0],
    }
    return {
        "title": "vehicle",
        "followTf": WORLD,
        "followMode": "follow-pose",
        "cameraState": camera,
        "scene": {},
        "transforms": {},
        "topics": {name: {"visible": True} for name in drawn},
        "layers": {"grid": grid | lines},
    }


def _split(direction: str, parts: Sequence[Any]) -> Any:
    """Panels of equal size one behind the other, as nested pairs."""
    if len(parts) == 1:
        return parts[0]
    rest = _split(direction, parts[1:])
    return {"first": parts[0], "second": rest, "direction": direction, "splitPercentage": round(100 / len(parts), 3)}


def plotjuggler(shown: Sequence[Plot]) -> str:
    """Layout of PlotJuggler 3: plots in two columns."""
    half = (len(shown) + 1) // 2
    sides = "".join(_dock_column(side) for side in (shown[:half], shown[half:]) if side)
    count = 1 + (len(shown) > half)
    sizes = ";".join([f"{1 / count:g}"] * count)
    return f"""<?xml version='1.0' encoding='UTF-8'?>
<root>
 <tabbed_widget name="Main Window" parent="main_window">
  <Tab tab_name="flight" containers="1">
   <Container>
    <DockSplitter orientation="|" sizes="{sizes}" count="{count}">
{sides}    </DockSplitter>
   </Container>
  </Tab>
  <currentTabIndex index="0"/>
 </tabbed_widget>
 <use_relative_time_offset enabled="1"/>
</root>
"""


def _dock_column(shown: Sequence[Plot]) -> str:
    sizes = ";".join([f"{1 / len(shown):g}"] * len(shown))
    areas = "".join(_dock_area(title, curves) for title, curves in shown)
    return f'     <DockSplitter orientation="-" sizes="{sizes}" count="{len(shown)}">\n{areas}     </DockSplitter>\n'


def _dock_area(title: str, curves: Sequence[tuple[str, str]]) -> str:
    lines = "".join(
        f"        <curve name={quoteattr(f'{topic}/{name}')} color={quoteattr(COLORS[k % len(COLORS)])}/>\n"
        for k, (topic, name) in enumerate(curves)
    )
    return (
        f"      <DockArea name={quoteattr(title)}>\n"
        '       <plot style="Lines" mode="TimeSeries">\n'
        f"{lines}       </plot>\n      </DockArea>\n"
    )
