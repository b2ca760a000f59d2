"""The scores of a search on disk, a file a round, so that an interrupted one goes on where it stopped."""

from __future__ import annotations

import io
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.files import shown, write_atomically
from skyarm.files.unpacked import npz_arrays
from skyarm.records.leaves import field_names, parts
from skyarm.tune.objective import Scores

Array = npt.NDArray[np.float64]

FACTS = "search.json"
"""What the scores are of."""


class ArchiveError(ValueError):
    """A folder holds the search of something else."""


class Archive:
    """Scores of a search by round; those of another search are refused.

    Args:
        folder: that is there.
        facts: plain values on which the scores depend.

    Raises:
        ArchiveError: one line: the folder holds other facts.
    """

    def __init__(self, folder: Path, facts: Mapping[str, Any]) -> None:
        self.folder = folder
        file, text = folder / FACTS, json.dumps(dict(facts), indent=1, sort_keys=True) + "\n"
        if not file.exists():
            write_atomically(file, text.encode())
            return
        try:
            known = json.loads(file.read_text("utf-8"))
        except (OSError, ValueError):
            known = None
        if known != json.loads(text):
            other = _first_difference(known, json.loads(text))
            raise ArchiveError(
                f"--out = {shown(str(folder))}: holds a search of something else ({other}); choose another folder, "
                f"or remove this one"
            )

    def get(self, number: int, asked: Array) -> Scores | None:
        """Scores of a round, if it is there, whole, and of these candidates."""
        try:
            held = npz_arrays(self._file(number).read_bytes())
            if not np.array_equal(held["asked"], asked):
                return None
            found = Scores(**{name: held[name] for name in field_names(Scores) or ()})
        except (OSError, ValueError, KeyError):
            return None
        return found if all(len(values) == len(asked) for values in parts(found).values()) else None

    def put(self, number: int, asked: Array, scores: Scores) -> None:
        """Keep the scores of a round."""
        content = io.BytesIO()
        np.savez(content, asked=asked, **parts(scores))
        write_atomically(self._file(number), content.getvalue())

    def _file(self, number: int) -> Path:
        return self.folder / f"round_{number:03d}.npz"


def _first_difference(known: Any, wanted: Mapping[str, Any]) -> str:
    if not isinstance(known, dict):
        return f"{FACTS} cannot be read"
    for name, value in wanted.items():
        if known.get(name) != value:
            return f"{name}: {shown(known.get(name))}, now {shown(value)}"
    return "other facts"
