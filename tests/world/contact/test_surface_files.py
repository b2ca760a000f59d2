"""Surfaces from files, beside MuJoCo's own reading of the same files."""

import math
import struct
import warnings
import zlib

import mujoco
import numpy as np
import pytest
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from skyarm import load_scenario, run, save_scenario
from skyarm.algebra import Vec3
from skyarm.planning.task import load_task
from skyarm.records.plain import plain
from skyarm.records.restore import restore
from skyarm.scenario.numbers import with_numbers
from skyarm.world.contact.contact_scene import surface_shape
from skyarm.world.contact.surface import heights_of
from skyarm.world.contact.surface_files import SurfaceFile, SurfaceFileWarning
from skyarm.world.scene.shapes import mesh_of
from support.commands import refused, skyarm

SCENE = """
<mujoco model="room">
  <asset><mesh name="part" file="part.obj" scale="1 2 0.5"/></asset>
  <worldbody>
    <geom name="floor" type="plane" size="5 5 .1" friction="0.7 0.005 0.0001"/>
    <geom name="wall" type="plane" size="5 5 .1" pos="2 0 0" xyaxes="0 0 1 .6 .8 0"/>
    <geom name="mark" type="ellipsoid" size=".1 .2 .3" contype="0" conaffinity="0"/>
    <body name="table" pos="1 0.5 0.4" euler="10 20 30">
      <geom name="top" type="box" size="0.4 0.3 0.02"/>
      <geom type="cylinder" size="0.03 0.2" pos="0.3 0.2 -0.2" friction="0"/>
      <body name="lamp" pos="0 0 0.02" euler="0 90 0">
        <geom name="bulb" type="sphere" size="0.05" pos="0.3 0 0" euler="0 90 90"/>
        <geom name="arm" type="capsule" fromto="0 0 0 0.3 0.1 0.05" size="0.01"/>
        <geom name="shade" type="mesh" mesh="part" pos="0.1 0 0" contype="0"/>
      </body>
    </body>
  </worldbody>
</mujoco>
"""
NAMES = ["floor", "wall", "top", "geom4", "bulb", "arm", "shade"]
PROBE = 0.03
CORNERS = np.random.default_rng(5).normal(0.0, 0.2, (40, 3))
BELOW = np.array([0.0, 0.0, -9.0])


def obj(corners):
    lines = [f"v {' '.join(map(repr, each))}" for each in corners.tolist()]
    faces = [f"f {' '.join(str(i + 1) for i in each)}" for each in _triangles(corners)]
    return "\n".join([*lines, *faces])


def _triangles(corners):
    hull = ConvexHull(corners)
    middle = corners[hull.vertices].mean(axis=0)
    for face in hull.simplices:
        a, b, c = corners[face]
        outwards = np.dot(np.cross(b - a, c - a), a - middle) > 0.0
        yield face if outwards else face[::-1]


FILES = {
    "room.xml": SCENE,
    "part.obj": obj(CORNERS),
    "flat.obj": "v 0 0 1\nv 1 0 1\nv 0 1 1\nv 1 1 1\n",
    "text.stl": "hello",
    "broken.xml": "<mujoco><worldbody><geom type='box'/></worldbody></mujoco>",
    "robot.urdf": "<robot/>",
}


def scene(inside):
    return f"<mujoco><worldbody>{inside}</worldbody></mujoco>"


RELIEF = (
    '<mujoco><asset><hfield name="h" nrow="2" ncol="2" size="1 1 1 1"/></asset>'
    '<worldbody><geom name="hill" type="hfield" hfield="h"/></worldbody></mujoco>'
)


