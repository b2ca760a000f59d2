"""Options of the last version by their new names."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from skyarm.files.old_names import warn_of_old_name

OLD_OPTIONS: Mapping[str, Mapping[str, str]] = {
    "reproduce": {"--jobs": "--workers", "--bench": "--compare"},
    "sweep": {"--threads": "--workers"},
    "basin": {"--threads": "--workers"},
    "compare": {"--threads": "--workers", "--single": "--one-by-one"},
    "export-c": {"--single": "--float32"},
}
"""Command -> old option -> new one."""


def with_new_options(arguments: Sequence[str]) -> list[str]:
    """The words of a command line with every old option of its command under its new name.

    Warns:
        OldNameWarning: an option is old; the warning says the new one.
    """
    command = next((word for word in arguments if not word.startswith("-")), "")
    old = OLD_OPTIONS.get(command, {})
    found = []
    for word in arguments:
        option, equals, value = word.partition("=")
        if option in old:
            warn_of_old_name(f"skyarm {command} {option}", old[option])
        found.append(old.get(option, option) + equals + value)
    return found
