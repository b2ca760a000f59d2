"""The commands on many flights: sweeps, statistics, margins, basins, benchmarks, comparisons."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from skyarm.cli.app import NOT_COMPLETED, Out, app, console, require_left_out, workers

MOST = 1_000_000
"""Flights of a cell of the comparison: more belong into a sweep, which keeps them on disk."""

Controller = Annotated[
    str | None, typer.Option(help="a preset, a law, LAW_tuned or FILE.py:make, in place of the scenario's own")
]


OLD_ORDER = {"allow_extra_args": True}
"""Of commands that still take the law first and then the scenario, out of the help's sight."""


@app.command()
def sweep(
    context: typer.Context,
    study: Annotated[str, typer.Argument(help="a study file (.toml) or the name of a shipped one")],
    controller: Annotated[
        list[str] | None, typer.Option(metavar="LAW", help="in place of the study's: names or FILE.py:make; repeat")
    ] = None,
    out: Annotated[str | None, typer.Option("--out", help="folder of the rows; out/NAME if left out")] = None,
    flying: Annotated[int, typer.Option("--workers", help="threads that fly; 0 takes every core")] = 0,
    ray: Annotated[str | None, typer.Option(help="address of a Ray cluster, or local")] = None,
) -> None:
    """Fly a study's episodes; rows as Parquet.

    The same command continues what was interrupted.
    """
    from skyarm.cli.sweep_command import sweep as perform

    if ray is not None:
        require_left_out(context, ["--workers"], " beside --ray, whose cluster says how many fly")
    perform(study, out, workers("--workers", flying), ray, console, controller)


@app.command()
def stats(
    folder: Annotated[str, typer.Argument(help="folder that 'skyarm sweep' wrote")],
    out: Annotated[str | None, typer.Option("--out", help="folder of the results; FOLDER/stats if left out")] = None,
    success: Annotated[
        list[str] | None, typer.Option(metavar="METRIC=LARGEST", help="of a success, in place of the study's; repeat")
    ] = None,
    map_: Annotated[tuple[str, str] | None, typer.Option("--map", help="two varied numbers, across and upward")] = None,
    seed: Annotated[int, typer.Option(help="of the bootstrap")] = 0,
) -> None:
    """Success, quantiles, curves, maps of a sweep."""
    from skyarm.cli.stats_command import stats as perform

    if seed < 0:
        raise ValueError(f"--seed = {seed}: must be at least 0")
    if not folder:
        raise ValueError("folder = '': must be one that 'skyarm sweep' wrote")
    perform(Path(folder), out, success, map_, seed, console)


@app.command(context_settings=OLD_ORDER)
def margins(
    context: typer.Context,
    scenario: Annotated[str, typer.Argument(help="a scenario file (.toml) or the name of a shipped one")],
    controller: Controller = None,
    instants: Annotated[int, typer.Option(help="looked at along the scenario, beside hover")] = 4,
    safety: Annotated[bool, typer.Option("--safety", help="with the safety layer")] = False,
    file: Annotated[str | None, typer.Option("--out", help="write eigenvalues and margins there, as JSON")] = None,
    loops: Annotated[
        bool, typer.Option("--loops", help="list every loop that was cut, not the weakest of each kind")
    ] = False,
    page: Annotated[
        str | None, typer.Option("--html", metavar="PAGE", help="write a page with Nyquist diagrams there, too (.html)")
    ] = None,
) -> None:
    """Linearise the closed loop: eigenvalues, margins.

    Of the sampled loop as it flies, delays and lags in it, in hover and along the scenario: delay and gain of the
    actuators; disk margins of every loop, cut at a rotor, a torque, a joint's drive or a number of the measurement,
    alone and together. Exit code 3 if the flight ended before its time.
    """
    from skyarm.cli.stability_commands import law_and_scenario, planned, say_new_order
    from skyarm.cli.stability_commands import margins as perform

    law, name = law_and_scenario(scenario, context.args, controller)
    completed = perform(planned(law, name, safety=safety), instants, file, console, every=loops, html=page)
    say_new_order("margins", scenario, context.args)
    if not completed:
        raise typer.Exit(NOT_COMPLETED)


