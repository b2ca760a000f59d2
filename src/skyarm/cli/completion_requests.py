"""What a shell asks for while words are being typed. Light: every command reads this module."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any

VARIABLE = "_SKYARM_COMPLETE"
"""Environment variable with which the script of ``skyarm completion`` asks."""


def asked_for() -> bool:
    """Whether a shell asks for completions rather than for a command."""
    return VARIABLE in os.environ


def complete(program: Any, arguments: Sequence[str]) -> int:
    """Answer a shell: Typer prints the completions, and ends."""
    import typer

    from skyarm.cli.completion import prepare

    command = typer.main.get_command(program)
    prepare(command)
    return int(command.main(list(arguments), prog_name="skyarm", complete_var=VARIABLE, standalone_mode=False) or 0)
