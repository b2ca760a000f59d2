"""The commands on one flight or vehicle: reproduce, run, list, show, export-c; and on the cache of code."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from skyarm.cli.app import NOT_COMPLETED, Out, app, console, require_left_out, tell, workers
from skyarm.cli.lines import say, say_if_many, say_steps, say_unlikely
from skyarm.cli.machine_output import give, is_document_wanted
from skyarm.cli.progress import bar, waiting


@app.command()
def reproduce(
    out: Out = "out/paper",
    plant: Annotated[str, typer.Option(help="rigid_body, mujoco or both")] = "both",
    flying: Annotated[int, typer.Option("--workers", help="processes that fly; 0 takes every core")] = 0,
    compare: Annotated[
        bool, typer.Option("--compare", help="compare all laws, fly the envelope: half an hour")
    ] = False,
    infer: Annotated[bool, typer.Option("--infer", help="search for what the paper leaves open anew: minutes")] = False,
) -> None:
    """Fly the paper; write tables, figures, report.

    Five experiments with two controllers on two plants, and the variations behind the reasons: results.json, table2.md,
    Figures 3-18 and one page, report.html, with the centroidal law beside the paper's on the same cases. With --compare
    all of 'skyarm compare' into OUT/compare and its envelope into OUT/envelope; the same command continues it. With
    --infer the settings that the paper leaves open are searched for anew, into OUT/unstated_settings.json, in place of
    those that ship; the same command continues that too.
    """
    from skyarm.cli.show import headline
    from skyarm.files import must_be_one_of
    from skyarm.paper.counted_cells import sentence
    from skyarm.paper.report_pages import opening_film
    from skyarm.paper.reproduce import prepare_folder
    from skyarm.paper.reproduce import reproduce as perform
    from skyarm.scenario.scenario_record import PLANTS

    if plant not in (*PLANTS, "both"):
        raise ValueError(f"--plant = {plant!r}: {must_be_one_of((*PLANTS, 'both'), plant)}")
    processes = workers("--workers", flying)
    plants = PLANTS if plant == "both" else (plant,)
    if compare:
        from skyarm.compare.comparison import Comparison
        from skyarm.compare.envelope import Envelope
    prepare_folder(out, plants)
    evidence = _evidence(out, processes) if infer else None
    with bar("flying", console) as advance:
        table = perform(
            out,
            plants=plants,
            workers=processes,
            comparison=Comparison() if compare else None,
            envelope=Envelope() if compare else None,
            evidence=evidence,
            progress=advance,
            note=console.print,
            film=opening_film,
        )
    give(table, folder=out)
    tell(sentence(table))
    console.print(headline(table))
    tell(f"results in {out}: report.html, table2.md, inference.md, results.json, figures/")


def _evidence(out: str, threads: int) -> dict[str, Any]:
    """Search for what the paper leaves open, and print what was found."""
    from skyarm.cli.terminal_tables import aligned
    from skyarm.paper.inference_tables import evidence_tables
    from skyarm.paper.inferred_settings import infer

    with bar("inferring", console) as advance:
        evidence = infer(out, threads=threads, progress=advance)
    for table in evidence_tables(evidence):
        tell(f"\n{table.caption}")
        for line in aligned([[name.removeprefix(">") for name in table.head], *table.rows]):
            tell(line)
    return evidence


@app.command()
def run(
    context: typer.Context,
    scenario: Annotated[str, typer.Argument(help="a scenario file (.toml), a log, or the name of a shipped one")],
    out: Out = "out/run",
    plant: Annotated[str | None, typer.Option(help="rigid_body, mujoco or mujoco_contacts for the file's")] = None,
    controller: Annotated[
        str | None, typer.Option(help="a preset, a law, LAW_tuned or FILE.py:make, in place of the file's")
    ] = None,
    seed: Annotated[int | None, typer.Option(help="seed of the noise, in place of the file's")] = None,
    duration: Annotated[float | None, typer.Option(help="seconds, in place of the file's")] = None,
    force: Annotated[bool, typer.Option("--force", help="replace the log of an earlier flight")] = False,
    logs: Annotated[
        list[str] | None,
        typer.Option("--log", metavar="FILE", help="file of the log, its format by its suffix; repeat"),
    ] = None,
    picture: Annotated[
        str | None, typer.Option("--plot", metavar="FILE", help="a picture of the flight (.png, .svg or .pdf)")
    ] = None,
    margin: Annotated[bool, typer.Option("--margin", help="say first how much delay the loop bears in hover")] = False,
) -> None:
    """Fly a scenario; write its log (npz, CSV, MCAP).

    The log is OUT/NAME.npz and .csv, or with --log the files named (.npz, .csv, .mcap, .parquet, .bag); that of an
    earlier flight is kept as NAME_1.npz, NAME_2.npz ... unless --force is given. While a flight goes on, what has been
    flown stands in NAME.partial.mcap, which stays if the run is killed. The errors are summed up over the scenario's
    own steady window, or where it says none over the flight after its first third. On a terminal a chart of the tip's
    error follows.

    Exit code: 0 if the flight was completed, 3 if it ended before its time (the log says why), 2 if the input was
    wrong, 130 after Ctrl-C.
    """
    from skyarm.cli.earlier_files import earlier_kept
    from skyarm.cli.flight_summary import episode, error_chart, facts
    from skyarm.cli.log_files import draw, log_files, require_kept_apart
    from skyarm.cli.shipped_names import require_not_another
    from skyarm.files import require_replaceable, require_writable, taken_back
    from skyarm.files.picture_names import picture_file
    from skyarm.log.formats import save_log
    from skyarm.log.mcap.journal import journal_beside, partial_file
    from skyarm.scenario.scenario_file import load_scenario
    from skyarm.scenario.unlikely_numbers import unlikely_numbers
    from skyarm.simulate import run as fly

    if logs:
        require_left_out(context, ["--out"], " beside --log, whose files say where")
    require_not_another(scenario, "scenario")
    planned = load_scenario(scenario, plant=plant, controller=controller, seed=seed, duration=duration)
    folder = Path(out)
    files = log_files(logs, (folder / f"{planned.name}.npz", folder / f"{planned.name}.csv"))
    require_kept_apart(files, scenario)
    drawn = None if picture is None else picture_file(picture, "--plot")
    with taken_back(*(() if logs else (folder,))):
        if not logs:
            require_writable(out)
        require_replaceable(*files, partial_file(files[0]))
        say_if_many(planned.name, planned.world.vehicle.n)
        say_unlikely(planned.name, unlikely_numbers(planned))
        say_steps(planned)
        if margin:
            from skyarm.cli.said_margin import margin_said

            with waiting(f"{planned.name}: delay margin", console):
                line, borne = margin_said(planned, planned.controller.name)
            tell(line)
            give(borne)
        with journal_beside(files[0], say) as journal:
            with bar(planned.name, console) as advance:
                log = fly(planned, lambda done, total: advance(done, total, ""), keep=journal)
            with earlier_kept([] if force else files) as kept:
                written = [save_log(log, file) for file in files]
    console.print(episode(log), soft_wrap=True)
    for line in error_chart(log) if console.is_terminal else ():
        tell(line)
    tell("log: " + ", ".join(str(path) for path in written))
    if drawn is not None:
        draw(log, drawn)
        tell(f"picture: {drawn}")
    give(facts(log), logs=written, kept=[str(name) for _, name in kept], picture=drawn)
    if kept:
        tell(f"the flight before it is kept: {', '.join(str(name) for _, name in kept)}")
    if log.status != "completed":
        raise typer.Exit(NOT_COMPLETED)


@app.command(name="list")
def list_(
    file: Annotated[
        str | None, typer.Option("--out", help="write names, titles and laws' options there, as JSON")
    ] = None,
) -> None:
    """List vehicles, scenarios, studies, controllers."""
    from skyarm.cli.library_commands import contents, library, write
    from skyarm.files import output_file

    written = None if file is None else output_file(file, "--out")
    found = contents()
    give(found)
    console.print(library(found), soft_wrap=True)
    if written is not None:
        tell(f"written: {write(found, written)}")


@app.command()
def show(
    context: typer.Context,
    vehicle: Annotated[str, typer.Argument(help="a vehicle file (.toml, .urdf, .xml) or the name of a shipped one")],
    gravity: Annotated[float, typer.Option(help="m/s^2")] = 9.81,
    ops: Annotated[bool, typer.Option("--ops", help="count the operations of its equations instead")] = False,
    drawing: Annotated[
        str | None, typer.Option(metavar="FILE", help="draw it there (.png, .svg, .pdf) instead, all labelled")
    ] = None,
    style: Annotated[str | None, typer.Option(help="of the drawing: paper or talk; paper if left out")] = None,
    dark: Annotated[bool, typer.Option("--dark", help="of a talk's drawing")] = False,
) -> None:
    """Show a vehicle: mass, hover, arm, rotors.

    Mass, centre of mass, hover speed and thrust margin, arm reach, static joint torques of a level base; limits of the
    joints, inertias, motor constants, all with units; sources of the numbers. With --drawing its frames, joints with
    their positive directions, rotors with the sense in which they turn, and lengths, as a picture.
    """
    from skyarm.actuation import AllocationError
    from skyarm.cli.shipped_names import require_not_another
    from skyarm.cli.show import operations_sheet, vehicle_sheet
    from skyarm.cli.vehicle_facts import operations, vehicle_facts
    from skyarm.files import number
    from skyarm.scenario.unlikely_numbers import unlikely_in_vehicle
    from skyarm.vehicle.vehicle_files import load_vehicle

    number(gravity, "--gravity", low=0.0, strict=True)
    require_not_another(vehicle, "vehicle")
    for option, given in (("--style", style is not None), ("--dark", dark)):
        if given and drawing is None:
            raise ValueError(f"{option}: must come with --drawing FILE")
    if drawing is not None:
        require_left_out(context, ["--gravity", "--ops"], " beside --drawing, which shows no numbers of it")
        from skyarm.cli.plot_command import draw_vehicle

        picture = draw_vehicle(vehicle, drawing, "paper" if style is None else style, dark=dark)
        give(drawing=picture)
        return tell(f"drawing: {picture}")
    loaded = load_vehicle(vehicle)
    if ops:
        require_left_out(context, ["--gravity"], " beside --ops, which counts operations")
        say_if_many(loaded.name, loaded.n)
        with waiting(f"{loaded.name}: counting operations", console):
            found = operations(loaded)
        give(vehicle=loaded.name, operations=found)
        console.print(operations_sheet(loaded, found))
        return
    try:
        with waiting(f"{loaded.name}: reach and static efforts", console):
            sheet = None if is_document_wanted() else vehicle_sheet(loaded, gravity)
            give(vehicle_facts(loaded, gravity) if sheet is None else {})
    except AllocationError as error:
        raise ValueError(f"{vehicle}: rotors = {error}") from None
    say_unlikely(loaded.name, unlikely_in_vehicle(loaded))
    if sheet is not None:
        console.print(sheet)


@app.command(name="export-c")
def export_c(
    controller: Annotated[
        str, typer.Argument(help="a preset, a law, LAW_tuned, FILE.py:make, or a scenario (its controller)")
    ],
    file: Annotated[str, typer.Option("--out", "-o", help="the C file to write")],
    vehicle: Annotated[str | None, typer.Option(help="the vehicle that a preset or law believes in")] = None,
    gravity: Annotated[float | None, typer.Option(help="m/s^2, believed by a preset or law; 9.81")] = None,
    rate: Annotated[float | None, typer.Option(help="Hz of the control; 200, or the scenario's")] = None,
    name: Annotated[str | None, typer.Option(help="begins the names in the file")] = None,
    single: Annotated[bool, typer.Option("--float32", help="float in place of double")] = False,
) -> None:
    """Write a controller as one C99 file."""
    from skyarm.cli.export_command import export

    with waiting(f"{controller}: writing C", console):
        line = export(controller, file, vehicle=vehicle, gravity=gravity, rate=rate, name=name, single=single)
    tell(line)


@app.command()
def cache(
    clear: Annotated[bool, typer.Option("--clear", help="remove all entries")] = False,
) -> None:
    """Show or clear the cache of machine code."""
    from skyarm.cli.cache import cache as perform

    perform(clear, tell)