@app.command(context_settings=OLD_ORDER)
def basin(
    context: typer.Context,
    scenario: Annotated[str, typer.Argument(help="a scenario file (.toml) or the name of a shipped one")],
    controller: Controller = None,
    out: Out = "out/basin",
    flights: Annotated[int, typer.Option(help="initial states")] = 100_000,
    rate: Annotated[float, typer.Option(help="largest initial body rate, rad/s")] = 12.0,
    offset: Annotated[float, typer.Option(help="largest initial distance, m")] = 1.0,
    speed: Annotated[float, typer.Option(help="largest initial speed, m/s")] = 2.0,
    safety: Annotated[bool, typer.Option("--safety", help="with the safety layer")] = False,
    seed: Annotated[int, typer.Option(help="of the draws")] = 0,
    flying: Annotated[int, typer.Option("--workers", help="threads that fly; 0 takes every core")] = 0,
) -> None:
    """Map what initial attitudes and rates are caught."""
    from skyarm.cli.stability_commands import basin as perform
    from skyarm.cli.stability_commands import law_and_scenario, planned, say_new_order

    if seed < 0:
        raise ValueError(f"--seed = {seed}: must be at least 0")
    threads = workers("--workers", flying)
    limits = {"rate": rate, "offset": offset, "speed": speed, "seed": seed}
    law, name = law_and_scenario(scenario, context.args, controller)
    perform(planned(law, name, safety=safety), flights, out, threads, limits, console, law)
    say_new_order("basin", scenario, context.args)


@app.command()
def tune(
    context: typer.Context,
    target: Annotated[
        str, typer.Argument(metavar="SCENARIO|VEHICLE", help="a file (.toml) or the name of a shipped one")
    ],
    controller: Controller = None,
    out: Annotated[str | None, typer.Option("--out", help="folder of the results; out/tune_... if left out")] = None,
    candidates: Annotated[int, typer.Option(help="sets of gains that are tried")] = 1640,
    plants: Annotated[int, typer.Option(help="wrong plants that each of them flies")] = 24,
    knobs: Annotated[
        list[str] | None, typer.Option(metavar="PATH", help="constants of the law that may change; all gains; repeat")
    ] = None,
    explain: Annotated[bool, typer.Option("--explain", help="say what is short of margin, and tune nothing")] = False,
    seed: Annotated[int, typer.Option(help="of plants, noise and search")] = 0,
    flying: Annotated[int, typer.Option("--workers", help="threads that fly; 0 takes every core")] = 0,
) -> None:
    """Find a law's gains for a vehicle; a front, a file.

    The same command continues what was interrupted. Exit code 3 if no gains meet the margins.
    """
    from skyarm.cli.tune_command import explain as tell_why
    from skyarm.cli.tune_command import tune as perform

    if explain:
        searching = ("--out", "--candidates", "--plants", "--seed", "--workers")
        require_left_out(context, searching, " beside --explain, which tunes nothing")
        tell_why(target, controller, knobs, console)
        return
    met = perform(
        target,
        controller,
        out,
        console,
        candidates=candidates,
        plants=plants,
        seed=seed,
        threads=workers("--workers", flying),
        knobs=knobs,
    )
    if not met:
        raise typer.Exit(NOT_COMPLETED)


@app.command()
def bench(
    quick: Annotated[bool, typer.Option("--quick", help="fewer rounds, shorter flights: about a minute")] = False,
    file: Annotated[str | None, typer.Option("--out", help="write the numbers there too, as JSON")] = None,
) -> None:
    """Measure every engine beside MuJoCo and others.

    Speed as ratios from one interleaved run, accuracy, latency, start, operations; some minutes on an idle machine.
    """
    from skyarm.cli.bench_command import bench as perform

    perform(file, quick, console)


