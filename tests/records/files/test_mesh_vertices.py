"""Vertices of OBJ and STL files, as other programs write them."""

import mujoco
import numpy as np
import pytest

from skyarm.records.files.mesh_vertices import read_vertices

ROWS = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 2e-1, 0.0], [0.0, 0.0, -3.5]]
FACES = [(0, 1, 2), (0, 3, 1), (0, 2, 3), (1, 3, 2)]


@pytest.mark.parametrize("end", ["\n", "\r\n"])
@pytest.mark.parametrize("more", ["", " 1.0", " 0.2 0.3 0.4"])
def test_weights_colours_and_other_lines_of_an_obj_file_are_passed_over(
    tmp_path, end, more
):
    lines = ["# v 9 9 9", "o part", "vn 0 0 1", "vt 0 1", "mtllib a.mtl"]
    lines += [f"  v\t{x!r}  {y!r} {z!r}{more}" for x, y, z in ROWS]
    lines += ["usemtl v", "f 1/1/1 2/1/1 3/1/1", "vp 1 2 3"]
    path = tmp_path / "PART.OBJ"
    path.write_bytes(end.join(lines).encode())
    assert read_vertices(path, (1.0, 1.0, 1.0)).tolist() == ROWS


def test_mujoco_reads_the_same_vertices(tmp_path):
    path = tmp_path / "part.obj"
    text = "".join(f"v {x!r} {y!r} {z!r}\n" for x, y, z in ROWS)
    text += "".join(f"f {a + 1} {b + 1} {c + 1}\n" for a, b, c in FACES)
    path.write_text(text)
    spec = mujoco.MjSpec()
    spec.add_mesh(name="m", file=str(path), scale=[0.5, -2.0, 1.0])
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname="m")
    model = spec.compile()
    turn = np.zeros(9)
    mujoco.mju_quat2Mat(turn, model.mesh_quat[0])
    theirs = model.mesh_vert @ turn.reshape(3, 3).T + model.mesh_pos[0]
    ours = read_vertices(path, (0.5, -2.0, 1.0))
    np.testing.assert_allclose(
        sorted(ours.tolist()), sorted(theirs.round(6).tolist()), atol=1e-6
    )


def test_an_stl_file_has_its_corners_in_turn(tmp_path):
    path = tmp_path / "part.stl"
    facets = "".join(
        "facet normal 0 0 0 outer loop "
        + " ".join(f"vertex {' '.join(map(repr, ROWS[i]))}" for i in face)
        + " endloop endfacet "
        for face in FACES
    )
    path.write_text(f"solid x {facets} endsolid x")
    read = read_vertices(path, (2.0, 1.0, 1.0))
    assert read.tolist() == [
        [2 * x, y, z] for f in FACES for x, y, z in np.take(ROWS, f, 0)
    ]
