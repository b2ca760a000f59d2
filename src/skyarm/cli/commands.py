"""The command line as a whole: which commands there are, and how it is performed.

Wrong input gives one line on standard error and exit code 2, never a traceback.
"""

from __future__ import annotations

import errno
import os
from typing import Annotated, Any

import typer

from skyarm.cli import single, studies
from skyarm.cli.app import app, console
from skyarm.cli.lines import INTERRUPTED, WRONG_INPUT, say
from skyarm.files import shown

JOINED = single, studies
"""The commands join the program when their modules are read, in this order."""

USAGE_ERROR: Any = typer.BadParameter.__mro__[2]
"""ClickException: some versions of typer carry their own copy of click."""


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


def perform() -> int:
    """Carry out the command line's words; wrong input becomes one line. Returns the exit code."""
    try:
        return int(app(standalone_mode=False) or 0)
    except USAGE_ERROR as error:
        return say(f"{error.format_message().rstrip('.')}; see 'skyarm --help'", WRONG_INPUT)
    except (typer.Abort, KeyboardInterrupt):
        return say("interrupted; finished files are whole", INTERRUPTED)
    except BrokenPipeError:
        # who read our output has gone, as `skyarm list | head` does; nothing is left to flush into
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        return 1
    except OSError as error:
        return say(_unusable(error), WRONG_INPUT)
    except ValueError as error:
        return say(str(error), WRONG_INPUT)
    except MemoryError:
        return say("not enough memory; fly fewer seconds or at a lower control rate", WRONG_INPUT)


def _unusable(error: OSError) -> str:
    """What could not be read or written, in words."""
    if error.errno is None:
        return str(error)
    what = "standard output" if error.filename is None else f"file = {shown(os.fspath(error.filename))}"
    return f"{what}: must be usable ({error.strerror or errno.errorcode.get(error.errno, error.errno)})"
