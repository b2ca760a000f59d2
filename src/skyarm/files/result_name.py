"""Names that become names of files: any text that the usual file systems take."""

from __future__ import annotations

from typing import Any

from skyarm.files.one_line import printable

LONGEST_NAME, LONGEST_BYTES = 100, 200
"""Characters, and bytes of UTF-8: a file system takes 255 with what is put before and after."""

FORBIDDEN = '/\\:*?"<>|'
"""Characters of no file name, on one system or another."""

DEVICES = {"con", "prn", "aux", "nul", *(f"{port}{k}" for port in ("com", "lpt") for k in range(1, 10))}
"""Names that Windows keeps for itself, with any suffix."""

ALLOWED = (
    f"must be 1 to {LONGEST_NAME} letters, digits and other printable characters without any of {' '.join(FORBIDDEN)}; "
    "it must not begin with '.', '-' or a blank, end with '.' or a blank, or be a device of Windows"
)


def is_result_name(name: Any) -> bool:
    """Whether a name can be that of a file on Linux, macOS and Windows."""
    return (
        isinstance(name, str)
        and 0 < len(name) <= LONGEST_NAME
        and printable(name) == name
        and len(name.encode()) <= LONGEST_BYTES
        and not any(character in FORBIDDEN for character in name)
        and name[0] not in ".- "
        and name[-1] not in ". "
        and name.split(".")[0].strip().lower() not in DEVICES
    )
