"""Arrays of a long flight in a file, read anew at every access."""

from __future__ import annotations

import errno
import os
import shutil
import weakref
from bisect import bisect_left
from collections import UserDict
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import accumulate
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any

import numpy as np

from skyarm.log.sensor_data import COMPONENTS
from skyarm.records.arrays import Array

ROOM = 3
"""Free space that a disk must have, in sizes of the arrays with the next ones: their
log's files are to be written."""


class ArraysByName(UserDict[str, Any]):
    """Arrays by name, each read anew at every access; a pickle holds the arrays
    themselves.

    Args:
        names: names of the arrays, in order.
        read: function that returns an array by name, and only some of its rows if a
            slice follows.
    """

    def __init__(self, names: Iterable[str], read: Callable[..., Array]) -> None:
        super().__init__({name: name for name in names})
        self.read = read

    def __getitem__(self, name: str) -> Array:
        return self.read(self.data[name])

    def __reduce__(self) -> tuple[Any, ...]:
        return dict, (dict(self),)


class ArrayFile:
    """File of arrays, without a name, which goes with its process.

    Args:
        folder: folder of the file.
    """

    def __init__(self, folder: Path) -> None:
        self._folder, self._file = folder, TemporaryFile(dir=folder, buffering=0)  # noqa: SIM115
        # closed when the object goes, also where the process ends by an error
        weakref.finalize(self, self._file.close)

    def store(self, arrays: Mapping[str, Array]) -> ArraysByName:
        """Append arrays; return them as they are read from the file.

        Raises:
            OSError: the disk has no room for them and for the files of their log.
        """
        file = self._file
        content = bytearray()
        places = dict[str, tuple[int, tuple[int, ...]]]()
        begin = file.seek(0, os.SEEK_END)
        for name, array in arrays.items():
            places[name] = begin + len(content), array.shape
            content += array.tobytes()
        room, size = shutil.disk_usage(self._folder).free, len(content)
        # checked before, because a full disk would leave a torn log
        if room < ROOM * (begin + 2 * size) or file.write(content) < size:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

        def read(name: str) -> Array:
            place, shape = places[name]
            array = np.empty(shape)
            self._file.seek(place)
            self._file.readinto(array.data)
            return array

        return ArraysByName(arrays, read)


def join(parts: Sequence[Mapping[str, Array]]) -> ArraysByName:
    """Arrays of successive parts of a flight as one, joined at every access.

    Parts may lack arrays: readings, measurements and estimates are NaN there, others 0;
    path time is the flight's.
    """
    ends = [*accumulate(len(part["time"]) for part in parts)]

    def of_part(part: Mapping[str, Array], name: str) -> Array:
        if name in part or name == "path_time":
            return part[name if name in part else "time"]
        like = next(each[name] for each in parts if name in each)
        readings = "." in name and not name.startswith(f"{COMPONENTS}.")
        estimate = name.startswith("measured_") or name.endswith(
            ("_found", "_deviation")
        )
        # 0 for what a component logs; NaN for what was never measured
        none = np.nan if readings or estimate else 0.0
        return np.full((len(part["time"]), *like.shape[1:]), none)

    def read(name: str, chosen: slice = slice(None)) -> Array:
        start, stop, _ = chosen.indices(ends[-1])
        # at the end of the flight no part ends later, and the last one serves
        first = bisect_left(ends, start + 1, hi=len(ends) - 1)
        last = bisect_left(ends, stop)
        rows = np.concatenate([of_part(part, name) for part in parts[first : last + 1]])
        begin = ([0, *ends])[first]
        return rows[start - begin : max(stop - begin, 0)]

    return ArraysByName((name for part in parts for name in part), read)
