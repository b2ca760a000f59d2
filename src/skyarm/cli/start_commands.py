"""The commands with which one starts: check, new, doctor, completion."""

from __future__ import annotations

from typing import Annotated

import typer

from skyarm.cli.app import app, console, tell
from skyarm.cli.lines import print_script
from skyarm.cli.machine_output import give
from skyarm.cli.progress import waiting


@app.command()
def check(
    what: Annotated[
        str, typer.Argument(metavar="VEHICLE|SCENARIO", help="a file (.toml, .urdf, .xml) or a shipped name")
    ],
    payload: Annotated[float, typer.Option(help="kg held at the tip")] = 0.0,
    page: Annotated[
        str | None, typer.Option("--html", metavar="PAGE", help="write a page with pictures there, too (.html)")
    ] = None,
    poses: Annotated[int, typer.Option("--arm-poses", help="sampled arm poses; the worst is then searched for")] = 1024,
    seed: Annotated[int, typer.Option(help="of the poses and of the states compared with MuJoCo")] = 0,
    gravity: Annotated[float | None, typer.Option(help="m/s^2, for a vehicle; 9.81 if left out")] = None,
) -> None:
    """Check whether a vehicle can fly, and why not.

    Thrust margin, torques and forces over all arm poses, with and without a payload; joint torques against limits;
    centre of mass, workspace, largest payload, largest steady wind; motor lag; units that look wrong; its equations
    beside MuJoCo's. Of a scenario also its reference against limits, and when rotors or joints would saturate.

    Exit code: 0 if it can fly, 1 if a fault was found, 2 if the input was wrong.
    """
    from skyarm.cli.check_command import FOUND, assess, document, page_file, sheet

    file = None if page is None else page_file(page)
    with waiting(f"{what}: checking", console):
        found = assess(what, payload, poses, seed, gravity)
        if file is not None:
            from skyarm.assess.assessment_page import write_page

            write_page(found, file)
    give(document(found), page=file)
    console.print(sheet(found), soft_wrap=False)
    if file is not None:
        tell(f"page: {file}")
    if not found.flies:
        raise typer.Exit(FOUND)


@app.command()
def new(
    kind: Annotated[str, typer.Argument(metavar="KIND", help="vehicle, scenario, law or study")],
    name: Annotated[str, typer.Argument(metavar="NAME", help="of the files and of what they describe")],
) -> None:
    """Write a vehicle, scenario, law or study to begin with.

    Commented files in the folder one stands in, which fly as they are, with a test for pytest. Nothing is overwritten.
    """
    from pathlib import Path

    from skyarm.cli.starter_files import FIRST, write_starter

    files = write_starter(kind, name, Path())
    first = FIRST[kind].replace("NAME", name)
    give(kind=kind, name=name, files=files, next=first)
    tell(f"written: {', '.join(map(str, files))}")
    tell(f"fly it: {first}")


@app.command()
def doctor() -> None:
    """Look at the installation: what works, what is missing.

    Versions, engines, machine code, OpenGL for films, GPU, extras and the command that adds each. Exit code: 0 if all
    that flights need works, 1 if not.
    """
    from skyarm.cli.doctor import BROKEN, BROKEN_CODE, MISSING, examine, works
    from skyarm.cli.terminal_tables import add, table_of

    with waiting("looking", console):
        parts = examine()
    give(works=works(parts), parts=[part.plain() for part in parts])
    table = table_of("", "", "", left=3)
    for part in parts:
        add(table, part.state, part.name, part.found)
    console.print(table)
    for part in parts:
        if part.state in (MISSING, BROKEN) and part.remedy:
            tell(f"{part.name}: {part.remedy}")
    tell("all that flights need works" if works(parts) else "something that flights need does not work")
    if not works(parts):
        raise typer.Exit(BROKEN_CODE)


@app.command()
def completion(
    shell: Annotated[str, typer.Argument(metavar="SHELL", help="bash, zsh or fish")],
) -> None:
    """Print the script with which a shell completes words.

    Commands, options and names of vehicles, scenarios, studies and laws. For bash:
    skyarm completion bash > ~/.local/share/bash-completion/completions/skyarm
    """
    from skyarm.cli.completion import WHERE, script

    text = script(shell)
    give(shell=shell, script=text, install=WHERE[shell])
    print_script(text)
