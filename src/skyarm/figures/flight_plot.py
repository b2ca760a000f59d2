"""One flight at a look: position, joints, attitude and rotors over time."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from skyarm.figures import style
from skyarm.figures.embed import image_bytes
from skyarm.files import write_atomically
from skyarm.log.flight_log import Log

Array = npt.NDArray[np.float64]

COLORS = ("#08306b", "#e6762b", "#1b7837", "#762a83", "#6b6b6b", "#b2182b")
"""Of the components of a panel, in order; further ones begin again."""

DPI = 160


def plot(log: Log, file: str | os.PathLike[str] | None = None) -> Figure:
    """Draw a flight: position and joints with their references, attitude, commanded rotor speeds.

    Args:
        log: of the flight.
        file: written there too, as PNG.

    Returns:
        a Matplotlib figure, which a notebook shows; ``figure.savefig`` writes other formats.

    Raises:
        OSError: the file cannot be written.
    """
    panels = 4 if log.joints.size else 3
    info = log.info
    title = f"{info.get('scenario', '')}: {info.get('controller', '')} on {info.get('plant', '')}, {log.status}"
    figure, axes = style.stacked(title, panels)
    left = iter(axes)
    ax = next(left)
    _lines(ax, log, log.position, ("x", "y", "z"), "position", "m")
    _lines(ax, log, log.position_reference)
    if log.joints.size:
        ax = next(left)
        _lines(ax, log, log.joints, [f"joint {i + 1}" for i in range(log.joints.shape[1])], "joints", "rad")
        _lines(ax, log, log.joints_reference)
    _lines(next(left), log, log.euler, ("roll", "pitch", "yaw"), "attitude", "rad")
    rotors = [f"rotor {i + 1}" for i in range(log.rotor_commands.shape[1])]
    _lines(next(left), log, log.rotor_commands, rotors, "rotors", "rad/s")
    if file is not None:
        write_atomically(Path(file), image_bytes(figure, dpi=DPI))
    return figure


def _lines(ax: Axes, log: Log, table: Array, names: Sequence[str] = (), label: str = "", unit: str = "") -> None:
    """A table's columns over time; without names dotted, as the reference of the lines before."""
    for i, column in enumerate(table.T):
        named: dict[str, Any] = {"label": names[i]} if names else {"linestyle": ":"}
        ax.plot(log.time, column, color=COLORS[i % len(COLORS)], linewidth=0.9 if names else 0.7, **named)
    if names:
        style.name_panel(ax, label, unit, "")
        prop = {"size": style.SMALL_SIZE, "family": style.FONT}
        box = {"framealpha": 0.8, "edgecolor": "none", "borderpad": 0.1}
        ax.legend(loc="upper left", ncols=len(names), prop=prop, handlelength=1.2, columnspacing=1.0, **box)
