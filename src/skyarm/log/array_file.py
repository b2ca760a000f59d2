"""A log as npz: its arrays, and what it says of itself as JSON."""

from __future__ import annotations

import io
import json
import os
from pathlib import Path
from typing import Any

import numpy as np

from skyarm.files import shown, write_atomically
from skyarm.files.unpacked import TooLargeError, npz_arrays
from skyarm.log.contents import LAYOUT, log_of
from skyarm.log.flight_log import Log
from skyarm.log.log_columns import layout


def write_npz(log: Log, path: str | os.PathLike[str]) -> Path:
    """Write one compressed npz; the file appears whole or not at all.

    The description says the names and units of the arrays' columns under ``columns``.
    """
    buffer = io.BytesIO()
    info = np.array(json.dumps(log.info | {LAYOUT: layout(log)}))
    arrays: dict[str, Any] = {**log.arrays(), "info": info}
    np.savez_compressed(buffer, **arrays)
    return write_atomically(path, buffer.getvalue())


def read_npz(path: str | os.PathLike[str]) -> Log:
    """Read a log that :func:`write_npz` wrote, or a version before it.

    Raises:
        OSError: the file cannot be read. ValueError: it is not such a log.
    """
    name, content_of_file = f"log = {shown(os.fspath(path))}", Path(path).read_bytes()
    try:
        content = npz_arrays(content_of_file)
        info = json.loads(str(content.pop("info")))
    except TooLargeError as error:
        raise ValueError(f"{name}: {error}") from None
    except Exception:  # archive, header, numbers and JSON have readers of their own, each with its own errors
        raise ValueError(f"{name}: must be a log that save_npz wrote") from None
    try:
        return log_of(content, info)
    except ValueError as error:
        raise ValueError(f"{name}: {error}") from None
