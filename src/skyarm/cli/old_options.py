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

JSON, OUT = "--json", "--out"

FILE_AFTER_JSON = {"list": "", "bench": "", "margins": ".json"}
"""Commands whose ``--json`` was followed by a file -> how that word must end to be one, and not the next argument."""


def with_new_options(arguments: Sequence[str]) -> list[str]:
    """The words of a command line with every old option of its command under its new name.

    Warns:
        OldNameWarning: an option is old; the warning says the new one.
    """
    command = next((word for word in arguments if not word.startswith("-")), "")
    old = OLD_OPTIONS.get(command, {})
    found = []
    for i, word in enumerate(arguments):
        option, equals, value = word.partition("=")
        if option in old:
            warn_of_old_name(f"skyarm {command} {option}", old[option])
        if option == JSON and (equals or _is_file(command, arguments[i + 1 : i + 2])) and command in FILE_AFTER_JSON:
            warn_of_old_name(f"skyarm {command} {JSON} FILE", f"{OUT} FILE")
            option = OUT
        found.append(old.get(option, option) + equals + value)
    return found


def _is_file(command: str, following: Sequence[str]) -> bool:
    """Whether the word after ``--json`` is the file that it once took."""
    return any(not word.startswith("-") and word.endswith(FILE_AFTER_JSON.get(command, "")) for word in following)