def image(grey):
    """A PNG file of grey pixels."""

    def part(kind, data):
        check = zlib.crc32(kind + data)
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", check)

    rows, columns = grey.shape
    lines = b"".join(b"\0" + row.tobytes() for row in grey)
    head = struct.pack(">IIBBBBB", columns, rows, 8, 0, 0, 0, 0)
    whole = part(b"IHDR", head), part(b"IDAT", zlib.compress(lines)), part(b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + b"".join(whole)


def world(folder, **words):
    """A scenario file with a body of a file, beside all files of this test."""
    folder.mkdir(exist_ok=True)
    for name, text in FILES.items():
        (folder / name).write_text(text, encoding="utf-8")
    row = "".join(f"{key} = {value!r}\n" for key, value in words.items())
    path = folder / "s.toml"
    path.write_text(
        'schema = 1\nname = "s"\nduration = 0.1\n[plant]\nvehicle = "crazyflie_arm1"\n'
        f'[controller]\nlaw = "centroidal"\n[[world.bodies]]\n{row}',
        encoding="utf-8",
    )
    return path


def read(folder, **words):
    return load_scenario(world(folder, **words))


def model_with_probe(path):
    spec = mujoco.MjSpec.from_file(str(path))
    probe = spec.worldbody.add_body(name="probe", mocap=True)
    ball = mujoco.mjtGeom.mjGEOM_SPHERE
    probe.add_geom(name="probe", type=ball, size=[PROBE, 0.0, 0.0])
    model = spec.compile()
    model.opt.ccd_tolerance, model.opt.ccd_iterations = 1e-12, 200
    return model


def test_shapes_of_a_scene_are_where_mujoco_has_them(tmp_path):
    """Poses, sizes and distances of 100 balls, in a file that is moved and turned."""
    angles = [0.1, -0.4, 1.3]
    turn = Rotation.from_euler("xyz", angles)
    # the vehicle, at the origin, is in front of the wall and above the floor
    position = -turn.apply([0.5, -0.2, 3.0])
    surfaces = read(
        tmp_path,
        name="room",
        file="room.xml",
        position=position.tolist(),
        angles=angles,
        most_vertices=256,
    ).world.surfaces
    assert [each.name for each in surfaces] == [f"room/{each}" for each in NAMES]
    model = model_with_probe(tmp_path / "room.xml")
    data, ball = mujoco.MjData(model), model.geom("probe").id
    draw = np.random.default_rng(1)
    geoms = [geom for geom in range(model.ngeom) if geom not in (2, ball)]
    mujoco.mj_kinematics(model, data)
    for geom, ours in zip(geoms, surfaces, strict=True):
        place = position + turn.apply(data.geom_xpos[geom])
        R = turn.as_matrix() @ data.geom_xmat[geom].reshape(3, 3)
        assert [*ours.position] == pytest.approx(place, abs=1e-9)
        assert np.array(ours.rotation.rows, float) == pytest.approx(R, abs=1e-9)
        half = model.geom_size[geom]
        sizes = {
            "box": 2.0 * half,
            "sphere": half[:1],
            "capsule": half[:2] * [1.0, 2.0],
            "cylinder": half[:2] * [1.0, 2.0],
        }
        assert ours.size == pytest.approx(sizes.get(ours.shape, ()), abs=1e-12)
    for _ in range(100):
        point = draw.uniform([-1.0, -1.0, 0.1], [1.9, 1.5, 1.5])
        data.mocap_pos[0] = point
        mujoco.mj_kinematics(model, data)
        seen = Vec3(*(position + turn.apply(point)).tolist())
        for geom, ours in zip(geoms, surfaces, strict=True):
            theirs = mujoco.mj_geomDistance(model, data, ball, geom, 10.0, None)
            # from inside the two take other ways out
            if theirs > 0.0:
                within = 1e-6 if ours.shape == "hull" else 1e-9
                depth = float(ours.depth(seen, PROBE, 0.0)[0])
                assert depth == pytest.approx(-theirs, abs=within)


def test_a_pitch_of_a_right_angle_keeps_the_roll(tmp_path):
    place = BELOW.tolist()
    wall = read(tmp_path, name="r", file="room.xml", position=place).world.surfaces[1]
    axes = np.array(wall.rotation.rows, float).T
    stated = np.array([[0, 0, 1], [0.6, 0.8, 0], [-0.8, 0.6, 0]])
    assert axes == pytest.approx(stated, abs=1e-15)


def test_friction_is_that_of_each_geom_unless_a_material_is_stated(tmp_path):
    place = {"name": "r", "file": "room.xml", "position": BELOW.tolist()}
    own = read(tmp_path, **place).world.surfaces
    assert [each.material.friction for each in own] == [0.7, 1, 1, 0, 1, 1, 1]
    assert {each.material.stiffness for each in own} == {5000.0}
    path = world(tmp_path, **place)
    path.write_text(path.read_text() + "material = { stiffness = 900.0 }\n")
    stated = load_scenario(path).world.surfaces
    assert {(s.material.friction, s.material.stiffness) for s in stated} == {
        (0.3, 900.0)
    }


@pytest.mark.parametrize("scale", [[1.0, 1.0, 1.0], [1e-1, 2e-1, -1e-1]])
def test_a_mesh_is_its_convex_hull_by_its_own_name(tmp_path, scale):
    (surface,) = read(
        tmp_path,
        name="part",
        file="part.obj",
        position=BELOW.tolist(),
        scale=scale,
        most_vertices=256,
    ).world.surfaces
    assert (surface.name, surface.shape) == ("part", "hull")
    hull = ConvexHull(CORNERS * scale)
    points = [[float(c) for c in each] for each in surface.vertices]
    assert ConvexHull(points).volume == pytest.approx(hull.volume, rel=1e-9)
    assert len(points) == len(hull.vertices)
    # above a face the height above its plane
    for normal in hull.equations[:, :3]:
        over = max(points, key=normal.dot) + 0.5 * normal
        depth = surface.depth(Vec3(*(over + BELOW).tolist()), 0.1, 0.0)[0]
        assert float(depth) == pytest.approx(-0.4, abs=1e-9)


def test_a_hull_of_fewer_corners_lies_inside_and_is_said(tmp_path):
    path = world(tmp_path, name="part", file="part.obj", position=BELOW.tolist())
    path.write_text(path.read_text() + "most_vertices = 8\n")
    with pytest.warns(SurfaceFileWarning, match="part: hull of 8 corners, up to"):
        (surface,) = load_scenario(path).world.surfaces
    inside = ConvexHull(CORNERS).equations
    points = np.array(surface.vertices, float)
    assert (points @ inside[:, :3].T + inside[:, 3]).max() < 1e-9


def test_a_scenario_is_stored_with_its_surfaces_and_saved_with_its_file(tmp_path):
    """From another folder, and with a number by the path of a surface."""
    made = read(
        tmp_path / "a",
        name="room",
        file="room.xml",
        position=BELOW.tolist(),
        most_vertices=256,
    )
    stored = plain(made)["environment"]["world"]
    assert len(stored["surfaces"]) == len(NAMES)
    assert "bodies" not in stored
    path = "world.surfaces.room/top.material.friction"
    changed = with_numbers(made, {path: 0.25})
    assert changed.world.surfaces[2].material.friction == 0.25
    (tmp_path / "b").mkdir()
    copy = save_scenario(tmp_path / "b" / "s.toml", changed, tmp_path / "a" / "s.toml")
    assert "../a/room.xml" in copy.read_text()
    assert load_scenario(copy).world == changed.world


def test_surfaces_of_a_file_are_obstacles_of_a_plan(tmp_path):
    world(tmp_path, name="x", file="room.xml")
    path = tmp_path / "t.toml"
    path.write_text(
        'schema = 1\nvehicle = "crazyflie_arm1"\npassable = ["room/floor"]\n'
        "phases = [{ to = { base = [1, 0, 1] }, duration = 1.0 }]\n"
        '[[world.bodies]]\nname = "room"\nfile = "room.xml"\nmost_vertices = 256\n'
    )
    names = [each.name for each in load_task(path).obstacles]
    assert names == [f"room/{each}" for each in NAMES[1:]]


BALL = '<geom name="ball" size="0.1"/>'
WRONG = [
    ({"file": "none.xml"}, "file = 'none.xml': no such file"),
    ({"file": "none.obj"}, "file = 'none.obj': no such file"),
    ({"file": "folder.xml"}, "file = 'folder.xml': is a folder"),
    ({"file": "../none/none.stl"}, "file = '../none/none.stl': no such file"),
    ({"file": "robot.urdf"}, "must end in .stl, .obj, .xml (MJCF)"),
    ({"file": ""}, "file = '': must end in .stl, .obj, .xml (MJCF)"),
    ({"file": 3}, "file = 3: must be text"),
    ({"file": "broken.xml"}, "must be a model that MuJoCo loads"),
    ({"file": "flat.obj"}, "file = 'flat.obj': has all of its vertices in one plane"),
    ({"file": "text.stl"}, "file = 'text.stl': must be an STL file"),
    ({"scale": [2.0, 2.0, 2.0]}, "scale must be left out of an MJCF scene"),
    ({"scale": 2.0}, "scale = 2.0: must be three numbers"),
    ({"name": ""}, "name = '': must not be empty"),
    ({"most_vertices": 3}, "most_vertices = 3: must be at least 4"),
    ({"most_vertices": 257}, "most_vertices = 257: must be at most 256"),
    ({"position": [0.0, math.nan, 0.0]}, "position[1] = nan: must be a finite number"),
    ({"shape": "box"}, "shape = 'box': unknown field"),
    (scene(""), "geoms = 0: must be one or more that touch"),
    (
        scene(BALL.replace("/>", ' contype="0" conaffinity="0"/>')),
        "geoms = 0: must be one or more that touch",
    ),
    (scene(f'<body name="door"><joint/>{BALL}</body>'), "geoms = 0: must be one"),
    (
        scene('<geom name="rough" size="0.1" friction="200"/>'),
        "r/rough: material.friction = 200.0: must be at most 100",
    ),
]


def test_what_a_scene_holds_and_no_surface_has_is_said_in_one_line(tmp_path):
    path = world(tmp_path, name="r", file="room.xml")
    (tmp_path / "room.xml").write_text(
        scene(
            '<geom name="floor" type="plane" size="1 1 1" pos="0 0 -2" margin="1e-3"/>'
            f'<body name="door"><joint/>{BALL}<body>{BALL}</body></body>'
            f'<body name="hand" mocap="true">{BALL}</body>'
            '<geom name="egg" type="ellipsoid" size="1 2 3"/>'
            '</worldbody><contact><pair geom1="floor" geom2="egg"/></contact>'
            "<worldbody>"
        ).replace('name="ball"', "")
    )
    with pytest.warns(SurfaceFileWarning) as said:
        surfaces = load_scenario(path).world.surfaces
    assert [each.name for each in surfaces] == ["r/floor"]
    assert [str(each.message) for each in said] == [
        "bodies door, hand: moves: left out; what moves is one of [[world.objects]] or"
        " a vehicle",
        "geom floor: margin: not read",
        "geom egg: ellipsoid: left out; it touches in MuJoCo alone",
        "1 stated pairs: not read; all surfaces touch",
    ]


def test_heights_of_an_image_and_of_a_scene_are_those_of_mujoco(tmp_path):
    heights = np.array([[0, 51, 102], [0, 0, 204]], "u1")
    (tmp_path / "hill.png").write_bytes(image(heights))
    (tmp_path / "hill.xml").write_text(
        '<mujoco><asset><hfield name="h" file="hill.png" size="1 0.25 3 0.1"/></asset>'
        '<worldbody><geom name="hill" type="hfield" hfield="h"/></worldbody></mujoco>'
    )
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "hill.xml"))
    own = SurfaceFile(name="r", file="hill.png", scale=(1.0, 0.5, 3.0))
    for each in (own, SurfaceFile(name="r", file="hill.xml")):
        (surface,) = each.surfaces(tmp_path)
        assert surface.size == pytest.approx((2.0, 0.5, 3.0, 0.1))
        grid = heights_of(surface.heights)
        # the first row of an image is the farthest one
        assert grid == pytest.approx(heights[::-1] / 204.0, abs=1e-5)
        assert grid.ravel() == pytest.approx(model.hfield_data, abs=1e-5)
        drawn, _ = mesh_of(surface_shape(surface))
        ends = [[-1.0, -0.25, 0.0], [1.0, 0.25, 1.5]]
        assert drawn[[0, -1]] == pytest.approx(np.array(ends), abs=1e-4)


