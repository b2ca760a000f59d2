"""Command ``skyarm plot``: pictures of flights and of a sweep's metrics."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

from skyarm.cli.arguments import (
    Out,
    distinct_labels,
    label_of,
    word_completion,
)
from skyarm.cli.output import give, tell
from skyarm.log.flight_log import Log
from skyarm.log.formats import WRITTEN_BY, load_log
from skyarm.records.files import shown, unreadable
from skyarm.records.files.names import picture_file
from skyarm.records.registry import names as registered
from skyarm.view.figures.flight_facts import flight_labels
from skyarm.view.figures.flight_panels import ALL, DEPTH, KINDS, PATH
from skyarm.view.figures.flight_plot import plot as draw


def plot(
    flights: list[str],
    file: Out,
    kind: Annotated[
        str | None,
        word_completion(*KINDS, ALL, PATH, DEPTH),
    ] = None,
    window: tuple[float, float] | None = None,
    metric: list[str] | None = None,
    over: str | None = None,
) -> None:
    """Draw flights, or curves of a sweep's metrics.

    Of a sweep the median and a band of 5 to 95 % over all else that varies. An
    expression has + - * / ( ) and sqrt, as in --over "length = sqrt(a * a + b * b)".

    Options:
        flights FLIGHT...: logs, with a label as NAME=FILE; or the folder of one sweep
        file FILE: the picture to write: .png, .svg or .pdf
        kind: with flights: tracking, attitude, tip, contact, efforts, rotors, parts,
            team, path, depth or all; all if left out
        window START STOP: with flights: the times that are drawn, s; the whole flight
            if left out
        metric METRIC: with a sweep: the metric that is drawn; repeat
        over NUMBER: with a sweep: the horizontal axis, a varied number or an expression
            of them
    """
    folders = [name for name in flights if name and Path(name).is_dir()]
    if folders and len(flights) > 1:
        raise ValueError(
            f"folder = {shown(folders[0])}: must stand alone; a picture is of one"
            " sweep, or of flights"
        )
    of_sweeps = {"--metric": metric, "--over": over}
    for option, value in (
        {"--kind": kind, "--window": window} if folders else of_sweeps
    ).items():
        if value is not None:
            where = (
                "logs of flights, and this is a folder"
                if folders
                else "a folder that 'skyarm sweep' wrote"
            )
            raise ValueError(f"{option} = {shown(value)}: must come with {where}")
    if not folders:
        logs, target = _logs_by_label(flights), picture_file(file, "--out")
        draw(logs, target, kind=ALL if kind is None else kind, window=window)
    elif not metric or not over:
        missing = "--over" if metric else "--metric"
        raise ValueError(
            f"{missing}: is missing; a picture of a sweep needs --metric NAME and"
            " --over NUMBER"
        )
    else:
        from skyarm.studies.sweep.sweep_figures import plot_sweep

        target = picture_file(file, "--out")
        plot_sweep(folders[0], metric, over, target)
    give(picture=target)
    tell(f"picture: {target}")


def _logs_by_label(names: Sequence[str]) -> dict[str, Log]:
    """Load logs by legend label: the name in NAME=FILE, or a generated unique label."""
    given, paths = zip(*map(label_of, names), strict=True)
    logs = [_log(path) for path in paths]
    labels = distinct_labels(names, given, flight_labels(logs, paths))
    return dict(zip(labels, logs, strict=True))


def _log(path: str) -> Log:
    reason = unreadable(Path(path)) if path else "is no file"
    if reason and Path(path).suffix.removeprefix(".") not in registered("log_format"):
        reason = f"must be a log that {WRITTEN_BY} wrote, or a sweep's folder"
    if reason:
        raise ValueError(f"flight = {shown(path)}: {reason}")
    return load_log(path)
