"""What a reader of foreign files left out or took in another way: said once in a vehicle's sheet, never in a flight."""

from __future__ import annotations

from skyarm.files import printable

SHOWN = 4
"""Names in a note; a hand of twenty joints would fill the screen."""


class Notes:
    """Notes that are being collected, the names that share one in a single line.

    Args:
        kind: of what the names are names of, for the line: ``joints a, b: TEXT``.
    """

    def __init__(self, kind: str = "joint") -> None:
        self._kind = kind
        self._names: dict[tuple[str, str], list[str]] = {}

    def add(self, text: str, name: str = "", kind: str = "") -> None:
        """A note on one name, or on the whole file."""
        names = self._names.setdefault((kind or self._kind, text), [])
        if name and name not in names:
            names.append(name)

    def lines(self) -> tuple[str, ...]:
        """All of them, each on one line."""
        return tuple(_line(kind, text, names) for (kind, text), names in self._names.items())


def _line(kind: str, text: str, names: list[str]) -> str:
    if not names:
        return printable(text)
    listed = ", ".join(names[:SHOWN]) + (f" and {len(names) - SHOWN} more" if len(names) > SHOWN else "")
    return printable(f"{kind}{'s' if len(names) > 1 else ''} {listed}: {text}")
