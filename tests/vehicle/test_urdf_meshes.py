"""Links of a URDF file as the meshes that it names: where they are, in which size, and
what is drawn without them.
"""

from __future__ import annotations

import dataclasses
import math
import shutil
from pathlib import Path

import numpy as np
import pytest

from skyarm import load_vehicle
from skyarm.plant.mujoco_model import build_spec
from skyarm.records.files.stl_mesh import MOST
from skyarm.records.identity import identity, log_digest
from skyarm.records.plain import plain
from skyarm.vehicle.linkage import BASE
from skyarm.vehicle.vehicle_records import Vehicle
from skyarm.world.scene.shapes import mesh_of
from skyarm.world.scene.vehicle_shapes import vehicle_shapes

INERTIAL = (
    '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0"'
    ' iyz="0"/></inertial>'
)
CORNERS = np.array(
    [[0.0, 0.0, 0.0], [100.0, 0.0, 0.0], [0.0, 200.0, 0.0], [0.0, 0.0, 300.0]]
)


def tetrahedron() -> str:
    """An STL file as text, in millimetres."""
    faces = [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]
    facets = "".join(
        "facet normal 0 0 0 outer loop "
        + " ".join("vertex " + " ".join(map(str, CORNERS[i])) for i in face)
        + " endloop endfacet "
        for face in faces
    )
    return f"solid x {facets} endsolid x"


def visual(
    origin: str = "", scale: str = "0.001 0.001 0.001", name: str = "part.stl"
) -> str:
    return (
        f'<visual>{origin}<geometry><mesh filename="{name}"'
        f' scale="{scale}"/></geometry></visual>'
    )


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """A base, a link of two meshes, one of which a fixed joint carries, and a link
    whose mesh is of another kind.
    """
    (tmp_path / "part.stl").write_text(tetrahedron())
    (tmp_path / "part.dae").write_text("")
    turned = '<origin xyz="0 0 0.1" rpy="0 0 1.5707963267948966"/>'
    hanging = INERTIAL.replace("<mass", '<origin xyz="0 0 -0.2"/><mass')
    text = f"""<robot name="r">
    <link name="root">{INERTIAL}{visual()}</link>
    <link name="upper">{INERTIAL}{visual(turned)}</link>
    <link name="cover">{visual(scale="-0.002 0.001 0.001")}</link>
    <link name="lower">{hanging}{visual(name="part.dae")}</link>
    <joint name="a" type="revolute"><parent link="root"/><child link="upper"/>
      <origin xyz="0.3 0 0"/><axis xyz="0 1 0"/>
      <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
    <joint name="f" type="fixed"><parent link="upper"/><child link="cover"/>
      <origin xyz="0 0.5 0" rpy="0 0 1.5707963267948966"/></joint>
    <joint name="b" type="revolute"><parent link="upper"/><child link="lower"/>
      <origin xyz="0 0 -0.4"/><axis xyz="0 1 0"/>
      <limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>"""
    path = tmp_path / "r.urdf"
    path.write_text(text)
    return path


def meshes(vehicle: Vehicle) -> dict[str, tuple[int, np.ndarray]]:
    """Body and vertices of the meshes that are drawn, by their links."""
    shapes = [shape for shape in vehicle_shapes(vehicle) if shape.kind == "mesh"]
    return {
        shape.name.split("/")[1]: (shape.body, mesh_of(shape)[0]) for shape in shapes
    }


def corners(points: np.ndarray) -> set[tuple[float, ...]]:
    return {tuple(np.round(point, 9) + 0.0) for point in points}


def test_links_are_drawn_as_their_meshes_where_the_files_are(file: Path) -> None:
    vehicle = load_vehicle(file)
    found = meshes(vehicle)
    assert {name: body for name, (body, _) in found.items()} == {
        "root": BASE,
        "upper": 0,
        "cover": 0,
    }
    assert corners(found["root"][1]) == corners(1e-3 * CORNERS)
    x, y, z = (1e-3 * CORNERS).T
    assert corners(found["upper"][1]) == corners(np.stack([-y, x, z + 0.1], axis=1))
    assert corners(found["cover"][1]) == corners(
        np.stack([-y, 0.5 - 2.0 * x, z], axis=1)
    )
    names = [shape.name for shape in vehicle_shapes(vehicle)]
    assert "hull" not in names
    assert not [name for name in names if name.startswith("link/upper")]
    assert "a mesh file is no .stl; it is drawn from its joints" in " ".join(
        vehicle.notes
    )
    assert [name for name in names if name.startswith("link/lower")], (
        "it has no mesh that can be drawn"
    )
    # who draws no meshes has the guesses
    assert "hull" in [shape.name for shape in vehicle_shapes(vehicle, meshes=False)]
    build_spec(vehicle, 9.81).compile()


