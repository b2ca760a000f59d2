"""Meshes of bodies of the world: files read and refused, and drawn where the body
is.
"""

from __future__ import annotations

import copy
import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from skyarm.records.files.stl_mesh import LARGEST, MOST, RECORD, mesh_or_none, read_stl
from skyarm.records.identity import identity, log_digest
from skyarm.records.plain import plain
from skyarm.records.restore import restore
from skyarm.scenario.readers import with_files
from skyarm.scenario.scenario_file import scenario_from
from skyarm.scenario.scenario_record import ScenarioError
from skyarm.world.contact import FreeObject, Mechanism, Surface
from skyarm.world.contact.contact_scene import surface_shape
from skyarm.world.scene.shapes import Shape, Solid, mesh_of
from support.pictures import needs_display
from support.worlds import DOCUMENT

BOX = Shape("box", "object", "box", -1, (0.1, 0.2, 0.3))
WALL = Surface(name="wall", shape="box", size=(0.1, 0.2, 0.3))
SHIFT = np.array([0.4, -0.1, 0.2])


def binary(corners: Any) -> bytes:
    rows = np.zeros(len(corners), RECORD)
    rows["corners"] = corners
    return (
        b"solid made by hand".ljust(80)
        + len(rows).to_bytes(4, "little")
        + rows.tobytes()
    )


def text(corners: Any) -> bytes:
    lines = ["solid a"]
    for triangle in corners:
        lines += [
            "facet normal 0 0 1",
            "outer loop",
            *("vertex {} {} {}".format(*p) for p in triangle),
        ]
        lines += ["endloop", "endfacet"]
    return "\n".join([*lines, "endsolid a"]).encode()


def corners_of(shape: Shape, shift: Any = 0.0) -> Any:
    vertices, faces = mesh_of(shape)
    return vertices[faces] + shift


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """A box as triangles, beside its place."""
    path = tmp_path / "box.stl"
    path.write_bytes(binary(corners_of(BOX, SHIFT)))
    return path


@pytest.mark.parametrize("written", [binary, text])
def test_both_kinds_of_files_give_the_triangles_and_each_vertex_once(
    tmp_path: Path, written: Any
) -> None:
    (tmp_path / "a.stl").write_bytes(written(corners_of(BOX)))
    vertices, faces = read_stl(tmp_path / "a.stl")
    assert vertices.shape == (8, 3)
    assert vertices[faces] == pytest.approx(corners_of(BOX), abs=1e-7)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "must be an STL file"),
        (b"hello", "must be an STL file"),
        (b"solid a\nvertex 1 2\nendsolid", "must be an STL file"),
        (b"solid a\nvertex 1 2 x\n", "must be an STL file"),
        (b"solid a\nendsolid a", "has 0 triangles, must have from 1"),
        (binary(np.zeros((0, 3, 3))), "has 0 triangles"),
        (binary(np.zeros((1, 3, 3)))[:-1], "must be an STL file"),
        (binary(np.full((1, 3, 3), np.nan)), "has a vertex at nan"),
        (binary(np.full((1, 3, 3), 1500.0)), "has a vertex at 1500: must be in metres"),
        (
            binary(np.arange(18.0).reshape(2, 3, 3) * [1.0, 0.5, 0.0]),
            "has all of its vertices in one plane",
        ),
        (
            binary(np.zeros((MOST + 1, 3, 3))),
            f"has {MOST + 1} triangles, must have from 1 to {MOST}",
        ),
    ],
)
def test_what_is_no_mesh_is_refused_with_the_field(
    tmp_path: Path, content: bytes, words: str
) -> None:
    (tmp_path / "a.stl").write_bytes(content)
    table = {"objects": [{"name": "a", "mesh": "a.stl"}]}
    with pytest.raises(
        ValueError, match=r"world.objects\[0\].mesh = 'a.stl': " + words
    ) as error:
        with_files(table, "world", tmp_path)
    assert "\n" not in str(error.value)


def test_a_file_beyond_measure_is_refused_unread(tmp_path: Path) -> None:
    with (tmp_path / "a.stl").open("wb") as file:
        file.truncate(int(LARGEST) + 1)
    with pytest.raises(ValueError, match=r"has 100 MB, must have at most 100 MB"):
        read_stl(tmp_path / "a.stl")


def test_a_file_that_is_not_there_and_a_mesh_of_what_has_no_end_are_refused(
    tmp_path: Path, file: Path
) -> None:
    document = copy.deepcopy(DOCUMENT)
    document["world"]["surfaces"][1]["mesh"] = "none.stl"
    with pytest.raises(
        ScenarioError, match=r"world.surfaces\[1\].mesh = 'none.stl': no such file"
    ):
        scenario_from(document, tmp_path)
    document["world"]["surfaces"][1]["mesh"] = ["a"]
    with pytest.raises(ScenarioError, match=r"mesh"):
        scenario_from(document, tmp_path)
    del document["world"]["surfaces"][1]["mesh"]
    document["world"]["surfaces"][0]["mesh"] = "box.stl"
    with pytest.raises(
        ScenarioError, match=r"mesh = .*box.stl': must be left out of a plane"
    ):
        scenario_from(document, tmp_path)


