"""``skyarm completion``: the shell's script, and the names that it completes."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import typer.completion

from skyarm.cli.completion_requests import VARIABLE
from skyarm.files import must_be_one_of, shown

TYPER: Any = typer.completion
"""Its functions for shells' scripts, which it does not list as its own."""

SHELLS = ("bash", "zsh", "fish")

WHERE = {
    "bash": "skyarm completion bash > ~/.local/share/bash-completion/completions/skyarm",
    "zsh": "skyarm completion zsh > ~/.zfunc/_skyarm, with fpath+=~/.zfunc before compinit in ~/.zshrc",
    "fish": "skyarm completion fish > ~/.config/fish/completions/skyarm.fish",
}
"""Shell -> how its script is installed."""

FILES = {
    "vehicle": (".toml", ".urdf"),
    "scenario": (".toml", ".npz"),
    "study": (".toml",),
    "controller": (".py",),
}
"""Kind -> suffixes of files of the folder one stands in that may be meant."""


def script(shell: str) -> str:
    """The script of a shell.

    Raises:
        ValueError: one line: another shell.
    """
    if shell not in SHELLS:
        raise ValueError(f"shell = {shown(shell)}: {must_be_one_of(SHELLS, shell)}")
    text: str = TYPER.get_completion_script(prog_name="skyarm", complete_var=VARIABLE, shell=shell)
    return text


ASKED: dict[str, dict[str, tuple[str, ...]]] = {
    "check": {"what": ("vehicle", "scenario")},
    "show": {"vehicle": ("vehicle",)},
    "run": {"scenario": ("scenario",), "controller": ("controller",)},
    "replay": {"controller": ("controller",)},
    "margins": {"scenario": ("scenario",), "controller": ("controller",)},
    "basin": {"scenario": ("scenario",), "controller": ("controller",)},
    "sweep": {"study": ("study",)},
    "compare": {"suite": ("scenario",), "laws": ("controller",), "vehicle": ("vehicle",)},
    "export-c": {"controller": ("controller",), "vehicle": ("vehicle",)},
    "new": {"kind": ("starter",)},
    "completion": {"shell": ("shell",)},
}
"""Command -> its parameter -> the kinds of names it takes."""


def prepare(command: Any) -> None:
    """Make the program's parameters complete names, and the shells' questions understood.

    Args:
        command: the whole program as Typer gives it to click.
    """
    TYPER.completion_init()
    for name, parameters in ASKED.items():
        known = {each.name: each for each in getattr(command.commands.get(name), "params", ())}
        for parameter, kinds in parameters.items():
            if parameter in known:
                known[parameter]._custom_shell_complete = _completer(kinds)


def _completer(kinds: Iterable[str]) -> Callable[[Any, Any, str], list[str]]:
    chosen = tuple(kinds)

    def complete(_context: Any, _parameter: Any, incomplete: str) -> list[str]:
        return [name for name in names(chosen) if name.startswith(incomplete)]

    return complete


def names(kinds: Iterable[str]) -> list[str]:
    """Names of some kinds, shipped and of files here, each once."""
    found: dict[str, None] = {}
    for kind in kinds:
        found |= dict.fromkeys((*_shipped(kind), *_files_here(FILES.get(kind, ()))))
    return list(found)


def _shipped(kind: str) -> Iterable[str]:
    if kind == "vehicle":
        from skyarm.vehicle.vehicle_files import list_vehicles

        return list_vehicles()
    if kind == "scenario":
        from skyarm.scenario.scenario_file import list_scenarios

        return list_scenarios()
    if kind == "study":
        from skyarm.sweep.study_file import list_studies

        return list_studies()
    if kind == "controller":
        from skyarm.control.catalogue import LAWS, PRESETS

        return (*PRESETS, *LAWS)
    if kind == "starter":
        from skyarm.cli.starter_files import KINDS

        return KINDS
    return SHELLS


def _files_here(suffixes: tuple[str, ...]) -> list[str]:
    try:
        return sorted(entry.name for entry in Path().iterdir() if entry.suffix in suffixes) if suffixes else []
    except OSError:
        return []
