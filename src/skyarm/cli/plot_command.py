"""What ``skyarm plot`` and ``skyarm show --drawing`` do."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from skyarm.files import shown, unreadable
from skyarm.log.flight_log import Log


def is_sweep(names: Sequence[str]) -> bool:
    """Whether a sweep's folder is to be drawn.

    Raises:
        ValueError: one line: a folder among other things.
    """
    folders = [name for name in names if name and Path(name).is_dir()]
    if folders and len(names) > 1:
        raise ValueError(f"folder = {shown(folders[0])}: must stand alone; a picture is of one sweep, or of flights")
    return bool(folders)


def draw_flights(
    names: Sequence[str],
    file: str,
    kind: str | None,
    window: tuple[float, float] | None,
    of_sweeps: Mapping[str, Any],
    style: str,
    *,
    dark: bool,
) -> Path:
    """Draw flights over each other; returns the picture's path.

    Raises:
        ValueError, OSError: one line.
    """
    for option, value in of_sweeps.items():
        if value is not None:
            raise ValueError(f"{option} = {shown(value)}: must come with a folder that 'skyarm sweep' wrote")
    from skyarm.figures.flight_facts import flight_labels
    from skyarm.figures.flight_panels import ALL
    from skyarm.figures.flight_plot import plot
    from skyarm.figures.style import picture_style
    from skyarm.files.picture_names import picture_file

    target = picture_file(file, "--out")
    picture_style(style, dark=dark)
    given = [_label_and_file(name) for name in names]
    logs = [_log(path) for _, path in given]
    usual = flight_labels(logs, [path for _, path in given])
    labels = [label or other for (label, _), other in zip(given, usual, strict=True)]
    for i, label in enumerate(labels):
        if label in labels[:i]:
            raise ValueError(f"flight = {shown(names[i])}: must have another name than a flight before it")
    plot(
        dict(zip(labels, logs, strict=True)),
        target,
        kind=ALL if kind is None else kind,
        style=style,
        dark=dark,
        window=window,
    )
    return target


def _label_and_file(name: str) -> tuple[str, str]:
    """NAME=FILE, or a file alone."""
    label, equals, path = name.partition("=")
    return (label.strip(), path) if equals and not Path(name).exists() else ("", name)


def _log(path: str) -> Log:
    """The log of a file.

    Raises:
        ValueError: no log, with what was perhaps meant. OSError: it cannot be read.
    """
    from skyarm.log.formats import load_log
    from skyarm.registry import names

    reason = unreadable(Path(path)) if path else "is no file"
    if reason and Path(path).suffix.removeprefix(".") not in names("log_format"):
        reason = "must be a log that 'skyarm run' wrote, or a sweep's folder"
    if reason:
        raise ValueError(f"flight = {shown(path)}: {reason}")
    return load_log(path)


def draw_sweep(
    folder: str, file: str, asked: Mapping[str, Any], of_flights: Mapping[str, Any], style: str, *, dark: bool
) -> Path:
    """Draw curves of a sweep's metrics; returns the picture's path.

    Raises:
        ValueError, OSError: one line.
    """
    for option, value in of_flights.items():
        if value is not None:
            raise ValueError(f"{option} = {shown(value)}: must come with logs of flights, and this is a folder")
    for option in ("--metric", "--over"):
        if not asked[option]:
            raise ValueError(f"{option}: is missing; a picture of a sweep needs --metric NAME and --over NUMBER")
    from skyarm.figures.metric_figure import plot_sweep
    from skyarm.files.picture_names import picture_file
    from skyarm.sweep.banded_curves import BAND

    target = picture_file(file, "--out")
    plot_sweep(
        folder,
        asked["--metric"],
        asked["--over"],
        target,
        by=asked["--by"],
        center="median" if asked["--center"] is None else asked["--center"],
        band=asked["--band"] or BAND,
        style=style,
        dark=dark,
    )
    return target


def draw_vehicle(name: str, file: str, style: str, *, dark: bool) -> Path:
    """Draw a vehicle, all labelled; returns the picture's path.

    Raises:
        ValueError, OSError: one line.
    """
    from skyarm.figures.style import save_picture
    from skyarm.figures.vehicle_drawing import vehicle_drawing
    from skyarm.files.picture_names import picture_file
    from skyarm.vehicle.vehicle_files import load_vehicle

    target = picture_file(file, "--drawing")
    return save_picture(vehicle_drawing(load_vehicle(name), style=style, dark=dark), target, style)