@pytest.mark.parametrize(("changed", "words"), WRONG)
def test_bodies_that_cannot_be_are_refused_in_one_line(tmp_path, changed, words):
    stated = {"name": "r", "file": "room.xml"}
    file = world(tmp_path, **stated | (changed if isinstance(changed, dict) else {}))
    (tmp_path / "folder.xml").mkdir()
    if isinstance(changed, str):
        (tmp_path / "room.xml").write_text(changed)
    refused(skyarm("check", str(file)), "world.bodies[0].", words)


def test_a_heightfield_flies_on_the_plant_that_knows_it(tmp_path):
    path = world(tmp_path, name="r", file="room.xml")
    (tmp_path / "room.xml").write_text(RELIEF)
    words = "world.surfaces[r/hill].shape = 'heightfield': touches on MuJoCo's plant"
    refused(skyarm("run", str(path)), words)
    flies = '[plant]\nkind = "mujoco"\ncontact = "geoms"\n'
    path.write_text(path.read_text().replace("[plant]\n", flies))
    scenario = load_scenario(path, duration=0.02)
    log = run(scenario)
    assert log.status == "completed"
    assert log.component("contact_force").shape == (4, 1)
    # a log has no need of the file
    (tmp_path / "room.xml").unlink()
    assert restore(plain(scenario)) == scenario


