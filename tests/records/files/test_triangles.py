"""Corners of triangles from STL files, in metres or scaled."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from skyarm.records.files.stl_mesh import RECORD, read_corners

POINTS = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 2.0, 0.5], [0.0, 0.0, 4.0]])
CORNERS = POINTS[[[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]]]


def write(path: Path, binary: bool) -> None:
    rows = np.zeros(4, RECORD)
    rows["corners"] = CORNERS
    facets = [
        "\n".join("vertex {} {} {}".format(*point) for point in each)
        for each in CORNERS
    ]
    loops = "".join(
        f"facet normal 0 0 1\nouter loop\n{each}\nendloop\nendfacet\n"
        for each in facets
    )
    text = f"solid a\n{loops}endsolid a\n"
    path.write_bytes(
        b"made".ljust(80) + (4).to_bytes(4, "little") + rows.tobytes()
        if binary
        else text.encode()
    )


@pytest.mark.parametrize("binary", [True, False])
def test_corners_are_as_the_file_has_them_unless_they_are_scaled(
    tmp_path: Path, binary: bool
) -> None:
    write(tmp_path / "one.stl", binary)
    np.testing.assert_array_equal(read_corners(tmp_path / "one.stl"), CORNERS)
    scaled = read_corners(tmp_path / "one.stl", (0.001, 2.0, 1.0))
    np.testing.assert_allclose(scaled, CORNERS * [0.001, 2.0, 1.0], rtol=1e-15)
