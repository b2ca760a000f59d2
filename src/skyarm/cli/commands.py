"""Command line program: table of commands, parsing and error messages.

Wrong input gives one line on standard error and exit code 2, never a traceback. Only
the module of the command that is called is loaded.
"""

from __future__ import annotations

import errno
import os
import re
import shlex
import sys
import traceback
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace
from typing import Annotated, Any, TypeAlias

import typer
from typer.core import TyperCommand, TyperGroup

from skyarm.cli.arguments import EVERY, Plugins, running
from skyarm.cli.lines import (
    INTERRUPTED,
    OUR_FAULT,
    PIPE_CLOSED,
    WRONG_INPUT,
    say,
    say_ended,
    say_warning,
)
from skyarm.cli.output import console, with_output_options
from skyarm.records.files import shown
from skyarm.records.files.own_inputs import inputs_kept
from skyarm.records.files.user_code import is_deliberate, own_failure
from skyarm.records.registry import Registration, load_plugin, registrations
from skyarm.records.registry.plugins import loaded_plugins, register_law_of_file
from skyarm.records.registry.registrations import SHIPPED
from skyarm.records.registry.shipped import SECTIONS

COMMANDS = {
    name: title for section in SECTIONS.values() for name, (_, title) in section.items()
}
"""Shipped command -> its line of the help."""

Parsed: TypeAlias = Any
"""Context or parameter of a parsed command: an object of click, or of the copy that
some versions of typer contain."""

PLUGIN = "--plugin"

USAGE_ERROR: Any = typer.BadParameter.__mro__[2]
"""Exception class for wrong usage, found by inheritance, since some versions of typer
contain a copy of click."""

VALUES: Mapping[type, str] = {int: "INTEGER", float: "NUMBER"}
"""Type of an option -> word of its value in the help; the value of another option is a
name."""

SLOW = "no machine code here"
"""Prefix of the warning of a flight in Python floats; its class is not imported for
commands without flights."""


def top(
    context: typer.Context,
    version: Annotated[
        bool, typer.Option("--version", help="print the version and stop")
    ] = False,
    plugin: Plugins = None,
) -> None:
    """Aerial manipulation: multirotors that carry robot arms."""
    del plugin  # read before the command is
    if version:
        from skyarm import __version__

        console.print(__version__)
        raise typer.Exit
    if context.invoked_subcommand is None:
        console.print(context.get_help(), soft_wrap=True)


class LateConversion:
    """Command whose parameters convert only values that are not what they shall be yet.

    Newer versions of typer convert by pydantic, whose import takes as long as half of
    NumPy's.
    """

    def get_params(self, ctx: Parsed) -> list[Parsed]:
        """Parameters of the command, ``--help`` included."""
        parameters: list[Parsed] = super().get_params(ctx)  # type: ignore[misc]
        for each in parameters:
            kind = getattr(each, "type_descriptor", None)
            if (
                kind is not None
                and not kind.is_ranged
                and kind.parameter_info.parser is None
            ):
                # values that are right already pass by; the others go typer's own way
                each.get_runtime_param = partial(
                    SimpleNamespace, coerce=partial(_value_as, kind.annotation)
                )
        return parameters


def _value_as(kind: object, value: Any, param: Parsed, ctx: Parsed) -> object:
    """Value of a parameter as its kind; a text that is not printable may be of bytes
    that are none.
    """
    several = param.multiple or param.nargs == -1
    if value is None:
        return () if several else None
    # a text that is not printable may come from bytes that are no UTF-8
    if type(value) is kind and not several and (kind is not str or value.isprintable()):
        return value
    return type(param).get_runtime_param(param).coerce(value, param=param, ctx=ctx)


