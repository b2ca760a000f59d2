"""Folders made for a result that does not come are gone again; archives and meshes that
are none are one line.
"""

from __future__ import annotations

import io
import os
import zipfile
from pathlib import Path

import numpy as np
import pytest

from skyarm.records.files import taken_back
from skyarm.records.files.stl_mesh import read_corners
from skyarm.records.files.unpacked import npz_arrays


def test_what_was_made_goes_and_what_was_there_stays(tmp_path: Path) -> None:
    there, new = tmp_path / "there", tmp_path / "there" / "new" / "inner"
    there.mkdir()

    def fail() -> None:
        with taken_back(new):
            new.mkdir(parents=True)
            raise KeyError("no result")

    with pytest.raises(KeyError):
        fail()
    assert list(tmp_path.rglob("*")) == [there]
    with taken_back(new):
        new.mkdir(parents=True)
    assert new.is_dir()


def test_members_that_no_array_is_packed_in_are_refused() -> None:
    def packed(method: int) -> bytes:
        held, file = io.BytesIO(), io.BytesIO()
        np.save(held, np.arange(3.0))
        with zipfile.ZipFile(file, "w", method) as archive:
            archive.writestr("x.npy", held.getvalue())
        return file.getvalue()

    for method in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        assert np.array_equal(npz_arrays(packed(method))["x"], np.arange(3.0))
    with pytest.raises(ValueError, match="members must be stored or deflated"):
        npz_arrays(packed(zipfile.ZIP_BZIP2))


def test_a_missing_mesh_or_a_pipe_is_one_line_and_one_that_is_there_is_read(
    tmp_path: Path,
) -> None:
    corners = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
    lines = ["solid one"]
    for left in range(4):
        lines += ["facet normal 0 0 1", "outer loop"]
        lines += [
            "vertex {} {} {}".format(*corner)
            for i, corner in enumerate(corners)
            if i != left
        ]
        lines += ["endloop", "endfacet"]
    mesh = tmp_path / "one.stl"
    mesh.write_text("\n".join([*lines, "endsolid one", ""]))
    assert read_corners(mesh).shape == (4, 3, 3)
    os.mkfifo(tmp_path / "pipe.stl")
    for name in ("none.stl", "pipe.stl"):
        with pytest.raises(ValueError, match="no such file"):
            read_corners(tmp_path / name)
