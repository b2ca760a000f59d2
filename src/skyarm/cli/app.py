"""The command line's program, which the commands join, and what they share."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from typing import Annotated, Any

import typer

from skyarm.cli.machine_output import with_output_options
from skyarm.cli.terminal import Terminal


class Program(typer.Typer):
    """A program whose every command takes ``--json`` and ``--quiet``, those of plugins too."""

    def command(self, name: str | None = None, **options: Any) -> Callable[[Any], Any]:
        """Join a function to the program; it is given back as it is."""
        join = super().command

        def joined(function: Callable[..., Any]) -> Callable[..., Any]:
            called = name or function.__name__.rstrip("_").replace("_", "-")
            join(name, **options)(with_output_options(called, function))
            return function

        return joined


app = Program(
    name="skyarm",
    help="Aerial manipulation: multirotors that carry robot arms.",
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)
console = Terminal(markup=False, highlight=False, emoji=False)

NOT_COMPLETED = 3
"""Exit code of a flight that ended before its time."""

MOST_WORKERS = 10_000
"""Threads or processes: beyond this it is a slip."""

# text, not Path: an empty name would become the folder one stands in
Out = Annotated[str, typer.Option("--out", help="folder for the results, made if missing")]


def cores() -> int:
    """Cores this process may use; a container often has fewer than its machine."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def workers(option: str, value: int) -> int:
    """How many threads or processes an option asks for; 0 takes every core.

    Raises:
        ValueError: one line.
    """
    if not 0 <= value <= MOST_WORKERS:
        raise ValueError(f"{option} = {value}: must be from 0 to {MOST_WORKERS}")
    return value or cores()


def require_left_out(context: typer.Context, options: Iterable[str], why: str) -> None:
    """Refuse options that are on the command line, their usual values too, where they would have no effect.

    Raises:
        ValueError: one line: the first of them, and why.
    """
    names = {word: each.name for each in context.command.params for word in each.opts}
    for option in options:
        source = context.get_parameter_source(str(names[option]))
        if source is not None and source.name != "DEFAULT":
            raise ValueError(f"{option}: must be left out{why}")


def tell(line: str) -> None:
    """One line on standard output."""
    console.print(line, soft_wrap=True)