def test_a_camera_beside_a_heightfield_is_refused(tmp_path):
    path = world(tmp_path, name="r", file="room.xml")
    (tmp_path / "room.xml").write_text(RELIEF)
    flies = '[plant]\nkind = "mujoco"\ncontact = "geoms"\n'
    camera = '[sensors.eye]\nkind = "depth_camera"\nposition = [0.1, 0.0, 0.1]\n'
    path.write_text(path.read_text().replace("[plant]\n", flies) + camera)
    words = "sensors.eye: sees no heightfield, must be left out beside"
    refused(skyarm("check", str(path)), words, "world.surfaces[r/hill]")


def test_what_is_no_list_of_bodies_is_refused(tmp_path):
    path = world(tmp_path, name="r", file="room.xml")
    path.write_text(path.read_text().replace("[[world.bodies]]", "[world.bodies]"))
    refused(skyarm("check", str(path)), "world.bodies = ", "must be a list of tables")


def test_two_bodies_of_one_name_are_refused(tmp_path):
    path = world(tmp_path, name="r", file="room.xml")
    row = '[[world.bodies]]\nname = "r"\nfile = "room.xml"\n'
    path.write_text(path.read_text() + row)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        words = "world.bodies[1].name = 'r': must be of one body only"
        refused(skyarm("check", str(path)), words)
