"""What every command takes on its line: plugins, and laws from files."""

from __future__ import annotations

from collections.abc import Sequence

from skyarm.registry.plugins import load_plugin, register_law_of_file

PLUGIN = "--plugin"


def without_plugins(arguments: Sequence[str]) -> list[str]:
    """Load each ``--plugin FILE.py`` and each law FILE.py:make; the arguments that are left for the command.

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
    for argument in left:
        for word in argument.partition("=")[2].split(",") if argument.startswith("--") else argument.split(","):
            register_law_of_file(word)
    return left
