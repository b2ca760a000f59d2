"""Output of all commands: text, tables and progress bars, or one JSON document.

Every command has ``--json``, ``--quiet`` and ``--plugin`` (:func:`with_output_options`)
and hands its result to :func:`give`. The document's first keys are the same for all
commands; docs/command_line.md lists the others.
"""

from __future__ import annotations

import functools
import inspect
import io
import json
import math
import re
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, redirect_stdout
from contextvars import ContextVar
from copy import copy
from dataclasses import dataclass, field, fields, is_dataclass
from numbers import Integral
from pathlib import Path, PurePath
from typing import Annotated, Any, get_args, get_origin

import typer
from rich.console import Console, ConsoleOptions, Group, RenderableType
from rich.segment import Segment
from rich.table import Table
from rich.text import Text

from skyarm.cli.arguments import EVERY
from skyarm.cli.lines import say
from skyarm.records.files import printable, write_atomically
from skyarm.records.files.user_code import require_result
from skyarm.records.registry.plugins import identities
from skyarm.view import pages
from skyarm.view.pages import Facts, Line, Mark

SCHEMA = 1
"""Version of the document; new keys keep it, removed or redefined ones raise it."""

PAUSE = 10.0
"""Least time (s) between two lines of progress, and before the first; chosen: a log of
an hour has 360, and what ends sooner has none."""

Advance = Callable[..., None]
"""Callback (done, total, last): counts so far, and text about the last step."""


STYLES = {"ok": "green", "note": "dim", "warning": "yellow", "fault": "bold red"}
"""Level of a finding, as in the title of its mark -> colour."""


class Terminal(Console):
    """Rich console that prints names from files as plain text, without markup or
    control characters.

    Every text is printed with its control characters written out, at the last place
    before styles and the terminal's own commands are added, so that no command can
    forget it.
    """

    def render(
        self, renderable: RenderableType, options: ConsoleOptions | None = None
    ) -> Iterable[Segment]:
        """Render text with control characters written out."""
        for segment in super().render(renderable, options):
            if segment.control or segment.text.isprintable():
                yield segment
            else:
                # line breaks are the only control characters that stay
                yield Segment(
                    "\n".join(map(printable, segment.text.split("\n"))), segment.style
                )

    def out(self, *objects: Any, **options: Any) -> None:
        """Raise an error, since this method would bypass the removal of control
        characters.
        """
        raise NotImplementedError("Terminal.out() writes past render(); use print()")


PLAIN: Mapping[str, Any] = {"markup": False, "highlight": False, "emoji": False}

console = Terminal(**PLAIN)


def tell(*lines: Line | RenderableType, screen: Console | None = None) -> None:
    """Print lines (never wrapped) and tables, to standard output or to the given
    console.
    """
    for line in lines:
        drawn = _drawn(line)
        (screen or console).print(drawn, soft_wrap=isinstance(drawn, (str, Text)))


def _drawn(line: Line | RenderableType) -> RenderableType:
    """Convert a line or table of a report to a Rich object."""
    if isinstance(line, Mark):
        return Text(
            printable(line.text),
            style="bold" if line.strong else STYLES.get(line.title, ""),
        )
    if not isinstance(line, pages.Table):
        return line
    tables = []
    # a wide table is turned rather than folded
    for part in _in_parts(line):
        names = [name.removeprefix(">") for name in part.head]
        tables.append(
            table := Table(
                box=None, pad_edge=False, show_header=any(names), header_style="dim"
            )
        )
        # names stay whole where they leave room for values
        whole = (
            max((len(str(row[0])) for row in part.rows), default=0)
            <= console.width - ROOM
        )
        for name, head in zip(names, part.head, strict=True):
            text, kept = Text(name, overflow="fold"), whole and not table.columns
            table.add_column(
                text, justify="left" if name == head else "right", no_wrap=kept
            )
        for row in part.rows:  # rich would read [s] in a cell as markup
            table.add_row(
                *(
                    (
                        Text(printable(c), overflow="fold")
                        if isinstance(c, str)
                        else _drawn(c)
                    )
                    for c in row
                )
            )
    return Group(
        *([_drawn(pages.heading(line.caption))] if line.caption else []), *tables
    )


ROOM = 24
"""Least width (letters) of a table beside the names of its rows, chosen."""

WIDE = 4
"""Least number of columns of a table that may be turned, chosen."""