def test_where_its_meshes_lie_or_that_they_are_absent_changes_no_vehicle(
    file: Path, tmp_path: Path
) -> None:
    other, bare = (tmp_path / name for name in ("other", "bare"))
    for folder in (other, bare):
        folder.mkdir()
        shutil.copy(file, folder)
    shutil.copy(tmp_path / "part.stl", other)
    found = [load_vehicle(each) for each in (file, other / "r.urdf", bare / "r.urdf")]
    assert [len(each.looks) for each in found] == [3, 3, 0]
    assert len({each.looks for each in found}) == 3, "or nothing is compared"
    assert len({identity(each) for each in found}) == 1
    assert len({log_digest(plain(each), {}) for each in found}) == 1


WRONG = {
    "two numbers": visual(scale="1 1"),
    "NaN": visual(scale="nan 1 1"),
    "zero": visual(scale="0 0.001 0.001"),
    "tiny": visual(scale="1e-30 1e-30 1e-30"),
    "huge": visual(scale="1e300 1 1"),
    "beyond numbers": visual(scale="1e308 1e308 1e308"),
    "kilometres": visual(scale="10 10 10"),
    "letters": visual('<origin xyz="a b c"/>'),
    "far": visual('<origin xyz="1e300 0 0"/>'),
    "two origins": visual("<origin/><origin/>"),
}


@pytest.mark.parametrize("wrong", WRONG.values(), ids=WRONG)
def test_a_picture_that_cannot_be_drawn_is_noted_and_refuses_no_vehicle(
    file: Path, wrong: str
) -> None:
    file.write_text(
        file.read_text().replace(f"{INERTIAL}{visual()}", f"{INERTIAL}{wrong}")
    )
    vehicle = load_vehicle(file)
    assert [look.name for look in vehicle.looks] == ["upper", "cover"]
    assert [
        note
        for note in vehicle.notes
        if note.startswith("link root: a mesh cannot be drawn (")
    ]
    build_spec(vehicle, 9.81).compile()


def test_a_mesh_in_millimetres_over_a_metre_is_drawn(file: Path) -> None:
    stl = file.with_name("part.stl")
    stl.write_text(stl.read_text().replace("300.0", "3000.0"))
    vehicle = load_vehicle(file)
    assert len(vehicle.looks) == 3
    assert meshes(vehicle)["root"][1].max() == 3.0


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (tetrahedron().replace("300.0", "0.0"), "has all of its vertices in one plane"),
        (
            "solid " + 3 * (MOST + 1) * "vertex " + "endsolid",
            f"has {MOST + 1} triangles",
        ),
        ("", "must be an STL file"),
    ],
)
def test_the_notes_tell_why_a_mesh_file_is_not_drawn(
    file: Path, content: str, reason: str
) -> None:
    file.with_name("part.stl").write_text(content)
    vehicle = load_vehicle(file)
    assert vehicle.looks == ()
    note = next(note for note in vehicle.notes if reason in note)
    assert note.startswith("links root, upper, cover: a mesh cannot be drawn (")


def test_a_mirrored_mesh_keeps_its_outside(file: Path) -> None:
    for shape in vehicle_shapes(load_vehicle(file)):
        if shape.kind == "mesh":
            vertices, faces = mesh_of(shape)
            a, b, c = (vertices[faces[:, i]] for i in range(3))
            volume = np.einsum("ni,ni->", a, np.cross(b, c)) / 6.0
            expected = abs(math.prod(shape.size)) * 1e6  # of the tetrahedron, mm^3
            assert volume == pytest.approx(expected, rel=1e-9)


def test_an_arm_on_an_airframe_takes_its_meshes_along(file: Path) -> None:
    own = file.with_name("own.toml")
    own.write_text(
        'schema = 1\nname = "own"\nairframe = "hummingbird"\n[[attach]]\narm ='
        ' "r.urdf"\nto = "base"\nposition = [0.0, 0.0, -0.1]\nprefix = "p_"\n'
    )
    found, alone = meshes(load_vehicle(own)), meshes(load_vehicle(file))
    assert {name: body for name, (body, _) in found.items()} == {
        "p_root": BASE,
        "p_upper": 0,
        "p_cover": 0,
    }
    assert corners(found["p_root"][1]) == corners(1e-3 * CORNERS - [0.0, 0.0, 0.1])
    assert corners(found["p_cover"][1]) == corners(alone["cover"][1])
    assert "hull" in [shape.name for shape in vehicle_shapes(load_vehicle(own))], (
        "the airframe has no mesh"
    )


def test_a_file_that_has_gone_leaves_the_guesses(file: Path) -> None:
    vehicle = load_vehicle(file)
    gone = tuple(
        dataclasses.replace(look, file=f"{look.file}.gone") for look in vehicle.looks
    )
    assert vehicle_shapes(dataclasses.replace(vehicle, looks=gone)) == vehicle_shapes(
        vehicle, meshes=False
    )
