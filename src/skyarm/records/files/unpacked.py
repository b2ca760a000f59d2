"""Compressed files, with a check of their unpacked size: a small file may unpack to
gigabytes.
"""

from __future__ import annotations

import io
import zipfile

import numpy as np

from skyarm.records.arrays import AnyArray

LARGEST = 1e9
"""Largest unpacked size (bytes) of a file of any packed size."""

RATIO = 20
"""Largest ratio of unpacked to packed size above that limit; arrays of a flight shrink
to a half or a tenth."""


class TooLargeError(ValueError):
    """Error for a file that would unpack to more than the size limit."""


def require_size(unpacked: float, content: bytes) -> None:
    """Raise an error if a file would unpack to more than the size limit.

    Args:
        unpacked: bytes.
        content: content of the file.

    Raises:
        TooLargeError: one line, without the file's name.
    """
    # arrays of zeros shrink without bound, hence a limit by size first
    most = max(LARGEST, RATIO * len(content))
    if not unpacked <= most:
        raise TooLargeError(
            f"must unpack to at most {most / 1e6:.0f} MB, and would to"
            f" {unpacked / 1e6:.3g} MB"
        )


def npz_arrays(content: bytes) -> dict[str, AnyArray]:
    """Arrays of an npz file by name; pickled Python objects are not loaded.

    Raises:
        TooLargeError: it unpacks to too much. ValueError: it is no such file.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            members = archive.infolist()
        # zipfile unpacks whole blocks of other methods, which savez does not write; of
        # these no more than it is asked
        if any(
            each.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
            for each in members
        ):
            raise ValueError("members must be stored or deflated")
        # a member yields no more than its entry says; entries may overlap in the file
        require_size(sum(each.file_size for each in members), content)
        with np.load(io.BytesIO(content), allow_pickle=False) as data:
            return {name: data[name] for name in data.files}
    except TooLargeError:
        raise
    except Exception as error:
        # archive, compression, header and numbers have readers with errors of their own
        raise ValueError(f"must be an npz file: {error}") from None