def _in_parts(table: pages.Table) -> list[pages.Table]:
    """The table itself; or, where the words of its heads do not fit, its columns as
    rows, a few rows beside each other.

    A table with a row that alone is too wide stays as it is.
    """
    words = [max(len(word) for word in (*name.split(), "")) for name in table.head]
    cells = [
        max((len(str(row[i])) for row in table.rows), default=0)
        for i in range(len(words))
    ]
    # two letters stand between columns
    if (
        len(words) < WIDE
        or sum(map(max, words, cells)) + 2 * len(words) <= console.width
    ):
        return [table]
    # names of columns become the first column
    first = max(map(len, table.head))
    parts = list[list[Sequence[Any]]]()
    used = console.width
    for row in table.rows:
        width = max(len(str(c)) for c in row) + 2
        if first + width > console.width:
            return [table]
        if used + width > console.width:
            parts.append([])
            used = first
        parts[-1].append(row)
        used += width
    names = [name.removeprefix(">") for name in table.head]
    turned = [[*zip(names, *rows, strict=True)] for rows in parts]
    return [
        pages.Table(head=["", *(f">{name}" for name in head[1:])], rows=rows)
        for head, *rows in turned
    ]


def tell_report(lines: Sequence[str]) -> None:
    """Print the lines of a report; the first is its title."""
    title, *others = lines
    tell(pages.heading(title), *others)


@dataclass
class _Asked:
    """Output options of the running command (JSON, quiet), and the results collected so
    far.
    """

    as_json: bool = False
    quiet: bool = False
    result: Facts = field(default_factory=dict)


_asked: ContextVar[_Asked] = ContextVar("asked")
"""Context variable that is set while a command runs."""


def give(result: Facts | None = None, **more: Any) -> None:
    """Add results of the running command to its JSON document."""
    _asked.get(_Asked()).result |= {**(result or {}), **more}


def plugin_facts() -> Facts:
    """Digests of loaded plugins and law files for a JSON document; empty without
    any.
    """
    return {"plugins": identities()} if identities() else {}


def is_document_wanted() -> bool:
    """True if the running command will print a JSON document instead of text."""
    return _asked.get(_Asked()).as_json


def say_cause(line: str) -> None:
    """Print the cause of a failure to standard error if ``--quiet`` suppresses standard
    output.
    """
    if _asked.get(_Asked()).quiet:
        say(line)


Command = Callable[..., float | None]
"""Function of a command: its parameters are the options, its result an exit code or
None."""


ROW = re.compile(r"^ {4}(\w+)(?: ([^:\n]+))?: (.+?)(?=\n {4}\w|\n\n|\Z)", re.M | re.S)
"""Row of a command's docstring below ``Options:``: parameter, metavar if it has one,
and help."""


def _words_and_rows(command: Command) -> tuple[str, str]:
    """Docstring of a command, and the rows below ``Options:`` in it."""
    words, _, rows = (inspect.getdoc(command) or "").partition("\n\nOptions:\n")
    return words, rows


def parameters_of(command: Command) -> list[inspect.Parameter]:
    """Parameters of a command, with the help that rows of its docstring below
    ``Options:`` give them.
    """
    rows = ROW.findall(_words_and_rows(command)[1])
    helps = {name: (metavar, help) for name, metavar, help in rows}
    return [
        _with_help(each, *helps[each.name])
        # a plugin's option may be its default, with a help of its own
        if each.name in helps and not hasattr(each.default, "help")
        else each
        for each in inspect.signature(command, eval_str=True).parameters.values()
    ]


def with_output_options(name: str, function: Command) -> Command:
    """Decorator that adds the common output options to a command, and the help of its
    own from its docstring.
    """
    own = parameters_of(function)
    taken = {each.name for each in own}
    added = [
        inspect.Parameter(
            parameter, inspect.Parameter.KEYWORD_ONLY, default=None, annotation=option
        )
        for parameter, option in EVERY.items()
        if parameter not in taken
    ]

    @functools.wraps(function)
    def perform(*arguments: Any, **options: Any) -> float | None:
        asked = {each.name: bool(options.pop(each.name, False)) for each in added}
        with _output(
            name, _Asked(asked.get("as_json", False), asked.get("quiet", False))
        ):
            code = function(*arguments, **options)
            # a user's command may return anything; only whole numbers are exit codes
            fine = isinstance(code, Integral | float | None) and (code or 0) % 1 == 0
            return require_result(function, code, fine, "an exit code, or None")

    perform.__dict__["__signature__"] = inspect.Signature([*own, *added])
    perform.__annotations__ = {each.name: each.annotation for each in (*own, *added)}
    perform.__doc__ = _words_and_rows(function)[0]
    return perform