def test_meshes_of_a_file_are_beside_it_and_in_what_is_drawn(file: Path) -> None:
    document = copy.deepcopy(DOCUMENT)
    document["world"]["objects"][0]["mesh"] = "box.stl"
    document["world"]["surfaces"][1]["mesh"] = "box.stl"
    contact = scenario_from(document, file.parent).world
    assert contact is not None
    assert contact.objects[0].mesh == contact.surfaces[1].mesh == str(file)
    drawn = {
        f"world/{each.name}": surface_shape(each)
        for each in (*contact.surfaces, *contact.objects[0].surfaces)
    }
    assert drawn["world/parcel"].mesh == drawn["world/wall"].mesh == str(file)
    assert drawn["world/post"].mesh == ""
    for made in (lambda shape: mesh_of(shape)[0], lambda shape: mesh_of(shape, 48)[0]):
        points = made(drawn["world/parcel"])
        assert points.min(axis=0) == pytest.approx(SHIFT - [0.1, 0.2, 0.3], abs=1e-7)


def test_where_a_mesh_lies_is_no_part_of_what_flies_and_is_found_from_any_folder(
    file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(file.parent.parent)
    table = {"surfaces": [{"name": "a", "mesh": file.name}]}
    assert with_files(table, "world", Path(file.parent.name))["surfaces"][0][
        "mesh"
    ] == str(file)
    here, there = (
        dataclasses.replace(WALL, mesh=str(folder / "box.stl"))
        for folder in (file.parent, file.parent.parent)
    )
    assert identity(here) == identity(there) == identity(WALL)
    other = dataclasses.replace(here, size=(0.3, 0.2, 0.1))
    assert (
        log_digest(plain(here), {})
        == log_digest(plain(there), {})
        != log_digest(plain(other), {})
    )
    assert (
        log_digest(plain(here), {"a": "b"})
        == log_digest(plain(there), {"a": "b"})
        != log_digest(plain(here), {})
    )


def test_a_record_without_a_mesh_is_written_as_before_and_a_lost_mesh_is_its_shape(
    tmp_path: Path,
) -> None:
    thing = FreeObject(name="a", size=(0.2, 0.4, 0.6), mass=0.1)
    assert "mesh" not in plain(thing)
    held = dataclasses.replace(thing, mesh=str(tmp_path / "gone.stl"))
    assert restore(plain(held)) == held
    shape = surface_shape(held.surfaces[0])
    assert mesh_or_none(shape.mesh) is None
    assert mesh_of(shape)[0] == pytest.approx(mesh_of(BOX)[0])
    part = Surface(name="handle", shape="sphere", size=(0.02,), mesh="x.stl")
    assert (
        Mechanism(name="m", kind="hinge", axis=(0, 0, 1), inertia=1.0, parts=(part,))
        .surfaces[0]
        .mesh
        == "x.stl"
    )


@needs_display
@pytest.mark.thorough
def test_a_film_draws_a_mesh_where_the_same_box_would_be(file: Path) -> None:
    """A mesh beside the origin of its body, that is turned, against a box there: MuJoCo
    moves a mesh's vertices.
    """
    from skyarm.view.picture.mujoco_sink import CameraPath, FramePanel, open_stage

    turn = np.array([[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]])
    at = np.array([0.1, 0.2, 1.0])
    path = CameraPath(
        np.array([[0.2, 0.0, 1.0]]),
        np.array([3.0]),
        np.array([30.0]),
        np.array([-20.0]),
    )
    mesh = dataclasses.replace(BOX, mesh=str(file))
    panels = []
    for i, (shape, place) in enumerate(
        ((mesh, at), (BOX, at + turn @ SHIFT), (BOX, at))
    ):
        solid = Solid(shape, place[None], turn[None], (0.8, 0.2, 0.1, 1.0))
        panels.append(FramePanel(0, 64 * i, 96, 64, path, [solid], lambda k: ()))
    with open_stage(panels, 96, 192) as stage:
        pictures = np.split(stage.draw(0).astype(int), 3)
    off, wrong = (np.abs(pictures[0] - each).max(axis=2) > 30 for each in pictures[1:])
    assert off.mean() < 0.005, "but for pixels on its edges"
    assert wrong.mean() > 0.05


def test_a_text_of_too_many_triangles_is_refused_before_its_numbers_are_read(
    tmp_path: Path,
) -> None:
    file = tmp_path / "many.stl"
    file.write_bytes(b"solid\n" + (b"vertex " * 3 * (MOST + 1)) + b"\nendsolid\n")
    with pytest.raises(
        ValueError, match=f"^has {MOST + 1} triangles, must have from 1 to {MOST}$"
    ):
        read_stl(file)


@pytest.mark.parametrize(
    "line", ["vertex 1 2", "vertex 1 2 x", "vertex 1 2 " + 70 * "3", "vertex"]
)
def test_a_corner_without_three_numbers_is_no_stl(line: str, tmp_path: Path) -> None:
    file = tmp_path / "wrong.stl"
    file.write_text(f"solid\nvertex 0 0 0\nvertex 1 0 0\n{line}\nendsolid\n")
    with pytest.raises(ValueError, match=r"^must be an STL file, binary or text$"):
        read_stl(file)
