"""Command line arguments shared by several commands: types, shell completion and
checks.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from contextvars import ContextVar
from pathlib import Path
from typing import Annotated, Any

import typer

from skyarm.records.files import must_be_one_of, require_file, shown
from skyarm.records.files.names import READS, names_in
from skyarm.records.registry import names as names_of_kind

MOST_WORKERS = 10_000
"""Largest number of threads or processes; chosen, far above the cores of a machine, as
so many would be started."""

MODELS = (".urdf", ".xacro", ".sdf")
"""Suffixes of files that only describe a vehicle."""

SUFFIXES: Mapping[str, tuple[str, ...]] = {
    "vehicle": (".toml", ".urdf", ".sdf"),
    "scenario": (".toml", ".npz"),
    "study": (".toml",),
    "task": (".toml",),
    "suite": (".toml",),
    "controller": (".py",),
    "autopilot": (),
}
"""Kind of a file -> suffixes of files in the present folder that are suggested."""


def shipped_names(kind: str) -> Iterable[str]:
    """Names of the shipped vehicles, scenarios, studies, tasks or controllers."""
    if kind == "vehicle":
        from skyarm.vehicle.vehicle_files import list_vehicles

        return list_vehicles()
    if kind == "scenario":
        from skyarm.scenario.scenario_file import list_scenarios

        return list_scenarios()
    if kind == "study":
        from skyarm.studies.sweep.study_file import list_studies

        return list_studies()
    if kind == "suite":
        from skyarm.studies.compare.compare_laws import SUITES

        return SUITES
    if kind == "task":
        from importlib import resources

        return names_in(resources.files("skyarm.planning") / "library")
    from skyarm.control.catalogue import AUTOPILOTS, LAWS, PRESETS

    return (*AUTOPILOTS,) if kind == "autopilot" else (*PRESETS, *LAWS, *AUTOPILOTS)


def name_completion(*kinds: str) -> Callable[[str], list[str]]:
    """Make a shell completion function for names that ship and files at the path
    begun.
    """

    def complete(incomplete: str) -> list[str]:
        # a list of names is completed at its last one
        before, comma, begun = incomplete.rpartition(",")
        suffixes = [suffix for kind in kinds for suffix in SUFFIXES[kind]]
        folder = begun[: begun.rfind("/") + 1]
        here = sorted(
            folder + entry.name
            for entry in Path(folder).glob("*")
            if entry.suffix in suffixes
        )
        names = dict.fromkeys(
            [*(name for kind in kinds for name in shipped_names(kind)), *here]
        )
        return [f"{before}{comma}{name}" for name in names if name.startswith(begun)]

    return complete


def word_completion(*words: str, registered: str = "") -> Callable[[str], list[str]]:
    """Make a shell completion function for some words, and the registered names of
    kinds, separated by spaces.
    """

    def complete(incomplete: str) -> list[str]:
        names = (
            *words,
            *(name for kind in registered.split() for name in names_of_kind(kind)),
        )
        return [each for each in names if each.startswith(incomplete)]

    return complete


# as text, since as a Path an empty name would mean the present folder
_OUT = typer.Option(
    "--out", "-o", metavar="FOLDER", help="folder for the results, made if missing"
)

Out = Annotated[str, _OUT]

OptionalOut = Annotated[str | None, _OUT]

Force = Annotated[
    bool,
    typer.Option("--force", help="replace a file that is there and that people edit"),
]

Plugins = Annotated[
    list[str] | None,
    typer.Option(
        "--plugin", metavar="FILE.py", help="a .py file that registers names; repeat"
    ),
]

EVERY: Mapping[str, Any] = {
    "as_json": Annotated[
        bool,
        typer.Option(
            "--json", help="the result as one JSON document, and nothing else"
        ),
    ],
    "quiet": Annotated[
        bool,
        typer.Option(
            "--quiet", "-q", help="no output and no progress, only warnings and errors"
        ),
    ],
    "plugin": Plugins,
    "debug": Annotated[
        bool, typer.Option("--debug", help="show where an error of skyarm itself arose")
    ],
}
"""Options that every command has, by parameter."""

Flying = Annotated[
    int,
    typer.Option(
        "--workers", help="threads or processes that fly; 0: one for each core"
    ),
]

On = Annotated[
    str | None,
    typer.Option(
        "--on",
        metavar="PLACE",
        help="where flights are computed: local, processes, ray or ray:HOST:PORT",
        autocompletion=word_completion("local", "processes", "ray"),
    ),
]

Scenario = Annotated[
    str,
    typer.Argument(
        help="a scenario file (.toml) or a shipped name",
        autocompletion=name_completion("scenario"),
    ),
]

ScenarioOrLog = Annotated[
    str,
    typer.Argument(
        help="a scenario (.toml), a log, or a shipped name",
        autocompletion=name_completion("scenario"),
    ),
]

Duration = Annotated[
    float | None, typer.Option(help="duration in s, in place of the file's")
]

Laws = Annotated[
    list[str] | None,
    typer.Option(
        "--laws",
        metavar="LAW,...",
        help="laws to fly: own, presets, laws, gains (.toml), FILE.py:make",
        autocompletion=name_completion("controller"),
    ),
]

Law = Annotated[
    list[str] | None,
    typer.Option(
        "--laws",
        metavar="LAW",
        help="one law: own, a preset, law, gains (.toml), FILE.py:make",
        autocompletion=name_completion("controller"),
    ),
]
"""``--laws`` of a command that takes one law."""


def workers(value: int) -> int:
    """Return the number of workers of ``--workers``; 0 means one for each available
    core.

    Raises:
        ValueError: one line.
    """
    require_within("--workers", value, 0, MOST_WORKERS)
    from skyarm.compile.llvm.shared_steps import cores

    return value or cores()


def require_within(
    option: str, value: float, low: float, high: float = float("inf")
) -> None:
    """Raise an error if a number is outside its bounds.

    Raises:
        ValueError: one line.
    """
    if not low <= value <= high:
        allowed = (
            f"from {low} to {high:.15g}" if high < float("inf") else f"at least {low}"
        )
        raise ValueError(f"{option} = {value}: must be {allowed}")


running: ContextVar[typer.Context] = ContextVar("running")
"""Context variable with the parsed words of the running command."""


def require_left_out(options: Iterable[str], why: str) -> None:
    """Raise an error if the user gave one of these options, which would have no effect.

    Raises:
        ValueError: one line: the first of them, and why.
    """
    parameters = running.get().command.params
    names = {word: each.name for each in parameters for word in each.opts}
    for option in options:
        if is_given(str(names[option])):
            raise ValueError(f"{option}: must be left out{why}")


def is_given(parameter: str) -> bool:
    """True if the user gave a parameter of the running command."""
    source = running.get().get_parameter_source(parameter)
    return source is not None and source.name != "DEFAULT"


def split_names(option: str, words: str) -> list[str]:
    """Split a comma-separated list of names.

    Raises:
        ValueError: none at all.
    """
    names = [name.strip() for name in words.split(",") if name.strip()]
    if not names:
        raise ValueError(f"{option}: must name at least one")
    return names


def names_of(option: str, values: Sequence[str] | None) -> list[str]:
    """Names in the values of a repeatable, comma-separated option; empty if it was not
    given.

    Raises:
        ValueError: a value of nothing but commas.
    """
    # a file of gains may have a comma in its path; an empty name is refused with the
    # names that there are
    lists = (
        [each] if not each or os.path.lexists(each) else split_names(option, each)
        for each in values or ()
    )
    return [name for names in lists for name in names]


def law_names(laws: Sequence[str] | None) -> list[str]:
    """Control laws named in the values of ``--laws``; empty if it was not given.

    Raises:
        ValueError: one line: a name of no law, or no such file of gains.
    """
    from skyarm.control.catalogue import OWN, is_named, must_be_named
    from skyarm.scenario.controller_table import is_gains_file

    named = names_of("--laws", laws)
    for name in named:
        if is_gains_file(name):
            require_file(name, f"--laws = {shown(name)}")
        elif name != OWN and not is_named(name):
            raise ValueError(
                f"--laws = {shown(name)}: {must_be_named(name)}; a .toml file, or"
                f" {OWN!r}, the law of the scenario with its options"
            )
    return named


def one_law(laws: Sequence[str] | None) -> str | None:
    """Control law of ``--laws`` for a command that takes one, the last if repeated;
    None if it was not given.

    Raises:
        ValueError: several between commas, or none at all.
    """
    last = (laws or ())[-1:]
    if len(names := names_of("--laws", last)) > 1:
        raise ValueError(f"--laws = {shown(','.join(names))}: must be one law")
    return next(iter(law_names(last)), None)


def chosen_names(
    option: str, words: str | None, there: Collection[str]
) -> tuple[str, ...]:
    """Parse a comma-separated choice among available names; None chooses all of them.

    Raises:
        ValueError: a name that is not there, or is named twice.
    """
    if words is None:
        return tuple(there)
    names = split_names(option, words)
    for name in names:
        if name not in there:
            raise ValueError(f"{option} = {shown(name)}: {must_be_one_of(there, name)}")
        if names.count(name) > 1:
            raise ValueError(f"{option} = {shown(name)}: must be named once")
    # in the order of what there is, however they were typed
    return tuple(name for name in there if name in names)


def label_of(name: str) -> tuple[str, str]:
    """Label and file of a flight given as NAME=FILE; the label is empty for a file
    alone.
    """
    label, equals, path = name.partition("=")
    # a file that has an equals sign in its name is a file
    return (label.strip(), path) if equals and not Path(name).exists() else ("", name)


def distinct_labels(
    names: Sequence[str], given: Sequence[str], usual: Sequence[str]
) -> list[str]:
    """Labels of flights: the given ones, and the usual ones where these are empty.

    Args:
        names: words of the command line, for the message.
        given: labels of these words.
        usual: labels that flights get by themselves.

    Raises:
        ValueError: one line: a label that a flight before it has.
    """
    labels = [label or other for label, other in zip(given, usual, strict=True)]
    require_distinct(names, labels)
    return labels


def require_distinct(names: Sequence[str], labels: Sequence[str]) -> None:
    """Raise an error if two flights have one label.

    Args:
        names: words of the command line, for the message.
        labels: labels of these words.

    Raises:
        ValueError: one line: a label that a flight before it has.
    """
    for i, label in enumerate(labels):
        if label in labels[:i]:
            raise ValueError(
                f"flight = {shown(names[i])}: must have another name than a flight"
                " before it"
            )


def require_not_another(name: str, expected: str) -> None:
    """Raise an error if a name denotes another kind of input than expected, such as a
    vehicle for a scenario.

    Args:
        name: name as given; files other than models are not looked at here.
        expected: "vehicle", "scenario", "study" or "task".

    Raises:
        ValueError: one line.
    """
    kinds = ("vehicle", "scenario", "study", "task")
    kind = next(
        (
            kind
            for kind in kinds
            # a name with a dot or slash is a path, whose file says itself what it is
            if "." not in name and "/" not in name and name in shipped_names(kind)
        ),
        "",
    )
    if expected != "vehicle" and Path(name).suffix in MODELS:
        kind = "vehicle"
    if kind and kind != expected and name not in shipped_names(expected):
        read = f"'{READS[kind]} {name}'"
        raise ValueError(
            f"{expected} = {shown(name)}: must be a {expected}, and this is a {kind},"
            f" for {read}"
        )