def _with_help(
    parameter: inspect.Parameter, metavar: str, words: str
) -> inspect.Parameter:
    """Parameter of a command with its help, as Typer reads it.

    Its annotation may state its option, or the function that completes it in a shell.
    """
    kind, *stated = (
        get_args(parameter.annotation)
        if get_origin(parameter.annotation) is Annotated
        else (parameter.annotation,)
    )
    # a copy, since several commands may share an option, each with its words; a plugin
    # may state more than what Typer reads
    option = next((copy(each) for each in stated if hasattr(each, "metavar")), None)
    complete = next(filter(callable, stated), None)
    if option is None and parameter.default is parameter.empty:
        option = typer.Argument(autocompletion=complete)
    elif option is None:
        # of a flag without a name Typer makes two options, --NAME and --no-NAME, of
        # which only one that is set needs the second
        name = parameter.name.replace("_", "-")
        names = [f"--{name}"] if kind is bool and not parameter.default else []
        option = typer.Option(*names, autocompletion=complete)
    option.metavar = metavar or option.metavar
    option.help = " ".join(words.split())
    return parameter.replace(annotation=Annotated[kind, option])


@contextmanager
def _output(name: str, asked: _Asked) -> Iterator[None]:
    """Context manager of a running command: discards text and prints the JSON document
    if requested.
    """
    before = _asked.set(asked)
    try:
        if not (asked.as_json or asked.quiet):
            yield
            return
        words = io.StringIO()
        ended: typer.Exit | None = None
        with redirect_stdout(words):
            try:
                yield
            except typer.Exit as stop:  # a flight that ended early is a result, too
                ended = stop
        if asked.as_json and sys.stdout:
            from skyarm import __version__

            head = {"schema": SCHEMA, "command": name, "skyarm": __version__}
            # ASCII: names from files stay text on whatever reads it
            sys.stdout.write(
                json_text(
                    {
                        # keys of the head come last in the table and first in the text,
                        # so that no result hides them
                        **(asked.result or {"lines": words.getvalue().splitlines()}),
                        **head,
                    },
                    head,
                )
            )
            sys.stdout.flush()
        if ended is not None:
            raise ended
    finally:
        _asked.reset(before)


def json_text(document: Facts, first: Iterable[str] = ()) -> str:
    """Format a document as strict JSON text, with some keys first."""
    return (
        json.dumps(
            plain({**dict.fromkeys(first), **document}), indent=1, allow_nan=False
        )
        + "\n"
    )


def write_json(file: Path, document: Facts) -> Path:
    """Write a document as a JSON file, atomically."""
    return write_atomically(file, json_text(document).encode())


def plain(value: Any) -> Any:
    """Convert dataclasses, arrays and paths to values that JSON can hold; non-finite
    numbers become None.
    """
    if is_dataclass(value) and not isinstance(value, type):
        return {each.name: plain(getattr(value, each.name)) for each in fields(value)}
    if isinstance(value, complex):
        return [value.real, value.imag]
    if isinstance(value, Mapping):
        return {str(key): plain(each) for key, each in value.items()}
    if isinstance(value, (list, tuple, set)):
        return [plain(each) for each in value]
    if hasattr(value, "tolist"):
        return plain(value.tolist())
    if isinstance(value, float):
        # strict JSON has neither infinity nor NaN
        return value if math.isfinite(value) else None
    return str(value) if isinstance(value, PurePath) else value


@contextmanager
def bar(title: str, pause: float = PAUSE) -> Iterator[Advance]:
    """Context manager with a progress bar; yields the function (done, total, last) that
    updates it.

    A bar where the console writes, or on standard error where only that is a terminal.
    Without a terminal a plain line on standard error, at most one in ``pause`` s, so
    that a log file shows that something goes on. Nothing with ``--quiet``.
    """
    if _asked.get(_Asked()).quiet:
        yield lambda *_, **_more: None
        return
    # a bar where it is seen: on the console, else on standard error
    screen: Terminal | None = console if console.is_terminal else None
    if screen is None and sys.stderr.isatty():
        screen = Terminal(stderr=True, **PLAIN)
    if screen is None:
        # a first line after a while, also where no step has ended yet
        # without a pause the first step is told at once: 1e6 s never come
        timer = threading.Timer(pause or 1e6, say, (f"{title} ...",))
        timer.daemon = True
        timer.start()
        printed = [time.monotonic()]

        def line(done: int = 0, total: int = 0, last: str = "") -> None:
            timer.cancel()
            now = time.monotonic()
            if now - printed[0] >= pause:
                printed[0] = now
                say(
                    f"{title}: {done} of {total} {last}"
                    if total
                    else f"{title}: {last}"
                )

        try:
            yield line
        finally:
            timer.cancel()
        return
    # only a terminal shows it
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        TextColumn("{task.fields[last]}", style="dim", markup=False),
    )
    with Progress(*columns, console=screen, transient=True) as progress:
        task = progress.add_task(title, total=None, last="")

        def advance(done: int = 0, total: int = 0, last: str = "") -> None:
            progress.update(task, completed=done, total=total or None, last=last)

        yield advance