class Spelled(LateConversion, TyperCommand):
    """Typer command whose options keep out of the way of a plugin's, with the help that
    every command has.
    """

    def __init__(self, *arguments: Any, **more: Any) -> None:
        super().__init__(*arguments, **more)
        every: list[Parsed] = self.params
        owned = [each for each in every if each.name not in EVERY]
        own = {word for each in owned for word in each.opts}
        # a short name that a plugin's command has for something else stays its own
        for each in every:
            each.opts = [
                word for word in each.opts if each.name not in EVERY or word not in own
            ]
            if each.param_type_name == "argument":
                each.metavar = each.metavar or each.name.upper()
                # typer would print the type in Python's words
                each.display_type_rich = lambda **_: ""
            elif not each.is_flag:
                kind = getattr(each, "type_descriptor", None)
                each.metavar = each.metavar or VALUES.get(
                    getattr(kind, "annotation", str), "NAME"
                )

    def invoke(self, ctx: Parsed) -> Any:
        """Run the command, whose options then are those of the running one."""
        running.set(ctx)
        return super().invoke(ctx)

    def collect_usage_pieces(self, ctx: Parsed) -> list[str]:
        """Words of the line of usage, a required argument without braces."""
        return [
            re.sub(r"[{}]", "", each).replace("......", "...")
            for each in super().collect_usage_pieces(ctx)
        ]

    def format_options(self, ctx: Parsed, formatter: Any) -> None:
        """Write the help of a command: its subcommands, its own options and shared
        options, each spelled once.
        """
        begin, every = f"{ctx.info_name} ", ctx.parent.command.commands
        parts = {
            name.removeprefix(begin): each
            for name, each in every.items()
            if name.startswith(begin)
        }
        if parts:
            with formatter.section("Commands"):
                formatter.write_dl(
                    [
                        (name, each.get_short_help_str(60))
                        for name, each in parts.items()
                    ]
                )
        shared = [{each.name for each in part.params} for part in parts.values()]
        options: list[Parsed] = self.params
        for each in options:
            # its own options, of no part, are those of older spellings
            has = [each.name in names for names in shared]
            each.hidden = each.hidden or (any(has) and not all(has))
        super().format_options(ctx, formatter)


class Grouped(LateConversion, TyperGroup):
    """Typer group whose help lists commands in sections, and whose errors give a
    renamed command's present name.
    """

    def resolve_command(self, ctx: Parsed, args: list[str]) -> Any:
        """Find the command named by the first argument, or by the first two."""
        # names of two words are subcommands
        if " ".join(args[:2]) in self.commands:
            args = [" ".join(args[:2]), *args[2:]]
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: Parsed, formatter: Any) -> None:
        """Write the commands of the help, section by section."""
        others = [
            name
            for name, each in self.commands.items()
            if name not in COMMANDS and not each.hidden
        ]
        for title, names in {**SECTIONS, "Plugins": others}.items():
            if names:
                with formatter.section(title):
                    formatter.write_dl(
                        [
                            (name, self.commands[name].get_short_help_str(60))
                            for name in names
                        ]
                    )


def program(words: Sequence[str]) -> typer.Typer:
    """Build the Typer program for a command line, importing only the command that is
    called.
    """
    made = typer.Typer(
        name="skyarm",
        cls=Grouped,
        pretty_exceptions_enable=False,
        rich_markup_mode=None,
        context_settings={
            "help_option_names": ["-h", "--help"],
            "max_content_width": 100,
        },
    )
    made.callback(invoke_without_command=True)(top)
    for name, row in registrations("command").items():
        if row.source != SHIPPED:
            made.command(name, cls=Spelled, help=row.title)(
                with_output_options(name, row.load())
            )
        # the help needs their titles, and no module
        elif name not in words:
            made.command(name, help=row.title)(lambda: None)
        else:
            # only the module of the command that is called is loaded
            module = import_module(_module(row))
            made.command(name, cls=Spelled)(
                with_output_options(name, getattr(module, name))
            )
            for word, function in getattr(module, "SUBCOMMANDS", {}).items():
                made.command(f"{name} {word}", cls=Spelled, hidden=True)(
                    with_output_options(name, function)
                )
    return made


def _module(row: Registration) -> str:
    """Name of the Python module that defines a command."""
    return str(row.target).partition(":")[0]


def perform() -> int:
    """Execute the command line of this process and return its exit code."""
    usual, warnings.showwarning = warnings.showwarning, say_warning
    try:
        # inputs are kept for the whole command, so that none is written over
        with _lines_for_users(), inputs_kept():
            arguments = without_plugins(sys.argv[1:])
            # also what a shell completes, whose words stand in its variables
            typed = shlex.split(
                os.environ.get("_TYPER_COMPLETE_ARGS")
                or os.environ.get("COMP_WORDS")
                or ""
            )
            return int(
                program([*arguments, *typed])(
                    arguments, prog_name="skyarm", standalone_mode=False
                )
                or 0
            )
    except USAGE_ERROR as error:
        return say(f"{_bad_usage(error)}; see '{_command()} --help'", WRONG_INPUT)
    except (typer.Abort, KeyboardInterrupt):
        return say_ended("interrupted", INTERRUPTED)
    except (BrokenPipeError, SystemExit) as error:
        # who read our output has gone, as `skyarm show | head` does, of which Rich and
        # Typer make an exit of their own; nothing is left to flush into
        if BrokenPipeError in {type(error), type(error.__context__)}:
            os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
            return PIPE_CLOSED
        # sys.exit in a user's code is an error of that code
        line = _in_users_code(error)
        if not line:
            raise
        return say(line, WRONG_INPUT)
    except MemoryError:
        return say(
            "not enough memory; fly fewer seconds or at a lower control rate",
            WRONG_INPUT,
        )
    except Exception as error:
        line = _in_users_code(error) or _input_error(error)
        return say(line, WRONG_INPUT) if line else _our_fault(error)
    finally:
        warnings.showwarning = usual


