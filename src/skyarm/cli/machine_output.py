"""What every command can be asked for: its result as one JSON document (``--json``), or silence (``--quiet``).

The program (:mod:`skyarm.cli.app`) puts both options on every command that joins it, and every command hands its result
to :func:`give`. The document's first keys are the same for all commands; docs/command_line.md says what follows.
"""

from __future__ import annotations

import contextlib
import functools
import inspect
import io
import json
import math
import sys
from collections.abc import Callable, Iterator, Mapping
from contextvars import ContextVar
from dataclasses import dataclass, field
from pathlib import PurePath
from typing import Annotated, Any, TypeVar

import typer

SCHEMA = 1
"""Of the document: keys are added under the same number; one that goes or means something else raises it."""

OPTIONS: Mapping[str, Any] = {
    "as_json": Annotated[bool, typer.Option("--json", help="the result as one JSON document, and nothing else")],
    "quiet": Annotated[bool, typer.Option("--quiet", help="no output and no progress, only warnings and errors")],
}
"""Parameter -> the option that every command has."""

Command = TypeVar("Command", bound=Callable[..., Any])


@dataclass
class _Asked:
    """What the command that runs was asked for, and what it has given so far."""

    as_json: bool = False
    quiet: bool = False
    result: dict[str, Any] = field(default_factory=dict)


_asked: ContextVar[_Asked] = ContextVar("asked")
"""Set while a command runs."""


def give(result: Mapping[str, Any] | None = None, **more: Any) -> None:
    """Hand over what ``--json`` prints: plain values, arrays, paths; what is not finite becomes null."""
    _asked.get(_Asked()).result |= {**(result or {}), **more}


def is_document_wanted() -> bool:
    """Whether what is given will be printed, for results that take a while to find."""
    return _asked.get(_Asked()).as_json


def is_quiet() -> bool:
    """Whether the command was told not to show its progress."""
    return _asked.get(_Asked()).quiet


def with_output_options(name: str, function: Command) -> Command:
    """The function of a command with ``--json`` and ``--quiet`` beside its own options.

    An option of its own that is called so, as a plugin may have one, stays its own.
    """
    signature = inspect.signature(function, eval_str=True)
    own = list(signature.parameters.values())
    taken = {word for each in own for word in _words(each)}
    added = [
        inspect.Parameter(parameter, inspect.Parameter.KEYWORD_ONLY, default=False, annotation=option)
        for parameter, option in OPTIONS.items()
        if not taken & {parameter, *option.__metadata__[0].param_decls, option.__metadata__[0].default}
    ]

    @functools.wraps(function)
    def perform(*arguments: Any, **options: Any) -> Any:
        asked = {each.name: bool(options.pop(each.name, False)) for each in added}
        with _output(name, _Asked(as_json=asked.get("as_json", False), quiet=asked.get("quiet", False))):
            return function(*arguments, **options)

    plain: Any = perform
    plain.__signature__ = signature.replace(parameters=[*own, *added])
    plain.__annotations__ = {each.name: each.annotation for each in (*own, *added)}
    changed: Command = plain
    return changed


def _words(parameter: inspect.Parameter) -> set[str]:
    """Name of a parameter, and of the option that stands for it."""
    found = {parameter.name}
    for each in (*getattr(parameter.annotation, "__metadata__", ()), parameter.default):
        if hasattr(each, "param_decls"):
            found |= {word for word in (*(each.param_decls or ()), each.default) if isinstance(word, str)}
    return found


@contextlib.contextmanager
def _output(name: str, asked: _Asked) -> Iterator[None]:
    """Run a command as it was asked: its words go nowhere where a document or nothing is wanted."""
    before = _asked.set(asked)
    try:
        if not (asked.as_json or asked.quiet):
            yield
            return
        words = io.StringIO()
        ended: typer.Exit | None = None
        with contextlib.redirect_stdout(words):
            try:
                yield
            except typer.Exit as stop:  # a flight that ended early is a result, too
                ended = stop
        if asked.as_json:
            _write(name, asked.result or {"lines": words.getvalue().splitlines()})
        if ended is not None:
            raise ended
    finally:
        _asked.reset(before)


def _write(name: str, result: Mapping[str, Any]) -> None:
    from skyarm import __version__

    head = {"schema": SCHEMA, "command": name, "skyarm": __version__}
    document = head | {key: value for key, value in result.items() if key not in head}
    # ASCII: names from files stay text on whatever reads it
    sys.stdout.write(json.dumps(plain(document), indent=1, allow_nan=False) + "\n")
    sys.stdout.flush()


def plain(value: Any) -> Any:
    """A value as JSON has it: null for what is not finite, lists for tuples and arrays, text for paths."""
    if isinstance(value, Mapping):
        return {str(key): plain(each) for key, each in value.items()}
    if isinstance(value, (list, tuple, set)):
        return [plain(each) for each in value]
    if hasattr(value, "tolist"):
        return plain(value.tolist())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return str(value) if isinstance(value, PurePath) else value