@app.command()
def compare(
    context: typer.Context,
    suite: Annotated[
        str, typer.Argument(help="paper-suite, envelope-suite, contact-suite, or a scenario (.toml or shipped)")
    ] = "paper-suite",
    out: Annotated[
        str | None, typer.Option("--out", help="folder of the results; out/compare, out/envelope, out/contact")
    ] = None,
    laws: Annotated[
        str | None, typer.Option(help="names or FILE.py:make, with commas; all of the suite if left out")
    ] = None,
    conditions: Annotated[str | None, typer.Option(help="of the suite, with commas; all if left out")] = None,
    axes: Annotated[str | None, typer.Option(help="of the envelope, with commas; all if left out")] = None,
    vehicle: Annotated[str | None, typer.Option(help="of the envelope, with an arm; the paper's if left out")] = None,
    tasks: Annotated[str | None, typer.Option(help="of the contact suite, with commas; all if left out")] = None,
    worlds: Annotated[int | None, typer.Option(help="wrong worlds of each task in contact; 200 if left out")] = None,
    quick: Annotated[
        bool, typer.Option("--quick", help="of the envelope: two values an axis, short flights; in contact: 16 worlds")
    ] = False,
    films: Annotated[bool, typer.Option("--films", help="film a flight of each task in contact")] = False,
    plants: Annotated[int, typer.Option(help="how many perturbed plants")] = 1000,
    seeds: Annotated[int, typer.Option(help="noisy flights of the truth")] = 8,
    one_by_one: Annotated[int, typer.Option(help="perturbed plants for what flies one by one: nmpc, MuJoCo")] = 8,
    seed: Annotated[int, typer.Option(help="of plants and noise")] = 0,
    plant: Annotated[str, typer.Option(help="rigid_body or mujoco")] = "rigid_body",
    flying: Annotated[int, typer.Option("--workers", help="threads that fly; 0 takes every core")] = 0,
) -> None:
    """Compare all laws; tables, figure, page.

    A scenario in place of the suite is flown as its file describes it, by its own law first (the row "own") and those
    of --laws: one table. Where --laws is left out, paper_pd, paper_ct and centroidal_tip fly beside it.
    The envelope-suite flies trials that get harder along axes (speed, delay, lag, wind, payload, noise): how far each
    law is good, and where it is lost. The contact-suite flies tasks that touch the world, each in many wrong worlds.
    The same command continues what was interrupted.
    """
    from skyarm.cli.compare_command import compare as perform
    from skyarm.files import must_be_one_of
    from skyarm.registry import names as registered

    for option, value in (("--plants", plants), ("--seeds", seeds), ("--one-by-one", one_by_one)):
        if not 1 <= value <= MOST:
            raise ValueError(f"{option} = {value}: must be from 1 to {MOST}")
    if seed < 0:
        raise ValueError(f"--seed = {seed}: must be at least 0")
    threads = workers("--workers", flying)
    if plant not in registered("plant"):
        raise ValueError(f"--plant = {plant!r}: {must_be_one_of(registered('plant'), plant)}")
    if worlds is not None and not 1 <= worlds <= MOST:
        raise ValueError(f"--worlds = {worlds}: must be from 1 to {MOST}")
    _require_effect(context, suite)
    if suite == "contact-suite":
        from skyarm.cli.compare_command import contact

        contact(
            out or "out/contact",
            laws=laws,
            tasks=tasks,
            worlds=worlds,
            quick=quick,
            seed=seed,
            plant=plant,
            one_by_one=one_by_one,
            threads=threads,
            films=films,
            console=console,
        )
        return
    if suite == "envelope-suite":
        from skyarm.cli.compare_command import envelope

        envelope(
            out or "out/envelope",
            laws=laws,
            axes=axes,
            vehicle=vehicle,
            quick=quick,
            seed=seed,
            plant=plant,
            threads=threads,
            console=console,
        )
        return
    perform(
        suite,
        out or "out/compare",
        laws=laws,
        columns=conditions,
        plants=plants,
        seeds=seeds,
        one_by_one=one_by_one,
        seed=seed,
        plant=plant,
        threads=threads,
        console=console,
    )


OF_SUITES = {
    "paper-suite": ("--conditions", "--plants", "--seeds", "--one-by-one"),
    "envelope-suite": ("--axes", "--vehicle", "--quick"),
    "contact-suite": ("--tasks", "--worlds", "--films", "--quick", "--one-by-one"),
}
"""Suite -> options that not every comparison has."""

OF_A_SCENARIO = ("--seeds",)
"""Options of :data:`OF_SUITES` that a comparison on a scenario has, too."""


def _require_effect(context: typer.Context, suite: str) -> None:
    """Refuse options that this comparison does not read."""
    own = OF_SUITES.get(suite, OF_A_SCENARIO)
    for option in dict.fromkeys(each for options in OF_SUITES.values() for each in options if each not in own):
        there = [name for name, options in OF_SUITES.items() if option in options]
        there += ["a scenario"] if option in OF_A_SCENARIO else []
        have = " and ".join(there) + (" have it" if len(there) > 1 else " has it")
        of = suite if suite in OF_SUITES else f"scenario {suite}"
        require_left_out(context, [option], f" for {of}; only {have}")
