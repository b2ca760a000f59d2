"""The command line: reproduce, run, list, show.

Wrong input gives one line on standard error and exit code 2, never a traceback.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Annotated, Any, NoReturn

import typer
from rich.console import Console

from skyarm.cli.progress import bar

app = typer.Typer(
    name="skyarm",
    help="Aerial manipulation: multirotors that carry robot arms.",
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)
console = Console(markup=False, highlight=False, emoji=False)

USAGE_ERROR: Any = typer.BadParameter.__mro__[2]
"""ClickException: some versions of typer carry their own copy of click."""

INTERRUPTED = 130
"""Exit code after Ctrl-C, as shells count it."""

Out = Annotated[Path, typer.Option("--out", help="folder for the results, made if missing")]


@app.command()
def reproduce(
    out: Out = Path("out/paper"),
    plant: Annotated[str, typer.Option(help="rigid_body, mujoco or both")] = "both",
    jobs: Annotated[int, typer.Option(help="processes that fly; 0 takes every core")] = 0,
) -> None:
    """Fly the paper; write tables, figures, report.

    Five experiments with two controllers on two plants, and the variations behind the reasons: results.json, table2.md,
    Figures 3-18 and one page, report.html.
    """
    from skyarm.cli.show import headline
    from skyarm.experiments.reproduce import reproduce as perform
    from skyarm.simulate.scenario import PLANTS

    if plant not in (*PLANTS, "both"):
        raise ValueError(f"--plant = {plant!r}: must be one of {', '.join(PLANTS)} or both")
    if jobs < 0:
        raise ValueError(f"--jobs = {jobs}: must be at least 0")
    plants = PLANTS if plant == "both" else (plant,)
    with bar("flying", console) as advance:
        table = perform(out, plants=plants, workers=jobs or _cores(), progress=advance, note=console.print)
    console.print(headline(table))
    console.print(f"results in {out}: report.html, table2.md, results.json, figures/", soft_wrap=True)


@app.command()
def run(
    scenario: Annotated[str, typer.Argument(help="a scenario file (.toml) or the name of a shipped one")],
    out: Out = Path("out/run"),
    plant: Annotated[str | None, typer.Option(help="rigid_body or mujoco, in place of the file's")] = None,
    controller: Annotated[str | None, typer.Option(help="a controller preset, in place of the file's")] = None,
    seed: Annotated[int | None, typer.Option(help="seed of the noise, in place of the file's")] = None,
    duration: Annotated[float | None, typer.Option(help="seconds, in place of the file's")] = None,
) -> None:
    """Fly a scenario; write its log (npz, CSV)."""
    from skyarm.cli.show import episode
    from skyarm.files import require_writable
    from skyarm.simulate import run as fly
    from skyarm.simulate.scenario_file import load_scenario

    planned = load_scenario(scenario, plant=plant, controller=controller, seed=seed, duration=duration)
    folder = require_writable(out)
    with bar(planned.name, console) as advance:
        log = fly(planned, lambda done, total: advance(done, total, ""))
    written = [log.save_npz(folder / f"{planned.name}.npz"), log.save_csv(folder / f"{planned.name}.csv")]
    console.print(episode(log))
    console.print("log: " + ", ".join(str(path) for path in written), soft_wrap=True)


@app.command(name="list")
def list_() -> None:
    """List vehicles, scenarios, controllers."""
    from skyarm.cli.show import library

    console.print(library(), soft_wrap=True)


@app.command()
def show(
    vehicle: Annotated[str, typer.Argument(help="a vehicle file (.toml, .urdf) or the name of a shipped one")],
    gravity: Annotated[float, typer.Option(help="m/s^2")] = 9.81,
) -> None:
    """Show a vehicle: mass, hover, arm reach.

    Mass, centre of mass, hover speed and thrust margin, arm reach, static joint torques, sources of the numbers.
    """
    from skyarm.actuation import AllocationError
    from skyarm.cli.show import vehicle_sheet
    from skyarm.files import number
    from skyarm.vehicle.files import load_vehicle

    number(gravity, "--gravity", low=0.0, strict=True)
    loaded = load_vehicle(vehicle)
    try:
        console.print(vehicle_sheet(loaded, gravity))
    except AllocationError as error:
        raise ValueError(f"{vehicle}: rotors = {error}") from None


@app.callback(invoke_without_command=True)
def top(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="print the version and stop")] = False,
) -> None:
    """Aerial manipulation: multirotors that carry robot arms."""
    if version:
        from skyarm import __version__

        console.print(__version__)
        raise typer.Exit
    if context.invoked_subcommand is None:
        typer.echo(context.get_help())


def main() -> None:
    """Entry point: errors at the boundary become one line and exit code 2."""
    try:
        code = app(standalone_mode=False)
    except USAGE_ERROR as error:
        _fail(f"{error.format_message().rstrip('.')}; see 'skyarm --help'")
    except (typer.Abort, KeyboardInterrupt):
        code = INTERRUPTED
    except BrokenPipeError:
        # who read our output has gone, as `skyarm list | head` does; nothing is left to flush into
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        code = 1
    except (ValueError, OSError) as error:
        _fail(str(error))
    except MemoryError:
        _fail("not enough memory; fly fewer seconds or at a lower control rate")
    if code == INTERRUPTED:
        print("skyarm: interrupted; finished files are whole", file=sys.stderr)
    sys.exit(code)


def _cores() -> int:
    """Cores this process may use; a container often has fewer than its machine."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _fail(message: str) -> NoReturn:
    """One line on standard error, exit code 2."""
    print(f"skyarm: {' '.join(message.split())}", file=sys.stderr)
    sys.exit(2)