def without_plugins(arguments: Sequence[str]) -> list[str]:
    """Load the user's plugin and law files named on a command line; returns the other
    arguments.

    Raises:
        RegistryError: one of them cannot be loaded.
        ValueError: ``--plugin`` without a file.
    """
    left: list[str] = []
    given = iter(arguments)
    for argument in given:
        name, has_value, value = argument.partition("=")
        if name != PLUGIN:
            left.append(argument)
            continue
        file = value if has_value else next(given, "")
        if not file:
            raise ValueError(f"{PLUGIN}: must be followed by a .py file")
        load_plugin(file)
    # before the options are read, since these check the names of laws
    for argument in left:
        for word in (
            argument.partition("=")[2].split(",")
            if argument.startswith("--")
            else argument.split(",")
        ):
            register_law_of_file(word)
    return left


def _bad_usage(error: Any) -> str:
    """One-line message for a wrong option or argument on the command line."""
    refused = getattr(error.__cause__, "errors", None)
    parameter = getattr(error, "param", None)
    if refused is None or parameter is None:
        return str(error.format_message()).rstrip(".")
    first = refused()[0]
    # pydantic's words, without its hints
    allowed = first["msg"].removeprefix("Input should be ").partition(",")[0]
    return f"{parameter.opts[0]} = {shown(first['input'])}: must be {allowed}"


def _command() -> str:
    """Name of the typed command, such as ``skyarm run``, for the message of a usage
    error.
    """
    words, rows = sys.argv[1:], registrations("command")
    while words and words[0] not in rows:
        words = words[1:]
    behind = (
        getattr(sys.modules.get(_module(rows[words[0]])), "SUBCOMMANDS", ())
        if words
        else ()
    )
    return " ".join(
        ["skyarm", *words[:1], *(word for word in words[1:2] if word in behind)]
    )


@contextmanager
def _lines_for_users() -> Iterator[None]:
    """Context manager that prints warnings meant for users, one line each.

    That a flight is slow is said at once.
    """
    with warnings.catch_warnings():
        warnings.filterwarnings("once", message=SLOW)
        # of numbers beyond measure the checks tell
        warnings.filterwarnings(
            "ignore",
            "(overflow|invalid value|divide by zero) encountered",
            RuntimeWarning,
        )
        python_shows = warnings.showwarning

        def show(message: Warning | str, *where: Any, **more: Any) -> None:
            if str(message).startswith(SLOW):
                say(str(message), 0)
            else:
                python_shows(message, *where, **more)

        warnings.showwarning = show
        yield


def _input_error(error: Exception) -> str:
    """One-line message for an error in input or files; empty for any other error."""
    from skyarm.compile.machine_code import MissingExtraError, NoMachineCodeError

    # of the system, whose words name no field; the library's own have no number
    if isinstance(error, OSError) and error.errno is not None:
        what = (
            "standard output"
            if error.filename is None
            else f"file = {shown(error.filename)}"
        )
        return (
            f"{what}: must be usable"
            f" ({error.strerror or errno.errorcode.get(error.errno, error.errno)})"
        )
    # an error that the library raised on purpose is an answer; another one is a fault
    deliberate = isinstance(
        error, (OSError, ValueError, NoMachineCodeError, MissingExtraError)
    ) and is_deliberate(error)
    return str(error) if deliberate else ""


def _our_fault(error: Exception) -> int:
    """Print an error of skyarm itself on one line, behind its traceback with
    ``--debug``.
    """
    if "--debug" in sys.argv:
        traceback.print_exception(error)
    where = traceback.extract_tb(error.__traceback__)[-1]
    place = f"{Path(where.filename).name}:{where.lineno}"
    what = f"{type(error).__name__} at {place}: {error}"
    return say(
        f"an error of skyarm, please report it with the output of --debug: {what}",
        OUR_FAULT,
    )


def _in_users_code(error: BaseException) -> str:
    """One-line message with file and line for an error in user code; empty for any
    other error.
    """
    # a user's code comes by plugins and by files of laws only
    return own_failure(error) if loaded_plugins() else ""
