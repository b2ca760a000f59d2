"""The command that draws what was flown."""

from __future__ import annotations

from typing import Annotated

import typer

from skyarm.cli.app import app, tell
from skyarm.cli.machine_output import give


@app.command()
def plot(
    flights: Annotated[
        list[str], typer.Argument(metavar="FLIGHT...", help="logs, as NAME=FILE for a name; or a sweep's folder")
    ],
    file: Annotated[str, typer.Option("--out", "-o", help="the picture to write: .png, .svg or .pdf")],
    kind: Annotated[
        str | None,
        typer.Option(
            help="of flights: tracking, attitude, tip, contact, efforts, rotors, path or all; all if left out"
        ),
    ] = None,
    window: Annotated[
        tuple[float, float] | None, typer.Option(metavar="START STOP", help="of flights: s; the whole if left out")
    ] = None,
    metric: Annotated[list[str] | None, typer.Option(help="of a sweep; repeat")] = None,
    over: Annotated[
        str | None, typer.Option(metavar="NUMBER", help="of a sweep: a varied number, or NAME = an expression of some")
    ] = None,
    by: Annotated[str | None, typer.Option(metavar="NUMBER", help="of a sweep: curves for each of its values")] = None,
    center: Annotated[str | None, typer.Option(help="of a sweep: median or mean; median if left out")] = None,
    band: Annotated[
        tuple[float, float] | None, typer.Option(metavar="LOW HIGH", help="of a sweep: shares; 0.05 0.95 if left out")
    ] = None,
    style: Annotated[str, typer.Option(help="paper (a column, readable in grey) or talk (a slide)")] = "paper",
    dark: Annotated[bool, typer.Option("--dark", help="of a talk, light on dark")] = False,
) -> None:
    """Draw flights, or curves of a sweep's metrics.

    Flights are drawn over each other, with references, limits of joints and rotors, gusts and faults. Of a sweep's
    folder the --metric is drawn over a varied number: its median and a band over all else that varies, and the share
    of episodes that were lost. An expression has + - * / ( ) and sqrt, as in --over "length = sqrt(a * a + b * b)".
    """
    from skyarm.cli.plot_command import draw_flights, draw_sweep, is_sweep

    asked = {"--metric": metric, "--over": over, "--by": by, "--center": center, "--band": band}
    if is_sweep(flights):
        given = {"--kind": kind, "--window": window}
        picture = draw_sweep(flights[0], file, asked, given, style, dark=dark)
    else:
        picture = draw_flights(flights, file, kind, window, asked, style, dark=dark)
    give(picture=picture)
    tell(f"picture: {picture}")
