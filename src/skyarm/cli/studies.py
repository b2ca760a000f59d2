"""The commands on many flights: sweeps, statistics, margins, basins, benches."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from skyarm.cli.app import NOT_COMPLETED, Out, app, console, workers

MOST = 1_000_000
"""Flights of a cell of the bench: more belong into a sweep, which keeps them on disk."""


@app.command()
def sweep(
    study: Annotated[str, typer.Argument(help="a study file (.toml) or the name of a shipped one")],
    out: Annotated[str | None, typer.Option("--out", help="folder of the rows; out/NAME if left out")] = None,
    threads: Annotated[int, typer.Option(help="threads that fly; 0 takes every core")] = 0,
    ray: Annotated[str | None, typer.Option(help="address of a Ray cluster, or local")] = None,
) -> None:
    """Fly a study's episodes; rows as Parquet.

    The same command continues what was interrupted.
    """
    from skyarm.cli.sweep import sweep as perform

    perform(study, out, workers("--threads", threads), ray, console)


@app.command()
def stats(
    folder: Annotated[Path, typer.Argument(help="folder that 'skyarm sweep' wrote")],
    out: Annotated[str | None, typer.Option("--out", help="folder of the results; FOLDER/stats if left out")] = None,
    success: Annotated[
        list[str] | None, typer.Option(help="METRIC=LARGEST of a success, in place of the study's")
    ] = None,
    map_: Annotated[tuple[str, str] | None, typer.Option("--map", help="two varied numbers, across and upward")] = None,
    seed: Annotated[int, typer.Option(help="of the bootstrap")] = 0,
) -> None:
    """Success, quantiles, robustness maps of a sweep."""
    from skyarm.cli.sweep import stats as perform

    if seed < 0:
        raise ValueError(f"--seed = {seed}: must be at least 0")
    perform(folder, out, success, map_, seed, console)


@app.command()
def margins(
    controller: Annotated[str, typer.Argument(help="a preset, a law, LAW_tuned, or 'own' for the scenario's")],
    scenario: Annotated[str, typer.Argument(help="a scenario file (.toml) or the name of a shipped one")],
    instants: Annotated[int, typer.Option(help="looked at along the scenario, beside hover")] = 4,
    safety: Annotated[bool, typer.Option("--safety", help="under the safety layer")] = False,
    file: Annotated[str | None, typer.Option("--json", help="write eigenvalues and margins there")] = None,
) -> None:
    """Linearise the closed loop: eigenvalues, margins.

    Of the sampled loop as it flies, delays and lags in it, in hover and along the scenario. Exit code 3 if the flight
    ended before its time.
    """
    from skyarm.cli.stability import margins as perform
    from skyarm.cli.stability import planned

    if not perform(planned(controller, scenario, safety=safety), instants, file, console):
        raise typer.Exit(NOT_COMPLETED)


@app.command()
def basin(
    controller: Annotated[str, typer.Argument(help="a preset, a law, LAW_tuned, or 'own' for the scenario's")],
    scenario: Annotated[str, typer.Argument(help="a scenario file (.toml) or the name of a shipped one")],
    out: Out = "out/basin",
    flights: Annotated[int, typer.Option(help="initial states")] = 100_000,
    rate: Annotated[float, typer.Option(help="largest initial body rate, rad/s")] = 12.0,
    offset: Annotated[float, typer.Option(help="largest initial distance, m")] = 1.0,
    speed: Annotated[float, typer.Option(help="largest initial speed, m/s")] = 2.0,
    safety: Annotated[bool, typer.Option("--safety", help="under the safety layer")] = False,
    seed: Annotated[int, typer.Option(help="of the draws")] = 0,
    threads: Annotated[int, typer.Option(help="threads that fly; 0 takes every core")] = 0,
) -> None:
    """Map what initial attitudes and rates are caught."""
    from skyarm.cli.stability import basin as perform
    from skyarm.cli.stability import planned

    if seed < 0:
        raise ValueError(f"--seed = {seed}: must be at least 0")
    flying = workers("--threads", threads)
    limits = {"rate": rate, "offset": offset, "speed": speed, "seed": seed}
    perform(planned(controller, scenario, safety=safety), flights, out, flying, limits, console, controller)


@app.command()
def bench(
    quick: Annotated[bool, typer.Option("--quick", help="fewer rounds, shorter flights: about a minute")] = False,
    file: Annotated[str | None, typer.Option("--json", help="write the numbers there too")] = None,
) -> None:
    """Measure every engine beside MuJoCo and others.

    Speed as ratios from one interleaved run, accuracy, latency, start, operations; some minutes on an idle machine.
    """
    from skyarm.cli.bench import bench as perform

    perform(file, quick, console)


@app.command()
def compare(
    suite: Annotated[str, typer.Argument(help="paper-suite")] = "paper-suite",
    out: Out = "out/compare",
    laws: Annotated[str | None, typer.Option(help="names, with commas; all if left out")] = None,
    conditions: Annotated[str | None, typer.Option(help="names, with commas; all if left out")] = None,
    plants: Annotated[int, typer.Option(help="how many wrong plants")] = 1000,
    seeds: Annotated[int, typer.Option(help="noisy flights of the truth")] = 8,
    single: Annotated[int, typer.Option(help="wrong plants for what flies one by one: nmpc, MuJoCo")] = 8,
    seed: Annotated[int, typer.Option(help="of plants and noise")] = 0,
    plant: Annotated[str, typer.Option(help="rigid_body or mujoco")] = "rigid_body",
    threads: Annotated[int, typer.Option(help="threads that fly; 0 takes every core")] = 0,
) -> None:
    """Fly all laws on one bench; tables, figure, page.

    The same command continues what was interrupted.
    """
    from skyarm.cli.compare import compare as perform
    from skyarm.simulate.scenario import PLANTS

    for option, value in (("--plants", plants), ("--seeds", seeds), ("--single", single)):
        if not 1 <= value <= MOST:
            raise ValueError(f"{option} = {value}: must be from 1 to {MOST}")
    if seed < 0:
        raise ValueError(f"--seed = {seed}: must be at least 0")
    flying = workers("--threads", threads)
    if plant not in PLANTS:
        raise ValueError(f"--plant = {plant!r}: must be one of {', '.join(PLANTS)}")
    perform(
        suite,
        out,
        laws=laws,
        columns=conditions,
        plants=plants,
        seeds=seeds,
        single=single,
        seed=seed,
        plant=plant,
        threads=flying,
        console=console,
    )
