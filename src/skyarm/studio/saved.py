"""What was flown by hand, written as a scenario that flies it again."""

from __future__ import annotations

from pathlib import Path

from skyarm.studio.fleet import Fleet


def save_flights(fleet: Fleet, folder: Path) -> str:
    """Write a scenario for each flight; returns what was written, in words."""
    return f"not yet: {folder}, {fleet.source}"
