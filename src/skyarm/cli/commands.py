"""The command line as a whole: which commands there are, and how it is performed.

Wrong input gives one line on standard error and exit code 2, never a traceback.
"""

from __future__ import annotations

import errno
import os
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Annotated, Any

import typer

from skyarm.cli import (
    film_command,
    flight_commands,
    picture_commands,
    run_commands,
    start_commands,
    studies,
    studio_command,
    vehicle_commands,
)
from skyarm.cli.app import app, console
from skyarm.cli.arguments import without_plugins
from skyarm.cli.completion_requests import asked_for, complete
from skyarm.cli.lines import INTERRUPTED, WRONG_INPUT, say, say_warning
from skyarm.cli.old_options import with_new_options
from skyarm.files import shown
from skyarm.files.old_names import OldNameWarning
from skyarm.registry.registrations import registrations

JOINED = (
    run_commands, start_commands, vehicle_commands, flight_commands, film_command, studies, picture_commands,
    studio_command,
)  # fmt: skip
"""The commands join the program when their modules are read, in this order."""

USAGE_ERROR: Any = typer.BadParameter.__mro__[2]
"""ClickException: some versions of typer carry their own copy of click."""


SLOW = "no machine code here"
"""Begins the warning of a flight in Python floats; its class is not loaded for commands that fly nothing."""


@app.callback(invoke_without_command=True)
def top(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="print the version and stop")] = False,
    plugin: Annotated[
        list[str] | None, typer.Option("--plugin", metavar="FILE.py", help="a .py file that registers names; repeat")
    ] = None,
) -> None:
    """Aerial manipulation: multirotors that carry robot arms."""
    del plugin  # read before the command is
    if version:
        from skyarm import __version__

        console.print(__version__)
        raise typer.Exit
    if context.invoked_subcommand is None:
        console.print(context.get_help(), soft_wrap=True)


def perform() -> int:
    """Carry out the command line's words; wrong input becomes one line. Returns the exit code."""
    usual, warnings.showwarning = warnings.showwarning, say_warning
    try:
        with _lines_for_users():
            arguments = with_new_options(without_plugins(sys.argv[1:]))
            for name, row in registrations("command").items():
                app.command(name, help=row.title)(row.load())
            if asked_for():
                return complete(app, arguments)
            return int(app(arguments, standalone_mode=False) or 0)
    except USAGE_ERROR as error:
        return say(f"{error.format_message().rstrip('.')}; see '{_command(error)} --help'", WRONG_INPUT)
    except (typer.Abort, KeyboardInterrupt):
        return say("interrupted; finished files are whole", INTERRUPTED)
    except BrokenPipeError:
        # who read our output has gone, as `skyarm list | head` does; nothing is left to flush into
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        return 1
    except OSError as error:
        return say(_own(error) or _unusable(error), WRONG_INPUT)
    except ValueError as error:
        return say(_own(error) or str(error), WRONG_INPUT)
    except SystemExit as error:
        line = _own(error)
        if not line:
            raise
        return say(line, WRONG_INPUT)
    except MemoryError:
        return say("not enough memory; fly fewer seconds or at a lower control rate", WRONG_INPUT)
    except Exception as error:
        return say(_failed(error), WRONG_INPUT)
    finally:
        warnings.showwarning = usual


def _command(error: Any) -> str:
    """The command that was given wrong words, as one types it."""
    context = getattr(error, "ctx", None)
    name = None if context is None or context.parent is None else context.info_name
    return f"skyarm {name}" if name else "skyarm"


@contextmanager
def _lines_for_users() -> Iterator[None]:
    """Show warnings for users as one line each, as errors are; others look as Python shows them.

    That a flight is slow is said at once. Old names are said at the end, so that wrong input stays one line.
    """
    old_names: list[str] = []
    with warnings.catch_warnings():
        warnings.filterwarnings("once", message=SLOW)
        warnings.filterwarnings("once", category=OldNameWarning)
        python_shows = warnings.showwarning

        def show(message: Warning | str, *where: Any, **more: Any) -> None:
            if isinstance(message, OldNameWarning):
                old_names.append(str(message))
            elif str(message).startswith(SLOW):
                say(str(message), 0)
            else:
                python_shows(message, *where, **more)

        warnings.showwarning = show
        yield
        for line in dict.fromkeys(old_names):
            say(line)


def _failed(error: Exception) -> str:
    """What failed that is no wrong input, in words: machine code that cannot be made, or code of the user's own.

    Raises:
        Exception: the error itself, where it is ours.
    """
    from skyarm.compile.machine_code import NoMachineCodeError

    if isinstance(error, NoMachineCodeError):
        return str(error)
    line = _own(error)
    if not line:
        raise error
    return line


def _own(error: BaseException) -> str:
    """What code of the user's own raised, with its file and line; empty where it raised nothing."""
    from skyarm.files.code_place import own_failure
    from skyarm.registry.plugins import loaded

    # code of the user's own comes by plugins and by files of laws only
    return own_failure(error) if loaded() else ""


def _unusable(error: OSError) -> str:
    """What could not be read or written, in words."""
    if error.errno is None:
        return str(error)
    what = "standard output" if error.filename is None else f"file = {shown(os.fspath(error.filename))}"
    return f"{what}: must be usable ({error.strerror or errno.errorcode.get(error.errno, error.errno)})"
